//! The firmware's images, built once for all tests, and boards that run them.

mod calls;

pub use calls::Calls;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use bristle::emulate::{Board, Launch, QEMU, Transport};
use bristle::image::{self, Target};
use bristle_core::drive::Number;
use bristle_core::scalar::Q16;

/// The compiled firmware of the STM32F405.
pub struct Images {
    /// The application.
    pub firmware: PathBuf,
    /// Panics at once.
    pub panic: PathBuf,
    /// Counts the instructions of a control period.
    pub cost: PathBuf,
    /// Counts those of its stages.
    pub stages: PathBuf,
    /// Counts those of new parameters under way.
    pub sets: PathBuf,
    /// Executes an undefined instruction at once.
    pub hard_fault: PathBuf,
}

/// The compiled firmware of the STM32F100.
pub struct FixedImages {
    /// The application.
    pub firmware: PathBuf,
    /// Counts the instructions of a control period.
    pub cost: PathBuf,
    /// Counts those of its stages.
    pub stages: PathBuf,
    /// Counts those of new parameters under way.
    pub sets: PathBuf,
}

/// The images; `None`, with a message, on a machine that cannot build them.
pub fn images() -> Option<&'static Images> {
    static IMAGES: OnceLock<Option<Images>> = OnceLock::new();
    let images = IMAGES.get_or_init(|| {
        let firmware = built(image::F405)?;
        let example = |name: &str| firmware.with_file_name("examples").join(name);
        Some(Images {
            panic: example("panic"),
            hard_fault: example("hard_fault"),
            cost: example("cost"),
            stages: example("stages"),
            sets: example("sets"),
            firmware,
        })
    });
    images.as_ref()
}

/// The images without floating point; `None`, with a message, on a machine that cannot build them.
pub fn fixed_images() -> Option<&'static FixedImages> {
    static IMAGES: OnceLock<Option<FixedImages>> = OnceLock::new();
    let images = IMAGES.get_or_init(|| {
        let firmware = built(image::F100)?;
        let example = |name: &str| firmware.with_file_name("examples").join(name);
        Some(FixedImages {
            cost: example("cost"),
            stages: example("stages"),
            sets: example("sets"),
            firmware,
        })
    });
    images.as_ref()
}

/// An image, on a machine that can build it.
fn built(target: Target) -> Option<PathBuf> {
    if !target_is_installed(target.triple) {
        return None;
    }
    // A directory of its own: the outer cargo may hold the lock of the usual one.
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("firmware");
    Some(image::build(target, Some(&directory), &["--examples"]).expect("the firmware builds"))
}

/// The images, on a machine that can also run them.
pub fn runnable_images() -> Option<&'static Images> {
    runnable().then(images).flatten()
}

/// The images without floating point, likewise.
pub fn runnable_fixed_images() -> Option<&'static FixedImages> {
    runnable().then(fixed_images).flatten()
}

fn runnable() -> bool {
    static RUNNABLE: OnceLock<bool> = OnceLock::new();
    *RUNNABLE.get_or_init(qemu_is_installed)
}

/// A board that has greeted; `None` on a machine without emulator or target.
pub fn booted<T: Number>(transport: Transport) -> Option<Board<T>> {
    let image = &runnable_images()?.firmware;
    Some(Board::boot(image, Launch::F405, transport).expect("the board greets"))
}

/// A board in fixed point, likewise.
pub fn booted_fixed(transport: Transport) -> Option<Board<Q16>> {
    let image = &runnable_fixed_images()?.firmware;
    Some(Board::boot(image, Launch::F100, transport).expect("the board greets"))
}

fn target_is_installed(triple: &str) -> bool {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc)
        .args(["--print", "target-libdir", "--target", triple])
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .output();
    let installed =
        output.is_ok_and(|o| Path::new(String::from_utf8_lossy(&o.stdout).trim()).exists());
    installed
        || missing(&format!(
            "the Rust target {triple} (rustup target add {triple})"
        ))
}

fn qemu_is_installed() -> bool {
    let version = Command::new(QEMU).arg("--version").output();
    version.is_ok_and(|o| o.status.success())
        || missing(&format!(
            "{QEMU} (Debian, Ubuntu: apt-get install {QEMU}; Fedora: dnf install {QEMU}-core; macOS: brew install qemu)"
        ))
}

/// Reports what is missing; fails where nothing may be, as in continuous integration.
fn missing(what: &str) -> bool {
    assert!(
        std::env::var_os("BRISTLE_REQUIRE_QEMU").is_none_or(|v| v != "1"),
        "missing: {what}"
    );
    // Written to the stream itself, as the test harness hides what passing tests print.
    let _ = writeln!(std::io::stderr(), "skipped: missing {what}");
    false
}
