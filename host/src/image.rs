//! The firmware's image: given, or built from the sources beside this program's.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::error::{Error, Result};

/// A target of the firmware, and the program for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Target {
    /// Rust's name of it.
    pub triple: &'static str,
    /// The program.
    pub program: &'static str,
    /// The command of cargo that builds it, as `.cargo/config.toml` of the sources says.
    pub alias: &'static str,
    /// The chip's name.
    pub chip: &'static str,
    /// Where the flash begins.
    pub flash: u32,
    /// Bytes of it for the image; what lies behind holds the parameters.
    pub room: u32,
    /// First and last address that the stack may begin at.
    pub stack: (u32, u32),
}

/// The STM32F405, with a floating-point unit.
pub const F405: Target = Target {
    triple: "thumbv7em-none-eabihf",
    program: "bristle-firmware",
    alias: "firmware",
    chip: "the STM32F405",
    flash: 0x0800_0000,
    // Sectors 10 and 11 hold the parameters.
    room: 0x000C_0000,
    stack: (0x2000_0000, 0x2002_0000),
};

/// The STM32F100, without one.
pub const F100: Target = Target {
    triple: "thumbv7m-none-eabi",
    program: "bristle-vldiscovery",
    alias: "vldiscovery",
    chip: "the STM32F100",
    flash: 0x0800_0000,
    room: 0x0002_0000,
    stack: (0x2000_0000, 0x2000_2000),
};

/// Builds the image with cargo, into `directory` or where cargo puts it, with further arguments such as `--features log`.
pub fn build(target: Target, directory: Option<&Path>, more: &[&str]) -> Result<PathBuf> {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .filter(|workspace| workspace.join("firmware").is_dir())
        .ok_or_else(|| {
            Error::Usage(
                "the firmware's sources are not where this program was built; give an image with --image".to_owned(),
            )
        })?;
    let directory = directory.map_or_else(|| workspace.join("target"), Path::to_owned);
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .arg(target.alias)
        .args(more)
        .arg("--target-dir")
        .arg(&directory)
        .current_dir(workspace)
        // Flags meant for the host, such as coverage or sanitizers, do not exist for the target.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .output()
        .map_err(|e| {
            Error::Usage(format!(
                "the firmware cannot be built without cargo ({e}); install Rust from https://rustup.rs, give an image with --image, or leave the emulator out with --on-host where the command has that"
            ))
        })?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let last: Vec<&str> = said.lines().rev().take(12).collect();
        let last: Vec<&str> = last.into_iter().rev().collect();
        return Err(Error::Usage(format!(
            "the firmware does not build; is the target installed (rustup target add {})? cargo says:\n{}",
            target.triple,
            last.join("\n")
        )));
    }
    let folder = directory.join(target.triple).join("firmware");
    Ok(folder.join(target.program))
}
