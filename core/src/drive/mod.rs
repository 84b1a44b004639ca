//! The drive: everything that happens in a control period, without the hardware.
//!
//! A period brings a [`Sample`] and the [`News`] from the link, and [`Drive::step`] answers what the bridge is to do.
//! The board's tasks only carry these values to and fro, so what runs on the board is what the host tests, and a
//! host that is given the same samples computes the same bits.
//!
//! ```text
//!   sample ─▶ units ─▶ monitor ─▶ run state ─▶ control law ─▶ limit ─▶ current loop ─▶ actuation
//!                                                   └─▶ snapshot ─▶ recorder, telemetry
//! ```
//!
//! The current loop runs where the parameters have one: the control law then asks for a current, by the torque constant that is
//! its gain, and the loop makes a voltage of it. Both run once a period, as the current is converted once a period.
//!
//! # Run states
//! | from | to | when |
//! | --- | --- | --- |
//! | off | running | the command to enable, with or without [`Bounds`] for the run, without a latched fault |
//! | running | off | the command to disable |
//! | any | faulted | a [`Fault`]; the bridge is off from this very period on |
//! | faulted | off | the command to clear, which takes the causes that are gone |

mod bounds;
pub mod fault;
mod legs;
mod mailbox;
mod monitor;
mod number;
pub mod parameters;
pub mod recorder;
mod sample;
pub mod signal;
pub mod store;
mod winding;

pub use bounds::Bounds;
pub use fault::{Fault, Faults};
pub use mailbox::Mailbox;
pub use monitor::Reading;
pub use number::Number;
pub use parameters::{Limits, Parameters};
pub use sample::{Encoder, Sample};

use bounds::Confines;
use monitor::Monitor;
use recorder::Recorder;
use serde::{Deserialize, Serialize};
use signal::{Selection, Signal, Snapshot};
use winding::Winding;

use crate::control::{Controller, Output, Position, Probe, SetPoint, Stage};

/// Periods from one comparison of the parameters to the next.
const VERIFY_EVERY: u32 = 64;

/// Where the drive stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// The bridge is off and may be enabled.
    Off,
    /// The axis is under control.
    Running,
    /// The bridge is off, and stays so until the faults are cleared.
    Faulted,
}

/// What the link brought since the last period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct News<T> {
    /// The latest set point.
    pub set_point: Option<SetPoint<T>>,
    /// Whether a valid frame came.
    pub heard: bool,
    /// Whether a period was missed.
    pub missed: bool,
}

impl<T> News<T> {
    /// Nothing new.
    pub const NONE: Self = Self {
        set_point: None,
        heard: false,
        missed: false,
    };
}

/// What the bridge is to do until the next period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuation<T> {
    /// What drives the axis, in the unit of `u`; zero with the bridge off.
    pub input: T,
    /// Whether the bridge is on.
    pub bridge: bool,
}

/// Why a command was not carried out. What was in force before still is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// The axis is running; disable it first.
    Running,
    /// Faults are latched; clear them first.
    Faulted,
    /// A parameter lies outside its range.
    Invalid,
    /// A recording without signals.
    NothingSelected,
    /// The flash did not take the parameters; the ones before are still in it.
    WriteFailed,
    /// Only an emulated board does this.
    NotEmulated,
    /// The axis is running, and something that must stay then would change; disable it first.
    Fixed,
}

/// Telemetry: one snapshot in so many periods.
#[derive(Clone, Copy, Debug, Default)]
struct Stream {
    selection: Selection,
    every: u16,
    wait: u16,
}

/// One axis with all that belongs to it.
pub struct Drive<'a, T> {
    /// The set in force; the controller has a copy of its part, and the two are compared now and then.
    parameters: Parameters<T>,
    controller: Controller<T>,
    encoder: Encoder,
    monitor: Monitor,
    state: State,
    /// Of this run.
    confines: Option<Confines<T>>,
    faults: Faults,
    set_point: SetPoint<T>,
    winding: Winding<T>,
    input: T,
    snapshot: Snapshot,
    recorder: Recorder<'a, T>,
    stream: Stream,
}

impl<'a, T: Number> Drive<'a, T> {
    /// A drive that is off; `None` if the parameters are not valid. `faults` are those found before its first period, and
    /// `ring` is where recordings go.
    pub fn new(parameters: Parameters<T>, faults: Faults, ring: &'a mut [u32]) -> Option<Self> {
        if !parameters.is_valid() {
            return None;
        }
        let mut drive = Self {
            controller: Controller::new(parameters.control, 0).ok()?,
            parameters,
            encoder: Encoder::new(),
            monitor: Monitor::new(),
            state: State::Off,
            confines: None,
            faults: Faults::NONE,
            set_point: SetPoint::Off,
            winding: Winding::new(),
            input: T::ZERO,
            snapshot: Snapshot::default(),
            recorder: Recorder::new(ring),
            stream: Stream::default(),
        };
        drive.latch(faults);
        Some(drive)
    }

