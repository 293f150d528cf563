// SPDX-License-Identifier: MIT OR Apache-2.0
//! Comparison with another build of this program: both measure the emulator in turn, which reveals a slowdown since the last release.

use crate::{Outcome, Ratios};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Option with the path of the other build.
pub(crate) const AGAINST: &str = "--against";

/// Emulator measurements of another build.
pub(crate) struct OtherBuild {
    program: PathBuf,
    /// Rows that both builds measure, by name: this build's ratio divided by the other build's, one per round.
    rows: Vec<(String, Ratios)>,
}

impl OtherBuild {
    pub(crate) fn new(program: &Path) -> OtherBuild {
        OtherBuild { program: program.to_owned(), rows: Vec::new() }
    }

    /// Runs the other build's measurement, and divides this build's rows of the round by it.
    ///
    /// # Errors
    /// If the other build cannot be started, fails, or lacks a row.
    pub(crate) fn round(&mut self, ours: &[(&str, f64)]) -> Outcome<()> {
        let shown = self.program.display();
        let output = Command::new(&self.program).arg("emulator").output();
        let output = output.map_err(|error| format!("{AGAINST} {shown}: {error}"))?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            return Err(format!("{AGAINST} {shown}: it fails ({}): {said}", output.status).into());
        }
        let theirs = rows(&String::from_utf8_lossy(&output.stdout));
        for &(name, ours) in ours {
            let row = theirs.iter().find(|(other, _)| other == name);
            let Some((_, theirs)) = row else {
                return Err(
                    format!("{AGAINST} {shown}: its table of the emulator has no row `{name}`").into()
                );
            };
            match self.rows.iter_mut().find(|(other, _)| other == name) {
                Some((_, ratios)) => ratios.0.push(ours / theirs),
                None => self.rows.push((name.to_owned(), Ratios(vec![ours / theirs]))),
            }
        }
        Ok(())
    }

    /// Cells of a row: median and range of the comparison.
    pub(crate) fn text(&self, name: &str) -> String {
        let row = self.rows.iter().find(|(other, _)| other == name);
        row.map_or_else(String::new, |(_, ratios)| ratios.text())
    }
}

/// Rows of a table `| name | number | …`.
fn rows(text: &str) -> Vec<(String, f64)> {
    let row = |line: &str| {
        let mut cells = line.strip_prefix('|')?.split('|').map(str::trim);
        Some((cells.next()?.to_owned(), cells.next()?.parse().ok()?))
    };
    text.lines().filter_map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_without_a_number_are_skipped() {
        let text = "| | times native | rounds |\n|---|---|---|\n| one run | 5.02 | 4.98 to 5.10 |\n| in a batch of 16, per robot | 1.92 | x |\n";
        let expected = [("one run".to_owned(), 5.02), ("in a batch of 16, per robot".to_owned(), 1.92)];
        assert_eq!(rows(text), expected);
    }

    #[test]
    fn failing_programs_are_named() {
        let error = OtherBuild::new(Path::new("/bin/false")).round(&[("one run", 1.0)]).unwrap_err();
        assert!(error.to_string().starts_with("--against /bin/false: it fails"), "{error}");
        let error = OtherBuild::new(Path::new("/bin/true")).round(&[("one run", 1.0)]).unwrap_err();
        assert_eq!(error.to_string(), "--against /bin/true: its table of the emulator has no row `one run`");
        let error = OtherBuild::new(Path::new("/no/such")).round(&[("one run", 1.0)]).unwrap_err();
        assert!(error.to_string().starts_with("--against /no/such: "), "{error}");
    }
}
