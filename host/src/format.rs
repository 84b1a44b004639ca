//! Numbers as a person reads them: on the terminal, in the report and in sentences alike.
//!
//! A value with an error shows the digits that the error allows; one without shows as many as asked for. Units are
//! printed as `N·m·s²/rad²`; JSON and model files keep the contract's `N*m*s^2/rad^2` and the raw numbers.

/// `12.34 ± 0.23`: the error with two significant digits, the value to the same decimal place.
///
/// Without a usable error the value keeps three significant digits. Far from one, both share a power of ten.
pub fn value(value: f64, se: Option<f64>) -> String {
    let Some(se) = se.filter(|se| *se > 0.0 && se.is_finite() && value.is_finite()) else {
        return significant(value, 3);
    };
    let largest = exponent(value.abs().max(se));
    let power = if (-3..5).contains(&largest) {
        0
    } else {
        largest
    };
    let scale = 10f64.powi(power);
    let (value, se) = (value / scale, se / scale);
    // Rounded to two digits first: 0.0996 becomes 0.10, which has one decimal less. Large errors round to 10, 100, …
    let place = exponent(rounded(se, 2)) - 1;
    let (decimals, step) = ((-place).max(0) as usize, 10f64.powi(place));
    let show = |x: f64| minus(&format!("{:.decimals$}", (x / step).round() * step));
    let text = format!("{} ± {}", show(value), show(se));
    if power == 0 {
        text
    } else {
        format!("({text})·10{}", superscript(power))
    }
}

/// A value with that many significant digits, trailing zeros kept: they say how well it is known.
pub fn significant(value: f64, digits: u8) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return "not finite".to_owned();
    }
    let value = rounded(value, digits);
    let exponent = exponent(value);
    let last = i32::from(digits) - 1;
    if (-4..6).contains(&exponent) {
        return minus(&format!("{value:.*}", (last - exponent).max(0) as usize));
    }
    let mantissa = format!("{:.*}", last as usize, value / 10f64.powi(exponent));
    format!("{}·10{}", minus(&mantissa), superscript(exponent))
}

