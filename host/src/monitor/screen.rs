//! The view in a terminal, and the keys that ask for things.

use std::io::{self, Write, stdout};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use bristle_core::drive::State;
use bristle_core::drive::signal::{SIGNALS, Signal};
use crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use crossterm::style::Print;
use crossterm::terminal::{self, Clear, ClearType, EnterAlternateScreen, LeaveAlternateScreen};
use crossterm::{cursor, execute, queue};

use super::{About, Handle, Mode, Request, Sample, View};
use crate::error::{Error, Result};
use crate::format::significant;

/// From drawing to drawing.
const EVERY: Duration = Duration::from_millis(100);
/// What the small curves show, s.
const CURVE: f64 = 4.0;
const KEYS: &str =
    "space STOP · e on · m mode · ↑ ↓ value · 0 zero · c clear faults · r record · q quit";

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wish {
    Stop,
    Quit,
    Ask(Request),
    /// The next mode, at zero.
    NextMode,
    /// So many steps more.
    Step(f64),
    Zero,
}

fn wish(code: KeyCode, modifiers: KeyModifiers, is_recording: bool) -> Option<Wish> {
    Some(match code {
        KeyCode::Char('c') if modifiers.contains(KeyModifiers::CONTROL) => Wish::Quit,
        KeyCode::Char(' ') | KeyCode::Esc => Wish::Stop,
        KeyCode::Char('q') => Wish::Quit,
        KeyCode::Char('e') => Wish::Ask(Request::Enable),
        KeyCode::Char('c') => Wish::Ask(Request::Clear),
        KeyCode::Char('r') if is_recording => Wish::Ask(Request::Save),
        KeyCode::Char('r') => Wish::Ask(Request::Record),
        KeyCode::Char('m') => Wish::NextMode,
        KeyCode::Char('0') => Wish::Zero,
        KeyCode::Up => Wish::Step(1.0),
        KeyCode::Down => Wish::Step(-1.0),
        KeyCode::PageUp => Wish::Step(5.0),
        KeyCode::PageDown => Wish::Step(-5.0),
        _ => return None,
    })
}

/// What is asked for after a key, from what is asked for now, of an axis that is at a position.
fn aimed(wish: Wish, now: Mode, position: f64, about: &About) -> Option<Mode> {
    match wish {
        Wish::NextMode => {
            let at = Mode::ALL.iter().position(|mode| mode.name() == now.name());
            let next = (at.unwrap_or(0) + 1) % Mode::ALL.len();
            Some(match Mode::ALL[next] {
                // A position of zero may be far away: it stays where it is.
                Mode::Position(_) => Mode::Position(position),
                mode => mode,
            })
        }
        Wish::Zero => Some(now.with(0.0)),
        Wish::Step(steps) => {
            let limit = now.limit(about);
            let step = limit.unwrap_or(about.speed) / 20.0;
            let value = now.value() + steps * step;
            Some(now.with(limit.map_or(value, |limit| value.clamp(-limit, limit))))
        }
        _ => None,
    }
}

/// The terminal as it was, when dropped.
struct Terminal;

impl Terminal {
    fn take() -> io::Result<Self> {
        terminal::enable_raw_mode()?;
        let terminal = Self;
        execute!(stdout(), EnterAlternateScreen, cursor::Hide)?;
        Ok(terminal)
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // Nothing more can be done about a terminal that refuses.
        let _ = execute!(stdout(), LeaveAlternateScreen, cursor::Show);
        let _ = terminal::disable_raw_mode();
    }
}

/// Shows the view until somebody quits or `ended` is set.
pub fn show(handle: &Handle, ended: &AtomicBool) -> Result<()> {
    let failed = |e: io::Error| {
        Error::Usage(format!(
            "the terminal cannot be used: {e}; leave --tui out for the page in a browser"
        ))
    };
    let _watcher = handle.watch();
    let _terminal = Terminal::take().map_err(failed)?;
    let mut due = Instant::now();
    while !ended.load(Ordering::Acquire) {
        if due <= Instant::now() {
            due = Instant::now() + EVERY;
            draw(handle).map_err(failed)?;
        }
        let wait = due.saturating_duration_since(Instant::now());
        if event::poll(wait).map_err(failed)?
            && let Event::Key(key) = event::read().map_err(failed)?
            && key.kind != KeyEventKind::Release
        {
            let is_recording = handle.view(|view| view.status.recording.is_some());
            let wish = wish(key.code, key.modifiers, is_recording);
            if wish == Some(Wish::Quit) {
                break;
            }
            wish.into_iter().for_each(|wish| carry_out(handle, wish));
        }
    }
    Ok(())
}

