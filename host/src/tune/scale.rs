//! Units for a board that computes in fixed point.

use bristle_core::control::{CurrentLoop, Parameters};
use bristle_core::friction::Units;

/// What a board in floating point counts in.
pub const SI: Units = Units {
    force: 1.0,
    position: 1.0,
    velocity: 1.0,
};

/// Powers of two that a unit is looked for among: from a millionth to a thousand of the SI unit, and for positions down to a
/// billionth.
const FORCE: std::ops::RangeInclusive<i32> = -20..=10;
const POSITION: std::ops::RangeInclusive<i32> = -30..=5;
const VELOCITY: std::ops::RangeInclusive<i32> = -20..=10;

/// The largest number in the chosen units: half of what 16 bits before the point hold, as sums are formed of two.
const LARGEST: f64 = 16_384.0;

/// A number in SI units and the powers in which force, position and velocity are in its unit.
type Quantity = (f64, [i32; 3]);

const FORCES: [i32; 3] = [1, 0, 0];
const VELOCITIES: [i32; 3] = [0, 0, 1];
const DAMPINGS: [i32; 3] = [1, 0, -1];
const STIFFNESSES: [i32; 3] = [1, -1, 0];
const RATES: [i32; 3] = [0, -1, 1];

fn inverse((value, powers): Quantity) -> Quantity {
    (1.0 / value, powers.map(|p| -p))
}

/// What the control path multiplies with: parameters, and what follows from them.
fn factors(p: &Parameters<f64>, current: Option<&CurrentLoop<f64>>) -> Vec<Quantity> {
    let (friction, adaptation) = (&p.friction, &p.adaptation);
    let compensation = &p.compensation;
    let gone = 1.0 - (-p.observer_bandwidth * p.period).exp();
    let count_speed = p.count / p.period;
    let kick = (p.period / p.inertia, [-1, 0, 1]);
    let mut all = vec![
        (p.period, [0, 1, -1]),
        (p.count, [0, 1, 0]),
        (p.inertia, [1, 1, -2]),
        (p.gain, FORCES),
        inverse((p.gain, FORCES)),
        (p.back_emf, [0, 0, -1]),
        (p.torque_limit, FORCES),
        (p.observer_bandwidth, RATES),
        (p.position_gain, RATES),
        (p.velocity_gain, DAMPINGS),
        (p.velocity_integral, STIFFNESSES),
        (friction.coulomb, FORCES),
        (friction.static_level, FORCES),
        (friction.viscous, DAMPINGS),
        (friction.bristle_stiffness, STIFFNESSES),
        (friction.bristle_damping, DAMPINGS),
        (compensation.slope, DAMPINGS),
        (adaptation.highest, FORCES),
        (adaptation.rate, RATES),
        (adaptation.window, [0, 1, -1]),
        (gone * gone * count_speed, VELOCITIES),
        (count_speed, VELOCITIES),
        inverse((count_speed, VELOCITIES)),
        kick,
        inverse(kick),
    ];
    for speed in [
        friction.stribeck_velocity,
        compensation.crossing,
        adaptation.speed,
    ] {
        all.extend([(speed, VELOCITIES), inverse((speed, VELOCITIES))]);
    }
    let effects = &p.effects;
    all.extend([
        (effects.viscous_difference, DAMPINGS),
        (effects.stiffness, STIFFNESSES),
        (effects.backlash.inertia, [1, 1, -2]),
        (effects.backlash.speed, VELOCITIES),
    ]);
    if let Some(current) = current {
        all.extend([
            (current.proportional, [0; 3]),
            (current.reset, [0; 3]),
            (current.back_emf, [0, 0, -1]),
        ]);
    }
    all.retain(|(value, _)| *value != 0.0);
    all
}

/// The largest that variables become: the speed at which the encoder seems to jump, `jump` counts in a period, and the largest
/// acceleration.
fn variables(p: &Parameters<f64>, jump: u16) -> [Quantity; 2] {
    [
        (f64::from(jump) * p.count / p.period, VELOCITIES),
        (p.torque_limit / p.inertia, [0, -1, 2]),
    ]
}

