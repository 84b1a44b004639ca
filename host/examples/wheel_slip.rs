//! Loss of adhesion of a driven wheel on a wet rail, and its recovery when the drive is taken back.
//!
//! ```text
//! cargo run --release --example wheel_slip
//! ```
//!
//! One wheelset of a locomotive, 18 t on the rail. Adhesion falls with slip in the form of Polach for a wet rail (μ0 = 0.30, A =
//! 0.40, B = 0.20 s/m) where the law sticks or slips; the law with bristles, which creeps below the limit, has the same
//! levels and falls over the same velocity, but along the rational curve.

mod plot;

use bristle::model::Model;
use bristle::plant::WheelSlip;
use bristle::step::{Drive, Memory, State, advance};
use plot::{BLUE, Curve, GREEN, GREY, ORANGE, Panel};

const PLANT: &str = "[plant]\nkind = \"wheel-slip\"\nmotion = \"linear\"\ninput = \"force\"\ninertia = 600\nwheel_mass = 900\nvehicle_mass = 18000\naxle_stiffness = 8e6\naxle_damping = 4e3\n";
const STICKS: &str = "model = \"stribeck\"\nstatic = 53e3\ncoulomb = 21.2e3\nviscous = 0.0\nstribeck_velocity = 5.0\nexponent = 1\n";
const CREEPS: &str = "model = \"modified-lugre\"\nstatic = 53e3\ncoulomb = 21.2e3\nviscous = 0.0\nstribeck_velocity = 5.0\nbristle_stiffness = 2e7\nbristle_damping = 1e4\n";
const STEP: f64 = 1e-3;

/// The pull of the drive at the rim, N: beyond what the rail takes, then back.
fn pull(t: f64) -> f64 {
    let points = [
        (0.0, 0.0),
        (3.0, 60e3),
        (4.0, 60e3),
        (4.5, 10e3),
        (10.0, 10e3),
    ];
    let k = points
        .iter()
        .rposition(|p| p.0 <= t)
        .unwrap_or(0)
        .min(points.len() - 2);
    let ((t0, u0), (t1, u1)) = (points[k], points[k + 1]);
    u0 + (u1 - u0) * (t - t0) / (t1 - t0)
}

/// Time, velocity of wheel and of vehicle, force of the axle and adhesion.
fn run(friction: &str) -> Vec<[f64; 5]> {
    let model = Model::parse(&format!("{PLANT}[friction]\n{friction}")).expect("the model parses");
    let plant = WheelSlip::new(&model).expect("the model is complete");
    let mut state = Memory::at_ease(&plant, State { q: 0.0, v: 5.0 });
    (0..10_000)
        .map(|k| {
            let t = f64::from(k) * STEP;
            let drive = Drive {
                u: pull(t),
                ..Drive::default()
            };
            let before = state;
            state = advance(&plant, drive, state, STEP);
            // The vehicle feels nothing but adhesion.
            let adhesion = 18_000.0 * (state.x[4] - before.x[4]) / STEP;
            [t, before.x[3], before.x[4], drive.u, adhesion]
        })
        .collect()
}

fn main() -> std::io::Result<()> {
    let (sticks, creeps) = (run(STICKS), run(CREEPS));
    let line = |rows: &[[f64; 5]], x: &dyn Fn(&[f64; 5]) -> f64, y: &dyn Fn(&[f64; 5]) -> f64| {
        rows.iter().map(|r| (x(r), y(r))).collect::<Vec<_>>()
    };
    let slip = |r: &[f64; 5]| r[1] - r[2];
    let lost = sticks
        .iter()
        .find(|r| slip(r) > 0.0)
        .expect("adhesion is lost");
    let found = sticks
        .iter()
        .rfind(|r| slip(r) > 0.0)
        .expect("adhesion is lost");
    let most = sticks.iter().map(slip).fold(0.0, f64::max);
    println!(
        "adhesion is lost at {:.2} s, at a pull of {:.1} kN; the wheel runs up to {most:.2} m/s ahead and holds again at {:.2} s",
        lost[0],
        lost[3] / 1e3,
        found[0]
    );
    let velocities = |rows: &[[f64; 5]]| {
        vec![
            Curve::new("wheel rim", ORANGE, line(rows, &|r| r[0], &|r| r[1])),
            Curve::new("vehicle", BLUE, line(rows, &|r| r[0], &|r| r[2])),
        ]
    };
    let forces = |rows: &[[f64; 5]]| {
        vec![
            Curve::new("adhesion", GREEN, line(rows, &|r| r[0], &|r| r[4] / 1e3)),
            Curve::new(
                "pull of the drive",
                GREY,
                line(rows, &|r| r[0], &|r| r[3] / 1e3),
            )
            .dashed(),
        ]
    };
    let panel = |title: &str, x, y, curves| Panel {
        title: title.to_owned(),
        x,
        y,
        curves,
    };
    let (time, speed) = ("time [s]", "velocity [m/s]");
    plot::write(
        "host/book/src/wheel_slip.svg",
        2,
        &[
            panel(
                "The wheel runs away, and is caught again",
                time,
                speed,
                velocities(&sticks),
            ),
            panel(
                "Adhesion falls as slip grows",
                time,
                "force [kN]",
                forces(&sticks),
            ),
            panel(
                "Adhesion against slip",
                "slip velocity [m/s]",
                "adhesion [kN]",
                vec![
                    Curve::new(
                        "sticks or slips",
                        GREEN,
                        line(&sticks, &slip, &|r| r[4] / 1e3),
                    ),
                    Curve::new(
                        "with bristles",
                        ORANGE,
                        line(&creeps, &slip, &|r| r[4] / 1e3),
                    ),
                ],
            ),
            panel("The same with bristles", time, speed, velocities(&creeps)),
        ],
    )
}
