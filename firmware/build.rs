//! Passes the target's linker arguments, and none when the host builds the dummy binaries.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=../memory.x");
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("none") {
        // The memory layout and vector table of cortex-m-rt; it includes memory.x of the workspace root.
        println!("cargo::rustc-link-arg=-Tlink.x");
        // No page alignment of segments: it would pad the image with up to 64 KB of flash.
        println!("cargo::rustc-link-arg=--nmagic");
    }
}
