//! Frames: postcard, CRC-16, COBS, one zero byte.

use heapless::Vec;
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{CHUNK, Rejection};

const CHECKSUM: usize = size_of::<u16>();

/// The largest message: a variant (1 byte), a sequence number (a varint of at most 3), a length (1, as
/// `CHUNK` < 128) and the samples. A law is shorter.
const MESSAGE_CAPACITY: usize = 1 + 3 + 1 + CHUNK * size_of::<f32>();
const _: () = assert!(CHUNK < 128, "the length varint is counted as one byte");

const BODY_CAPACITY: usize = MESSAGE_CAPACITY + CHECKSUM;

/// The most bytes in a frame: COBS adds one byte for each 254 begun, and the delimiter one more.
pub const FRAME_CAPACITY: usize = BODY_CAPACITY + BODY_CAPACITY.div_ceil(254) + 1;

/// The bytes of one frame. What [`encode`] returns ends with the delimiter; what [`Deframer`] returns omits it.
pub type Frame = Vec<u8, FRAME_CAPACITY>;

const DELIMITER: u8 = 0;

/// Turns a message into the bytes to send, delimiter included.
///
/// Fails with [`Rejection::TooLong`] for a message larger than any request or response; those always fit.
pub fn encode<T: Serialize>(message: &T) -> Result<Frame, Rejection> {
    let mut body = [0; BODY_CAPACITY];
    let length = postcard::to_slice(message, &mut body[..MESSAGE_CAPACITY])
        .map_err(|_| Rejection::TooLong)?
        .len();
    let checksum = crc16(&body[..length]).to_le_bytes();
    body[length..length + CHECKSUM].copy_from_slice(&checksum);

    let mut frame = Frame::new();
    frame
        .resize_default(FRAME_CAPACITY)
        .map_err(|_| Rejection::TooLong)?;
    let stuffed =
        cobs::try_encode(&body[..length + CHECKSUM], &mut frame).map_err(|_| Rejection::TooLong)?;
    frame.truncate(stuffed);
    frame.push(DELIMITER).map_err(|_| Rejection::TooLong)?;
    Ok(frame)
}

/// Turns the bytes between two delimiters back into a message.
///
/// Fails with [`Rejection::Corrupt`] unless the frame is whole and holds exactly one message.
pub fn decode<T: DeserializeOwned>(mut frame: Frame) -> Result<T, Rejection> {
    let length = cobs::decode_in_place(&mut frame).map_err(|_| Rejection::Corrupt)?;
    let (message, checksum) = frame
        .get(..length)
        .and_then(<[u8]>::split_last_chunk::<CHECKSUM>)
        .ok_or(Rejection::Corrupt)?;
    if crc16(message) != u16::from_le_bytes(*checksum) {
        return Err(Rejection::Corrupt);
    }
    match postcard::take_from_bytes(message) {
        Ok((value, [])) => Ok(value),
        _ => Err(Rejection::Corrupt),
    }
}

/// Cuts a stream of bytes into frames.
///
/// Work per byte is constant and small, so that it can run in a receive interrupt; decoding is left to whoever
/// takes the frame.
#[derive(Debug, Default)]
pub struct Deframer {
    frame: Frame,
    overflowed: bool,
}

impl Deframer {
    /// A deframer at the start of a frame.
    pub const fn new() -> Self {
        Self {
            frame: Frame::new(),
            overflowed: false,
        }
    }

    /// Takes the next byte; returns a frame when this byte completes one.
    ///
    /// Empty frames are skipped without a word: a sender may put a delimiter in front of a frame to end
    /// whatever noise the line carried before. A frame that is too long is dropped to its end and reported once.
    pub fn push(&mut self, byte: u8) -> Option<Result<Frame, Rejection>> {
        if byte != DELIMITER {
            self.overflowed |= self.frame.push(byte).is_err();
            return None;
        }
        let frame = core::mem::take(&mut self.frame);
        if core::mem::take(&mut self.overflowed) {
            Some(Err(Rejection::TooLong))
        } else if frame.is_empty() {
            None
        } else {
            Some(Ok(frame))
        }
    }
}