    /// One control period.
    pub fn step(&mut self, sample: &Sample, news: &News<T>) -> Actuation<T> {
        self.step_probed(sample, news, &mut ())
    }

    /// The same, under a probe.
    #[inline]
    pub fn step_probed(
        &mut self,
        sample: &Sample,
        news: &News<T>,
        probe: &mut impl Probe,
    ) -> Actuation<T> {
        let reading = self.read(*sample);
        let driven = (self.state == State::Running).then_some(self.input);
        let limits = &self.parameters.limits;
        let found = self.monitor.check(limits, &reading, news, driven);
        let beyond = match self.in_force() {
            Some(confines) => confines.check(self.encoder.total(), &reading),
            None => Faults::NONE,
        };
        self.latch(found.and(beyond));
        if let Some(set_point) = news.set_point {
            self.set_point = set_point;
        }
        probe.ended(Stage::Monitor);
        self.amend(&reading);
        probe.ended(Stage::Current);
        let output = self.law(probe);
        let bridge = self.state == State::Running;
        self.input = if bridge {
            self.winding.input(&self.parameters, &reading, &output)
        } else {
            T::ZERO
        };
        probe.ended(Stage::Current);
        self.observe(&reading, &output);
        probe.ended(Stage::Record);
        Actuation {
            input: self.input,
            bridge,
        }
    }

    /// Raw readings in their units.
    #[inline]
    fn read(&mut self, sample: Sample) -> Reading<T> {
        let limits = &self.parameters.limits;
        let current = i32::from(sample.current) - i32::from(limits.current_zero);
        Reading {
            moved: self.encoder.follow(sample.count),
            current: limits.current_per_count.times(current),
            bus: limits.bus_per_count.times(sample.bus.into()),
            gate_fault: sample.gate_fault,
        }
    }

    /// The bounds of a run that goes on.
    #[inline]
    fn in_force(&self) -> Option<&Confines<T>> {
        let confines = self.confines.as_ref();
        confines.filter(|_| self.state == State::Running)
    }

    /// The control law. Without power it is asked for nothing, and goes on observing.
    #[inline]
    fn law(&mut self, probe: &mut impl Probe) -> Output<T> {
        let set_point = match self.state {
            State::Running => self.set_point,
            State::Off | State::Faulted => SetPoint::Off,
        };
        let total = self.encoder.total();
        let output = self.controller.step_probed(total, set_point, probe);
        // What is not finite in floating point, the control law has found.
        let sound = !T::FIXED || output.velocity.is_sound() && output.torque.is_sound();
        if !(output.finite && sound) {
            self.raise(Fault::Unsound);
            self.controller.reset(self.encoder.total());
        }
        if self
            .in_force()
            .is_some_and(|c| c.is_passed_by(output.velocity))
        {
            self.raise(Fault::Overspeed);
        }
        output
    }

    /// Tells the control law what the current loop made of what it asked for.
    #[inline]
    fn amend(&mut self, reading: &Reading<T>) {
        if self.parameters.current.is_some() && self.state == State::Running {
            let (off, short) = self.winding.off(reading.current);
            self.controller.amend(off, short);
        }
    }

    /// Puts the period on record.
    #[inline]
    fn observe(&mut self, reading: &Reading<T>, output: &Output<T>) {
        self.snapshot.period = self.snapshot.period.wrapping_add(1);
        let words = &mut self.snapshot.words;
        words[Signal::Input as usize] = self.input.to_word();
        words[Signal::Position as usize] = self.encoder.total() as u32;
        words[Signal::Velocity as usize] = output.velocity.to_word();
        words[Signal::Current as usize] = reading.current.to_word();
        words[Signal::Bus as usize] = reading.bus.to_word();
        words[Signal::Error as usize] = output.error.to_word();
        words[Signal::Friction as usize] = output.friction.to_word();
        words[Signal::Coulomb as usize] = output.coulomb.to_word();
        self.recorder.sample(&self.snapshot);
    }

    fn latch(&mut self, found: Faults) {
        if !found.is_empty() {
            self.faults = self.faults.and(found);
            self.state = State::Faulted;
        }
    }

    /// The compare values that make an actuation in V of two legs of a bridge, for a counter that turns at `top`; none with
    /// the bridge off.
    pub fn legs(&self, actuation: &Actuation<T>, top: u16) -> Option<[u16; 2]> {
        let bus = T::from_word(self.snapshot.get(Signal::Bus));
        actuation
            .bridge
            .then(|| legs::compare(actuation.input, bus, top))
    }

