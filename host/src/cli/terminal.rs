//! What the terminal shows: progress while working, then the verdict in short.

use std::fmt::Write;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Duration;

use anstyle::{AnsiColor, Style};
use indicatif::{ProgressBar, ProgressStyle};

use crate::check::Warning;
use crate::curve::Curve;
use crate::dbi::Study;
use crate::diagnose::{Diagnosis, Estimates, Finding, Verdict};
use crate::error::Error;
use crate::fit::Fit;
use crate::format::{self, percent, whole_percent};
use crate::model::Causality;
use crate::pem::Outcome;
use crate::stream::Progress;

const BOLD: Style = Style::new().bold();
const DIM: Style = Style::new().dimmed();

fn colour(colour: AnsiColor) -> Style {
    Style::new()
        .bold()
        .fg_color(Some(anstyle::Color::Ansi(colour)))
}

/// Progress on the error stream; silent when that is not a terminal.
pub(super) struct Meter {
    bar: ProgressBar,
}

impl Meter {
    pub fn new() -> Self {
        let bar = if std::io::stderr().is_terminal() {
            let bar = ProgressBar::no_length();
            bar.enable_steady_tick(Duration::from_millis(100));
            bar
        } else {
            ProgressBar::hidden()
        };
        Self { bar }
    }

    /// A step of unknown length.
    pub fn say(&self, what: &str) {
        self.start(what, "{spinner} {msg} {elapsed:.dim}");
    }

    /// A step that counts samples, towards a number if that is known.
    pub fn count(&self, what: &str, samples: Option<usize>) {
        let template = match samples {
            None => "{spinner} {msg}: {human_pos} samples, {per_sec} {elapsed:.dim}",
            Some(_) => "{spinner} {msg} [{bar:30}] {percent} %, {per_sec} {eta:.dim}",
        };
        self.start(what, template);
        self.bar.reset();
        samples.inspect(|samples| self.bar.set_length(*samples as u64));
    }

    /// So many more samples.
    pub fn add(&self, samples: usize) {
        self.bar.inc(samples as u64);
    }

    /// Shows how far the identification of long recordings has come.
    pub fn follow(&self, progress: Progress) {
        match progress {
            Progress::Pilot => self.say("identifying stretches"),
            Progress::Pass(number, samples) => self.count(&format!("pass {number}"), Some(samples)),
            Progress::Samples(samples) => self.add(samples),
        }
    }

    /// Leaves no trace.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn start(&self, what: &str, template: &str) {
        let style = ProgressStyle::with_template(template);
        self.bar
            .set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
        self.bar.set_message(what.to_owned());
    }
}

/// A remark on the error stream.
pub(super) fn note(what: &str) {
    anstream::eprintln!("{BOLD}note:{BOLD:#} {what}");
}

/// How much was read how fast.
pub(super) fn throughput(samples: usize, per_second: f64) {
    let (number, unit) = if per_second >= 1e6 {
        (per_second * 1e-6, "million")
    } else {
        (per_second * 1e-3, "thousand")
    };
    anstream::println!("{DIM}{samples} samples, {number:.2} {unit} a second{DIM:#}");
}

/// Which part of the recordings values and errors are of.
pub(super) fn from_whole() {
    anstream::println!(
        "The values are from the whole recordings; the errors are those of values from the first 70 % alone."
    );
}

/// One line on the error stream.
pub(super) fn error(error: &Error) {
    let red = colour(AnsiColor::Red);
    anstream::eprintln!("{red}error:{red:#} {error}");
}

/// What there is to know about the recordings, a line each on the error stream.
pub(super) fn warnings(warnings: &[Warning]) {
    let yellow = colour(AnsiColor::Yellow);
    for warning in warnings {
        anstream::eprintln!(
            "{yellow}warning:{yellow:#} {} ({})",
            warning.text,
            warning.id
        );
    }
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

/// Shows a fit to the torque-speed curve.
pub(super) fn curve(estimates: &Estimates, curve: &Curve, unit: &str) {
    let mut out = String::new();
    table(&mut out, estimates);
    let _ = writeln!(
        out,
        "{} steady points, off by {:.3e} {unit} RMS ({:.3e} at the start) after {} iterations ({})",
        curve.points.len(),
        curve.rmse,
        curve.rmse_at_start,
        curve.iterations,
        curve.reason
    );
    anstream::print!("{out}");
}

/// Shows what a minimisation did.
pub(super) fn minimisation(outcome: &Outcome, start: &Fit) {
    let (objective, rmse) = (outcome.objective, outcome.prediction_rmse);
    if outcome.kept_start {
        anstream::println!(
            "Nothing better than the start was found in {} iterations ({}); its values are kept",
            outcome.iterations,
            outcome.reason
        );
        return;
    }
    anstream::println!(
        "Prediction errors minimised in {} iterations ({}): objective {:.5} to {:.5}, RMS error {:.3e} to {:.3e}",
        outcome.iterations,
        outcome.reason,
        objective.before,
        objective.after,
        rmse.before,
        rmse.after,
    );
    anstream::println!(
        "The start was off by {} on the held-out part",
        percent(start.held_out.nrmse, None)
    );
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
        let _ = if rival.separated {
            writeln!(
                out,
                "  {DIM}runner-up {}, which fits worse{DIM:#}",
                rival.id
            )
        } else {
            writeln!(
                out,
                "  {DIM}rival {}: {}{DIM:#}",
                rival.id, rival.tell_apart_by
            )
        };
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
