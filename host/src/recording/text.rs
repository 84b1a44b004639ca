//! Text in UTF-8, checked while it is read, and the lines of a file.

use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};

/// Lines that begin so are not part of a table.
pub(super) const COMMENT: u8 = b'#';

/// A file whose bytes are checked on their way: text in UTF-8 without NUL, which is valid UTF-8 but in no table; it marks
/// binary files and UTF-16.
pub(super) struct Checked<R> {
    pub file: R,
    /// Bytes that have passed.
    at: u64,
    /// The beginning of a character whose end is still to come.
    partial: Vec<u8>,
}

/// The byte where text ends and something else begins.
#[derive(Debug, thiserror::Error)]
#[error("not text from byte {0}")]
pub(super) struct NotText(pub u64);

impl<R: Read> Checked<R> {
    /// Checks what follows byte `at`, where the file stands.
    pub fn new(file: R, at: u64) -> Self {
        Self {
            file,
            at,
            partial: Vec::new(),
        }
    }

    fn check(&mut self, bytes: &[u8]) -> Result<(), NotText> {
        if let Some(nul) = bytes.iter().position(|&b| b == 0) {
            return Err(NotText(self.at + nul as u64));
        }
        if self.partial.is_empty() && bytes.is_ascii() {
            return Ok(());
        }
        let start = self.at - self.partial.len() as u64;
        let mut text = std::mem::take(&mut self.partial);
        text.extend_from_slice(bytes);
        match std::str::from_utf8(&text) {
            Ok(_) => Ok(()),
            Err(e) if e.error_len().is_none() && !bytes.is_empty() => {
                self.partial = text.split_off(e.valid_up_to());
                Ok(())
            }
            Err(e) => Err(NotText(start + e.valid_up_to() as u64)),
        }
    }
}

impl<R: Read> Read for Checked<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.check(&buffer[..count]).map_err(io::Error::other)?;
        self.at += count as u64;
        Ok(count)
    }
}

/// The line, counted from 1, that byte `at` stands on.
pub(super) fn line_at(file: &mut (impl Read + Seek), at: u64) -> io::Result<usize> {
    file.seek(SeekFrom::Start(0))?;
    let mut before = BufReader::with_capacity(1 << 16, file.take(at));
    let mut line = 1;
    loop {
        let bytes = before.fill_buf()?;
        let count = bytes.len();
        if count == 0 {
            return Ok(line);
        }
        line += bytes.split(|&b| b == b'\n').count() - 1;
        before.consume(count);
    }
}

/// The first line from byte `at` on that is neither empty nor a comment: its number and its text.
pub(super) fn first_line(file: &mut (impl Read + Seek), at: u64) -> io::Result<(usize, String)> {
    let mut number = line_at(file, at)?;
    file.seek(SeekFrom::Start(at))?;
    let mut lines = BufReader::new(file);
    let mut line = Vec::new();
    while lines.read_until(b'\n', &mut line)? > 0 && skipped(&line) {
        line.clear();
        number += 1;
    }
    Ok((number, String::from_utf8_lossy(&line).into_owned()))
}

fn skipped(line: &[u8]) -> bool {
    line.first() == Some(&COMMENT) || line.trim_ascii().is_empty()
}

#[cfg(test)]
mod tests {
    use super::{Checked, NotText, first_line};
    use std::io::{Cursor, Read};

    /// Hands out a few bytes at a time, so that characters are torn apart.
    struct Trickle<'a>(&'a [u8]);

    impl Read for Trickle<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            let count = buffer.len().min(3);
            self.0.read(&mut buffer[..count])
        }
    }

    fn broken_at(bytes: &[u8]) -> Option<u64> {
        let read = Checked::new(Trickle(bytes), 0).read_to_end(&mut Vec::new());
        let found = read.err()?.into_inner()?.downcast::<NotText>().ok()?;
        Some(found.0)
    }

    #[test]
    fn text_passes_in_any_pieces_and_the_first_other_byte_is_named() {
        assert_eq!(broken_at("t,u[µs],°°°\n".as_bytes()), None);
        assert_eq!(broken_at(b"t,u\n\0"), Some(4));
        assert_eq!(broken_at(b"t,u\xe9\n1"), Some(3));
        assert_eq!(broken_at(b"t,u\xc2"), Some(3));
    }

    #[test]
    fn lines_are_counted_over_comments_and_empty_ones() {
        let mut file = Cursor::new("t,u\n\n# a\n1,2\n");
        assert_eq!(first_line(&mut file, 4).unwrap(), (4, "1,2\n".to_owned()));
        assert_eq!(first_line(&mut file, 0).unwrap().0, 1);
    }
}