    /// Takes a fault that something outside the control period has found.
    pub fn raise(&mut self, fault: Fault) {
        let mut found = Faults::NONE;
        found.raise(fault);
        self.latch(found);
    }

    /// Whether it is time for [`Drive::verify`], after a period.
    #[inline]
    pub const fn is_to_be_verified(&self) -> bool {
        self.snapshot.period.is_multiple_of(VERIFY_EVERY)
    }

    /// Compares the parameters with those that the control law uses. Meant to be called now and then, as it takes as
    /// long as a control step.
    pub fn verify(&mut self) {
        if *self.controller.parameters() != self.parameters.control || !self.parameters.is_valid() {
            self.raise(Fault::CorruptParameters);
        }
    }

    /// Turns the axis on, with nothing asked of it.
    pub fn enable(&mut self) -> Result<(), Refusal> {
        self.begin(None)
    }

    /// The same within bounds, which hold until the axis is off.
    pub fn enable_within(&mut self, bounds: &Bounds<T>) -> Result<(), Refusal> {
        if !bounds.is_valid() {
            return Err(Refusal::Invalid);
        }
        self.begin(Some(*bounds))
    }

    fn begin(&mut self, bounds: Option<Bounds<T>>) -> Result<(), Refusal> {
        match self.state {
            State::Off => {}
            State::Running => return Err(Refusal::Running),
            State::Faulted => return Err(Refusal::Faulted),
        }
        self.set_point = SetPoint::Off;
        self.input = T::ZERO;
        self.winding = Winding::new();
        self.monitor = Monitor::new();
        let origin = self.encoder.total();
        self.confines = bounds.map(|bounds| Confines { bounds, origin });
        self.controller.confine(bounds.map(|bounds| bounds.input));
        self.controller.reset(origin);
        self.state = State::Running;
        Ok(())
    }

    /// Turns the axis off.
    pub fn disable(&mut self) {
        if self.state == State::Running {
            self.state = State::Off;
        }
    }

    /// Forgets the faults. One whose cause persists comes back in the next period.
    pub fn clear(&mut self) {
        if self.state == State::Faulted {
            self.faults = Faults::NONE;
            self.state = State::Off;
        }
    }

    /// Puts parameters in force from the next period on, all of them or none. While the axis runs, what [`parameters`] says must
    /// stay then has to be as it is.
    pub fn set(&mut self, parameters: &Parameters<T>) -> Result<(), Refusal> {
        if !parameters.surrounds_validly() {
            return Err(Refusal::Invalid);
        }
        if self.state == State::Running && !self.parameters.may_become(parameters) {
            return Err(Refusal::Fixed);
        }
        let taken = self.controller.set_parameters(parameters.control);
        taken.map_err(|_| Refusal::Invalid)?;
        self.parameters = *parameters;
        Ok(())
    }

    /// Fails while the axis runs: what is about to happen takes longer than a period.
    pub fn must_not_run(&self) -> Result<(), Refusal> {
        if self.state == State::Running {
            return Err(Refusal::Running);
        }
        Ok(())
    }

    /// The parameters in force.
    pub const fn parameters(&self) -> &Parameters<T> {
        &self.parameters
    }

    /// Damages the parameters in use, to see that it is noticed.
    pub fn corrupt(&mut self) {
        self.parameters.control.inertia += T::EPSILON;
    }

    /// Where the drive stands.
    pub const fn state(&self) -> State {
        self.state
    }

    /// The latched faults.
    pub const fn faults(&self) -> Faults {
        self.faults
    }

    /// The signals of the last period.
    pub const fn snapshot(&self) -> &Snapshot {
        &self.snapshot
    }

    /// Where the axis stands, as the encoder has counted since the start.
    pub fn position(&self) -> Position<T> {
        Position::at(self.encoder.total())
    }

    /// The recording.
    pub const fn recorder(&mut self) -> &mut Recorder<'a, T> {
        &mut self.recorder
    }

    /// Chooses the telemetry; `every` 0 turns it off.
    pub fn stream(&mut self, selection: Selection, every: u16) {
        self.stream = Stream {
            selection,
            every,
            wait: 0,
        };
    }

    /// The signals to send as telemetry after this period, if it is one whose turn it is.
    #[inline]
    pub fn due(&mut self) -> Option<Selection> {
        let stream = &mut self.stream;
        if stream.every == 0 || stream.selection.is_empty() {
            return None;
        }
        if stream.wait > 0 {
            stream.wait -= 1;
            return None;
        }
        stream.wait = stream.every - 1;
        Some(stream.selection)
    }
}
