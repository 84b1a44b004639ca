//! Parameters that change while the axis moves: what is remembered goes on, and the command steps by what they say.

mod servo;

use bristle_core::Scalar;
use bristle_core::control::{
    Controller, Driver, Harmonic, Learning, Method, Output, Parameters, Position, SetPoint,
};
use bristle_core::friction::Units;
use bristle_core::scalar::Q16;
use servo::{Axis, COUNT, PERIOD, SI, TRUTH, parameters};

/// Units for fixed point.
const SCALED: Units = Units {
    force: 0.2,
    position: 8.0 * COUNT,
    velocity: 1.0,
};

/// An axis that follows a sine, sample by sample.
#[derive(Clone)]
struct Run<T> {
    controller: Controller<T>,
    axis: Axis,
    units: Units,
    k: u32,
}

impl<T: Scalar> Run<T> {
    fn new(set: &Parameters<f64>, units: Units) -> Self {
        Self {
            controller: Controller::new(set.scaled(&units).unwrap(), 0).unwrap(),
            axis: Axis::default(),
            units,
            k: 0,
        }
    }

    fn set(&mut self, set: &Parameters<f64>) {
        let set = set.scaled(&self.units).unwrap();
        self.controller.set_parameters(set).unwrap();
    }

    fn step(&mut self) -> Output<T> {
        let t = f64::from(self.k) * PERIOD;
        self.k += 1;
        let (sine, cosine) = (3.0 * t).sin_cos();
        let counts = Scalar::floor(self.axis.q / COUNT);
        let set_point = SetPoint::Position {
            position: Position::from_f64(0.5 * sine / COUNT),
            velocity: T::from_f64(1.5 * cosine / self.units.velocity),
            acceleration: T::from_f64(-4.5 * sine * self.units.time() / self.units.velocity),
        };
        let output = self.controller.step(counts, set_point);
        assert!(output.finite);
        self.axis.advance(&TRUTH, output.command.to_f64(), PERIOD);
        output
    }

    fn pass(&mut self, samples: u32) {
        for _ in 0..samples {
            self.step();
        }
    }

    /// What comes of the next sample, without the past of this run changing.
    fn ahead(&self, set: &Parameters<f64>) -> Output<T> {
        let mut copy = self.clone();
        copy.set(set);
        copy.step()
    }
}

/// A controller that believes in three quarters of the friction, so that there is something to remember.
fn believed(learning: Learning, method: Method) -> Parameters<f64> {
    let mut set = parameters(&TRUTH, 80.0);
    (set.friction.coulomb, set.friction.static_level) = (0.15, 0.15);
    set.adaptation.method = learning;
    set.adaptation.offset = 0.1;
    set.compensation.method = method;
    if method == Method::Bristles {
        set.compensation.driver = Driver::Desired;
    }
    set.effects.offset = 0.01;
    set
}

/// Runs two controllers, of which one is told in every period what it knows already.
fn the_same_set_changes_nothing<T: Scalar>(units: Units) {
    for (learning, method) in [
        (Learning::Off, Method::Static),
        (Learning::Observer, Method::Static),
        (Learning::Rows, Method::Static),
        (Learning::Observer, Method::Bristles),
    ] {
        let set = believed(learning, method);
        let (mut left, mut told) = (Run::<T>::new(&set, units), Run::<T>::new(&set, units));
        for _ in 0..3000 {
            told.set(&set);
            assert_eq!(left.step(), told.step());
        }
        let learned = left.step().coulomb.to_f64() * units.force;
        let moved = (learned - 0.15).abs() > 0.01;
        assert_eq!(moved, learning != Learning::Off, "{learned}");
    }
}

#[test]
fn a_set_like_the_one_in_force_changes_no_bit() {
    the_same_set_changes_nothing::<f64>(SI);
    the_same_set_changes_nothing::<f32>(SI);
    the_same_set_changes_nothing::<Q16>(SCALED);
}

/// What may change under way, each by a share.
type Change = fn(&mut Parameters<f64>, f64);

const CHANGES: [(&str, Change); 12] = [
    ("inertia", |p, e| p.inertia *= 1.0 + e),
    ("observer", |p, e| p.observer_bandwidth *= 1.0 + e),
    ("kp", |p, e| p.position_gain *= 1.0 + e),
    ("kv", |p, e| p.velocity_gain *= 1.0 + e),
    ("ki", |p, e| p.velocity_integral *= 1.0 + e),
    ("levels", |p, e| {
        p.friction.coulomb *= 1.0 + e;
        p.friction.static_level *= 1.0 + e;
    }),
    ("viscous", |p, e| p.friction.viscous *= 1.0 + e),
    ("bristles", |p, e| p.friction.bristle_stiffness *= 1.0 + e),
    ("share", |p, e| p.compensation.share -= e),
    ("learning", |p, e| p.adaptation.rate *= 1.0 + e),
    ("offset", |p, e| p.effects.offset += 0.1 * e),
    ("waves", |p, e| {
        p.effects.waves[0] = Harmonic {
            cycle: 1 << 20,
            sine: 0.1 * e,
            cosine: 0.0,
        };
    }),
];

