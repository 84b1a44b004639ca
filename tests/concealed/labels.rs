//! The sealed labels: what is in each recording.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use rand::rngs::OsRng;
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, SeedableRng, TryRngCore};
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};

use crate::plants::{NAMED, Noise, OTHERS, Recipe, pair};

/// One case, as a line of the file.
#[derive(Clone, Debug)]
pub struct Label {
    pub seed: u64,
    /// Effects, none for a clean axis.
    pub effects: Vec<&'static str>,
    /// Size of each, as a share of the RMS drive.
    pub size: f64,
    pub noise: Noise,
    /// Whether the baseline gives the inertia, rightly unless it is what is wrong.
    pub inertia_given: bool,
}

/// What a case is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Clean,
    Single,
    Pair,
    Outside,
}

const SIZES: [f64; 3] = [0.03, 0.10, 0.30];
const NOISES: [Noise; 3] = [Noise::Low, Noise::Medium, Noise::High];
/// The fields of a line.
pub const HEADER: &str = "seed,effects,size,noise,inertia_given";

impl Label {
    pub fn kind(&self) -> Kind {
        match self.effects.as_slice() {
            [] => Kind::Clean,
            [one] if NAMED.contains(one) => Kind::Single,
            [_] => Kind::Outside,
            _ => Kind::Pair,
        }
    }

    pub fn recipe(&self) -> Recipe {
        Recipe::with_effects(self.seed, &self.effects, self.size, self.noise)
    }

    pub fn line(&self) -> String {
        let effects = self.effects.join("+");
        let given = u8::from(self.inertia_given);
        format!(
            "{},{effects},{},{:?},{given}",
            self.seed, self.size, self.noise
        )
    }

    fn parse(line: &str) -> Option<Self> {
        let fields: Vec<&str> = line.split(',').collect();
        let [seed, effects, size, noise, given] = fields.as_slice() else {
            return None;
        };
        let id = |name: &str| NAMED.iter().chain(&OTHERS).copied().find(|id| *id == name);
        let effects = effects.split('+').filter(|e| !e.is_empty());
        Some(Self {
            seed: seed.parse().ok()?,
            effects: effects.map(id).collect::<Option<_>>()?,
            size: size.parse().ok()?,
            noise: NOISES.into_iter().find(|n| format!("{n:?}") == *noise)?,
            inertia_given: *given == "1",
        })
    }
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/concealed")
}

fn digest(text: &str) -> String {
    let mut hex = String::new();
    for byte in Sha256::digest(text) {
        let _ = write!(hex, "{byte:02x}");
    }
    hex
}

/// Draws cases, adds them to those that are there and writes the digest of all.
pub fn seal(count: usize) -> Result<(), String> {
    let before = open()?;
    let seed = OsRng.try_next_u64().map_err(|e| e.to_string())?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut labels: Vec<Label> = (0..count).map(|k| draw(&mut rng, k)).collect();
    // Any first part is a fair sample of those that are drawn together.
    labels.shuffle(&mut rng);
    let lines: Vec<String> = before.iter().chain(&labels).map(Label::line).collect();
    let text = format!("{HEADER}\n{}\n", lines.join("\n"));
    let write = |name: &str, text: &str| {
        fs::write(folder().join(name), text).map_err(|e| format!("{name}: {e}"))
    };
    write("labels.csv", &text)?;
    write("labels.sha256", &format!("{}\n", digest(&text)))
}

/// Of ten cases six have one effect, two are clean, one has a pair and one something outside the catalogue.
fn draw(rng: &mut ChaCha8Rng, k: usize) -> Label {
    let effects = match k % 10 {
        0 | 1 => Vec::new(),
        2 => pair(rng).to_vec(),
        3 => vec![OTHERS[k / 10 % OTHERS.len()]],
        _ => vec![NAMED[(k / 10 * 6 + k % 10 - 4) % NAMED.len()]],
    };
    // Two effects of 3 % each are hardly more than one.
    let sizes = if effects.len() > 1 {
        &SIZES[1..]
    } else {
        &SIZES
    };
    Label {
        seed: rng.random(),
        inertia_given: effects.is_empty() && rng.random_bool(0.3),
        size: if effects.is_empty() {
            0.0
        } else {
            *sizes.choose(rng).unwrap_or(&0.1)
        },
        noise: *NOISES.choose(rng).unwrap_or(&Noise::Low),
        effects,
    }
}

/// The cases, if nobody has touched them.
pub fn open() -> Result<Vec<Label>, String> {
    let read =
        |name: &str| fs::read_to_string(folder().join(name)).map_err(|e| format!("{name}: {e}"));
    let (text, sealed) = (read("labels.csv")?, read("labels.sha256")?);
    if digest(&text) != sealed.trim() {
        return Err("labels.csv is not the file that labels.sha256 seals".to_owned());
    }
    let lines = text.lines().skip(1).enumerate();
    lines
        .map(|(k, line)| Label::parse(line).ok_or(format!("labels.csv, line {}: {line}", k + 2)))
        .collect()
}
