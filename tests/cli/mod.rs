//! The program as its users start it, in a folder of its own, and recordings small enough to be quick.
#![allow(
    dead_code,
    reason = "each test program uses its own part of this module"
)]

use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use bristle::axis::Axis;
use bristle::model::Model;
use bristle::simulate::{State, advance};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;

/// What the owner of the axis believes.
pub const BASELINE: &str = "name = \"test axis\"

[plant]
motion  = \"rotary\"
input   = \"torque\"
gain    = 1.0
inertia = \"?\"

[friction]
model   = \"coulomb-viscous\"
coulomb = \"?\"
viscous = \"?\"
";

/// An axis of which the baseline knows everything.
pub const PLAIN: &str = "[plant]
motion = \"rotary\"
inertia = 0.012
[friction]
coulomb = 0.12
viscous = 0.02
";

/// The same axis with an unbalance that the baseline leaves out.
pub const UNBALANCED: &str = "[plant]
motion = \"rotary\"
inertia = 0.012
[friction]
coulomb = 0.12
viscous = 0.02
[effects.gravity]
amplitude = 0.08
phase = 0.5
";

const RATE: f64 = 500.0;
const COUNTS: f64 = 65_536.0;
/// RMS of the torque that acts on the axis and is not recorded, N·m.
const DISTURBANCE: f64 = 0.01;

/// One sample of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    pub t: f64,
    pub u: f64,
    pub q: f64,
}

/// What the driver of an axis under position control would have recorded.
pub fn record(truth: &str, seconds: f64, seed: u64) -> Vec<Sample> {
    let model = Model::parse(truth).expect("the truth is a valid model");
    let axis = Axis::new(&model).expect("the truth has all values");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let count = TAU / COUNTS;
    let mut state = State { q: 0.0, v: 0.0 };
    let mut before = 0.0;
    (0..(seconds * RATE) as usize)
        .map(|k| {
            let t = k as f64 / RATE;
            let q = (state.q / count).floor() * count;
            let wave = |hertz: f64| (TAU * hertz * t).sin();
            let reference = 1.5 * wave(0.31) + 0.6 * wave(0.83) + 0.12 * wave(2.3);
            let u = 6.0 * (reference - q) - 0.05 * (q - before) * RATE;
            before = q;
            // Sum of twelve uniform numbers: variance 1, close to normal.
            let noise = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
            state = advance(&axis, u + DISTURBANCE * noise, state, 1.0 / RATE);
            Sample { t, u, q }
        })
        .collect()
}

/// A recording in the plainest form.
pub fn csv(samples: &[Sample]) -> String {
    let mut text = String::from("t[s],u[N*m],q[rad]\n");
    for Sample { t, u, q } in samples {
        let _ = writeln!(text, "{t:?},{u:?},{q:?}");
    }
    text
}

/// A real recording, as `folder/file` below the `shared/data` that lies beside the checkout or beside a folder that holds
/// it; where it is not, a line says that the test was skipped.
pub fn real(name: &str) -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent()?;
    let mut places = root
        .ancestors()
        .skip(1)
        .map(|folder| folder.join("shared/data").join(name));
    let found = places.find(|path| path.is_file());
    if found.is_none() {
        // Written to the stream itself, as the test harness hides what passing tests print.
        use std::io::Write;
        let _ = writeln!(
            std::io::stderr(),
            "skipped: ../shared/data/{name} is not there"
        );
    }
    found
}

/// What a run of the program left.
#[derive(Debug)]
pub struct Ran {
    pub status: i32,
    pub stdout: String,
    pub stderr: String,
}

/// A folder to run the program in.
pub struct Folder(TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    /// A folder with a baseline and a recording of a truth: `axis.toml` and `run.csv`.
    pub fn with(truth: &str, seconds: f64) -> Self {
        let folder = Self::new();
        folder.write("axis.toml", BASELINE);
        folder.write("run.csv", csv(&record(truth, seconds, 1)));
        folder
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).expect("writes");
    }

    pub fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    pub fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_str(&self.read(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Names and contents of all files.
    pub fn files(&self) -> Vec<(PathBuf, Vec<u8>)> {
        let mut files = Vec::new();
        collect(self.0.path(), &mut files);
        files.sort();
        files
    }

    /// Runs the program on a command line split at spaces.
    pub fn run(&self, line: &str) -> Ran {
        let output = Command::new(env!("CARGO_BIN_EXE_bristle"))
            .args(line.split_whitespace())
            .current_dir(self.0.path())
            .output()
            .expect("the program starts");
        let text = |bytes| String::from_utf8(bytes).expect("output is UTF-8");
        Ran {
            status: output.status.code().expect("the program ends by itself"),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }

    /// Runs the program on a command line that must succeed; returns what it printed.
    pub fn done(&self, line: &str) -> String {
        let ran = self.run(line);
        assert_eq!(ran.status, 0, "bristle {line}: {ran:?}");
        ran.stdout
    }
}

fn collect(folder: &Path, files: &mut Vec<(PathBuf, Vec<u8>)>) {
    for entry in std::fs::read_dir(folder).expect("a readable folder") {
        let path = entry.expect("a readable entry").path();
        if path.is_dir() {
            collect(&path, files);
        } else {
            let content = std::fs::read(&path).expect("a readable file");
            files.push((path, content));
        }
    }
}
