//! Numbers as a person reads them: value ± error with the digits that the error allows, and units in print.

use crate::diagnose::Estimate;

/// `12.34 ± 0.23`: the error with two significant digits, the value to the same decimal place.
///
/// Without a usable error the value keeps four significant digits. Far from one, both share a power of ten.
pub(super) fn value(value: f64, se: Option<f64>) -> String {
    if !value.is_finite() {
        return "not finite".to_owned();
    }
    let Some(se) = se.filter(|se| *se > 0.0 && se.is_finite()) else {
        return significant(value, 4);
    };
    let largest = exponent(value.abs().max(se));
    let power = if (-3..5).contains(&largest) {
        0
    } else {
        largest
    };
    let scale = 10f64.powi(power);
    let (value, se) = (value / scale, se / scale);
    let (digits, step) = error_digits(se);
    let rounded = |x: f64| (x / step).round() * step;
    let text = format!(
        "{} ± {:.digits$}",
        minus(&format!("{:.digits$}", rounded(value))),
        rounded(se)
    );
    if power == 0 {
        text
    } else {
        format!("({text})·10{}", superscript(power))
    }
}

/// Decimals that show two digits of an error, and the step that they round to (10, 100, … for large errors).
fn error_digits(se: f64) -> (usize, f64) {
    let mut place = exponent(se) - 1;
    // 0.0996 rounds up to 0.10, which has one digit less.
    if (se / 10f64.powi(place)).round() >= 100.0 {
        place += 1;
    }
    ((-place).max(0) as usize, 10f64.powi(place))
}

/// A value with that many significant digits, trailing zeros kept: they say how well it is known.
pub(super) fn significant(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return if value == 0.0 { "0" } else { "not finite" }.to_owned();
    }
    let exponent = exponent(value);
    if (-4..6).contains(&exponent) {
        let place = digits - 1 - exponent;
        let step = 10f64.powi(-place);
        let rounded = if place < 0 {
            (value / step).round() * step
        } else {
            value
        };
        return minus(&format!("{rounded:.*}", place.max(0) as usize));
    }
    let mantissa = format!("{:.*}", (digits - 1) as usize, value / 10f64.powi(exponent));
    format!("{}·10{}", minus(&mantissa), superscript(exponent))
}

/// A given number as it was given: no digits added, none taken away within seven.
fn given(value: f64) -> String {
    let text = significant(value, 7);
    if !text.contains('.') || text.contains('·') {
        return text;
    }
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A parameter with its error and unit; one that was not estimated says so.
pub(super) fn estimate(estimate: &Estimate) -> String {
    match estimate.se {
        Some(_) => with_unit(&value(estimate.value, estimate.se), estimate.unit),
        None => format!(
            "{} (given)",
            with_unit(&given(estimate.value), estimate.unit)
        ),
    }
}

/// Text with a unit after it; a pure number has none.
pub(super) fn with_unit(text: &str, unit: &str) -> String {
    if unit == "1" || unit.is_empty() {
        text.to_owned()
    } else if text.contains('±') && !text.starts_with('(') {
        format!("({text}) {}", self::unit(unit))
    } else {
        format!("{text} {}", self::unit(unit))
    }
}

/// A unit in print: `N*m*s^2/rad^2` becomes `N·m·s²/rad²`.
pub(super) fn unit(unit: &str) -> String {
    unit.replace('*', "·").replace("^2", "²").replace("^3", "³")
}

/// A unit with a prefix in which a magnitude is a convenient number, and the factor into it.
///
/// Units of time and pure numbers stay as they are.
pub(super) fn scaled_unit(largest: f64, unit: &str) -> (f64, String) {
    let unit = self::unit(unit);
    let prefixable = unit.starts_with("rad") || unit.starts_with('m') || unit.starts_with('N');
    if !(prefixable && largest > 0.0 && largest.is_finite()) {
        return (1.0, unit);
    }
    for (factor, prefix) in [(1.0, ""), (1e3, "m"), (1e6, "µ")] {
        if largest * factor >= 0.5 {
            return (factor, format!("{prefix}{unit}"));
        }
    }
    (1e9, format!("n{unit}"))
}

/// A share as a percentage with its error.
pub(super) fn percent(share: f64, se: Option<f64>) -> String {
    with_percent(&value(100.0 * share, se.map(|se| 100.0 * se)))
}

fn with_percent(text: &str) -> String {
    if text.contains('±') && !text.starts_with('(') {
        format!("({text}) %")
    } else {
        format!("{text} %")
    }
}

fn exponent(value: f64) -> i32 {
    value.abs().max(f64::MIN_POSITIVE).log10().floor() as i32
}

fn minus(text: &str) -> String {
    text.replace('-', "−")
}

fn superscript(power: i32) -> String {
    let digit = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        c => c
            .to_digit(10)
            .and_then(|d| char::from_u32(0x2070 + d))
            .unwrap_or(c),
    };
    power.to_string().chars().map(digit).collect()
}

