//! Recordings that are done.

use super::Session;
use crate::monitor::recording::Saved;
use crate::monitor::view::Kind;

impl Session {
    pub(super) fn save(&mut self) {
        if let Some(recording) = self.recording.take() {
            self.saving.push(recording.save(self.form.clone()));
        }
        self.shared.view(|view| view.status.recording = None);
    }

    /// Tells of recordings that are written; waits for `all` of them, or leaves the rest for later.
    pub(super) fn collect_saved(&mut self, all: bool) {
        for thread in std::mem::take(&mut self.saving) {
            if !all && !thread.is_finished() {
                self.saving.push(thread);
                continue;
            }
            let (kind, text) = match thread.join() {
                Ok(Ok(saved)) => (Kind::Saved, told(&saved)),
                Ok(Err(e)) => (Kind::Warning, e.to_string()),
                Err(_) => (
                    Kind::Warning,
                    "the recording could not be written".to_owned(),
                ),
            };
            self.shared.view(|view| view.note(kind, text));
        }
    }
}

fn told(saved: &Saved) -> String {
    let rows = saved.rows;
    let path = saved.path.display();
    match saved.missing {
        0 => format!("{path}: {rows} rows, without a gap"),
        missing => format!("{path}: {rows} rows; {missing} were lost on the way"),
    }
}
