//! The firmware image and the emulated board that runs it.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::thread::sleep;
use std::time::{Duration, Instant};

use bristle_core::link::{Deframer, Request, Response, decode, encode};
use tempfile::TempDir;

const TARGET: &str = "thumbv7em-none-eabihf";
const QEMU: &str = "qemu-system-arm";

/// Far beyond anything the emulator takes, even on a busy machine: only a dead board runs into it.
const PATIENCE: Duration = Duration::from_secs(20);

/// The compiled firmware.
pub struct Images {
    /// The application.
    pub firmware: PathBuf,
    /// Panics at once.
    pub panic: PathBuf,
    /// Executes an undefined instruction at once.
    pub hard_fault: PathBuf,
}

/// The images, built once for all tests; `None`, with a message, on a machine that cannot build them.
pub fn images() -> Option<&'static Images> {
    static IMAGES: OnceLock<Option<Images>> = OnceLock::new();
    let images = IMAGES.get_or_init(|| target_is_installed().then(build));
    images.as_ref()
}

/// The images, on a machine that can also run them.
pub fn runnable_images() -> Option<&'static Images> {
    static RUNNABLE: OnceLock<bool> = OnceLock::new();
    let runnable = *RUNNABLE.get_or_init(qemu_is_installed);
    runnable.then(images).flatten()
}

fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the host package lies in the workspace")
}

fn target_is_installed() -> bool {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc)
        .args(["--print", "target-libdir", "--target", TARGET])
        .current_dir(workspace())
        .output();
    let installed =
        output.is_ok_and(|o| Path::new(String::from_utf8_lossy(&o.stdout).trim()).exists());
    installed
        || missing(&format!(
            "the Rust target {TARGET} (rustup target add {TARGET})"
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

fn build() -> Images {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("firmware");
    let status = Command::new(env!("CARGO"))
        .args([
            "build",
            "--package",
            "bristle-firmware",
            "--bins",
            "--examples",
        ])
        .args(["--profile", "firmware", "--target", TARGET, "--target-dir"])
        // A directory of its own: the outer cargo may hold the lock of the usual one.
        .arg(&directory)
        .current_dir(workspace())
        // Flags meant for the host, such as coverage or sanitizers, do not exist for the target.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .status()
        .expect("cargo runs");
    assert!(status.success(), "the firmware does not build");
    let output = directory.join(TARGET).join("firmware");
    Images {
        firmware: output.join("bristle-firmware"),
        panic: output.join("examples/panic"),
        hard_fault: output.join("examples/hard_fault"),
    }
}

/// A running emulator, killed when dropped: also when the test that owns it panics.
struct Emulator(Child);

impl Emulator {
    fn start(image: &Path, serial: &[&str]) -> Self {
        let child = Command::new(QEMU)
            .args(["-M", "netduinoplus2", "-nographic", "-monitor", "none"])
            .args(["-semihosting-config", "enable=on,target=native"])
            .args(serial)
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .expect("the emulator starts");
        Self(child)
    }

    fn exit_status(&mut self) -> Option<ExitStatus> {
        self.0.try_wait().expect("the emulator is our child")
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // Fails only if it has ended already, which is as good.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Runs an image that ends by itself.
pub fn run_to_end(image: &Path) -> ExitStatus {
    let mut emulator = Emulator::start(image, &["-serial", "null"]);
    poll(|| emulator.exit_status()).expect("the image ends by itself")
}

/// Calls `attempt` until it yields something or patience ends.
fn poll<T>(mut attempt: impl FnMut() -> Option<T>) -> Option<T> {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        if let Some(value) = attempt() {
            return Some(value);
        }
        sleep(Duration::from_millis(5));
    }
    None
}

/// An emulated board and the host's end of its serial link.
pub struct Board {
    // Dropped in this order: the emulator first, then the directory of its socket.
    emulator: Emulator,
    link: UnixStream,
    deframer: Deframer,
    received: VecDeque<Response>,
    _directory: TempDir,
}

impl Board {
    /// Starts the firmware. Its greeting is the first thing to [`Board::receive`].
    pub fn boot(image: &Path) -> Self {
        let directory = tempfile::tempdir().expect("a temporary directory");
        let path = directory.path().join("link");
        // Bound before the emulator starts, which connects to it: there is no race to lose.
        let listener = UnixListener::bind(&path).expect("a socket");
        listener.set_nonblocking(true).expect("a socket option");
        let chardev = format!("socket,id=link,server=off,path={}", path.display());
        let mut emulator =
            Emulator::start(image, &["-chardev", &chardev, "-serial", "chardev:link"]);
        let link = poll(|| {
            assert_eq!(emulator.exit_status(), None, "the emulator ended early");
            match listener.accept() {
                Ok((stream, _)) => Some(stream),
                Err(error) if error.kind() == ErrorKind::WouldBlock => None,
                Err(error) => panic!("accepting the emulator's connection: {error}"),
            }
        })
        .expect("the emulator connects");
        link.set_nonblocking(false).expect("a socket option");
        link.set_read_timeout(Some(PATIENCE))
            .expect("a socket option");
        link.set_write_timeout(Some(PATIENCE))
            .expect("a socket option");
        Self {
            emulator,
            link,
            deframer: Deframer::new(),
            received: VecDeque::new(),
            _directory: directory,
        }
    }

    /// Sends bytes as they are.
    pub fn send_raw(&mut self, bytes: &[u8]) {
        self.link.write_all(bytes).expect("the board takes bytes");
    }

    /// Sends a request.
    pub fn send(&mut self, request: &Request) {
        self.send_raw(&encode(request).expect("every request fits a frame"));
    }

    /// Waits for the next response.
    pub fn receive(&mut self) -> Response {
        loop {
            if let Some(response) = self.received.pop_front() {
                return response;
            }
            let mut buffer = [0; 4096];
            let length = match self.link.read(&mut buffer) {
                Ok(length @ 1..) => length,
                end => panic!(
                    "no answer ({end:?}); the emulator's exit status: {:?}",
                    self.emulator.exit_status()
                ),
            };
            for &byte in &buffer[..length] {
                if let Some(frame) = self.deframer.push(byte) {
                    let response = frame.and_then(decode);
                    self.received
                        .push_back(response.expect("the link loses nothing"));
                }
            }
        }
    }

    /// Sends a request and waits for the response.
    pub fn ask(&mut self, request: &Request) -> Response {
        self.send(request);
        self.receive()
    }
}