#[cfg(test)]
mod tests {
    use super::{estimate, percent, scaled_unit, significant, unit, value};
    use crate::diagnose::Estimate;

    #[test]
    fn the_error_decides_the_digits() {
        assert_eq!(value(95.1089, Some(0.2345)), "95.11 ± 0.23");
        assert_eq!(value(-0.5, Some(0.0996)), "−0.50 ± 0.10");
        assert_eq!(value(203.51, Some(12.34)), "204 ± 12");
        assert_eq!(value(20351.0, Some(1234.0)), "20400 ± 1200");
        assert_eq!(value(0.1, Some(3.0)), "0.1 ± 3.0");
    }

    #[test]
    fn far_from_one_value_and_error_share_a_power_of_ten() {
        assert_eq!(value(1.234e-5, Some(2.1e-7)), "(1.234 ± 0.021)·10⁻⁵");
        assert_eq!(value(-4.0e7, Some(1.0e6)), "(−4.00 ± 0.10)·10⁷");
    }

    #[test]
    fn without_an_error_four_digits_are_shown() {
        assert_eq!(value(0.068_314, None), "0.06831");
        assert_eq!(value(0.068_314, Some(0.0)), "0.06831");
        assert_eq!(value(f64::NAN, Some(0.1)), "not finite");
        assert_eq!(significant(123_456.0, 3), "123000");
        assert_eq!(significant(1.5e-9, 3), "1.50·10⁻⁹");
    }

    #[test]
    fn estimates_carry_their_unit_and_say_when_they_were_given() {
        let shown = |value, se, unit| estimate(&Estimate { value, se, unit });
        assert_eq!(shown(20.1234, Some(0.56), "N"), "(20.12 ± 0.56) N");
        assert_eq!(shown(35.150_651_88, None, "N/V"), "35.15065 N/V (given)");
        assert_eq!(shown(1.0, None, "1"), "1 (given)");
        assert_eq!(shown(0.5, Some(0.1), "1"), "0.50 ± 0.10");
    }

    #[test]
    fn units_are_printed_and_prefixed() {
        assert_eq!(unit("N*m*s^2/rad^2"), "N·m·s²/rad²");
        assert_eq!(scaled_unit(0.012, "rad"), (1e3, "mrad".to_owned()));
        assert_eq!(scaled_unit(2.0, "m"), (1.0, "m".to_owned()));
        assert_eq!(scaled_unit(2e-7, "m"), (1e9, "nm".to_owned()));
        assert_eq!(scaled_unit(0.001, "V"), (1.0, "V".to_owned()));
    }

    #[test]
    fn shares_are_percentages() {
        assert_eq!(percent(0.0683, Some(0.0042)), "(6.83 ± 0.42) %");
        assert_eq!(percent(0.0683, None), "6.830 %");
    }
}
