//! Output files: all are written, or none is touched.

use std::io::Write;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Result};

/// Files that a command is going to write.
#[derive(Default)]
pub(super) struct Outputs {
    files: Vec<(PathBuf, String)>,
}

impl Outputs {
    /// Plans a file, if a path was given.
    pub fn add(
        &mut self,
        path: Option<&PathBuf>,
        content: impl FnOnce() -> Result<String>,
    ) -> Result<()> {
        if let Some(path) = path {
            self.files.push((path.clone(), content()?));
        }
        Ok(())
    }

    /// Writes all planned files beside their destinations, then moves them into place; returns their paths.
    pub fn write(self) -> Result<Vec<PathBuf>> {
        let mut written = Vec::new();
        for (path, content) in self.files {
            let unwritable = |reason| Error::Unwritable {
                path: path.clone(),
                reason,
            };
            let folder = path
                .parent()
                .filter(|p| !p.as_os_str().is_empty())
                .unwrap_or(Path::new("."));
            let mut file = NamedTempFile::new_in(folder).map_err(unwritable)?;
            file.write_all(content.as_bytes()).map_err(unwritable)?;
            readable_by_others(&file);
            written.push((path, file));
        }
        written
            .into_iter()
            .map(|(path, file)| match file.persist(&path) {
                Ok(_) => Ok(path),
                Err(e) => Err(Error::Unwritable {
                    path,
                    reason: e.error,
                }),
            })
            .collect()
    }
}

/// Temporary files are private; results are ordinary files.
#[cfg(unix)]
fn readable_by_others(file: &NamedTempFile) {
    use std::os::unix::fs::PermissionsExt;
    let _ = file
        .as_file()
        .set_permissions(std::fs::Permissions::from_mode(0o644));
}

#[cfg(not(unix))]
fn readable_by_others(_file: &NamedTempFile) {}

/// Refuses outputs that would overwrite an input or each other.
pub(super) fn check(inputs: &[&Path], outputs: &[Option<&PathBuf>]) -> Result<()> {
    let same = |a: &Path, b: &Path| {
        a == b || matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
    };
    let outputs: Vec<&PathBuf> = outputs.iter().flatten().copied().collect();
    for (k, output) in outputs.iter().enumerate() {
        if inputs.iter().any(|input| same(input, output)) {
            return Err(Error::Usage(format!(
                "{} is an input; choose another name for the output",
                output.display()
            )));
        }
        if outputs[..k].iter().any(|other| same(other, output)) {
            return Err(Error::Usage(format!(
                "{} is named for two outputs; give each its own name",
                output.display()
            )));
        }
    }
    Ok(())
}
