//! The current loop of a motor whose winding the model knows.

use std::f64::consts::TAU;

use bristle_core::control::CurrentLoop;

use super::{Wish, motor};
use crate::error::{Error, Result};
use crate::format::shortest;
use crate::model::Model;

/// What is asked of a current loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inner {
    /// `ω/(2π)`, Hz: the error of the current falls by `1 − ω·T` in a period `T`, at `1/ω` to about `1/e`.
    pub bandwidth: f64,
    /// Largest current that may be asked for, A; what the largest `u` drives through the winding at standstill if none.
    pub limit: Option<f64>,
}

/// The electrical side of a motor, per unit of `u`, where the amplifier makes `gain·u` of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Winding {
    /// `R`, Ω.
    pub resistance: f64,
    /// `L`, H.
    pub inductance: f64,
    /// `ke`, V·s/rad.
    pub back_emf: f64,
    /// `kt`, N·m/A, at the shaft that the model's inertia is on.
    pub torque_constant: f64,
}

/// Largest `ω·T`. Where the voltage of a sample is applied a whole period later, as by a timer that takes its compare values
/// over at the next update, the error obeys `z² − z + ω·T = 0`, and up to 1/4 both roots are real: nothing overshoots.
const FASTEST: f64 = 0.25;

impl Winding {
    /// The winding of a model, if it has one.
    pub fn of(model: &Model) -> Result<Self> {
        if !model.kind.is_electric() {
            return Err(Error::Usage(format!(
                "--current-bandwidth needs a model that knows the winding, and plant.kind = \"{}\" does not; use kind = \"dc-motor\" or \"geared-servo\" with resistance, inductance and torque_constant",
                model.kind.as_str()
            )));
        }
        let motor = motor(model)?;
        let gain = motor.axis.gain;
        Ok(Self {
            resistance: motor.resistance / gain,
            inductance: motor.inductance / gain,
            back_emf: motor.back_emf / gain,
            torque_constant: motor.torque_constant,
        })
    }
}

/// The current loop that is wished for, if one is: with the gains of [`CurrentLoop::tuned`].
pub fn current(model: &Model, wish: &Wish) -> Result<Option<CurrentLoop<f64>>> {
    let Some(inner) = &wish.current else {
        return Ok(None);
    };
    wish.check()?;
    let winding = Winding::of(model)?;
    let (omega, period) = (TAU * inner.bandwidth, 1.0 / wish.rate);
    if omega * period > FASTEST {
        return Err(Error::Usage(format!(
            "--current-bandwidth {} Hz is too much for {} samples a second, at which {} Hz is the most; sample faster or ask for less",
            shortest(inner.bandwidth, 4),
            shortest(wish.rate, 6),
            // Cut off, so that what is named is accepted.
            shortest((100.0 * FASTEST * wish.rate / TAU).floor() / 100.0, 6)
        )));
    }
    let [proportional, reset] =
        CurrentLoop::tuned(winding.resistance, winding.inductance, omega, period);
    Ok(Some(CurrentLoop {
        proportional,
        reset,
        back_emf: winding.back_emf,
        limit: wish.limit,
    }))
}

#[cfg(test)]
mod tests {
    use super::{Inner, current};
    use crate::model::Model;
    use crate::tune::{Wish, parameters};

    const MOTOR: &str = "[plant]\nkind = \"dc-motor\"\nmotion = \"rotary\"\ninput = \"voltage\"\ngain = 2.0\ninertia = 2e-4\n\
        resistance = 2.6\ninductance = 1.8e-3\ntorque_constant = 0.05\nback_emf = 0.06\n[friction]\ncoulomb = 0.01\nviscous = 2e-4\n";

    fn wish(bandwidth: f64, limit: Option<f64>) -> Wish {
        Wish {
            bandwidth: 6.0,
            rate: 8000.0,
            counts: 4096.0,
            limit: 12.0,
            current: Some(Inner { bandwidth, limit }),
        }
    }

    #[test]
    fn the_loop_is_per_unit_of_u_and_the_controller_counts_in_amperes() {
        let model = Model::parse(MOTOR).unwrap();
        let found = current(&model, &wish(300.0, None)).unwrap().unwrap();
        let omega = std::f64::consts::TAU * 300.0;
        // Ki = ρ·Kp/T = R·ω.
        assert!((found.reset * found.proportional * 8000.0 / (1.3 * omega) - 1.0).abs() < 1e-12);
        let x: f64 = 2.6 / 1.8e-3 / 8000.0;
        let gain = 0.9e-3 * omega * x / (1.0 - (-x).exp());
        assert!((found.proportional / gain - 1.0).abs() < 1e-12);
        assert_eq!((found.back_emf, found.limit), (0.03, 12.0));
        let control = parameters(&model, &wish(300.0, None)).unwrap();
        assert_eq!((control.gain, control.back_emf), (0.05, 0.0));
        // 24 V over 2.6 Ω.
        assert!((control.command_limit - 24.0 / 2.6).abs() < 1e-12);
        assert!((control.torque_limit - 0.05 * 24.0 / 2.6).abs() < 1e-12);
        let limited = parameters(&model, &wish(300.0, Some(3.0))).unwrap();
        assert_eq!(
            (limited.command_limit, limited.torque_limit),
            (3.0, 0.05 * 3.0)
        );
    }

    #[test]
    fn what_cannot_be_is_refused_with_what_to_change() {
        let plain = MOTOR.replace("kind = \"dc-motor\"\n", "").replace(
            "resistance = 2.6\ninductance = 1.8e-3\ntorque_constant = 0.05\n",
            "",
        );
        for (text, bandwidth, limit, part) in [
            (MOTOR, 319.0, None, "318.3"),
            (MOTOR, -1.0, None, "--current-bandwidth"),
            (MOTOR, 100.0, Some(0.0), "--current-limit"),
            (&plain, 100.0, None, "dc-motor"),
        ] {
            let refused = current(&Model::parse(text).unwrap(), &wish(bandwidth, limit));
            let said = refused.err().unwrap();
            assert!(said.to_string().contains(part), "{said}");
            assert_eq!(said.exit_status(), 2);
        }
        let model = Model::parse(MOTOR).unwrap();
        assert!(current(&model, &wish(318.0, None)).is_ok());
    }
}
