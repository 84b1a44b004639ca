//! What a person is told before an axis moves, and after.

use std::fmt;
use std::path::Path;

use bristle_core::drive::Bounds;
use bristle_core::link::{Board, Hello};

use super::bench::Excite;
use super::emulate::Follow;
use super::terminal;
use crate::bench;
use crate::excite::{STAGES, Shape};
use crate::format::{self, shortest};
use crate::guided::{Ending, Line, Rows, Signal};
use crate::model::{Model, Motion};
use crate::plant;

/// Everything that is told before a run.
pub(super) struct Briefing<'a> {
    pub place: &'a str,
    pub hello: Option<&'a Hello>,
    /// Tells names and units.
    pub model: Option<&'a Model>,
    /// What is known of the axis; a prediction is made if that is everything.
    pub known: Option<&'a Model>,
    /// The test signal, or none if there is a file.
    pub shape: Option<Excite>,
    pub file: Option<&'a Path>,
    pub amplitude: f64,
    pub follow: Follow,
    pub signal: &'a Signal,
    pub rate: f64,
    /// rad or m.
    pub travel: f64,
    pub bounds: &'a Bounds<f32>,
    pub line: &'a Line,
    /// Latched ones.
    pub faults: &'a [&'static str],
}

/// Numbers are shown as they were given.
fn number(x: f64) -> String {
    shortest(x, 4)
}

impl Briefing<'_> {
    fn position(&self) -> &'static str {
        match self.model.map(|model| model.motion) {
            Some(Motion::Rotary) => "rad",
            Some(Motion::Linear) => "m",
            None => "rad or m",
        }
    }

    fn velocity(&self) -> &'static str {
        match self.model.map(|model| model.motion) {
            Some(Motion::Rotary) => "rad/s",
            Some(Motion::Linear) => "m/s",
            None => "rad/s or m/s",
        }
    }

    /// The unit of u, with a space before it; nothing if nobody has told it.
    fn input_unit(&self) -> String {
        let unit = self.model.map(|model| bench::unit("u", model));
        unit.map_or_else(String::new, |unit| format!(" {}", format::unit(unit)))
    }

    fn amplitude(&self) -> String {
        let unit = match self.follow {
            Follow::Input => return format!("u = {}{}", number(self.amplitude), self.input_unit()),
            Follow::Velocity => self.velocity(),
            Follow::Position => self.position(),
        };
        format!("{} {unit}", number(self.amplitude))
    }

    fn seconds(&self) -> f64 {
        self.signal.values.len() as f64 / self.rate
    }

    fn movement(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let what = match self.follow {
            Follow::Input => "u itself, the controllers off",
            Follow::Velocity => "the velocity, under control",
            Follow::Position => "the position, under control, from where it stands",
        };
        match (self.file, self.shape.map(Shape::from)) {
            (Some(file), _) => writeln!(
                f,
                "What moves   the axis, by the u of {}, up to {}{}",
                file.display(),
                number(self.signal.largest()),
                self.input_unit()
            ),
            (None, Some(Shape::Sequence)) => {
                writeln!(
                    f,
                    "What moves   the axis; a sequence drives {what}, A is {}:",
                    self.amplitude()
                )?;
                let mut from = 0.0;
                for stage in STAGES {
                    let to = stage.end * self.seconds();
                    writeln!(
                        f,
                        "             {:>6} to {:>6} s  {}: {}",
                        number(from),
                        number(to),
                        stage.name,
                        stage.text
                    )?;
                    from = to;
                }
                Ok(())
            }
            (None, shape) => {
                let name = shape.map_or_else(String::new, |s| format!("{s:?}").to_lowercase());
                writeln!(
                    f,
                    "What moves   the axis; a {name} drives {what}, up to {}",
                    self.amplitude()
                )
            }
        }
    }

    /// What the model says that will happen, if it knows everything.
    fn prediction(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let (position, velocity) = (self.position(), self.velocity());
        let predicted = self.signal.predicted_travel();
        if let Some((start, most)) = predicted {
            writeln!(
                f,
                "Predicted    {} {position} either way by the file, from {} {position} where its recording had them: bring the axis there first if",
                number(most),
                number(start)
            )?;
            writeln!(f, "             it is not the same everywhere")?;
        }
        let simulated = self.known.filter(|_| self.follow == Follow::Input);
        if let Some((most, fastest)) = simulated.and_then(|model| self.simulated(model)) {
            writeln!(
                f,
                "Predicted    {} {position} either way and {} {velocity} by the model{}",
                number(most),
                number(fastest),
                if most > self.travel || fastest > self.bounds.speed.into() {
                    ": the board will end the run before its time"
                } else {
                    ""
                }
            )?;
        }
        Ok(())
    }

    /// Largest way and largest speed of the model under the signal, if it has all values and stays finite.
    fn simulated(&self, model: &Model) -> Option<(f64, f64)> {
        let mut plant = plant::new(model).ok()?;
        let u = &self.signal.values;
        let t: Vec<f64> = (0..=u.len()).map(|k| k as f64 / self.rate).collect();
        let (mut most, mut fastest) = (0.0_f64, 0.0_f64);
        for k in 0..u.len() {
            plant.advance(&t, u, k, 0.0);
            let now = plant.measured();
            most = most.max(now.q.abs());
            fastest = fastest.max(now.v.abs());
        }
        (most.is_finite() && fastest.is_finite()).then_some((most, fastest))
    }

    fn recording(&self) -> String {
        let every = self.line.every;
        let rows = number(self.rate / f64::from(every));
        let how = if self.line.by_ring {
            "in the memory of the board"
        } else {
            "by telemetry"
        };
        if every == 1 {
            format!("every control period, {rows} rows a second, {how}")
        } else {
            format!(
                "one control period in {every}, {rows} rows a second, {how}: what u does in between is not seen; a shorter run is recorded finer"
            )
        }
    }
}