/// A value with up to that many significant digits and no zeros after the last one that says something: for numbers
/// that were given or counted.
pub fn shortest(value: f64, digits: u8) -> String {
    let text = significant(value, digits);
    if !text.contains('.') || text.contains('·') {
        return text;
    }
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A value with three significant digits and its unit, for sentences.
pub fn quantity(value: f64, unit: &str) -> String {
    with_unit(&significant(value, 3), unit)
}

/// `−1.67 to 0.845 rad/s`: a range of a coordinate, for sentences.
pub fn range([low, high]: [f64; 2], unit: &str) -> String {
    format!("{} to {}", significant(low, 3), quantity(high, unit))
}

/// A parameter with its error and unit; one without an error was given, with up to seven digits.
pub fn parameter(value: f64, se: Option<f64>, unit: &str) -> String {
    match se {
        Some(_) => with_unit(&self::value(value, se), unit),
        None => with_unit(&shortest(value, 7), unit),
    }
}

/// Text with a unit after it; a pure number has none.
pub fn with_unit(text: &str, unit: &str) -> String {
    if unit == "1" || unit.is_empty() {
        text.to_owned()
    } else {
        format!("{text} {}", self::unit(unit))
    }
}

/// A unit in print: `N*m*s^2/rad^2` becomes `N·m·s²/rad²`.
pub fn unit(unit: &str) -> String {
    unit.replace('*', "·").replace("^2", "²").replace("^3", "³")
}

/// A unit with a prefix in which a magnitude is a convenient number, and the factor into it.
///
/// Units of time and pure numbers stay as they are.
pub fn scaled_unit(largest: f64, unit: &str) -> (f64, String) {
    let unit = self::unit(unit);
    let prefixable = unit.starts_with("rad") || unit.starts_with('m') || unit.starts_with('N');
    let plain = largest <= 0.0 || !largest.is_finite();
    if plain || !prefixable {
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
pub fn percent(share: f64, se: Option<f64>) -> String {
    with_unit(&value(100.0 * share, se.map(|se| 100.0 * se)), "%")
}

/// A share as a whole percentage; one that is not positive is none.
pub fn whole_percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share.max(0.0))
}

/// A value rounded to significant digits.
fn rounded(value: f64, digits: u8) -> f64 {
    format!("{value:.*e}", usize::from(digits.max(1)) - 1)
        .parse()
        .unwrap_or(value)
}

/// Power of ten of the first significant digit.
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

/// The shortest decimal that single precision takes for this number: a period of 0.001 s and not of 0.0010000000475 s.
pub fn decimal(x: f32) -> f64 {
    x.to_string().parse().unwrap_or_else(|_| x.into())
}

#[cfg(test)]
mod tests {
    use super::{
        parameter, percent, quantity, range, scaled_unit, shortest, significant, unit, value,
        whole_percent,
    };

    #[test]
    fn the_error_decides_the_digits() {
        assert_eq!(value(95.1089, Some(0.2345)), "95.11 ± 0.23");
        assert_eq!(value(-0.5, Some(0.0996)), "−0.50 ± 0.10");
        assert_eq!(value(203.51, Some(12.34)), "204 ± 12");
        assert_eq!(value(20351.0, Some(1234.0)), "20400 ± 1200");
        assert_eq!(value(0.1, Some(3.0)), "0.1 ± 3.0");
        assert_eq!(value(0.0, Some(0.02)), "0.000 ± 0.020");
    }

    #[test]
    fn far_from_one_value_and_error_share_a_power_of_ten() {
        assert_eq!(value(1.234e-5, Some(2.1e-7)), "(1.234 ± 0.021)·10⁻⁵");
        assert_eq!(value(-4.0e7, Some(1.0e6)), "(−4.00 ± 0.10)·10⁷");
    }

    #[test]
    fn without_an_error_three_digits_are_shown() {
        assert_eq!(value(0.068_314, None), "0.0683");
        assert_eq!(value(0.068_314, Some(0.0)), "0.0683");
        assert_eq!(value(0.068_314, Some(f64::NAN)), "0.0683");
        assert_eq!(value(f64::NAN, Some(0.1)), "not finite");
    }

    #[test]
    fn significant_digits_are_kept_whatever_the_size() {
        assert_eq!(significant(0.364_4, 3), "0.364");
        assert_eq!(significant(0.999_6, 3), "1.00");
        assert_eq!(significant(-1.6649, 3), "−1.66");
        assert_eq!(significant(123_456.0, 3), "123000");
        assert_eq!(significant(999_999.0, 3), "1.00·10⁶");
        assert_eq!(significant(1.5e-9, 3), "1.50·10⁻⁹");
        assert_eq!(significant(-8.043e7, 3), "−8.04·10⁷");
        assert_eq!(significant(0.0, 3), "0");
        assert_eq!(shortest(12.0, 4), "12");
        assert_eq!(shortest(2.5, 4), "2.5");
        assert_eq!(shortest(1200.0, 4), "1200");
    }

    #[test]
    fn quantities_carry_their_unit() {
        assert_eq!(quantity(0.364_44, "N*m"), "0.364 N·m");
        assert_eq!(quantity(2.0, "1"), "2.00");
        assert_eq!(range([-1.6651, 0.845_2], "rad/s"), "−1.67 to 0.845 rad/s");
        assert_eq!(parameter(20.1234, Some(0.56), "N"), "20.12 ± 0.56 N");
        assert_eq!(parameter(35.150_651_88, None, "N/V"), "35.15065 N/V");
        assert_eq!(parameter(1.0, None, "1"), "1");
        assert_eq!(
            parameter(1.234e-5, Some(2.1e-7), "kg*m^2"),
            "(1.234 ± 0.021)·10⁻⁵ kg·m²"
        );
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
        assert_eq!(percent(0.0683, Some(0.0042)), "6.83 ± 0.42 %");
        assert_eq!(percent(0.0683, None), "6.83 %");
        assert_eq!(whole_percent(0.401), "40 %");
        assert_eq!(whole_percent(-0.1), "0 %");
    }
}
