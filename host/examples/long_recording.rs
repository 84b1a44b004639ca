//! Writes a recording of any length, to see what identification makes of it.
//!
//! ```text
//! cargo run --release --example long_recording -- 100000000 /tmp/long.csv
//! ```
//!
//! A rotary axis (inertia 0.01 kg·m², Coulomb friction 0.2 N·m, viscous friction 0.02 N·m·s/rad) under a sum of sines at
//! 1 kHz, with an encoder of 4,096 counts a turn and an unrecorded torque of 2 % of the drive.

use std::error::Error;
use std::f64::consts::TAU;
use std::fs::File;
use std::io::{BufWriter, Write};

use bristle::axis::Axis;
use bristle::model::Model;
use bristle::step::{Drive, Memory, advance};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const MODEL: &str = "[plant]
motion = \"rotary\"
inertia = 0.01
[friction]
model = \"coulomb-viscous\"
coulomb = 0.2
viscous = 0.02
";
const PERIOD: f64 = 1e-3;
const COUNTS: f64 = 4096.0;
/// Amplitude, N·m, and frequency, Hz, of the sines; no period is a multiple of another.
const SINES: [(f64, f64); 5] = [
    (0.25, 0.21),
    (0.2, 0.57),
    (0.2, 1.31),
    (0.15, 2.73),
    (0.1, 4.93),
];
/// RMS of the unrecorded torque, N·m: 2 % of that of the sines.
const LOAD: f64 = 0.0059;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(samples), Some(path)) = (arguments.next(), arguments.next()) else {
        return Err("give the number of samples and the file to write".into());
    };
    let samples: u64 = samples.parse()?;
    let axis = Axis::new(&Model::parse(MODEL)?)?;
    let mut out = BufWriter::with_capacity(1 << 20, File::create(path)?);
    writeln!(out, "t[s],u[N*m],q[rad]")?;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut state = Memory {
        x: [0.0; 2],
        z: 0.0,
    };
    for k in 0..samples {
        let t = k as f64 * PERIOD;
        let drive: f64 = SINES.iter().map(|(a, f)| a * (TAU * f * t).sin()).sum();
        // What is written is what acts.
        let u = (drive * 1e6).round() * 1e-6;
        let q = (state.x[0] * COUNTS / TAU).floor() * TAU / COUNTS;
        writeln!(out, "{t:.3},{u:.6},{q:.6}")?;
        // Uniform on ±√3 has unit variance.
        let load = LOAD * 3f64.sqrt() * rng.random_range(-1.0..=1.0);
        let drive = Drive {
            t,
            dt: PERIOD,
            u,
            load,
        };
        state = advance(&axis, drive, state, PERIOD);
    }
    out.flush()?;
    Ok(())
}
