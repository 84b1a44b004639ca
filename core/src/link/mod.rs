//! The link between the host and a board: one set of messages, used by both ends.
//!
//! A [`Packet`] or [`Report`] is encoded with postcard, followed by a CRC-16, COBS-stuffed and ended by a zero byte
//! (see [`encode`]). COBS makes the zero byte unambiguous, so a receiver that starts in the middle of a frame, or that
//! sees garbage, is back in step at the next zero. Postcard alone would accept many corrupted frames as a
//! *different* valid message; the checksum keeps a flipped bit from becoming a parameter.
//!
//! The board speaks first: [`Report::Hello`] says that its receiver is listening and which [`PROTOCOL_VERSION`] it
//! speaks. Every command but samples and set points is answered, in order. Everything is numbered: packets by the
//! host, telemetry and control periods by the board, so that each end notices what it has lost; nothing that comes
//! over the link can stop the board from listening.
//!
//! ```
//! use bristle_core::control::SetPoint;
//! use bristle_core::link::{Command, Packet, Receiver, Received, encode};
//!
//! let aim = SetPoint::Torque(0.25_f32);
//! let packet = Packet { sequence: 0, command: Command::SetPoint(aim) };
//! let bytes = encode(&packet).expect("every packet fits a frame");
//!
//! let mut receiver = Receiver::new();
//! let received = bytes.iter().find_map(|&byte| receiver.push(byte));
//! assert_eq!(received, Some(Received::SetPoint(aim)));
//! ```

mod frame;
mod message;
mod receiver;
mod server;

pub use frame::{
    ACTUATION_CAPACITY, Damage, Deframer, FRAME_CAPACITY, Frame, decode, encode, encode_short,
};
pub use message::{
    Answer, Board, CHUNK, Command, Counters, Hello, Injection, Numbers, PROTOCOL_VERSION, Packet,
    Report,
};
pub use receiver::{Received, Receiver};
pub use server::{Reaction, actuation, serve, store, suffer, telemetry};
