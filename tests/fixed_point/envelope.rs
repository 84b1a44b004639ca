//! How far an axis under fixed point can be from the same axis under the reference in `f64`, derived.
//!
//! While the axis slides one way, the loop is linear but for the encoder: Coulomb friction is a constant, and what is learned
//! of it is a linear filter. The difference of two runs then obeys the same linear equations, driven by what the one run
//! rounds and the other does not. Each such error is bounded by the resolution (a product is rounded by at most
//! `η = 2⁻¹⁷` in the board's units) and by how far a factor is from its exact value, times the largest signal that it
//! multiplies. From where it enters, the loop amplifies it to the position by at most the sum of the absolute values of its
//! impulse response (the ℓ₁ norm; Dahleh and Pearson 1987). The envelope is the sum over all of them.
//!
//! The encoder rounds to whole counts, and its observer is not surprised within one: what it takes for the surprise is off
//! from `q − q̂` by less than one count in each run, so by less than two in their difference, at any moment.

use bristle::emulate::{self, Plan, Transport, Tuned};
use bristle::model::Model;
use bristle::plant::{self, Plant};
use bristle::step::State;
use bristle::tune;
use bristle_core::Scalar;
use bristle_core::control::{Controller, Driver as From, Output, Parameters};
use bristle_core::drive::Number;
use bristle_core::friction::Units;
use bristle_core::scalar::Q16;

use crate::{SENSORS, SETUP, plan_along};

const AXIS: &str = "[plant]\nmotion = \"rotary\"\ninput = \"torque\"\ngain = 1.0\ninertia = 0.0001\n\
    [friction]\nmodel = \"coulomb-viscous\"\ncoulomb = 0.1\nviscous = 0.001\n";
const SAMPLES: usize = 10_000;
const PERIOD: f64 = 1e-3;

/// The largest rounding error of a product, in the board's units.
const ETA: f64 = 1.0 / 131_072.0;

fn model() -> Model {
    Model::parse(AXIS).expect("a model")
}

/// From the start on between 0.4 and 1.6 rad/s.
fn reference(t: f64) -> (f64, (f64, f64)) {
    let (a, b) = (2.0 * t, 11.0 * t);
    let q = t - 0.25 * a.cos() - 0.1 / 11.0 * b.cos() + 0.25 + 0.1 / 11.0;
    let v = 1.0 + 0.5 * a.sin() + 0.1 * b.sin();
    (q, (v, a.cos() + 1.1 * b.cos()))
}

fn plan<T: Number>(units: &Units) -> Plan<T> {
    plan_along(reference, SAMPLES, units)
}

/// An axis that is moving already.
fn plant(t: &[f64]) -> Box<dyn Plant> {
    let mut plant = plant::new(&model()).expect("a plant");
    let v = reference(0.0).1.0;
    plant.start(t, &[], 0, State { q: 0.0, v });
    plant
}

/// What `tune` makes of the model, with the friction of the set point alone: what is fed forward needs no linear model.
fn tuned<T: Number>() -> (Tuned<T>, Parameters<f64>) {
    let mut exact = tune::parameters(&model(), &SETUP.wish).expect("a controller");
    exact.compensation.driver = From::Desired;
    let mut tuned: Tuned<T> = emulate::tuned(&model(), &SETUP, &SENSORS).expect("it fits");
    tuned.parameters.control = exact.scaled(&tuned.units).expect("it fits");
    (tuned, exact)
}

/// What the controller sees and does over the run, in SI units.
fn outputs<T: Number>(units: &Units, control: Parameters<T>) -> (Vec<Output<f64>>, Vec<f64>) {
    let plan = plan::<T>(units);
    let mut plant = plant(&plan.t);
    let mut controller = Controller::new(control, 0).expect("valid parameters");
    let (mut seen, mut u, mut q) = (Vec::new(), Vec::new(), Vec::new());
    let start = SENSORS.counts(plant.measured().q);
    for k in 0..SAMPLES {
        q.push(plant.measured().q);
        let counts = SENSORS.counts(plant.measured().q) - start;
        let output = controller.step(counts as i32, plan.set_points[k]);
        assert!(output.finite && !output.saturated, "{k}: {output:?}");
        u.push(output.command.to_f64());
        seen.push(si(&output, units));
        if k + 1 < SAMPLES {
            plant.advance(&plan.t, &u, k, 0.0);
        }
    }
    (seen, q)
}

