//! A motor behind a gear, of the type of the Quanser SRV02: everything counts at the output shaft.
//!
//! With the ratio `N` = `plant.gear_ratio`, the efficiencies `ηg` = `plant.gear_efficiency` and `ηm` =
//! `plant.motor_efficiency` (both 1 unless given), the rotor's `Jm` = `plant.motor_inertia` and the inertia `Jl` =
//! `plant.inertia` of gears and load on the output shaft, the servo is a motor (`dc_motor.rs`) with
//! `J = Jl + ηg·N²·Jm`, `kt′ = ηg·ηm·N·kt` and `ke′ = N·ke`. Efficiencies act as when the motor drives the load, also
//! while the load drives the motor: that is how the manual identifies them.
//!
//! # The public data of the SRV02
//! Quanser, SRV02 User Manual, table 3.1: `R` = 2.6 Ω, `L` = 0.18 mH, `kt` = 7.68e-3 N·m/A, `ke` = 7.68e-3 V·s/rad, `N` =
//! 70 (high gear), `ηg` = 0.90, `ηm` = 0.69, rotor 3.90e-7 kg·m² and tachometer 7.06e-8 kg·m², so `Jm` = 4.61e-7 kg·m²,
//! and viscous friction 0.015 N·m·s/rad. Its gears, discs with the masses and radii of table 3.2 (24 teeth: 5 g, 6.35 mm;
//! two with 72 teeth: 30 g, 19 mm; 120 teeth: 83 g, 32 mm), have `Jl` = 5.3e-5 kg·m². `J` comes to 2.09e-3 kg·m² and the
//! speed to 1.53 rad/s per volt. A model file with these numbers is `host/examples/srv02.toml`.

use super::DcMotor;
use crate::error::{Error, Result};
use crate::model::Model;

/// The motor that the output shaft feels.
pub fn geared_servo(model: &Model) -> Result<DcMotor> {
    let mut motor = DcMotor::new(model)?;
    let constant = |name: &str| model.constant(&format!("plant.{name}"));
    let (ratio, gear) = (constant("gear_ratio"), constant("gear_efficiency"));
    let own = constant("motor_efficiency");
    for (name, efficiency) in [("gear", gear), ("motor", own)] {
        if !(efficiency > 0.0 && efficiency <= 1.0) {
            return Err(Error::Usage(format!(
                "plant.{name}_efficiency = {efficiency} must be above 0 and at most 1"
            )));
        }
    }
    motor.axis.inertia += gear * ratio * ratio * constant("motor_inertia");
    motor.torque_constant *= gear * own * ratio;
    motor.back_emf *= ratio;
    Ok(motor)
}