fn carry_out(handle: &Handle, wish: Wish) {
    match wish {
        Wish::Stop => handle.stop(),
        Wish::Ask(request) => handle.ask(request),
        other => {
            let mode = handle.view(|view| {
                let about = view.about()?;
                let position = view.latest()?.values[Signal::Position as usize];
                aimed(other, view.status.aim, position, about)
            });
            mode.into_iter()
                .for_each(|mode| handle.ask(Request::Aim(mode)));
        }
    }
}

fn draw(handle: &Handle) -> io::Result<()> {
    let (width, height) = terminal::size()?;
    let lines = handle.view(|view| lines(view, width.into(), height.into()));
    let mut out = stdout().lock();
    for (row, line) in (0..height).zip(lines) {
        queue!(
            out,
            cursor::MoveTo(0, row),
            Print(line),
            Clear(ClearType::UntilNewLine)
        )?;
    }
    queue!(out, Clear(ClearType::FromCursorDown))?;
    out.flush()
}

/// What the terminal shows.
fn lines(view: &View, width: usize, height: usize) -> Vec<String> {
    let Some(about) = view.about() else {
        return vec!["bristle monitor: nothing was heard yet".to_owned()];
    };
    let mut lines = vec![
        format!(
            "bristle monitor · {} · {} · {}",
            about.axis, about.board, about.place
        ),
        standing(view),
        String::new(),
    ];
    let recent = recent(view, about);
    for (k, channel) in about.signals.iter().enumerate() {
        let value = recent.last().map(|sample| sample.values[k]);
        let value = value.map_or_else(|| "–".to_owned(), |x| significant(x, 5));
        let curve = curve(&recent, k, width.saturating_sub(50));
        lines.push(format!(
            "  {:<22}{value:>12} {:<12} {curve}",
            channel.name, channel.unit
        ));
    }
    lines.push(String::new());
    lines.push(learned(view, about));
    lines.push(asked(view, about));
    lines.push(String::new());
    let room = height.saturating_sub(lines.len() + 2);
    let notes: Vec<String> = view
        .notes_from(&mut 0)
        .map(|n| format!("  {:>8.1} s  {}", n.t, n.text))
        .collect();
    lines.extend_from_slice(&notes[notes.len().saturating_sub(room)..]);
    lines.resize(height.saturating_sub(1).max(lines.len()), String::new());
    lines.push(KEYS.to_owned());
    lines
        .into_iter()
        .map(|line| line.chars().take(width).collect())
        .collect()
}

fn standing(view: &View) -> String {
    let status = &view.status;
    let link = if status.link { "up" } else { "LOST" };
    let axis = match (status.stopping, status.state) {
        (true, _) => "stopping",
        (_, Some(State::Running)) => "RUNNING",
        (_, Some(State::Off)) => "off",
        (_, Some(State::Faulted)) => "FAULTED",
        (_, None) => "unknown",
    };
    let faults = match status.faults.as_slice() {
        [] => "none".to_owned(),
        faults => faults.join(", "),
    };
    let losses = &status.losses;
    let lost = losses.telemetry.saturating_add(losses.damaged);
    format!("link {link}   axis {axis}   faults {faults}   lost frames {lost}")
}

fn learned(view: &View, about: &About) -> String {
    let Some(level) = view.coulomb() else {
        return "Coulomb level –".to_owned();
    };
    let how = if about.learned_range.is_some() {
        "learned"
    } else {
        "as deployed"
    };
    format!(
        "Coulomb level {} ± {} {} ({how}; mean and spread over {:.1} s)",
        significant(level.mean, 4),
        significant(level.spread, 2),
        about.torque_unit,
        level.over
    )
}

fn asked(view: &View, about: &About) -> String {
    let mode = view.status.aim;
    let asked = match (view.status.armed, mode) {
        (false, _) => "the axis is off".to_owned(),
        (true, Mode::Off) => "nothing, u = 0".to_owned(),
        (true, _) => format!("{} {}", mode.name(), significant(mode.value(), 4)),
    };
    let recording = match view.status.recording {
        None => String::new(),
        Some(rows) => format!("   recording, {rows} rows"),
    };
    let limit = mode
        .limit(about)
        .map(|limit| format!(" (up to {})", significant(limit, 4)));
    format!("asked for: {asked}{}{recording}", limit.unwrap_or_default())
}

/// The last seconds.
fn recent<'a>(view: &'a View, about: &About) -> Vec<&'a Sample> {
    let kept = (CURVE * about.rate / f64::from(about.every.max(1))) as u64;
    view.samples_from(&mut view.end().saturating_sub(kept))
        .0
        .collect()
}

