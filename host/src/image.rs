//! The firmware's image: given, or built from the sources beside this program's.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::error::{Error, Result};

/// A target of the firmware, and the program for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Target {
    /// Rust's name of it.
    pub triple: &'static str,
    /// The package.
    pub package: &'static str,
}

/// The STM32F405, with a floating-point unit.
pub const F405: Target = Target {
    triple: "thumbv7em-none-eabihf",
    package: "bristle-firmware",
};

/// Builds the image with cargo, into `directory` or where cargo puts it.
pub fn build(target: Target, directory: Option<&Path>) -> Result<PathBuf> {
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
        .args(["build", "--package", target.package, "--bins", "--examples"])
        .args(["--profile", "firmware", "--target", target.triple])
        .arg("--target-dir")
        .arg(&directory)
        .current_dir(workspace)
        // Flags meant for the host, such as coverage or sanitizers, do not exist for the target.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .output()
        .map_err(|e| {
            Error::Usage(format!(
                "the firmware cannot be built without cargo ({e}); install Rust from https://rustup.rs, or give an image with --image"
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
    Ok(folder.join(target.package))
}