/// CRC-16/IBM-3740 (polynomial 0x1021, initial value 0xFFFF): Hamming distance 4 up to 4 KB, so up to three
/// flipped bits of a message are always noticed (Koopman and Chakravarty 2004). Bit by bit, as the link is too
/// slow for a table to be worth its flash.
fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |crc, &byte| {
        (0..8).fold(crc ^ (u16::from(byte) << 8), |crc, _| {
            let shifted = crc << 1;
            if crc & 0x8000 == 0 {
                shifted
            } else {
                shifted ^ 0x1021
            }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::{Deframer, FRAME_CAPACITY, Frame, crc16, decode, encode};
    use crate::friction::{CoulombViscous, Curve, Stribeck};
    use crate::link::{CHUNK, Law, Rejection, Request, Response, Samples};

    fn samples(value: f32) -> Samples {
        core::iter::repeat_n(value, CHUNK).collect()
    }

    fn frames(bytes: &[u8]) -> std::vec::Vec<Result<Frame, Rejection>> {
        let mut deframer = Deframer::new();
        bytes.iter().filter_map(|&b| deframer.push(b)).collect()
    }

    #[test]
    fn the_checksum_matches_its_published_check_value() {
        assert_eq!(crc16(b"123456789"), 0x29B1);
    }

    #[test]
    fn every_kind_of_message_survives_the_round_trip() {
        let law = Law::Stribeck(Stribeck {
            coulomb: 0.0, // zero bytes exercise the stuffing
            viscous: 1e-30,
            static_level: f32::MAX,
            stribeck_velocity: f32::MIN_POSITIVE,
            curve: Curve::Rational,
        });
        for request in [
            Request::Hello,
            Request::SetLaw(law),
            Request::Evaluate {
                sequence: 0,
                velocities: Samples::new(),
            },
            Request::Evaluate {
                sequence: u16::MAX,
                velocities: samples(-0.0),
            },
        ] {
            let decoded = frames(&encode(&request).unwrap())
                .remove(0)
                .and_then(decode);
            assert_eq!(decoded, Ok(request));
        }
        let response = Response::Rejected {
            reason: Rejection::NotFinite,
            total: u32::MAX,
        };
        let decoded = frames(&encode(&response).unwrap())
            .remove(0)
            .and_then(decode);
        assert_eq!(decoded, Ok(response));
    }

    #[test]
    fn the_largest_messages_fill_the_frame_exactly() {
        // No byte of this pattern is zero, so COBS cannot save any: the capacity is tight, not merely enough.
        let value = f32::from_bits(0x3F80_0101);
        let request = Request::Evaluate {
            sequence: u16::MAX,
            velocities: samples(value),
        };
        let response = Response::Forces {
            sequence: u16::MAX,
            forces: samples(value),
        };
        assert_eq!(encode(&request).unwrap().len(), FRAME_CAPACITY);
        assert_eq!(encode(&response).unwrap().len(), FRAME_CAPACITY);
        assert_eq!(encode(&(request, 1.0_f32)), Err(Rejection::TooLong));
    }

    #[test]
    fn a_flipped_bit_anywhere_is_noticed() {
        let request = Request::SetLaw(Law::CoulombViscous(CoulombViscous {
            coulomb: 0.2,
            viscous: 0.01,
        }));
        let clean = encode(&request).unwrap();
        for bit in 0..8 * (clean.len() - 1) {
            let mut damaged = clean.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            for frame in frames(&damaged) {
                assert_eq!(frame.and_then(decode::<Request>), Err(Rejection::Corrupt));
            }
        }
    }

    #[test]
    fn garbage_is_refused_and_the_next_frame_is_whole_again() {
        let request = encode(&Request::Hello).unwrap();
        // A fixed xorshift stream: reproducible, and long enough to hold short and overlong frames.
        let mut state = 0x2545_F491_u32;
        let mut stream: std::vec::Vec<u8> = (0..20_000)
            .map(|_| {
                state ^= state << 13;
                state ^= state >> 17;
                state ^= state << 5;
                (state >> 11) as u8
            })
            .collect();
        stream.push(0);
        stream.extend_from_slice(&request);

        let mut frames = frames(&stream);
        assert_eq!(frames.pop().unwrap().and_then(decode), Ok(Request::Hello));
        assert!(frames.iter().any(|f| f == &Err(Rejection::TooLong)));
        assert!(frames.len() > 40);
        for frame in frames {
            assert!(frame.and_then(decode::<Request>).is_err());
        }
    }

    #[test]
    fn lone_delimiters_and_trailing_bytes() {
        assert!(frames(&[0, 0, 0]).is_empty());
        // Whole, with a right checksum, but more than one message.
        let two = encode(&(Request::Hello, 7_u8)).unwrap();
        let decoded = frames(&two).remove(0).and_then(decode::<Request>);
        assert_eq!(decoded, Err(Rejection::Corrupt));
    }
}