/// A signal in a row of blocks, each the mean of its part of the time.
fn curve(recent: &[&Sample], signal: usize, width: usize) -> String {
    const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    debug_assert!(signal < SIGNALS);
    if width == 0 || recent.len() < width {
        return String::new();
    }
    let means: Vec<f64> = (0..width)
        .map(|k| {
            let part = &recent[k * recent.len() / width..(k + 1) * recent.len() / width];
            part.iter().map(|sample| sample.values[signal]).sum::<f64>() / part.len() as f64
        })
        .collect();
    let low = means.iter().copied().fold(f64::INFINITY, f64::min);
    let high = means.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let height = |x: f64| {
        if high > low {
            ((x - low) / (high - low) * 7.0).round() as usize
        } else {
            3
        }
    };
    means
        .into_iter()
        .map(|x| BLOCKS[height(x).min(7)])
        .collect()
}

#[cfg(test)]
mod tests {
    use bristle_core::drive::Parameters;
    use crossterm::event::{KeyCode, KeyModifiers};

    use super::{KEYS, Wish, aimed, curve, lines, wish};
    use crate::monitor::view::Kind;
    use crate::monitor::{About, Mode, Moves, Request, Sample, View};

    fn about() -> About {
        let moves = Moves {
            speed: 2.0,
            acceleration: 10.0,
        };
        About::new(
            "here",
            None,
            &Parameters::harmless(),
            None,
            moves,
            (1e-3, 1),
        )
    }

    fn view() -> View {
        let mut view = View::new();
        view.set_about(about());
        for period in 0..100 {
            let values = std::array::from_fn(|k| f64::from(period) * k as f64);
            view.push(Sample { period, values });
        }
        view.note(Kind::Fault, "overcurrent");
        view
    }

    #[test]
    fn it_shows_values_faults_and_keys_within_the_terminal() {
        let mut view = view();
        view.status.faults = vec!["overcurrent"];
        for (width, height) in [(80, 24), (40, 10), (200, 60)] {
            let shown = lines(&view, width, height);
            assert!(shown.iter().all(|line| line.chars().count() <= width));
            assert!(shown.len() >= height);
        }
        let shown = lines(&view, 120, 30).join("\n");
        for part in [
            "faults overcurrent",
            "velocity",
            "198.00",
            "0.0 s  overcurrent",
            KEYS,
        ] {
            assert!(shown.contains(part), "{part}\n{shown}");
        }
    }

    #[test]
    fn keys_ask_for_what_they_say_and_the_space_bar_stops() {
        let plain = KeyModifiers::NONE;
        assert_eq!(wish(KeyCode::Char(' '), plain, true), Some(Wish::Stop));
        assert_eq!(wish(KeyCode::Esc, plain, false), Some(Wish::Stop));
        assert_eq!(
            wish(KeyCode::Char('c'), KeyModifiers::CONTROL, false),
            Some(Wish::Quit)
        );
        let clear = wish(KeyCode::Char('c'), plain, false);
        assert_eq!(clear, Some(Wish::Ask(Request::Clear)));
        let save = wish(KeyCode::Char('r'), plain, true);
        assert_eq!(save, Some(Wish::Ask(Request::Save)));
        let about = about();
        let aimed = |wish, now| aimed(wish, now, 0.3, &about);
        let up = Wish::Step(1.0);
        let velocity = Mode::Velocity;
        assert_eq!(aimed(up, velocity(0.0)), Some(velocity(0.1)));
        assert_eq!(aimed(up, velocity(2.0)), Some(velocity(2.0)));
        assert_eq!(aimed(Wish::Zero, velocity(2.0)), Some(velocity(0.0)));
        let mut mode = Mode::Off;
        for next in ["input", "torque", "velocity", "position", "off"] {
            mode = aimed(Wish::NextMode, mode).unwrap();
            assert_eq!(mode.name(), next);
            // Nothing moves by a change of mode alone.
            assert!(mode.value() == 0.0 || mode == Mode::Position(0.3));
        }
    }

    #[test]
    fn a_curve_rises_where_the_signal_does() {
        let view = view();
        let recent: Vec<&Sample> = view.samples_from(&mut 0).0.collect();
        assert_eq!(curve(&recent, 1, 8), "▁▂▃▄▅▆▇█");
        assert_eq!(curve(&recent, 0, 4), "▄▄▄▄");
        assert_eq!(curve(&recent[..3], 1, 8), "");
    }
}
