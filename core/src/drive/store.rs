//! Parameters in flash: two records, written in turn, of which the newer whole one counts.
//!
//! A record is a version, a serial number, the parameters as the link carries them, and a CRC-32 of all of it. It is written
//! into the sector that does *not* hold the record in force, from its first word to its last, so whenever the power
//! fails, the record in force is untouched, and the new one counts only with its checksum, which is written last.

use core::ops::Range;

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use embedded_storage::nor_flash::NorFlash;

use super::{Fault, Faults, Number, Parameters};

/// Changes with the order or meaning of the parameters; a record of another version counts as none.
const VERSION: u32 = 2;

/// The size of a record, more than any set of parameters needs, which a test of `link` holds.
pub const BYTES: usize = 384;

const CRC32: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// The checksum of records, CRC-32 as in Ethernet; also what tells one image from another.
pub fn checksum(bytes: &[u8]) -> u32 {
    CRC32.checksum(bytes)
}

/// What the flash holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stored<T> {
    /// Nothing was ever stored, or only by another version of the firmware.
    Nothing,
    /// Neither record is whole, and at least one is damaged.
    Corrupt,
    /// The parameters of the newer whole record.
    Parameters(Parameters<T>),
}

/// Why parameters could not be stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WriteFailed;

/// Where in the flash the two sectors lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Places {
    /// The offset of each sector.
    pub offsets: [u32; 2],
    /// The size of a sector.
    pub size: u32,
}

/// What is found in a sector. The parameters themselves are read again where they are wanted: a board may have no room
/// for those of two sectors at once.
#[derive(PartialEq, Eq)]
enum Record {
    Blank,
    Foreign,
    Damaged,
    /// With this serial number.
    Whole(u32),
}

/// Reads the parameters in force.
pub fn load<T: Number>(flash: &mut impl NorFlash, places: Places) -> Stored<T> {
    let records = places.offsets.map(|offset| read::<T>(flash, offset).0);
    let damaged = records.contains(&Record::Damaged);
    let found = newest(&records).and_then(|(index, _)| {
        let offset = places.offsets.get(index)?;
        read(flash, *offset).1
    });
    match found {
        Some(parameters) => Stored::Parameters(parameters),
        None if damaged => Stored::Corrupt,
        None => Stored::Nothing,
    }
}

/// The parameters that a board begins with, which may be the harmless ones, and its faults with those found now.
pub fn boot<T: Number>(
    flash: &mut impl NorFlash,
    places: Places,
    mut faults: Faults,
) -> (Parameters<T>, Faults) {
    let stored = load(flash, places);
    faults.raise_if(Fault::CorruptParameters, stored == Stored::Corrupt);
    match stored {
        Stored::Parameters(parameters) => (parameters, faults),
        Stored::Nothing | Stored::Corrupt => (Parameters::harmless(), faults),
    }
}

/// Stores parameters and reads them back. The ones before stay in force until the new ones are whole.
pub fn save<T: Number>(
    flash: &mut impl NorFlash,
    places: Places,
    parameters: &Parameters<T>,
) -> Result<(), WriteFailed> {
    let records = places.offsets.map(|offset| read::<T>(flash, offset).0);
    let (serial, target) = match newest(&records) {
        Some((index, serial)) => (serial.wrapping_add(1), 1 - index),
        None => (0, 0),
    };
    let offset = *places.offsets.get(target).ok_or(WriteFailed)?;
    let end = offset.checked_add(places.size).ok_or(WriteFailed)?;
    flash.erase(offset, end).map_err(|_| WriteFailed)?;
    write(flash, offset..end, serial, parameters)?;
    match read(flash, offset) {
        (Record::Whole(found), Some(back)) if found == serial && back == *parameters => Ok(()),
        _ => Err(WriteFailed),
    }
}

