//! Passes the target's linker arguments and memory map, and none when the host builds the dummy binaries.

use std::path::PathBuf;

/// The map of the workspace, which includes that of the chip.
const MAP: &str = "../memory.x";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=memory");
    println!("cargo::rerun-if-changed={MAP}");
    let target = |key: &str| std::env::var(format!("CARGO_CFG_TARGET_{key}")).unwrap_or_default();
    if target("OS") != "none" {
        return;
    }
    // As in Cargo.toml: the target decides on the chip.
    let chip = match &*target("ABI") {
        "eabihf" => "stm32f405",
        _ => "stm32f100",
    };
    let folder = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets it"));
    for (from, to) in [(MAP, "memory.x"), (&format!("memory/{chip}.x"), "chip.x")] {
        std::fs::copy(from, folder.join(to)).expect("the map is there");
    }
    println!("cargo::rustc-link-search={}", folder.display());
    // The vector table of cortex-m-rt, which includes memory.x.
    println!("cargo::rustc-link-arg=-Tlink.x");
    if std::env::var_os("CARGO_FEATURE_LOG").is_some() {
        // The texts of the log, in sections that are not loaded.
        println!("cargo::rustc-link-arg=-Tdefmt.x");
    }
    // No page alignment of segments: it would pad the image with up to 64 KB of flash.
    println!("cargo::rustc-link-arg=--nmagic");
}