fn si<T: Scalar>(o: &Output<T>, units: &Units) -> Output<f64> {
    Output {
        command: o.command.to_f64(),
        torque: o.torque.to_f64() * units.force,
        saturated: o.saturated,
        finite: o.finite,
        error: o.error.to_f64() * units.position,
        position: bristle_core::control::Position {
            counts: o.position.counts,
            fraction: o.position.fraction.to_f64(),
        },
        velocity: o.velocity.to_f64() * units.velocity,
        friction: o.friction.to_f64() * units.force,
        coulomb: o.coulomb.to_f64() * units.force,
        offset: o.offset.to_f64() * units.force,
    }
}

/// The factors of the control path, as `control` derives them from its parameters.
#[derive(Clone, Copy)]
struct Factors<S> {
    /// Share of a surprise that moves the position.
    l1: S,
    /// Velocity per count of surprise.
    l2: S,
    /// Counts a sample per velocity.
    counts: S,
    /// Velocity of a count a sample.
    per_count: S,
    /// Velocity that a torque gives in a sample, and its inverse.
    kick: S,
    per_kick: S,
    /// `u` per torque.
    per_torque: S,
    /// Share of the surprise that the Coulomb level learns in a sample.
    share: S,
    count: S,
    kp: S,
    kv: S,
    ki: S,
    period: S,
    inertia: S,
    viscous: S,
}

impl<S: Scalar> Factors<S> {
    fn of(p: &Parameters<S>) -> Self {
        let (gone, _) = (p.observer_bandwidth * p.period).relax();
        Self {
            l1: gone + gone - gone * gone,
            l2: gone * gone * (p.count / p.period),
            counts: p.period / p.count,
            per_count: p.count / p.period,
            kick: p.period / p.inertia,
            per_kick: p.inertia / p.period,
            per_torque: S::ONE / p.gain,
            share: p.adaptation.rate * p.period,
            count: p.count,
            kp: p.position_gain,
            kv: p.velocity_gain,
            ki: p.velocity_integral,
            period: p.period,
            inertia: p.inertia,
            viscous: p.friction.viscous,
        }
    }

    /// In SI units.
    fn si(self, units: &Units) -> Factors<f64> {
        let (f, p, v, t) = (units.force, units.position, units.velocity, units.time());
        Factors {
            l1: self.l1.to_f64(),
            l2: self.l2.to_f64() * v,
            counts: self.counts.to_f64() / v,
            per_count: self.per_count.to_f64() * v,
            kick: self.kick.to_f64() * v / f,
            per_kick: self.per_kick.to_f64() * f / v,
            per_torque: self.per_torque.to_f64() / f,
            share: self.share.to_f64(),
            count: self.count.to_f64() * p,
            kp: self.kp.to_f64() / t,
            kv: self.kv.to_f64() * f / v,
            ki: self.ki.to_f64() * f / p,
            period: self.period.to_f64() * t,
            inertia: self.inertia.to_f64() * f * t / v,
            viscous: self.viscous.to_f64() * f / v,
        }
    }
}

/// Where an error enters.
#[derive(Clone, Copy, Default)]
struct Errors {
    /// The way of a prediction, and the position, counts.
    way: f64,
    position: f64,
    /// The surprise, counts.
    surprise: f64,
    velocity: f64,
    level: f64,
    /// The velocity asked for.
    command: f64,
    torque: f64,
    integral: f64,
    input: f64,
    /// What acts, as the observer has it.
    drive: f64,
}

impl Errors {
    fn fields(&mut self) -> [&mut f64; 10] {
        [
            &mut self.way,
            &mut self.position,
            &mut self.surprise,
            &mut self.velocity,
            &mut self.level,
            &mut self.command,
            &mut self.torque,
            &mut self.integral,
            &mut self.input,
            &mut self.drive,
        ]
    }
}

/// The difference of two runs that slide the same way, in SI units; the position of the observer in counts.
#[derive(Clone, Copy, Default)]
struct Difference {
    q: f64,
    v: f64,
    position: f64,
    velocity: f64,
    level: f64,
    integral: f64,
    drive: f64,
}