impl fmt::Display for Briefing<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let board = match self.hello.map(|hello| hello.board) {
            Some(Board::OdriveV3) => "ODrive v3",
            Some(Board::Emulated) | None => "emulated board",
        };
        let name = self.model.map_or("", |model| model.name.as_str());
        let name = if name.is_empty() { "an axis" } else { name };
        writeln!(f, "Axis         {name}, {board} at {}", self.place)?;
        self.movement(f)?;
        writeln!(f, "How long     {} s", number(self.seconds()))?;
        writeln!(
            f,
            "How far      {} {} either way from here; beyond, the bridge goes off and the axis coasts: leave room",
            number(self.travel),
            self.position()
        )?;
        writeln!(
            f,
            "How fast     {} {}; beyond, the bridge goes off",
            number(self.bounds.speed.into()),
            self.velocity()
        )?;
        writeln!(
            f,
            "How strong   |u| up to {}{}, cut beyond; motor current up to {} A; beyond, the bridge goes off",
            number(self.bounds.input.into()),
            self.input_unit(),
            number(self.bounds.current.into())
        )?;
        self.prediction(f)?;
        writeln!(f, "Recorded     {}", self.recording())?;
        if !self.faults.is_empty() {
            writeln!(
                f,
                "Faults       {} are latched, and cleared when it begins",
                self.faults.join(", ")
            )?;
        }
        writeln!(
            f,
            "To stop      any key, or Ctrl-C. It is software: keep a hand on the supply's switch."
        )
    }
}

/// Whether the axis is off.
pub(super) fn told_off(is_off: bool) {
    if is_off {
        anstream::println!("The axis is off; the board has confirmed it.");
    } else {
        terminal::note(
            "the board has not confirmed that the axis is off: if it is still powered, it turns its bridge off by itself as no set point comes any more",
        );
    }
}

/// How a run ended, in words.
pub(super) fn why(ending: &Ending) -> String {
    match ending {
        Ending::Whole => "the run came to its end".to_owned(),
        Ending::Aborted => "it was stopped from here".to_owned(),
        Ending::Tripped(faults) if faults.is_empty() => {
            "another program has turned the axis off".to_owned()
        }
        Ending::Tripped(faults) => {
            let of = |fault: &bristle_core::drive::Fault| {
                let page = fault.page();
                format!(
                    "{}: {} (fault {}). {}",
                    page.id,
                    page.detection,
                    fault.number(),
                    page.remedy
                )
            };
            let all: Vec<String> = faults.iter().map(of).collect();
            format!("the board turned its bridge off, {}", all.join(" Also "))
                .trim_end_matches('.')
                .to_owned()
        }
        Ending::Lost(why) => format!("the board was lost: {why}"),
    }
}

/// How much was recorded, and what is missing of it.
pub(super) fn told_rows(rows: &Rows, line: Line, period: f64) {
    let missing = match rows.missing(line.every) {
        0 => "without a gap".to_owned(),
        missing => format!("{missing} more were lost on the way"),
    };
    anstream::println!(
        "{} rows over {} s, {missing}",
        rows.0.len(),
        number(rows.seconds(period))
    );
}
