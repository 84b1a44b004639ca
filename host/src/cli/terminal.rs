//! What the terminal shows: progress while working, then the verdict in short.

use std::fmt::Write;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Duration;

use anstyle::{AnsiColor, Style};
use indicatif::{ProgressBar, ProgressStyle};

use crate::dbi::Study;
use crate::diagnose::{Diagnosis, Estimates, Finding, Verdict};
use crate::error::Error;
use crate::fit::Fit;
use crate::format::{self, percent, whole_percent};
use crate::model::Causality;

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

fn table(out: &mut String, estimates: &Estimates) {
    let width = estimates.keys().map(String::len).max().unwrap_or(0);
    for (name, estimate) in estimates {
        let status = match estimate.status.as_str() {
            "identified" => String::new(),
            other => format!("  ({other})"),
        };
        let _ = writeln!(
            out,
            "  {name:<width$}  {}{DIM}{status}{DIM:#}",
            format::parameter(estimate.value, estimate.se, estimate.unit)
        );
    }
}

/// What was predicted, and what the errors are a share of.
fn judged(causality: Causality) -> (&'static str, &'static str) {
    match causality {
        Causality::Forward => ("Free run over 1 s windows", "of the motion"),
        Causality::Inverse => ("u along the measured motion", "of its RMS"),
    }
}

fn fit_line(fit: &Fit, causality: Causality) -> String {
    let (what, share) = judged(causality);
    format!(
        "{what}: off by {} {share} on the training part, by {} on the held-out part",
        percent(fit.train.nrmse, None),
        percent(fit.held_out.nrmse, None)
    )
}

/// Shows the outcome of an identification.
pub(super) fn identification(
    parameters: &Estimates,
    fit: &Fit,
    causality: Causality,
    windows: &str,
) {
    let mut out = String::new();
    table(&mut out, parameters);
    let _ = writeln!(out, "{DIM}{windows}{DIM:#}");
    let _ = writeln!(out, "{}", fit_line(fit, causality));
    anstream::print!("{out}");
}

/// Shows in short whether the estimates of DBI hold.
pub(super) fn study(study: &Study) {
    let mut out = String::new();
    table(&mut out, &study.parameters);
    let _ = writeln!(out, "{DIM}{}{DIM:#}", study.windows.reason);
    let agreeing = study.agreement.iter().filter(|a| a.agree).count();
    let _ = writeln!(
        out,
        "{BOLD}{agreeing} of {}{BOLD:#} estimates agree over half-widths from half to double the chosen one:",
        study.agreement.len()
    );
    for agreement in &study.agreement {
        let _ = writeln!(out, "  {}", agreement.text);
    }
    let whiteness = &study.whiteness;
    let _ = writeln!(
        out,
        "Autocorrelation of the residual outside the 95 % band of white noise: at {} of {} lags before whitening, at {} after.",
        whiteness.outside_before,
        whiteness.after.len() - 1,
        whiteness.outside_after
    );
    anstream::print!("{out}");
}

/// Shows a verdict in short.
pub(super) fn diagnosis(diagnosis: &Diagnosis, causality: Causality) {
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
            "\n{BOLD}Unexplained{BOLD:#}: generic functions take away {} of the squared error that is left:",
            whole_percent(unexplained.gain)
        );
        for (coordinate, gain) in &unexplained.coordinates {
            let _ = writeln!(out, "  of {coordinate}: {}", whole_percent(*gain));
        }
    }
    if diagnosis.verdict != Verdict::Adequate {
        let _ = writeln!(out, "\n{}", diagnosis.place.text);
    }
    let (before, after) = (&diagnosis.fit.before, &diagnosis.fit.after);
    let (what, share) = judged(causality);
    let _ = if diagnosis.findings.is_empty() {
        writeln!(out, "{}", fit_line(before, causality))
    } else {
        writeln!(
            out,
            "{what}, held-out part: off by {} {share} before, by {BOLD}{}{BOLD:#} after.",
            percent(before.held_out.nrmse, None),
            percent(after.held_out.nrmse, None)
        )
    };
    anstream::print!("{out}");
}

fn show_finding(out: &mut String, number: usize, finding: &Finding) {
    let _ = writeln!(
        out,
        "\n{BOLD}{number}. {}{BOLD:#} ({}), confidence {:.2}, {} of the mismatch",
        finding.name,
        finding.id,
        finding.confidence,
        whole_percent(finding.evidence.share_of_residual)
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
    use super::{Estimates, table};
    use crate::diagnose::Estimate;

    #[test]
    fn parameters_line_up_with_errors_and_printed_units() {
        let estimate = |value, se: Option<f64>, unit| Estimate {
            value,
            se,
            unit,
            status: se.map_or("given", |_| "identified").to_owned(),
        };
        let estimates = Estimates::from([
            ("static".to_owned(), estimate(0.3644, Some(0.0131), "N*m")),
            ("gain".to_owned(), estimate(35.150_65, None, "N/V")),
        ]);
        let mut out = String::new();
        table(&mut out, &estimates);
        let plain = anstream::adapter::strip_str(&out).to_string();
        assert_eq!(
            plain,
            "  gain    35.15065 N/V  (given)\n  static  0.364 ± 0.013 N·m\n"
        );
    }
}
