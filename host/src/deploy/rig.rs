//! What a model file does not say: the board, its supply, and what it must not do.

use bristle_core::drive::Parameters;
use bristle_core::link::Board;

use crate::emulate::{self, Sensors, Setup};
use crate::error::{self, Error, Result};
use crate::format::shortest;
use crate::model::{Kind, Model, Motion};
use crate::tune::{Drive, Wish};

/// A board as it is wired.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rig {
    /// Which board.
    pub board: Board,
    /// Nominal supply, V.
    pub bus: f64,
    /// Largest motor current, A; the range of the converter if none.
    pub current: Option<f64>,
}

/// The control rate of an `ODrive` v3, Hz: an update every third period of a PWM of 24 kHz.
const ODRIVE_RATE: f64 = 8000.0;
/// Of its current, A to a count: 40 V/V over 0.5 mΩ, and 12 bits of 3.3 V.
const ODRIVE_CURRENT: f64 = 3.3 / 4096.0 / (40.0 * 0.5e-3);
/// The divider of its bus voltage, by the largest supply of the variant, V.
const ODRIVE_DIVIDERS: [(f64, f64); 2] = [(24.0, 11.0), (56.0, 19.0)];
/// The share of the bus that its bridge can apply.
const BRIDGE: f64 = 15.0 / 16.0;

impl Rig {
    /// Control periods a second, if the board does not leave them to choose.
    pub fn rate(&self) -> Option<f64> {
        match self.board {
            Board::Emulated => None,
            Board::OdriveV3 => Some(ODRIVE_RATE),
        }
    }

    /// The converters of the board, for an encoder whose count is `count` rad or m.
    fn sensors(&self, count: f64) -> Result<Sensors> {
        match self.board {
            Board::Emulated => Ok(Sensors {
                bus: self.bus,
                ..Sensors::emulated(count)
            }),
            Board::OdriveV3 => {
                let fits = ODRIVE_DIVIDERS.iter().find(|(most, _)| self.bus <= *most);
                let Some((_, divider)) = fits else {
                    return Err(Error::Usage(format!(
                        "--bus {} V is more than any ODrive v3 bears; the variants are for up to 24 V and 56 V",
                        self.bus
                    )));
                };
                Ok(Sensors {
                    count,
                    current_per_count: ODRIVE_CURRENT,
                    bus_per_count: 3.3 / 4096.0 * divider,
                    bus: self.bus,
                })
            }
        }
    }

    /// Says what of a model or a wish this board cannot do.
    fn check(&self, model: &Model, wish: &Wish) -> Result<()> {
        if self.board != Board::OdriveV3 {
            return Ok(());
        }
        if wish.rate != ODRIVE_RATE {
            return Err(Error::Usage(format!(
                "--rate {} does not fit an ODrive v3, whose timer makes {ODRIVE_RATE} control periods a second; leave the option out",
                shortest(wish.rate, 6)
            )));
        }
        if model.input != "voltage" && !matches!(model.kind, Kind::DcMotor | Kind::GearedServo) {
            return Err(Error::Usage(format!(
                "the model's u is a {}, and this board's bridge applies a voltage; identify a model with plant.input = \"voltage\" and back_emf, or plant.kind = \"dc-motor\"",
                model.input
            )));
        }
        if wish.limit > BRIDGE * self.bus {
            return Err(Error::Usage(format!(
                "--limit {} V is more than the bridge makes of --bus {} V, {} V; lower it, as what lies beyond is cut where no controller knows of it",
                shortest(wish.limit, 4),
                shortest(self.bus, 4),
                shortest(BRIDGE * self.bus, 4)
            )));
        }
        Ok(())
    }
}

/// The parameters for a board, all of them within what the board and its numbers can do, or what to change if they are
/// not.
pub fn parameters(model: &Model, setup: &Setup, rig: &Rig) -> Result<Parameters<f32>> {
    error::positive(&[("--bus", Some(rig.bus)), ("--current", rig.current)])?;
    let wish = &setup.wish;
    rig.check(model, wish)?;
    let sensors = rig.sensors(model.motion.turn() / wish.counts)?;
    let mut found = emulate::parameters(model, setup, &sensors)?;
    if let Some(current) = rig.current {
        let most = f64::from(found.limits.current);
        if current > most {
            return Err(Error::Usage(format!(
                "--current {} A is beyond what the board can measure, {} A; lower it",
                shortest(current, 4),
                shortest(most, 4)
            )));
        }
        found.limits.current = current as f32;
        emulate::check_current(&found)?;
    }
    check_speed(model, wish, &sensors, found.limits.jump)?;
    if !found.is_valid() {
        return Err(Error::Usage(format!(
            "the limits {:?} are out of range; check --bus, --current and --counts",
            found.limits
        )));
    }
    Ok(found)
}

