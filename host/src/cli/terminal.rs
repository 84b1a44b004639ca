//! What the terminal shows: progress while working, then the verdict in short.

use std::fmt::Write;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Duration;

use anstyle::{AnsiColor, Style};
use indicatif::{ProgressBar, ProgressStyle};

use crate::diagnose::{Diagnosis, Estimate, Estimates, Finding, Verdict};
use crate::error::Error;
use crate::fit::Fit;

const BOLD: Style = Style::new().bold();
const DIM: Style = Style::new().dimmed();

fn colour(colour: AnsiColor) -> Style {
    Style::new()
        .bold()
        .fg_color(Some(anstyle::Color::Ansi(colour)))
}

/// A spinner on the error stream; silent when that is not a terminal.
pub(super) fn progress() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{spinner} {msg} {elapsed:.dim}")
        .unwrap_or_else(|_| ProgressStyle::default_spinner());
    let bar = ProgressBar::new_spinner().with_style(style);
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

/// One line on the error stream.
pub(super) fn error(error: &Error) {
    let red = colour(AnsiColor::Red);
    anstream::eprintln!("{red}error:{red:#} {error}");
}

/// `12.34 ± 0.05 N*m`, the error with two digits and the value as far.
pub(super) fn value(estimate: &Estimate) -> String {
    let unit = if estimate.unit == "1" {
        String::new()
    } else {
        format!(" {}", estimate.unit)
    };
    match estimate.se.filter(|se| *se > 0.0 && se.is_finite()) {
        None => format!("{}{unit}", significant(estimate.value, 5)),
        Some(se) => {
            let digits = (1 - se.log10().floor() as i32).max(0) as usize;
            let exponent = estimate.value.abs().max(se).log10().floor() as i32;
            if (-3..6).contains(&exponent) {
                format!("{:.digits$} ± {se:.digits$}{unit}", estimate.value)
            } else {
                let scale = 10f64.powi(exponent);
                let digits = (1 - (se / scale).log10().floor() as i32).max(0) as usize;
                format!(
                    "({:.digits$} ± {:.digits$})e{exponent}{unit}",
                    estimate.value / scale,
                    se / scale
                )
            }
        }
    }
}

fn significant(value: f64, digits: i32) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = value.abs().log10().floor() as i32;
    if (-4..7).contains(&exponent) {
        let decimals = (digits - 1 - exponent).max(0) as usize;
        let text = format!("{value:.decimals$}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    } else {
        format!("{value:.*e}", (digits - 1) as usize)
    }
}

fn table(out: &mut String, estimates: &Estimates) {
    let width = estimates.keys().map(String::len).max().unwrap_or(0);
    for (name, estimate) in estimates {
        let given = if estimate.se.is_none() {
            "  (given)"
        } else {
            ""
        };
        let _ = writeln!(
            out,
            "  {name:<width$}  {}{DIM}{given}{DIM:#}",
            value(estimate)
        );
    }
}

fn fit_line(fit: &Fit) -> String {
    format!(
        "free run over 1 s windows: {:.3} % of the motion on the training part, {:.3} % on the held-out part",
        100.0 * fit.train.nrmse,
        100.0 * fit.held_out.nrmse
    )
}

/// Shows the outcome of an identification.
pub(super) fn identification(parameters: &Estimates, fit: &Fit) {
    let mut out = String::new();
    table(&mut out, parameters);
    let _ = writeln!(out, "{}", fit_line(fit));
    anstream::print!("{out}");
}

/// Shows a verdict in short.
pub(super) fn diagnosis(diagnosis: &Diagnosis) {
    let style = match diagnosis.verdict {
        Verdict::Adequate => colour(AnsiColor::Green),
        Verdict::Explained => colour(AnsiColor::Yellow),
        Verdict::Unknown => colour(AnsiColor::Magenta),
    };
    let word = format!("{:?}", diagnosis.verdict).to_uppercase();
    let mut out = format!("{style}{word}{style:#}  {}\n", diagnosis.text);
    for (k, finding) in diagnosis.findings.iter().enumerate() {
        show_finding(&mut out, k + 1, finding);
    }
    if let Some(unexplained) = &diagnosis.unexplained {
        let _ = writeln!(
            out,
            "\n{BOLD}Unexplained{BOLD:#}: generic functions take away {:.0} % of the squared error that is left:",
            100.0 * unexplained.gain
        );
        for (coordinate, gain) in &unexplained.coordinates {
            let _ = writeln!(out, "  of {coordinate}: {:.0} %", 100.0 * gain.max(0.0));
        }
    }
    if diagnosis.verdict != Verdict::Adequate {
        let _ = writeln!(out, "\n{}", diagnosis.place.text);
    }
    let (before, after) = (&diagnosis.fit.before, &diagnosis.fit.after);
    let _ = if diagnosis.findings.is_empty() {
        writeln!(out, "{}", fit_line(before))
    } else {
        writeln!(
            out,
            "Held-out free run over 1 s windows: {:.3} % of the motion before, {BOLD}{:.3} %{BOLD:#} after.",
            100.0 * before.held_out.nrmse,
            100.0 * after.held_out.nrmse
        )
    };
    anstream::print!("{out}");
}

fn show_finding(out: &mut String, number: usize, finding: &Finding) {
    let _ = writeln!(
        out,
        "\n{BOLD}{number}. {}{BOLD:#} ({}), confidence {:.2}, {:.0} % of the mismatch",
        finding.name,
        finding.id,
        finding.confidence,
        100.0 * finding.evidence.share_of_residual
    );
    let _ = writeln!(out, "  {}", finding.text);
    table(out, &finding.parameters);
    for rival in &finding.rivals {
        let _ = writeln!(
            out,
            "  {DIM}rival {}: {}{DIM:#}",
            rival.id, rival.tell_apart_by
        );
    }
}

/// Names the files that were written.
pub(super) fn written(paths: &[PathBuf]) {
    for path in paths {
        anstream::println!("wrote {}", path.display());
    }
}

#[cfg(test)]
mod tests {
    use super::{significant, value};
    use crate::diagnose::Estimate;

    fn shown(v: f64, se: Option<f64>) -> String {
        value(&Estimate {
            value: v,
            se,
            unit: "N*m",
        })
    }

    #[test]
    fn the_error_decides_the_digits() {
        assert_eq!(shown(95.1089, Some(0.2345)), "95.11 ± 0.23 N*m");
        assert_eq!(shown(203.5, Some(12.0)), "204 ± 12 N*m");
        assert_eq!(
            shown(0.000_012_34, Some(0.000_000_21)),
            "(1.234 ± 0.021)e-5 N*m"
        );
        assert_eq!(shown(35.150_65, None), "35.151 N*m");
    }

    #[test]
    fn significant_digits_are_kept() {
        assert_eq!(significant(0.0, 5), "0");
        assert_eq!(significant(1234.5, 5), "1234.5");
        assert_eq!(significant(1.5e-9, 3), "1.50e-9");
    }
}
