//! The image for the target is linked by hand: vectors, code, constants and nothing else.

use std::env;

fn main() {
    println!("cargo::rerun-if-changed=link.x");
    if env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none") {
        let folder = env::var("CARGO_MANIFEST_DIR").expect("cargo sets it");
        println!("cargo::rustc-link-arg=-T{folder}/link.x");
    }
}
