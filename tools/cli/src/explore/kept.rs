// SPDX-License-Identifier: MIT OR Apache-2.0
//! Results of earlier searches, in the user's cache folder: a file for programs, options and this Takt, a line for each row with its
//! cycles. A line is written as soon as it is known, so that a search that is stopped goes on where it was.

use super::moves::content;
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::PathBuf;

/// The longest file that is read, bytes.
const MOST: u64 = 1 << 26;

/// The cycles of each program on a row; none if one does not fit it.
pub(super) type Known = Option<Vec<u64>>;

pub(super) struct Kept {
    known: HashMap<String, Known>,
    file: Option<File>,
}

impl Kept {
    /// The results known for a key: all that they depend on but the row.
    pub(super) fn open(key: &str) -> Kept {
        let path = folder().join(format!("{:016x}.jsonl", content(key)));
        let is_short = std::fs::metadata(&path).is_ok_and(|about| about.len() <= MOST);
        let text = if is_short { std::fs::read_to_string(&path).unwrap_or_default() } else { String::new() };
        // A line that was cut off is no result.
        let known = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
        let _ = std::fs::create_dir_all(folder());
        let file = OpenOptions::new().create(true).append(true).open(path).ok();
        let mut kept = Kept { known, file };
        if !text.is_empty() && !text.ends_with('\n') {
            kept.append("\n");
        }
        kept
    }

    /// The cycles of a row; `Some(None)` if a program does not fit it.
    pub(super) fn find(&self, row: &str) -> Option<Known> {
        self.known.get(row).cloned()
    }

    pub(super) fn add(&mut self, row: String, cycles: Known) {
        if let Ok(line) = serde_json::to_string(&(&row, &cycles)) {
            self.append(&format!("{line}\n"));
        }
        self.known.insert(row, cycles);
    }

    /// A result that cannot be kept is found again.
    fn append(&mut self, text: &str) {
        if let Some(file) = &mut self.file {
            let _ = file.write_all(text.as_bytes());
        }
    }
}

fn folder() -> PathBuf {
    takt_rtl::verilator::cache_folder().join("explore")
}
