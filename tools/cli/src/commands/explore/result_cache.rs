// SPDX-License-Identifier: MIT OR Apache-2.0
//! Results of earlier searches in the user's cache: one file for each combination of programs, options and build, with one line per row
//! that has its cycles and a checksum. Lines are written as soon as they are known, so that a stopped search can resume.

use super::moves::content;
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write as _;

/// Cycles of each program on a row; `None` if a program does not fit.
pub(super) type CachedCycles = Option<Vec<u64>>;

pub(super) struct ResultCache {
    known: HashMap<String, CachedCycles>,
    file: Option<File>,
}

impl ResultCache {
    /// Opens the stored results for a key.
    pub(super) fn open(key: &str) -> ResultCache {
        let folder = takt_cache::folder().ok().map(|folder| folder.join("explore"));
        let path = folder.as_ref().map(|folder| folder.join(format!("{:016x}.jsonl", content(key))));
        let bytes = path.as_deref().and_then(takt_cache::plain);
        if let Some(path) = path.as_deref().filter(|_| bytes.is_none()) {
            takt_cache::discard(path);
        }
        let bytes = bytes.unwrap_or_default();
        // Ignore truncated and damaged lines.
        let known = bytes.split(|byte| *byte == b'\n').filter_map(read_line).collect();
        let _ = folder.map(std::fs::create_dir_all);
        let file = path.and_then(|path| OpenOptions::new().create(true).append(true).open(path).ok());
        let mut kept = ResultCache { known, file };
        if !bytes.is_empty() && !bytes.ends_with(b"\n") {
            kept.append("\n");
        }
        kept
    }

    /// Cycles of a row, if stored; `Some(None)` if a program does not fit it.
    pub(super) fn find(&self, row: &str) -> Option<CachedCycles> {
        self.known.get(row).cloned()
    }

    pub(super) fn add(&mut self, row: String, cycles: CachedCycles) {
        if let Ok(line) = serde_json::to_string(&(&row, &cycles)) {
            self.append(&format!("{:016x} {line}\n", content(&line)));
        }
        self.known.insert(row, cycles);
    }

    /// Appends text to the file. Errors are ignored: a missing result is computed again.
    fn append(&mut self, text: &str) {
        if let Some(file) = &mut self.file {
            let _ = file.write_all(text.as_bytes());
        }
    }
}

/// Parses a line into row and cycles; `None` if the checksum is wrong.
fn read_line(line: &[u8]) -> Option<(String, CachedCycles)> {
    let (sum, line) = std::str::from_utf8(line).ok()?.split_once(' ')?;
    (u64::from_str_radix(sum, 16) == Ok(content(line))).then(|| serde_json::from_str(line).ok())?
}