/// Writes a record from its first word to its last.
#[inline(never)]
fn write<T: Number>(
    flash: &mut impl NorFlash,
    places: Range<u32>,
    serial: u32,
    parameters: &Parameters<T>,
) -> Result<(), WriteFailed> {
    let record = encode(serial, parameters).ok_or(WriteFailed)?;
    for (place, word) in places.step_by(4).zip(record.chunks_exact(4)) {
        flash.write(place, word).map_err(|_| WriteFailed)?;
    }
    Ok(())
}

/// The sector and the serial number of the newer whole record. Serial numbers wrap, and the two differ by one.
fn newest(records: &[Record; 2]) -> Option<(usize, u32)> {
    let whole = |index: usize| match records[index] {
        Record::Whole(serial) => Some((index, serial)),
        _ => None,
    };
    match (whole(0), whole(1)) {
        (Some(a), Some(b)) => Some(if b.1 == a.1.wrapping_add(1) { b } else { a }),
        (a, b) => a.or(b),
    }
}

fn encode<T: Number>(serial: u32, parameters: &Parameters<T>) -> Option<[u8; BYTES]> {
    let mut bytes = [0; BYTES];
    let (content, checksum) = bytes.split_last_chunk_mut::<4>()?;
    let (version, rest) = content.split_first_chunk_mut::<4>()?;
    let (number, body) = rest.split_first_chunk_mut::<4>()?;
    *version = VERSION.to_le_bytes();
    *number = serial.to_le_bytes();
    postcard::to_slice(parameters, body).ok()?;
    *checksum = self::checksum(content).to_le_bytes();
    Some(bytes)
}

/// What a sector holds, with the parameters if it is whole.
#[inline(never)]
fn read<T: Number>(flash: &mut impl NorFlash, offset: u32) -> (Record, Option<Parameters<T>>) {
    let mut bytes = [0; BYTES];
    if flash.read(offset, &mut bytes).is_err() {
        return (Record::Damaged, None);
    }
    if bytes.iter().all(|b| *b == 0xFF) {
        return (Record::Blank, None);
    }
    decode(&bytes).unwrap_or((Record::Damaged, None))
}

/// What a record's bytes hold; `None` if they are damaged.
fn decode<T: Number>(bytes: &[u8; BYTES]) -> Option<(Record, Option<Parameters<T>>)> {
    let (content, checksum) = bytes.split_last_chunk::<4>()?;
    if self::checksum(content) != u32::from_le_bytes(*checksum) {
        return None;
    }
    let (version, rest) = content.split_first_chunk::<4>()?;
    let (serial, body) = rest.split_first_chunk::<4>()?;
    if u32::from_le_bytes(*version) != VERSION {
        return Some((Record::Foreign, None));
    }
    let parameters: Parameters<T> = postcard::from_bytes(body).ok()?;
    let whole = Record::Whole(u32::from_le_bytes(*serial));
    parameters.is_valid().then_some((whole, Some(parameters)))
}

#[cfg(test)]
mod tests {
    use embedded_storage::nor_flash::{
        ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
    };

    use super::{BYTES, Places, Stored, load, save};
    use crate::drive::Parameters;

    const SECTOR: usize = 400;
    const PLACES: Places = Places {
        offsets: [0, SECTOR as u32],
        size: SECTOR as u32,
    };

    /// A NOR flash whose power fails at a step: an erase goes byte by byte, a write bit by bit from one to zero.
    struct Flash {
        bytes: [u8; 2 * SECTOR],
        steps_left: usize,
    }

    #[derive(Debug)]
    struct Off;

    impl NorFlashError for Off {
        fn kind(&self) -> NorFlashErrorKind {
            NorFlashErrorKind::Other
        }
    }

    impl Flash {
        fn blank() -> Self {
            Self {
                bytes: [0xFF; 2 * SECTOR],
                steps_left: usize::MAX,
            }
        }