impl Difference {
    /// One sample and the period after it, under errors; the equations of `control`, term by term.
    fn next(self, f: &Factors<f64>, e: &Errors) -> Self {
        let free = self.velocity + f.kick * (self.drive - self.level);
        let way = 0.5 * (self.velocity + free) * f.counts + e.way;
        let surprise = self.q / f.count - self.position - way + e.surprise;
        let moved = way + f.l1 * surprise + e.position;
        let position = self.position + moved;
        let velocity = free + f.l2 * surprise + e.velocity;
        let taken = (f.kick * self.drive - (velocity - self.velocity)) * f.per_kick;
        let level = self.level + f.share * (taken - self.level) + e.level;
        let command = -f.kp * position * f.count + e.command;
        let torque = level + f.kv * (command - velocity) + self.integral + e.torque;
        let slow = command - moved * f.per_count;
        let input = torque * f.per_torque + e.input;
        // The axis: `J·v̇ = u − Fv·v` with `u` held.
        let rate = f.viscous / f.inertia;
        let stays = (-rate * f.period).exp();
        let mean = (1.0 - stays) / rate;
        Self {
            q: self.q + mean * self.v + (f.period - mean) / rate * input / f.inertia,
            v: stays * self.v + mean * input / f.inertia,
            position,
            velocity,
            level,
            integral: self.integral + f.ki * f.period * slow + e.integral,
            drive: torque - f.viscous * velocity + e.drive,
        }
    }
}

/// The sum of the absolute values of the position's response to a unit of one error in one sample.
fn amplification(f: &Factors<f64>, field: usize) -> f64 {
    let mut unit = Errors::default();
    *unit.fields()[field] = 1.0;
    let mut x = Difference::default().next(f, &unit);
    let mut sum = 0.0;
    for _ in 0..SAMPLES {
        sum += x.q.abs();
        x = x.next(f, &Errors::default());
    }
    // The loop is stable, and the sum complete.
    assert!(x.q.abs() < 1e-9 * sum, "{field}: {} of {sum}", x.q);
    sum
}

/// The largest absolute value over the samples of all runs.
fn largest(runs: &[&[Output<f64>]], f: impl Fn(&Output<f64>, &Output<f64>, usize) -> f64) -> f64 {
    let pairs = runs.iter().flat_map(|run| run.windows(2).enumerate());
    pairs.fold(0.0, |most, (k, pair)| {
        most.max(f(&pair[0], &pair[1], k + 1).abs())
    })
}

