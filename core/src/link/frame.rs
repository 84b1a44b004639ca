//! Frames: postcard, CRC-16, COBS, one zero byte.

use crc::{CRC_16_IBM_3740, Crc, NoTable};
use heapless::Vec;
use serde::Serialize;
use serde::de::DeserializeOwned;

const CHECKSUM_BYTES: usize = size_of::<u16>();

/// The largest message is a set of parameters. A test holds that it fits with the largest numbers, and the next larger
/// one, an answer full of recorded words.
const MESSAGE_CAPACITY: usize = 320;

const BODY_CAPACITY: usize = MESSAGE_CAPACITY + CHECKSUM_BYTES;

/// Hamming distance 4 up to 4 KB, so up to three flipped bits of a message are always noticed (Koopman and Chakravarty
/// 2004). Without a table, as the link is too slow for one to be worth its flash.
const CHECKSUM: Crc<u16, NoTable> = Crc::<u16, NoTable>::new(&CRC_16_IBM_3740);

/// The most bytes in a frame: COBS adds one byte for each 254 begun, and the delimiter one more.
pub const FRAME_CAPACITY: usize = BODY_CAPACITY + BODY_CAPACITY.div_ceil(254) + 1;

/// The most bytes in the frame of a [`Report::Actuation`](super::Report::Actuation): the discriminant, a period and an input of
/// up to five bytes each, the bridge, faults of up to three, the checksum, what COBS adds, and the delimiter.
pub const ACTUATION_CAPACITY: usize = 1 + 5 + 5 + 1 + 3 + CHECKSUM_BYTES + 2;

/// The bytes of one frame. What [`encode`] returns ends with the delimiter; what [`Deframer`] returns omits it.
pub type Frame = Vec<u8, FRAME_CAPACITY>;

const DELIMITER: u8 = 0;

/// Why a frame holds no message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Damage {
    /// More bytes than [`FRAME_CAPACITY`] without a delimiter, or a message too large to send.
    TooLong,
    /// Not COBS, a wrong checksum, or not exactly one message.
    Corrupt,
}

/// Turns a message into the bytes to send, delimiter included.
///
/// Fails with [`Damage::TooLong`] for a message larger than any request or response; those always fit.
pub fn encode<T: Serialize>(message: &T) -> Result<Frame, Damage> {
    encode_short(message)
}

/// The same for a message whose frame is known to have at most `N` bytes, where memory is scarce.
pub fn encode_short<T: Serialize, const N: usize>(message: &T) -> Result<Vec<u8, N>, Damage> {
    let mut body = [0; N];
    let room = body.get_mut(..N.min(MESSAGE_CAPACITY));
    let room = room.ok_or(Damage::TooLong)?;
    let length = postcard::to_slice(message, room)
        .map_err(|_| Damage::TooLong)?
        .len();
    // Lengths are looked up and not indexed with: the control task of an emulated board encodes, and may not panic.
    let (content, rest) = body.split_at_mut_checked(length).ok_or(Damage::TooLong)?;
    let checksum = CHECKSUM.checksum(content).to_le_bytes();
    *rest.first_chunk_mut().ok_or(Damage::TooLong)? = checksum;
    let whole = body.get(..length + CHECKSUM_BYTES);
    let whole = whole.ok_or(Damage::TooLong)?;

    let mut frame = Vec::new();
    frame.resize_default(N).map_err(|_| Damage::TooLong)?;
    let stuffed = cobs::try_encode(whole, &mut frame).map_err(|_| Damage::TooLong)?;
    frame.truncate(stuffed);
    frame.push(DELIMITER).map_err(|_| Damage::TooLong)?;
    Ok(frame)
}