        fn step(&mut self) -> Result<(), Off> {
            self.steps_left = self.steps_left.checked_sub(1).ok_or(Off)?;
            Ok(())
        }
    }

    impl ErrorType for Flash {
        type Error = Off;
    }

    impl ReadNorFlash for Flash {
        const READ_SIZE: usize = 1;
        fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Off> {
            let offset = offset as usize;
            bytes.copy_from_slice(&self.bytes[offset..offset + bytes.len()]);
            Ok(())
        }
        fn capacity(&self) -> usize {
            self.bytes.len()
        }
    }

    impl NorFlash for Flash {
        const WRITE_SIZE: usize = 4;
        const ERASE_SIZE: usize = SECTOR;
        fn erase(&mut self, from: u32, to: u32) -> Result<(), Off> {
            for at in from..to {
                self.step()?;
                self.bytes[at as usize] = 0xFF;
            }
            Ok(())
        }
        fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Off> {
            assert_eq!(bytes.len(), Self::WRITE_SIZE);
            for (k, byte) in bytes.iter().enumerate() {
                for bit in 0..8 {
                    self.step()?;
                    self.bytes[offset as usize + k] &= byte | !(1 << bit);
                }
            }
            Ok(())
        }
    }

    fn set(timeout: u16) -> Parameters<f32> {
        let mut parameters = Parameters::harmless();
        parameters.limits.command_timeout = timeout;
        parameters
    }

    #[test]
    fn what_is_stored_is_read_back_and_the_newest_counts() {
        const { assert!(BYTES <= SECTOR) };
        let mut flash = Flash::blank();
        assert_eq!(load::<f32>(&mut flash, PLACES), Stored::Nothing);
        for timeout in [10, 20, 30, 40, 50] {
            save(&mut flash, PLACES, &set(timeout)).unwrap();
            assert_eq!(load(&mut flash, PLACES), Stored::Parameters(set(timeout)));
        }
    }

    /// From nothing, from one record and from two: whatever step the power fails at, the old set or the new one is
    /// there, and the next attempt succeeds.
    #[test]
    fn a_power_cut_at_any_step_leaves_the_old_or_the_new() {
        for records_before in 0..4 {
            let mut start = Flash::blank();
            for k in 0..records_before {
                save(&mut start, PLACES, &set(k)).unwrap();
            }
            let old = load::<f32>(&mut start, PLACES);
            let new = Stored::Parameters(set(999));
            let all = SECTOR + 8 * BYTES;
            for steps in 0..=all {
                let mut flash = Flash {
                    bytes: start.bytes,
                    steps_left: steps,
                };
                let outcome = save(&mut flash, PLACES, &set(999));
                assert_eq!(outcome.is_ok(), steps == all);
                flash.steps_left = usize::MAX;
                let found = load::<f32>(&mut flash, PLACES);
                // A first record that was cut off is damage without anything older to fall back to.
                let none = records_before == 0 && found == Stored::Corrupt;
                assert!(found == old || found == new || none, "{steps}: {found:?}");
                assert!(outcome.is_err() || found == new);
                save(&mut flash, PLACES, &set(5)).unwrap();
                assert_eq!(load(&mut flash, PLACES), Stored::Parameters(set(5)));
            }
        }
    }

    #[test]
    fn a_flipped_bit_falls_back_to_the_older_record_and_two_are_corrupt() {
        let mut start = Flash::blank();
        save(&mut start, PLACES, &set(1)).unwrap();
        save(&mut start, PLACES, &set(2)).unwrap();
        for bit in 0..8 * BYTES {
            let mut flash = Flash {
                bytes: start.bytes,
                steps_left: usize::MAX,
            };
            flash.bytes[SECTOR + bit / 8] ^= 1 << (bit % 8);
            assert_eq!(load(&mut flash, PLACES), Stored::Parameters(set(1)));
            flash.bytes[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(load::<f32>(&mut flash, PLACES), Stored::Corrupt);
        }
    }
}