/// The bound of each error: the resolution in the units, and errors of factors with the signals that they multiply.
fn bounds(
    exact: &Factors<f64>,
    board: &Factors<f64>,
    units: &Units,
    runs: &[&[Output<f64>]],
) -> Errors {
    let (force, velocity, time) = (units.force, units.velocity, units.time());
    let off = |pick: fn(&Factors<f64>) -> f64| (pick(exact) - pick(board)).abs();
    let moved = |a: &Output<f64>, b: &Output<f64>| b.position.minus(a.position);
    // `moved = (v + v' − l₂·s)/2·counts + l₁·s`, solved for the surprise `s`.
    let surprised = |a: &Output<f64>, b: &Output<f64>| {
        let steady = 0.5 * (a.velocity + b.velocity) * exact.counts;
        (moved(a, b) - steady) / (exact.l1 - 0.5 * exact.l2 * exact.counts)
    };
    let speed = largest(runs, |_, b, _| b.velocity);
    let torque = largest(runs, |_, b, _| b.torque);
    let level = largest(runs, |_, b, _| b.coulomb);
    let wanted = |b: &Output<f64>, k: usize| reference(k as f64 * PERIOD).1.0 + exact.kp * b.error;
    let error = largest(runs, |_, b, k| wanted(b, k) - b.velocity);
    let slow = largest(runs, |a, b, k| wanted(b, k) - moved(a, b) * exact.per_count);
    let step = largest(runs, |a, b, _| moved(a, b));
    let surprise = largest(runs, |a, b, _| surprised(a, b));
    let position = largest(runs, |_, b, _| b.error);
    let change = largest(runs, |a, b, _| b.velocity - a.velocity);
    let learned = largest(runs, |a, b, _| (b.coulomb - a.coulomb) / exact.share);
    let acceleration = largest(runs, |_, _, k| reference(k as f64 * PERIOD).1.1);
    let asked = largest(runs, |_, _, k| reference(k as f64 * PERIOD).1.0);
    let drive = torque + exact.viscous * speed;
    Errors {
        // Half of a sum, which is cut off, and a product.
        way: ETA * velocity * exact.counts + ETA + off(|f| f.counts) * speed,
        position: ETA + off(|f| f.l1) * surprise,
        surprise: 2.0,
        // What acts, dry friction, and the correction.
        velocity: 3.0 * ETA * velocity
            + off(|f| f.kick) * (drive + level)
            + off(|f| f.l2) * surprise,
        level: exact.share
            * (exact.per_kick * ETA * velocity
                + ETA * force
                + off(|f| f.kick) * drive * exact.per_kick
                + off(|f| f.per_kick) * (change + exact.kick * drive))
            + 2.0 * ETA * force
            + off(|f| f.share) * learned,
        // Counts to a position and on to a velocity; the set point is rounded as well.
        command: exact.kp * (ETA * units.position + ETA * exact.count)
            + 2.0 * ETA * velocity
            + off(|f| f.kp) * position
            + exact.kp * off(|f| f.count) * position / exact.count,
        // Feedback, inertia and two parts of friction, times a share of one.
        torque: 5.0 * ETA * force
            + off(|f| f.kv) * error
            + off(|f| f.inertia) * acceleration
            + exact.inertia * ETA * velocity / time
            + off(|f| f.viscous) * asked
            + exact.viscous * ETA * velocity,
        integral: ETA * force / time * exact.period
            + ETA * force
            + (off(|f| f.ki) * exact.period + exact.ki * off(|f| f.period)) * slow
            + exact.ki * exact.period * (ETA * velocity + off(|f| f.per_count) * step),
        input: ETA + off(|f| f.per_torque) * torque,
        drive: ETA * force + off(|f| f.viscous) * speed,
    }
}

#[test]
fn in_fixed_point_the_axis_stays_within_its_envelope_of_the_reference() {
    let (board, exact) = tuned::<Q16>();
    let units = board.units;
    let (reference, q) = outputs(&tune::SI, exact);
    let (fixed, fixed_q) = outputs(&units, board.parameters.control);
    for (k, (a, b)) in reference.iter().zip(&fixed).enumerate().skip(50) {
        let slides = |o: &Output<f64>| o.velocity > exact.adaptation.speed && !o.saturated;
        assert!(slides(a) && slides(b), "{k}: {a:?}, {b:?}");
    }
    let factors = Factors::of(&exact);
    let rounded = Factors::of(&board.parameters.control).si(&units);
    let mut bounds = bounds(&factors, &rounded, &units, &[&reference, &fixed]);
    let shares: Vec<f64> = bounds
        .fields()
        .into_iter()
        .enumerate()
        .map(|(k, bound)| *bound * amplification(&factors, k))
        .collect();
    let envelope: f64 = shares.iter().sum();
    let counts: Vec<f64> = shares.iter().map(|s| s / SENSORS.count).collect();
    let apart = |q: &[f64], other: &[f64]| {
        let pairs = q.iter().zip(other);
        pairs.fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()))
    };
    let found = apart(&q, &fixed_q);
    println!("envelope {} counts, {counts:?}", envelope / SENSORS.count);
    println!("found {} counts; {units:?}", found / SENSORS.count);
    assert!(found > 0.0 && found <= envelope, "{found} {envelope}");

    // And what the emulated board does is the fixed-point run, to the bit.
    let Some(mut running) = super::running(Transport::Fast, &board.parameters) else {
        return;
    };
    let plan = plan(&units);
    let outcome = emulate::run(&mut running, plant(&plan.t).as_mut(), &plan).expect("a run");
    assert!(outcome.periods.iter().all(|p| p.bridge));
    let emulated: Vec<f64> = outcome.record.truth.iter().map(|s| s.q).collect();
    assert_eq!(emulated, fixed_q);
}