#[test]
fn the_command_steps_in_proportion_to_what_changes() {
    for method in [Method::Static, Method::Bristles] {
        let set = believed(Learning::Off, method);
        let mut run = Run::<f64>::new(&set, SI);
        run.pass(700);
        for _ in 0..40 {
            run.pass(50);
            let stays = run.ahead(&set).torque;
            for (what, change) in CHANGES {
                let stepped = |share: f64| {
                    let mut next = set;
                    change(&mut next, share);
                    run.ahead(&next).torque - stays
                };
                // Twice the change, twice the step: nothing jumps by itself. What is not linear leaves a share of the
                // change, of a torque that is at most the limit.
                let (half, whole) = (stepped(1e-4), stepped(2e-4));
                assert!(
                    (whole - 2.0 * half).abs() < 2e-4 * 2e-4 * 10.0,
                    "{what}: {half} {whole}"
                );
                assert!(whole.abs() < 2e-4 * 0.7, "{what}: {whole}");
            }
        }
    }
}

#[test]
fn gains_act_on_what_is_remembered() {
    let set = believed(Learning::Off, Method::Static);
    let mut run = Run::<f64>::new(&set, SI);
    run.pass(1700);
    let stays = run.ahead(&set);
    // The integral goes on from where it is: a new gain of its own shows from the sample after the next on.
    let mut other = set;
    other.velocity_integral = 0.0;
    assert_eq!(run.ahead(&other).torque, stays.torque);
    // kp adds kv·Δkp·error, and a correction for friction of slope·Δkp·error within its clamp.
    other = set;
    other.compensation.slope = 0.0;
    let flat = run.ahead(&other).torque;
    other.position_gain *= 1.5;
    let step = run.ahead(&other).torque - flat;
    let expected = set.velocity_gain * 0.5 * set.position_gain * stays.error;
    assert!((step - expected).abs() < 1e-12, "{step} {expected}");
    assert!(expected.abs() > 1e-6);
}

#[test]
fn what_was_learned_stays_until_the_set_says_otherwise() {
    for learning in [Learning::Observer, Learning::Rows] {
        let set = believed(learning, Method::Static);
        let mut run = Run::<f64>::new(&set, SI);
        run.pass(4000);
        let learned = run.step().coulomb;
        assert!((learned - 0.2).abs() < 0.02, "{learned}");
        let level = |change: &dyn Fn(&mut Parameters<f64>)| {
            let mut next = set;
            change(&mut next);
            run.ahead(&next).coulomb
        };
        // A period of learning later.
        let near = |a: f64, b: f64| (a - b).abs() < 0.01;
        assert!(near(level(&|p| p.velocity_gain *= 1.2), learned));
        assert!(near(level(&|p| p.friction.viscous *= 1.2), learned));
        assert!(near(level(&|p| p.friction.coulomb = 0.1), 0.1));
        assert_eq!(level(&|p| p.adaptation.method = Learning::Off), 0.15);
        assert!(level(&|p| p.adaptation.highest = 0.17) <= 0.17);
        assert!(level(&|p| p.adaptation.lowest = 0.3) >= 0.3);
    }
}

#[test]
fn rows_begin_anew_where_the_model_of_them_changes_and_learn_on() {
    let set = believed(Learning::Rows, Method::Static);
    let mut run = Run::<f32>::new(&set, SI);
    run.pass(4000);
    let mut other = set;
    other.friction.viscous *= 1.1;
    // Told two things in turn, faster than a window lasts, it learns nothing and stays where it is.
    let learned = run.step().coulomb;
    for _ in 0..40 {
        for set in [other, set] {
            run.set(&set);
            run.pass(40);
            assert_eq!(run.step().coulomb, learned);
        }
    }
    run.pass(3000);
    let (again, truth) = (f64::from(run.step().coulomb), 0.2);
    assert!((again - truth).abs() < 0.02, "{again}");
}

#[test]
fn bristles_keep_their_force_under_another_stiffness() {
    let set = believed(Learning::Off, Method::Bristles);
    let mut run = Run::<f64>::new(&set, SI);
    run.pass(1700);
    let before = run.ahead(&set).friction;
    let mut stiffer = set;
    stiffer.friction.bristle_stiffness *= 4.0;
    let after = run.ahead(&stiffer).friction;
    // It slides, where the force is that of the level whatever the stiffness.
    assert!(
        (after - before).abs() < 1e-6 * before.abs(),
        "{before} {after}"
    );
    // What nobody observed is not bent: a period of sliding at 1.5 rad/s bends it by 1.5 mrad at most.
    let mut unobserved = Run::<f64>::new(&believed(Learning::Off, Method::Static), SI);
    unobserved.pass(700);
    let viscous = set.friction.viscous * 1.5;
    let first = unobserved.ahead(&set).friction;
    let most = set.friction.bristle_stiffness * 1.5 * PERIOD + viscous;
    assert!(first.abs() <= most, "{first} {most}");
}
