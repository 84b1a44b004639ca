//! What comes back from the board.

use bristle_core::drive::signal::{SIGNALS, Signal};
use bristle_core::drive::{Faults, Refusal, State};
use bristle_core::link::{Answer, Counters, Report};

use super::Session;
use super::link::{Asked, Link};
use crate::monitor::aim::Mode;
use crate::monitor::recording::Recording;
use crate::monitor::view::{Kind, Sample};

impl Session {
    pub(super) fn take(&mut self, link: &mut Link, report: &Report<f32>) {
        if let Report::Answer { to, answer } = report
            && let Some(asked) = link.answered(*to)
        {
            self.take_answer(asked, answer);
        }
    }

    fn take_answer(&mut self, asked: Asked, answer: &Answer<f32>) {
        match (asked, answer) {
            (Asked::Stop, Answer::Done) => self.shared.view(|view| view.status.stopping = false),
            (Asked::Enable, Answer::Done) => self.shared.view(|view| {
                // Unless it was stopped in the meantime.
                view.status.armed = !view.status.stopping;
                view.note(Kind::Note, "on");
            }),
            (Asked::Enable, Answer::Refused(why)) => {
                let text = match why {
                    Refusal::Faulted => "not turned on: faults are latched; clear them first",
                    Refusal::Running => "it is on already, by another program; stop it first",
                    _ => "the board refuses to be turned on",
                };
                self.shared.view(|view| view.note(Kind::Warning, text));
            }
            (
                Asked::Status,
                Answer::Status {
                    state,
                    faults,
                    counters,
                },
            ) => self.take_status(*state, *faults, counters),
            _ => {}
        }
    }

    fn take_status(&mut self, state: State, faults: Faults, counters: &Counters) {
        let ids: Vec<&'static str> = faults.iter().map(|fault| fault.page().id).collect();
        let tripped = self.shared.view(|view| {
            let known = std::mem::replace(&mut view.status.faults, ids.clone());
            for id in ids.into_iter().filter(|id| !known.contains(id)) {
                view.note(Kind::Fault, id);
            }
            view.status.losses.count_commands(counters);
            view.status.state = Some(state);
            // Answers come in order: this one is later than that to the command to turn on.
            let tripped = view.status.armed && state != State::Running;
            if tripped {
                view.status.armed = false;
                view.status.aim = Mode::Off;
            }
            tripped
        });
        if tripped {
            self.aim.drop_all();
        }
    }

    pub(super) fn take_telemetry(&mut self, link: &mut Link) {
        let (frames, lost) = link.peer.take_telemetry();
        let damaged = link.peer.damaged();
        let mut is_full = false;
        self.shared.view(|view| {
            let losses = &mut view.status.losses;
            losses.telemetry = losses.telemetry.saturating_add(lost - link.lost.0);
            losses.damaged = losses.damaged.saturating_add(damaged - link.lost.1);
            link.lost = (lost, damaged);
            for frame in &frames {
                let Some(sample) = sample(frame.period, &frame.words, link.count) else {
                    continue;
                };
                view.push(sample);
                if let Some(recording) = &mut self.recording {
                    is_full |= !recording.push(sample);
                }
            }
            view.status.recording = self.recording.as_ref().map(Recording::len);
        });
        if is_full {
            self.save();
        }
    }
}

/// A frame in SI units; none if it holds other signals than were chosen, as of an earlier program.
fn sample(period: u32, words: &[u32], count: f64) -> Option<Sample> {
    let words: &[u32; SIGNALS] = words.try_into().ok()?;
    let mut values = words.map(|word| f64::from(f32::from_bits(word)));
    let at = Signal::Position as usize;
    values[at] = f64::from(words[at] as i32) * count;
    Some(Sample { period, values })
}
