//! The firmware's image as the flash is to hold it.

use std::path::{Path, PathBuf};

use object::elf::{EM_ARM, FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader};
use object::{Endianness, read};

use crate::error::{Error, Result};
use crate::image::Target;

/// What the flash is to hold.
#[derive(Debug)]
pub struct Image {
    /// The ELF file.
    pub path: PathBuf,
    /// Address of the first byte.
    pub address: u32,
    /// The bytes from there on; what no segment fills is 0xFF, as in erased flash.
    pub bytes: Vec<u8>,
}

impl Image {
    /// Reads an ELF file and checks that it starts on this chip.
    ///
    /// # Errors
    /// [`Error::Unreadable`], or [`Error::Usage`] with what makes the file no image for the chip.
    pub fn read(path: &Path, target: &Target) -> Result<Self> {
        let file = std::fs::read(path).map_err(|reason| Error::Unreadable {
            path: path.to_owned(),
            reason,
        })?;
        let refuse = |what: String| {
            Error::Usage(format!(
                "{}: {what}; give the ELF file that `cargo {}` makes, or leave --image out to have it built",
                path.display(),
                target.alias
            ))
        };
        let segments = segments(&file).map_err(refuse)?;
        let bytes = flat(&segments, target).map_err(refuse)?;
        check_vectors(&bytes, target).map_err(refuse)?;
        Ok(Self {
            path: path.to_owned(),
            address: target.flash,
            bytes,
        })
    }
}

/// Address and bytes of what the file says is to be loaded.
fn segments(file: &[u8]) -> std::result::Result<Vec<(u32, &[u8])>, String> {
    let no_elf = |e: read::Error| format!("is no 32-bit ELF file ({e})");
    let header = FileHeader32::<Endianness>::parse(file).map_err(no_elf)?;
    let endian = header.endian().map_err(no_elf)?;
    if header.e_machine(endian) != EM_ARM {
        return Err("is not for an ARM processor".to_owned());
    }
    let headers = header.program_headers(endian, file).map_err(no_elf)?;
    let loaded = headers
        .iter()
        .filter(|h| h.p_type(endian) == PT_LOAD && h.p_filesz(endian) > 0);
    loaded
        .map(|h| match h.data(endian, file) {
            Ok(bytes) => Ok((h.p_paddr(endian), bytes)),
            Err(()) => Err("ends before its last segment does".to_owned()),
        })
        .collect()
}

/// All segments in one piece from the beginning of the flash.
fn flat(segments: &[(u32, &[u8])], target: &Target) -> std::result::Result<Vec<u8>, String> {
    let mut flat = Vec::new();
    for (address, bytes) in segments {
        let room = target.room as usize;
        let place = address.checked_sub(target.flash).map(|at| at as usize);
        let Some(start) = place.filter(|start| start + bytes.len() <= room) else {
            return Err(format!(
                "puts {} bytes at {address:#010x}, outside what {} has for an image ({:#010x} to {:#010x})",
                bytes.len(),
                target.chip,
                target.flash,
                target.flash + target.room - 1
            ));
        };
        let end = start + bytes.len();
        if flat.len() < end {
            flat.resize(end, 0xFF);
        }
        flat[start..end].copy_from_slice(bytes);
    }
    Ok(flat)
}

/// Checks what the processor reads first: where the stack begins and where the program does (ARMv7-M, B1.5.3).
fn check_vectors(bytes: &[u8], target: &Target) -> std::result::Result<(), String> {
    let word = |k: usize| {
        let bytes = bytes.get(4 * k..4 * k + 4)?;
        bytes.try_into().ok().map(u32::from_le_bytes)
    };
    let (Some(stack), Some(start)) = (word(0), word(1)) else {
        return Err("holds no vector table".to_owned());
    };
    let inside = (target.flash..target.flash + bytes.len() as u32).contains(&start);
    // Bit 0 says that Thumb instructions follow, the only ones that the processor has.
    if !(target.stack.0..=target.stack.1).contains(&stack) || !inside || start & 1 == 0 {
        return Err(format!(
            "does not begin with a vector table for {} (stack at {stack:#010x}, start at {start:#010x})",
            target.chip
        ));
    }
    Ok(())
}