/// At the speed at which back-EMF takes all of the voltage, the encoder must not seem to jump.
fn check_speed(model: &Model, wish: &Wish, sensors: &Sensors, jump: u16) -> Result<()> {
    let drive = Drive::of(model)?;
    let top = (wish.limit / drive.back_emf).abs();
    let counts = top / wish.rate / sensors.count;
    if drive.back_emf == 0.0 || counts < f64::from(jump) {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "at {} V the axis reaches {} {}/s, where the encoder passes {} counts a period, and {jump} are taken for a lost encoder; lower --limit, or use an encoder of fewer counts",
        shortest(wish.limit, 4),
        shortest(top, 4),
        if model.motion == Motion::Rotary {
            "rad"
        } else {
            "m"
        },
        shortest(counts, 5),
    )))
}

#[cfg(test)]
mod tests {
    use bristle_core::link::Board;

    use super::{Rig, parameters};
    use crate::emulate::Setup;
    use crate::model::Model;
    use crate::tune::Wish;

    const SETUP: Setup = Setup {
        wish: Wish {
            bandwidth: 6.0,
            rate: 8000.0,
            counts: 8192.0,
            limit: 12.0,
            current: None,
        },
        compensate: true,
    };
    const RIG: Rig = Rig {
        board: Board::OdriveV3,
        bus: 24.0,
        current: Some(20.0),
    };

    fn motor(input: &str) -> Model {
        let text = format!(
            "[plant]\nmotion = \"rotary\"\ninput = \"{input}\"\ngain = 0.13\nback_emf = 0.54\ninertia = 0.002\n[friction]\ncoulomb = 0.1\nviscous = 0.015\n"
        );
        let text = if input == "voltage" {
            text
        } else {
            text.replace("back_emf = 0.54\n", "")
        };
        Model::parse(&text).unwrap()
    }

    #[test]
    fn the_scales_are_those_of_the_circuit() {
        let found = parameters(&motor("voltage"), &SETUP, &RIG).unwrap();
        // 24 V over 11 are 2.18 V, of 3.3 V 2708 counts; 10 A over 0.5 mΩ times 40 are 0.2 V, 248 counts.
        assert!((24.0 / found.limits.bus_per_count - 2708.0).abs() < 1.0);
        assert!((10.0 / found.limits.current_per_count - 248.2).abs() < 0.1);
        assert_eq!(found.limits.current, 20.0);
        assert_eq!(found.control.period, 1.25e-4);
        // The other variant divides by 19.
        let high = parameters(&motor("voltage"), &SETUP, &Rig { bus: 48.0, ..RIG }).unwrap();
        let ratio = high.limits.bus_per_count / found.limits.bus_per_count;
        assert!((ratio - 19.0 / 11.0).abs() < 1e-6);
    }

    #[test]
    fn what_the_board_cannot_do_is_refused_with_what_to_change() {
        let wish = |change: fn(&mut Wish)| {
            let mut setup = SETUP;
            change(&mut setup.wish);
            setup
        };
        let cases = [
            ("voltage", SETUP, Rig { bus: 60.0, ..RIG }, "--bus"),
            ("voltage", SETUP, Rig { bus: -1.0, ..RIG }, "--bus"),
            (
                "voltage",
                SETUP,
                Rig {
                    current: Some(90.0),
                    ..RIG
                },
                "--current",
            ),
            ("voltage", wish(|w| w.limit = 23.0), RIG, "--limit"),
            ("voltage", wish(|w| w.rate = 1000.0), RIG, "--rate"),
            ("voltage", wish(|w| w.counts = 1e7), RIG, "lost encoder"),
            ("torque", SETUP, RIG, "voltage"),
        ];
        for (input, setup, rig, part) in cases {
            let refused = parameters(&motor(input), &setup, &rig).err().unwrap();
            assert!(refused.to_string().contains(part), "{refused}");
            assert_eq!(refused.exit_status(), 2);
        }
        let emulated = Rig {
            board: Board::Emulated,
            ..RIG
        };
        assert!(parameters(&motor("torque"), &SETUP, &emulated).is_ok());
    }
}
