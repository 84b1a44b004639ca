//! The files the tool is given.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::recipe::{Motion, Recipe};
use super::{Case, Recording};

/// Writes a recording and its baseline into a folder, under the name of the recording's seed.
pub fn keep(folder: &Path, recording: &Recording, baseline: &str) {
    let file = |ending: &str| folder.join(format!("{}.{ending}", recording.truth.seed));
    write_csv(recording, &file("csv"))
        .and_then(|()| fs::write(file("toml"), baseline))
        .expect("writes into the folder of --dump");
}

/// Writes `t,u,q` as CSV with units. Numbers are the shortest that read back exactly.
fn write_csv(recording: &Recording, path: &Path) -> io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    match recording.motion {
        Motion::Rotary => writeln!(file, "t[s],u[N*m],q[rad]")?,
        Motion::Linear => writeln!(file, "t[s],u[N],q[m]")?,
    }
    let rows = recording.t.iter().zip(&recording.u).zip(&recording.q);
    for ((t, u), q) in rows {
        writeln!(file, "{t},{u},{q}")?;
    }
    file.flush()
}

/// The model file that knows nothing: Coulomb and viscous friction and inertia, all to be estimated; or, where that is
/// what is wrong, a given inertia.
pub fn baseline_toml(recipe: &Recipe, truth: &Case) -> String {
    let mut parameters = truth.parameters.iter();
    let mismatch = parameters.find(|(id, ..)| *id == "inertia-mismatch");
    let inertia = mismatch.map_or("\"?\"".to_owned(), |(.., ratio)| {
        (truth.inertia / ratio).to_string()
    });
    let (motion, input) = match recipe.motion {
        Motion::Rotary => ("rotary", "torque"),
        Motion::Linear => ("linear", "force"),
    };
    format!(
        r#"name = "simulated axis {seed}"

[plant]
motion  = "{motion}"
input   = "{input}"
gain    = 1.0
inertia = {inertia}

[friction]
model   = "coulomb-viscous"
coulomb = "?"
viscous = "?"
"#,
        seed = recipe.seed
    )
}
