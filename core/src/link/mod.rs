//! The serial link between the host and a board: one set of messages, used by both ends.
//!
//! A [`Request`] or [`Response`] is encoded with postcard, followed by a CRC-16, COBS-stuffed and ended by
//! a zero byte (see [`encode`]). COBS makes the zero byte unambiguous, so a receiver that starts in the middle
//! of a frame, or that sees garbage, is back in step at the next zero. Postcard alone would accept many
//! corrupted frames as a *different* valid message; the checksum keeps a flipped bit from becoming a parameter.
//!
//! The board speaks first: [`Response::Hello`] says that its receiver is listening and which
//! [`PROTOCOL_VERSION`] it speaks. From then on every request gets exactly one response, in order, and every
//! damaged frame gets one [`Response::Rejected`]; nothing the host sends can stop the board from listening.
//!
//! ```
//! use bristle_core::friction::CoulombViscous;
//! use bristle_core::link::{Deframer, Law, Request, decode, encode};
//!
//! let request = Request::SetLaw(Law::CoulombViscous(CoulombViscous { coulomb: 0.2, viscous: 0.01 }));
//! let bytes = encode(&request)?;
//!
//! let mut deframer = Deframer::new();
//! let frame = bytes.iter().find_map(|&byte| deframer.push(byte)).unwrap()?;
//! assert_eq!(decode::<Request>(frame)?, request);
//! # Ok::<(), bristle_core::link::Rejection>(())
//! ```

mod frame;
mod law;
mod server;

pub use frame::{Deframer, FRAME_CAPACITY, Frame, decode, encode};
pub use law::Law;
pub use server::Server;

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Changes whenever an older peer would misread a message.
///
/// Postcard numbers enum variants by position, so even reordering them is a new version.
pub const PROTOCOL_VERSION: u16 = 1;

/// The most velocities in one request: two frames of this size fit a few hundred bytes of RAM, while framing
/// costs less than a tenth of the link.
pub const CHUNK: usize = 32;

/// A sequence of samples, in the units of the law in force.
pub type Samples = Vec<f32, CHUNK>;

/// What the host asks of the board.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Request {
    /// Asks for another [`Response::Hello`], for a host that arrives after the board has booted.
    Hello,
    /// Puts a friction law in force, in place of the last one.
    SetLaw(Law),
    /// Evaluates the law in force at each velocity, in rad/s or m/s.
    Evaluate {
        /// Returned unchanged, so that the host can pair responses with requests.
        sequence: u16,
        /// Must be finite.
        velocities: Samples,
    },
}

/// What the board answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Response {
    /// The board is listening.
    Hello {
        /// The board's [`PROTOCOL_VERSION`].
        version: u16,
        /// The board's [`CHUNK`].
        chunk: u16,
    },
    /// The law is in force.
    LawSet,
    /// The friction while sliding at each velocity of the request, in N·m or N.
    Forces {
        /// The sequence number of the request.
        sequence: u16,
        /// As many as there were velocities.
        forces: Samples,
    },
    /// A frame was not acted upon. What was in force before still is.
    Rejected {
        /// Why this one was refused.
        reason: Rejection,
        /// How many have been refused since boot, this one included; saturates.
        total: u32,
    },
}

/// Why a frame was not acted upon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Rejection {
    /// More bytes than [`FRAME_CAPACITY`] without a delimiter, or a message too large to send.
    TooLong,
    /// Not COBS, a wrong checksum, or not exactly one message.
    Corrupt,
    /// Whole frames were dropped because they came faster than they were served.
    Overrun,
    /// Velocities came before any law.
    NoLaw,
    /// The law's parameters violate their documented ranges.
    InvalidLaw,
    /// A velocity was infinite or not a number.
    NotFinite,
}