/// Turns the bytes between two delimiters back into a message. Works in their place, and leaves nothing of use there.
///
/// Fails with [`Damage::Corrupt`] unless the frame is whole and holds exactly one message.
pub fn decode<T: DeserializeOwned>(frame: &mut [u8]) -> Result<T, Damage> {
    let length = cobs::decode_in_place(frame).map_err(|_| Damage::Corrupt)?;
    let (message, checksum) = frame
        .get(..length)
        .and_then(<[u8]>::split_last_chunk::<CHECKSUM_BYTES>)
        .ok_or(Damage::Corrupt)?;
    if CHECKSUM.checksum(message) != u16::from_le_bytes(*checksum) {
        return Err(Damage::Corrupt);
    }
    match postcard::take_from_bytes(message) {
        Ok((value, [])) => Ok(value),
        _ => Err(Damage::Corrupt),
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
    /// The frame was handed out.
    complete: bool,
}

impl Deframer {
    /// A deframer at the start of a frame.
    pub const fn new() -> Self {
        Self {
            frame: Frame::new(),
            overflowed: false,
            complete: false,
        }
    }

    /// Takes the next byte; returns a frame when this byte completes one, in the place where it was gathered.
    ///
    /// Empty frames are skipped without a word: a sender may put a delimiter in front of a frame to end
    /// whatever noise the line carried before. A frame that is too long is dropped to its end and reported once.
    pub fn push(&mut self, byte: u8) -> Option<Result<&mut [u8], Damage>> {
        if core::mem::take(&mut self.complete) {
            self.frame.clear();
        }
        if byte != DELIMITER {
            self.overflowed |= self.frame.push(byte).is_err();
            return None;
        }
        self.complete = true;
        if core::mem::take(&mut self.overflowed) {
            Some(Err(Damage::TooLong))
        } else if self.frame.is_empty() {
            None
        } else {
            Some(Ok(&mut self.frame))
        }
    }
}

#[cfg(test)]
mod tests {
    use serde::de::DeserializeOwned;

    use super::{ACTUATION_CAPACITY, CHECKSUM, Damage, Deframer, decode, encode, encode_short};
    use crate::control::{CurrentLoop, SetPoint};
    use crate::drive::recorder::{Order, Trigger};
    use crate::drive::signal::{Selection, Signal};
    use crate::drive::store::BYTES;
    use crate::drive::{Fault, Faults, Number, Parameters, Sample};
    use crate::link::{Answer, CHUNK, Command, Packet, Report};
    use crate::scalar::Q16;

    /// What the frames in some bytes hold.
    fn messages<T: DeserializeOwned>(bytes: &[u8]) -> std::vec::Vec<Result<T, Damage>> {
        let mut deframer = Deframer::new();
        let decoded = |&byte: &u8| Some(deframer.push(byte)?.and_then(decode));
        bytes.iter().filter_map(decoded).collect()
    }

    fn packet(command: Command<f32>) -> Packet<f32> {
        Packet {
            sequence: 300,
            command,
        }
    }

    #[test]
    fn the_checksum_matches_its_published_check_value() {
        assert_eq!(CHECKSUM.checksum(b"123456789"), 0x29B1);
    }

    #[test]
    fn messages_survive_the_round_trip() {
        let sample = Sample {
            count: 0,
            current: 2048,
            bus: u16::MAX,
            gate_fault: true,
        };
        let order = Order {
            selection: Selection::of(&Signal::ALL),
            every: 3,
            trigger: Trigger::Falls(Signal::Coulomb, -0.0),
            before: 9,
        };
        for command in [
            Command::Hello,
            Command::Sample(sample),
            Command::SetPoint(SetPoint::Torque(f32::MIN_POSITIVE)),
            Command::Enable,
            Command::Set(Parameters::harmless()),
            Command::Record(order),
        ] {
            let bytes = encode(&packet(command.clone())).unwrap();
            assert_eq!(messages(&bytes), [Ok(packet(command))]);
        }
    }

    /// A set in which every number takes as many bytes as it can.
    fn widest<T: Number>(number: T) -> Parameters<T> {
        let mut set = Parameters::harmless();
        let limits = &mut set.limits;
        for slot in [
            &mut limits.current_per_count,
            &mut limits.current,
            &mut limits.bus_per_count,
            &mut limits.bus_min,
            &mut limits.bus_max,
            &mut limits.stall,
        ] {
            *slot = number;
        }
        for slot in [
            &mut limits.jump,
            &mut limits.current_zero,
            &mut limits.stall_periods,
            &mut limits.command_timeout,
            &mut limits.link_timeout,
        ] {
            *slot = u16::MAX;
        }
        let control = &mut set.control;
        for slot in [
            &mut control.period,
            &mut control.count,
            &mut control.inertia,
            &mut control.gain,
            &mut control.back_emf,
            &mut control.command_limit,
            &mut control.torque_limit,
            &mut control.observer_bandwidth,
            &mut control.position_gain,
            &mut control.velocity_gain,
            &mut control.velocity_integral,
            &mut control.friction.coulomb,
            &mut control.friction.viscous,
            &mut control.friction.static_level,
            &mut control.friction.stribeck_velocity,
            &mut control.friction.bristle_stiffness,
            &mut control.friction.bristle_damping,
            &mut control.compensation.share,
            &mut control.compensation.slope,
            &mut control.compensation.crossing,
            &mut control.adaptation.rate,
            &mut control.adaptation.speed,
            &mut control.adaptation.lowest,
            &mut control.adaptation.highest,
            &mut control.adaptation.window,
            &mut control.adaptation.forgotten,
            &mut control.adaptation.offset,
            &mut control.effects.backlash.gap,
            &mut control.effects.backlash.inertia,
            &mut control.effects.backlash.speed,
            &mut control.effects.offset,
            &mut control.effects.viscous_difference,
            &mut control.effects.stiffness,
        ] {
            *slot = number;
        }
        let effects = &mut control.effects;
        for wave in effects.waves.iter_mut().chain([&mut effects.friction]) {
            (wave.cycle, wave.sine, wave.cosine) = (u32::MAX, number, number);
        }
        set.current = Some(CurrentLoop {
            proportional: number,
            reset: number,
            back_emf: number,
            limit: number,
        });
        set
    }

    fn fits<T: Number>(number: T) {
        let parameters = widest(number);
        let mut buffer = [0; 1024];
        let size = postcard::to_slice(&parameters, &mut buffer).unwrap().len();
        // Version, serial number and checksum stand beside it in flash.
        assert!(size <= BYTES - 12, "{size}");
        let packet = Packet {
            sequence: u16::MAX,
            command: Command::Set(parameters),
        };
        let report = Report::Answer {
            to: u16::MAX,
            answer: Answer::Parameters(parameters),
        };
        let words = Report::<T>::Answer {
            to: u16::MAX,
            answer: Answer::Words {
                first: u32::MAX,
                words: core::iter::repeat_n(u32::MAX, CHUNK).collect(),
            },
        };
        assert!(encode(&packet).is_ok() && encode(&report).is_ok() && encode(&words).is_ok());
    }

    #[test]
    fn the_largest_messages_fit_and_larger_ones_are_refused() {
        fits(f32::from_bits(0x3F80_0101));
        fits(Q16::MIN);
        assert_eq!(encode(&[[1_u8; 32]; 32]), Err(Damage::TooLong));
        let enable = packet(Command::Enable);
        let long = encode(&enable).unwrap();
        assert_eq!(*encode_short::<_, 8>(&enable).unwrap(), *long);
        for short in [
            encode_short::<_, 2>(&enable).err(),
            encode_short::<_, 5>(&enable).err(),
        ] {
            assert_eq!(short, Some(Damage::TooLong));
        }
    }

    fn longest_actuation<T: Number>(input: T) {
        let mut faults = Faults::NONE;
        Fault::ALL.into_iter().for_each(|fault| faults.raise(fault));
        let report = Report::Actuation {
            period: u32::MAX,
            input,
            bridge: true,
            faults,
        };
        let long = encode(&report).unwrap();
        assert_eq!(
            encode_short::<_, ACTUATION_CAPACITY>(&report).unwrap(),
            *long
        );
        // Faults take two bytes as yet, and a float four: more is not kept free.
        assert!(long.len() + 2 >= ACTUATION_CAPACITY, "{}", long.len());
    }

    #[test]
    fn the_longest_actuation_fits() {
        longest_actuation(f32::from_bits(0x3F80_0101));
        longest_actuation(Q16::MIN);
    }

    #[test]
    fn a_flipped_bit_anywhere_is_noticed() {
        let clean = encode(&packet(Command::SetPoint(SetPoint::Torque(0.2)))).unwrap();
        for bit in 0..8 * (clean.len() - 1) {
            let mut damaged = clean.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            for message in messages::<Packet<f32>>(&damaged) {
                assert_eq!(message, Err(Damage::Corrupt));
            }
        }
    }

    #[test]
    fn lone_delimiters_and_trailing_bytes() {
        assert!(messages::<Packet<f32>>(&[0, 0, 0]).is_empty());
        // Whole, with a right checksum, but more than one message.
        let two = encode(&(packet(Command::Hello), 7_u8)).unwrap();
        assert_eq!(messages::<Packet<f32>>(&two), [Err(Damage::Corrupt)]);
    }
}
