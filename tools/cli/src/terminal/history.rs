// SPDX-License-Identifier: MIT OR Apache-2.0
//! Command history across sessions, in a file of the folder `takt` in XDG's state folder.

use rustyline::Config;
use rustyline::history::{FileHistory, History};
use std::env;
use std::path::{Path, PathBuf};

/// Maximum number of commands in the history.
const COMMANDS: usize = 1000;

/// Configuration of the line editor and its history.
pub(crate) fn config() -> Config {
    Config::builder()
        .auto_add_history(true)
        .max_history_size(COMMANDS)
        .and_then(|builder| builder.history_ignore_dups(true))
        .map_or_else(|_| Config::default(), |builder| builder.build())
}

/// Command history. A missing or unwritable file is not an error.
pub(crate) struct CommandHistory {
    pub(crate) history: FileHistory,
    pub(crate) file: Option<PathBuf>,
}

impl CommandHistory {
    /// Loads the history of earlier sessions from the file of this name.
    pub(crate) fn load(name: &str) -> CommandHistory {
        let mut history = FileHistory::with_config(&config());
        let file = file(name);
        if let Some(file) = &file {
            let _ = history.load(file);
        }
        CommandHistory { history, file }
    }

    /// Adds a command to the history.
    #[cfg(feature = "tui")]
    pub(crate) fn add(&mut self, line: &str) {
        let _ = self.history.add(line);
        append(&mut self.history, self.file.as_deref());
    }

    /// Command `distance` entries back; 1 is the last.
    #[cfg(feature = "tui")]
    pub(crate) fn back(&self, distance: usize) -> Option<String> {
        use rustyline::history::SearchDirection::Forward;
        let index = self.history.len().checked_sub(distance)?;
        self.history.get(index, Forward).ok()?.map(|found| found.entry.into_owned())
    }
}

/// Appends new commands to the file at once, so that they survive however the session ends.
pub(crate) fn append(history: &mut FileHistory, file: Option<&Path>) {
    if let Some(file) = file {
        let _ = file.parent().map(std::fs::create_dir_all);
        let _ = history.append(file);
    }
}

fn file(name: &str) -> Option<PathBuf> {
    let absolute = |name| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let state = absolute("XDG_STATE_HOME").or_else(|| Some(absolute("HOME")?.join(".local/state")))?;
    Some(state.join("takt").join(name))
}
