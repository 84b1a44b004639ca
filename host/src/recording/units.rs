//! Units in column headers.

use crate::motion::Motion;

/// Factor from `unit` to the SI unit of the canonical column `name`, or what to write instead.
pub(super) fn factor(name: &str, unit: &str, motion: Motion) -> Result<f64, String> {
    use std::f64::consts::TAU;
    let plain: String = unit
        .chars()
        .filter(|c| !c.is_whitespace())
        .map(|c| if c == '·' || c == '.' { '*' } else { c })
        .collect();
    let time: &[(&str, f64)] = &[
        ("s", 1.0),
        ("ms", 1e-3),
        ("us", 1e-6),
        ("µs", 1e-6),
        ("ns", 1e-9),
        ("min", 60.0),
    ];
    let angle: &[(&str, f64)] = &[
        ("rad", 1.0),
        ("mrad", 1e-3),
        ("deg", TAU / 360.0),
        ("°", TAU / 360.0),
        ("rev", TAU),
        ("turn", TAU),
        ("turns", TAU),
    ];
    let length: &[(&str, f64)] = &[
        ("m", 1.0),
        ("cm", 1e-2),
        ("mm", 1e-3),
        ("um", 1e-6),
        ("µm", 1e-6),
    ];
    let angular_rate: &[(&str, f64)] = &[
        ("rad/s", 1.0),
        ("deg/s", TAU / 360.0),
        ("°/s", TAU / 360.0),
        ("rpm", TAU / 60.0),
        ("1/min", TAU / 60.0),
        ("rev/s", TAU),
        ("turn/s", TAU),
    ];
    let linear_rate: &[(&str, f64)] = &[
        ("m/s", 1.0),
        ("cm/s", 1e-2),
        ("mm/s", 1e-3),
        ("um/s", 1e-6),
        ("µm/s", 1e-6),
    ];
    let drive: &[(&str, f64)] = &[
        ("N*m", 1.0),
        ("Nm", 1.0),
        ("mN*m", 1e-3),
        ("mNm", 1e-3),
        ("N*cm", 1e-2),
        ("Ncm", 1e-2),
        ("kN*m", 1e3),
        ("kNm", 1e3),
        ("N", 1.0),
        ("mN", 1e-3),
        ("kN", 1e3),
        ("V", 1.0),
        ("mV", 1e-3),
        ("A", 1.0),
        ("mA", 1e-3),
    ];
    let table = match (name, motion) {
        ("t", _) => time,
        ("q" | "q_ref", Motion::Rotary) => angle,
        ("q" | "q_ref", Motion::Linear) => length,
        ("v", Motion::Rotary) => angular_rate,
        ("v", Motion::Linear) => linear_rate,
        ("u", _) => drive,
        _ => return Ok(1.0),
    };
    table
        .iter()
        .find(|(known, _)| *known == plain)
        .map(|&(_, factor)| factor)
        .ok_or_else(|| {
            let known: Vec<&str> = table.iter().map(|&(unit, _)| unit).collect();
            format!(
                "the unit [{unit}] is not one of {} (plant.motion is \"{}\")",
                known.join(", "),
                motion.as_str()
            )
        })
}

#[cfg(test)]
mod tests {
    use super::{Motion, factor};

    #[test]
    fn converts_to_si() {
        assert_eq!(factor("t", "ms", Motion::Rotary), Ok(1e-3));
        assert_eq!(factor("u", "N·m", Motion::Rotary), Ok(1.0));
        assert_eq!(factor("q", "mm", Motion::Linear), Ok(1e-3));
        assert!(
            (factor("v", "rpm", Motion::Rotary).unwrap() * 60.0 - std::f64::consts::TAU).abs()
                < 1e-12
        );
    }

    #[test]
    fn refuses_a_length_on_a_rotary_axis() {
        assert!(
            factor("q", "mm", Motion::Rotary)
                .unwrap_err()
                .contains("rotary")
        );
    }
}
