//! The messages. They carry the numbers of the control path as they are, so nothing is rounded on the way.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::control::SetPoint;
use crate::drive::recorder::{Contents, Order};
use crate::drive::signal::{SIGNALS, Selection};
use crate::drive::{Bounds, Faults, Parameters, Refusal, Sample, State};

/// Changes whenever an older peer would misread a message.
///
/// Postcard numbers enum variants by position, so even reordering them is a new version. [`Report::Hello`] stays the
/// first of its kind and begins with this number, so that any two versions can tell that they differ.
pub const PROTOCOL_VERSION: u16 = 3;

/// The most recorded words in one frame: framing costs less than a tenth of the link.
pub const CHUNK: usize = 48;

/// What the host sends: a command and its number, which counts up and wraps, so that the board notices what is lost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Packet<T> {
    /// One more than that of the packet before.
    pub sequence: u16,
    /// What to do.
    pub command: Command<T>,
}

/// What the host asks of the board.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Command<T> {
    /// Asks for a [`Report::Hello`], for a host that arrives after the board has booted.
    Hello,
    /// The readings of a period, in place of hardware; only an emulated board takes them. Answered by
    /// [`Report::Actuation`] alone.
    Sample(Sample),
    /// What the axis is to do. Not answered, as it is sent at a high rate.
    SetPoint(SetPoint<T>),
    /// Turns the axis on.
    Enable,
    /// Turns it off.
    Disable,
    /// Forgets the latched faults.
    Clear,
    /// Asks for state, faults and counters.
    Status,
    /// Puts parameters in force, whole; on a running axis only those that may change then: see [`crate::drive::parameters`].
    Set(Parameters<T>),
    /// Asks for those in force.
    Get,
    /// Writes the parameters in force to the flash.
    Store,
    /// Begins a recording.
    Record(Order<T>),
    /// Ends it.
    StopRecording,
    /// Asks what was recorded.
    Recorded,
    /// Asks for recorded words.
    Read {
        /// The number of the first one, counted through all rows.
        first: u32,
    },
    /// Chooses telemetry.
    Telemetry {
        /// The signals of each frame.
        selection: Selection,
        /// Periods from frame to frame; 0 for none.
        every: u16,
    },
    /// Makes something go wrong; only an emulated board does.
    Inject(Injection),
    /// Turns the axis on within bounds, which hold until it is off.
    EnableWithin(Bounds<T>),
}

/// Faults that no sample can bring about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Injection {
    /// A parameter in use changes by itself.
    CorruptParameter,
    /// A bit of a record in flash changes.
    CorruptFlash {
        /// Which of the two records.
        record: u8,
    },
    /// The control task stops, and the watchdog resets the board.
    Hang,
    /// The crystal stops.
    Clock,
    /// The board starts anew, as after a loss of power.
    Restart,
}

/// What the board sends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Report<T> {
    /// The board is listening. Sent at boot and on demand.
    Hello(Hello),
    /// What an emulated board does with its bridge until the next sample.
    Actuation {
        /// The number of the control period, which counts up.
        period: u32,
        /// What drives the axis, in the unit of `u`.
        input: T,
        /// Whether the bridge is on.
        bridge: bool,
        /// The latched faults.
        faults: Faults,
    },
    /// Signals, at the rate that was chosen.
    Telemetry {
        /// Counts up with every frame that was due; a gap is frames that found the line busy.
        number: u16,
        /// The number of the control period.
        period: u32,
        /// The chosen signals in their order.
        words: Vec<u32, SIGNALS>,
    },
    /// The answer to one packet.
    Answer {
        /// The sequence number of the packet.
        to: u16,
        /// What became of it.
        answer: Answer<T>,
    },
}

/// Who is at the other end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// The board's [`PROTOCOL_VERSION`].
    pub protocol: u16,
    /// The version of the firmware: major, minor, patch.
    pub version: [u16; 3],
    /// The CRC-32 of the image as it lies in flash, which the host can compare with the file.
    pub build: u32,
    /// Which board.
    pub board: Board,
    /// Which numbers the control path computes in.
    pub numbers: Numbers,
    /// How many words a recording can hold.
    pub ring: u32,
}

impl Hello {
    /// What a board with this code says of itself.
    #[must_use]
    pub fn new(board: Board, numbers: Numbers, build: u32, ring: u32) -> Self {
        let part = |text: &str| text.parse().unwrap_or(0);
        Self {
            protocol: PROTOCOL_VERSION,
            version: [
                part(env!("CARGO_PKG_VERSION_MAJOR")),
                part(env!("CARGO_PKG_VERSION_MINOR")),
                part(env!("CARGO_PKG_VERSION_PATCH")),
            ],
            build,
            board,
            numbers,
            ring,
        }
    }
}

/// The boards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Board {
    /// An emulated board: its sensors and its bridge are on the host.
    Emulated,
    /// `ODrive` v3.
    OdriveV3,
}

/// Number formats of the control path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Numbers {
    /// Single precision; parameters and signals are in SI units.
    F32,
    /// 16 fractional bits; parameters and signals are in the units that the host has chosen.
    Q16,
}

/// What became of a command.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Answer<T> {
    /// It was carried out.
    Done,
    /// It was not.
    Refused(Refusal),
    /// The state of the board.
    Status {
        /// Where the drive stands.
        state: State,
        /// The latched faults.
        faults: Faults,
        /// What was lost, and how far the stack has grown.
        counters: Counters,
    },
    /// The parameters in force.
    Parameters(Parameters<T>),
    /// What was recorded.
    Recorded(Contents),
    /// Recorded words; fewer than [`CHUNK`] at the end.
    Words {
        /// The number of the first one.
        first: u32,
        /// See `drive::signal::Snapshot`.
        words: Vec<u32, CHUNK>,
    },
}

/// What was lost since boot, and how far the stack has grown; each saturates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Frames with a wrong checksum, too long, or of no known content.
    pub damaged: u32,
    /// Gaps in the sequence numbers.
    pub missing: u32,
    /// Commands that came faster than they were served.
    pub dropped: u32,
    /// The most bytes of stack that were in use; zero on a host.
    pub stack: u32,
}
