//! Output files: all are written, or none is touched.

use std::fs::File;
use std::io::{self, Write};
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
        let staged: Vec<(PathBuf, Staged)> = self
            .files
            .into_iter()
            .map(|(path, content)| match Staged::new(&path, content) {
                Ok(staged) => Ok((path, staged)),
                Err(reason) => Err(Error::Unwritable { path, reason }),
            })
            .collect::<Result<_>>()?;
        staged
            .into_iter()
            .map(|(path, staged)| match staged.publish() {
                Ok(()) => Ok(path),
                Err(reason) => Err(Error::Unwritable { path, reason }),
            })
            .collect()
    }
}

/// A file that is ready but not yet in its place.
enum Staged {
    /// To be renamed to the path.
    File(NamedTempFile, PathBuf),
    /// To be written to something that must not be replaced, such as a terminal or a pipe.
    Stream(File, String),
}

impl Staged {
    fn new(path: &Path, content: String) -> io::Result<Self> {
        // What a link points to is written, and the link stays.
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        let existing = std::fs::metadata(&path).ok();
        if existing.as_ref().is_some_and(|m| !m.is_file()) {
            return Ok(Self::Stream(
                File::options().write(true).open(&path)?,
                content,
            ));
        }
        let mut file = NamedTempFile::new_in(folder(&path))?;
        file.write_all(content.as_bytes())?;
        match existing {
            Some(existing) => file.as_file().set_permissions(existing.permissions())?,
            None => readable_by_others(&file)?,
        }
        Ok(Self::File(file, path))
    }

    fn publish(self) -> io::Result<()> {
        match self {
            Self::File(file, path) => file.persist(path).map(drop).map_err(|e| e.error),
            Self::Stream(mut stream, content) => stream.write_all(content.as_bytes()),
        }
    }
}

fn folder(path: &Path) -> &Path {
    path.parent()
        .filter(|parent| !parent.as_os_str().is_empty())
        .unwrap_or(Path::new("."))
}

/// The same for all ways to write a path, whether there is a file yet or not.
fn place(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default();
    path.canonicalize()
        .or_else(|_| folder(path).canonicalize().map(|folder| folder.join(name)))
        .unwrap_or_else(|_| path.to_owned())
}

/// Temporary files are private; results are ordinary files.
#[cfg(unix)]
fn readable_by_others(file: &NamedTempFile) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    let permissions = std::fs::Permissions::from_mode(0o644);
    file.as_file().set_permissions(permissions)
}

#[cfg(not(unix))]
#[expect(clippy::unnecessary_wraps, reason = "on other systems it can fail")]
fn readable_by_others(_file: &NamedTempFile) -> io::Result<()> {
    Ok(())
}

/// Refuses, before any work is done, outputs that cannot be written or would overwrite an input or each other.
pub(super) fn check(inputs: &[&Path], outputs: &[Option<&PathBuf>]) -> Result<()> {
    let same = |a: &Path, b: &Path| place(a) == place(b);
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
        let refuse = |reason: String| {
            Err(Error::Unwritable {
                path: PathBuf::clone(output),
                reason: io::Error::other(reason),
            })
        };
        if output.is_dir() {
            return refuse("it is a folder".to_owned());
        }
        if !folder(output).is_dir() {
            return refuse(format!("there is no folder {}", folder(output).display()));
        }
        // What is found only at the end costs a long computation, or a run of an axis.
        if output.is_file() || !output.exists() {
            tempfile::tempfile_in(folder(output)).map_err(|reason| Error::Unwritable {
                path: PathBuf::clone(output),
                reason,
            })?;
        }
    }
    Ok(())
}

/// Prints a result that is not for a person, byte for byte; a reader that has had enough is no failure.
pub(super) fn print(bytes: &[u8]) -> Result<()> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        Err(reason) if reason.kind() != io::ErrorKind::BrokenPipe => Err(Error::Unwritable {
            path: "standard output".into(),
            reason,
        }),
        _ => Ok(()),
    }
}