/// The units in which fixed point holds the parameters of a controller best.
///
/// A factor `x` of the control path is off by up to `ε/x`, where `ε = 2⁻¹⁷` is what rounding takes at most. Of all units that
/// are powers of two, so that what is 1 in them is exact, these make the sum of squares of those relative errors
/// smallest, among those in which no factor is beyond half of the range, nor velocity or acceleration at their largest.
/// If there are none, those that exceed it least.
pub fn units(parameters: &Parameters<f64>, current: Option<&CurrentLoop<f64>>, jump: u16) -> Units {
    let logarithm = |(value, powers): Quantity| (value.abs().log2(), powers.map(f64::from));
    let factors: Vec<_> = factors(parameters, current)
        .into_iter()
        .map(logarithm)
        .collect();
    let variables = variables(parameters, jump).map(logarithm);
    let cost = |exponents: [f64; 3]| {
        let scaled = |(log, powers): &(f64, [f64; 3])| {
            log - powers[0] * exponents[0] - powers[1] * exponents[1] - powers[2] * exponents[2]
        };
        let all = factors.iter().chain(&variables).map(scaled);
        let beyond = all.map(|log| (log - LARGEST.log2()).max(0.0)).sum::<f64>();
        let errors = factors.iter().map(|f| (-2.0 * scaled(f)).exp2());
        (beyond, errors.sum::<f64>())
    };
    let mut best = ((f64::INFINITY, f64::INFINITY), SI);
    for force in FORCE {
        for position in POSITION {
            for velocity in VELOCITY {
                let exponents = [force, position, velocity].map(f64::from);
                let found = cost(exponents);
                if found < best.0 {
                    let [force, position, velocity] = exponents.map(f64::exp2);
                    best = (
                        found,
                        Units {
                            force,
                            position,
                            velocity,
                        },
                    );
                }
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use bristle_core::scalar::Q16;

    use super::{Units, factors, units};
    use crate::model::Model;
    use crate::tune::{Inner, Wish, current, parameters};

    /// Parameters in other units are parameters: what is computed of them must be what is computed in SI units, in its unit.
    #[test]
    fn the_powers_of_factors_agree_with_scaled_parameters() {
        let text = "[plant]\nkind = \"dc-motor\"\nmotion = \"rotary\"\ninput = \"voltage\"\ninertia = 2e-3\nresistance = 2.6\n\
            inductance = 1e-3\ntorque_constant = 0.05\n[friction]\nmodel = \"lugre\"\ncoulomb = 0.1\nviscous = 0.015\n\
            static = 0.13\nstribeck_velocity = 0.2\nbristle_stiffness = 50.0\nbristle_damping = 0.1\n\
            [effects.spring]\nstiffness = 0.3\n[effects.viscous-asymmetry]\ndifference = 0.002\n";
        let wish = Wish {
            bandwidth: 6.0,
            rate: 1000.0,
            counts: 4096.0,
            limit: 12.0,
            current: Some(Inner {
                bandwidth: 30.0,
                limit: None,
            }),
        };
        let model = Model::parse(text).unwrap();
        let mut found = parameters(&model, &wish).unwrap();
        found.effects.backlash.inertia = 3e-4;
        found.effects.backlash.speed = 0.7;
        let inner = current(&model, &wish).unwrap().unwrap();
        let here = factors(&found, Some(&inner));
        assert!(here.iter().all(|(value, _)| value.is_finite()));
        // Every factor that there is: none drops out for being zero.
        assert_eq!(here.len(), 25 + 6 + 4 + 3 - 1, "{here:?}");
        for (force, position, velocity) in [(2.0, 1.0, 1.0), (1.0, 8.0, 1.0), (1.0, 1.0, 32.0)] {
            let units = Units {
                force,
                position,
                velocity,
            };
            let scaled = (found.scaled(&units).unwrap(), inner.scaled(&units).unwrap());
            let there = factors(&scaled.0, Some(&scaled.1));
            for (k, ((value, powers), (other, _))) in here.iter().zip(&there).enumerate() {
                let unit =
                    force.powi(powers[0]) * position.powi(powers[1]) * velocity.powi(powers[2]);
                let off = other * unit / value - 1.0;
                assert!(off.abs() < 1e-9, "factor {k}: {value} in {unit}: {other}");
            }
        }
    }

    /// From a small gearmotor to a heavy slide: everything is held to 1 %, which is what `scaled` asks for.
    #[test]
    fn axes_of_all_sizes_fit() {
        for (motion, inertia, coulomb, viscous, limit) in [
            ("rotary", 1e-5, 0.002, 1e-5, 0.05),
            ("rotary", 1e-4, 0.1, 1e-3, 1.0),
            ("rotary", 2e-3, 0.2, 0.015, 1.0),
            ("rotary", 0.1, 1.0, 0.1, 20.0),
            ("linear", 100.0, 20.0, 200.0, 500.0),
        ] {
            let text = format!(
                "[plant]\nmotion = \"{motion}\"\ninertia = {inertia}\n[friction]\ncoulomb = {coulomb}\nviscous = {viscous}\n"
            );
            let counts = if motion == "linear" { 1e6 } else { 16384.0 };
            let wish = Wish {
                bandwidth: 10.0,
                rate: 1000.0,
                counts,
                limit,
                current: None,
            };
            let found = parameters(&Model::parse(&text).unwrap(), &wish).unwrap();
            let units = units(&found, None, 1 << 12);
            let scaled = found.scaled::<Q16>(&units);
            assert!(scaled.is_ok_and(|p| p.is_valid()), "{text}: {units:?}");
        }
    }
}
