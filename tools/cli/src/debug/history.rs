// SPDX-License-Identifier: MIT OR Apache-2.0
//! The commands of earlier sessions, in a file of the user's: `takt/history` where XDG has state.

use rustyline::Config;
use rustyline::history::{FileHistory, History};
use std::env;
use std::path::{Path, PathBuf};

/// Commands that are kept.
const COMMANDS: usize = 1000;

/// The configuration of line and history.
pub(super) fn config() -> Config {
    Config::builder()
        .auto_add_history(true)
        .max_history_size(COMMANDS)
        .and_then(|builder| builder.history_ignore_dups(true))
        .map_or_else(|_| Config::default(), |builder| builder.build())
}

/// Commands, oldest first. That there is no file, or none can be written, is no reason not to debug.
pub(super) struct Past {
    pub(super) history: FileHistory,
    pub(super) file: Option<PathBuf>,
}

impl Past {
    /// Those of earlier sessions.
    pub(super) fn load() -> Past {
        let mut history = FileHistory::with_config(&config());
        let file = file();
        if let Some(file) = &file {
            let _ = history.load(file);
        }
        Past { history, file }
    }

    /// Adds a command to them.
    #[cfg(feature = "tui")]
    pub(super) fn add(&mut self, line: &str) {
        let _ = self.history.add(line);
        append(&mut self.history, self.file.as_deref());
    }

    /// The command so many back, 1 being the last.
    #[cfg(feature = "tui")]
    pub(super) fn back(&self, distance: usize) -> Option<String> {
        use rustyline::history::SearchDirection::Forward;
        let index = self.history.len().checked_sub(distance)?;
        self.history.get(index, Forward).ok()?.map(|found| found.entry.into_owned())
    }
}

/// Writes the commands that are not in the file yet: at once, so that they are not lost however the session ends.
pub(super) fn append(history: &mut FileHistory, file: Option<&Path>) {
    if let Some(file) = file {
        let _ = file.parent().map(std::fs::create_dir_all);
        let _ = history.append(file);
    }
}

fn file() -> Option<PathBuf> {
    let absolute = |name| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let state = absolute("XDG_STATE_HOME").or_else(|| Some(absolute("HOME")?.join(".local/state")))?;
    Some(state.join("takt/history"))
}
