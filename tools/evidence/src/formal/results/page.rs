// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tables of `docs/verification.md`, from the rows of `verification.toml` and from the outcomes of mutants.

use crate::mutants::results::Survivor;
use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use serde_json::Value;
use std::fmt::Write as _;

const ROWS: &str = include_str!("../../../verification.toml");
const EXPLAINED: &str = include_str!("../../../survivors.toml");

/// A row of the document: a part of the project, and the evidence for its correctness.
#[derive(Deserialize, Debug)]
#[serde(deny_unknown_fields)]
pub(super) struct Row {
    section: String,
    part: String,
    oracle: String,
    kind: String,
    how: String,
    /// Date of the last complete run of the evidence in the row; empty if CI runs it.
    #[serde(default)]
    date: String,
    /// Command that repeats the evidence; empty if none exists.
    command: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Rows {
    row: Vec<Row>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ExplanationFile {
    mutant: Vec<Explanation>,
}

/// Explanation of surviving mutants.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Explanation {
    /// Keys of the explained mutants.
    of: Vec<String>,
    why: String,
    /// The mutants are equivalent: results are the same, and at most time or memory of the tool differ.
    no_fault: bool,
}

fn explanations() -> Result<Vec<Explanation>> {
    let ExplanationFile { mutant } = toml::from_str(EXPLAINED).context("survivors.toml")?;
    Ok(mutant)
}

/// Looks up the explanation of a surviving mutant.
fn explained<'a>(explanations: &'a [Explanation], survivor: &Survivor) -> Option<&'a Explanation> {
    explanations.iter().find(|explanation| explanation.of.contains(&survivor.key))
}

/// Surviving mutants of a part.
fn survivors(part: &Value) -> Result<Vec<Survivor>> {
    serde_json::from_value(part["survivors"].clone()).context("survivors of mutants.json")
}

/// Permitted kinds of evidence.
const KINDS: [&str; 4] = ["proved", "exhaustive", "tested", "not verified"];

/// Reads and checks the rows of `verification.toml`.
///
/// # Errors
/// If the file is malformed.
pub(super) fn rows() -> Result<Vec<Row>> {
    let Rows { row } = toml::from_str(ROWS).context("verification.toml")?;
    for Row { part, kind, command, .. } in &row {
        ensure!(KINDS.contains(&kind.as_str()), "verification.toml: {part}: there is no kind `{kind}`");
        let none = kind == "not verified";
        ensure!(command.is_empty() == none, "verification.toml: {part}: a command, or `not verified`");
    }
    Ok(row)
}

/// Table of a section.
pub(super) fn table(rows: &[Row], section: &str) -> String {
    let mut text = String::from(
        "| part | oracle | evidence | how much | whole last run | command |\n|---|---|---|---|---|---|\n",
    );
    for row in rows.iter().filter(|row| row.section == section) {
        let Row { part, oracle, kind, how, date, command, .. } = row;
        let date = match (date.as_str(), kind.as_str()) {
            ("", "not verified") => "–",
            ("", _) => "in CI",
            (date, _) => date,
        };
        let command = if command.is_empty() { "–".to_owned() } else { format!("`{command}`") };
        let _ = writeln!(text, "| {part} | {oracle} | {kind} | {how} | {date} | {command} |");
    }
    text
}

/// Table of mutation scores, and list of surviving mutants with explanations.
///
/// # Errors
/// If the explanations are malformed.
pub(super) fn mutants(results: &serde_json::Map<String, Value>) -> Result<String> {
    let explanations = explanations()?;
    let mut text = String::from(
        "| part | mutants there are | tried | no faults, by SAT | no faults, by argument | found | score | on | command |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    let mut rows = String::from(
        "| survivor | change, or place in the circuit | a fault? | reason |\n|---|---|---|---|\n",
    );
    for (name, part) in results {
        let of = |key: &str| part[key].as_u64().unwrap_or_default();
        let (tried, equivalent, found) = (of("tried"), of("equivalent"), of("found"));
        let is_none = |survivor: &&Survivor| {
            explained(&explanations, survivor).is_some_and(|explanation| explanation.no_fault)
        };
        let survivors = survivors(part)?;
        let argued = survivors.iter().filter(is_none).count() as u64;
        let real = tried.saturating_sub(equivalent + argued).max(1);
        let score = 100.0 * found as f64 / real as f64;
        let date = part["date"].as_str().unwrap_or("–");
        let is_circuit = ["units", "core", "board"].contains(&name.as_str());
        let all = if is_circuit { "–".to_owned() } else { of("all").to_string() };
        let chosen = of("chosen");
        let limit =
            if is_circuit || chosen == of("all") { String::new() } else { format!(" --limit {chosen}") };
        let _ = writeln!(
            text,
            "| {name} | {all} | {tried} | {equivalent} | {argued} | {found} | {score:.1} % | {date} | `cargo evidence mutants --part {name}{limit}` |"
        );
        for survivor in &survivors {
            let (fault, why) = match explained(&explanations, survivor) {
                Some(explanation) => {
                    (if explanation.no_fault { "no" } else { "yes" }, explanation.why.as_str())
                }
                None => ("unknown", "not explained yet"),
            };
            let reached = if survivor.is_reached { "" } else { " (no test comes there)" };
            let (key, change) = (code(&survivor.key), code(&survivor.change));
            let _ = writeln!(rows, "| {key} | {change}{reached} | {fault} | {why} |");
        }
    }
    Ok(format!("{text}\n{rows}"))
}

/// Formats text as code in a table cell.
fn code(text: &str) -> String {
    format!("`{}`", text.replace('|', "\\|").replace('`', "'"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use std::fs;
    use takt_automation::XTASK;
    use takt_automation::command::root;

    /// Folder of a package in the workspace.
    fn folder(package: &str) -> Option<std::path::PathBuf> {
        let manifest = fs::read_to_string(root().join("Cargo.toml")).unwrap();
        let members = manifest.lines().find(|line| line.starts_with("members")).unwrap();
        let folders = members.split('"').skip(1).step_by(2).map(|folder| root().join(folder));
        let name = format!("name = \"{package}\"");
        folders.into_iter().find(|folder| {
            fs::read_to_string(folder.join("Cargo.toml"))
                .is_ok_and(|text| text.lines().any(|line| line == name))
        })
    }

    /// The package has a test, or a test module, with this path.
    fn has_test(package: &str, path: &str, is_lib: bool) -> bool {
        let folder = folder(package).unwrap_or_else(|| panic!("there is no package {package}"));
        let (module, function) = path.split_once("::").unwrap_or((path, ""));
        if is_lib {
            let last = path.rsplit("::").next().unwrap_or(path);
            return fs::read_dir(folder.join("src").join(module)).is_ok_and(|files| {
                files.flatten().any(|file| file.file_name().to_str() == Some(&format!("{last}.rs")))
            });
        }
        let list = fs::read_to_string(folder.join("tests/main.rs")).unwrap();
        let modules: Vec<&str> =
            list.lines().filter_map(|line| line.strip_prefix("mod ")?.strip_suffix(';')).collect();
        let begins = modules
            .iter()
            .any(|name| if path.contains("::") { *name == module } else { name.starts_with(module) });
        let text = fs::read_to_string(folder.join(format!("tests/{module}.rs"))).unwrap_or_default();
        // A macro may generate the function: look for the name followed by a colon in the macro's list.
        let named = function.is_empty()
            || [
                format!("fn {function}("),
                format!(" {function}:"),
                format!(" {function},"),
                format!(" {function} "),
            ]
            .iter()
            .any(|named| text.contains(named));
        begins && named
    }

    /// Every row can be reproduced: its command exists, with these options, and so do the tests that it names.
    #[test]
    fn every_command_exists() {
        let mutants = crate::mutants::results::results().unwrap();
        let page = super::mutants(&mutants).unwrap();
        let scores =
            page.split('`').filter(|piece| piece.starts_with("cargo evidence mutants")).map(str::to_owned);
        let commands =
            rows().unwrap().into_iter().map(|row| row.command).filter(|command| !command.is_empty());
        for command in commands.chain(scores) {
            let words: Vec<&str> = command.split(' ').skip_while(|word| word.contains('=')).collect();
            match words[..] {
                ["cargo", "evidence", ..] => {
                    let parsed = crate::Arguments::try_parse_from(&words[1..]);
                    assert!(parsed.is_ok(), "{command}: {}", parsed.err().unwrap());
                }
                ["cargo", "xtask", task, ..] => assert!(XTASK.contains(&task), "{command}"),
                ["cargo", "test", "--release", "-p", package, ..] => {
                    let is_lib = words.contains(&"--lib");
                    assert!(is_lib || words.windows(2).any(|pair| pair == ["--test", "suite"]), "{command}");
                    let last = words[words.len() - 1];
                    if !["suite", "full"].contains(&last) {
                        assert!(has_test(package, last, is_lib), "{command}: there is no test `{last}`");
                    } else {
                        assert!(folder(package).is_some(), "{command}");
                    }
                }
                _ => panic!("`{command}` is no command of the project"),
            }
        }
    }

    /// Every survivor has exactly one explanation, and every explanation refers to survivors.
    #[test]
    fn survivors_are_explained() {
        let results = crate::mutants::results::results().unwrap();
        let all: Vec<String> =
            results.values().flat_map(|part| survivors(part).unwrap()).map(|survivor| survivor.key).collect();
        let explanations = explanations().unwrap();
        let mut explained: Vec<&String> =
            explanations.iter().flat_map(|explanation| &explanation.of).collect();
        for survivor in &all {
            assert!(explained.contains(&survivor), "survivors.toml does not explain {survivor}");
        }
        explained.sort_unstable();
        assert!(explained.windows(2).all(|pair| pair[0] != pair[1]), "explained twice: {explained:?}");
        for of in explained {
            assert!(all.contains(of), "survivors.toml: no survivor is {of}");
        }
    }

    #[test]
    fn score_excludes_equivalent_mutants() {
        let survivor = explanations().unwrap().into_iter().find(|explanation| explanation.no_fault);
        let key = &survivor.expect("some are no faults").of[0];
        let survivors = serde_json::json!([
            { "key": key, "change": "a → b", "is_reached": false },
            { "key": "no such place", "change": "c → d" }
        ]);
        let part = serde_json::json!({
            "all": 12, "chosen": 12, "tried": 11, "found": 8, "equivalent": 1, "survivors": survivors, "date": "day"
        });
        let page = super::mutants(&[("timing".to_owned(), part)].into_iter().collect()).unwrap();
        // Score: 8 of 11 - 1 - 1.
        assert!(page.contains("| timing | 12 | 11 | 1 | 1 | 8 | 88.9 % | day |"), "{page}");
        assert!(page.contains("| `a → b` (no test comes there) | no |"), "{page}");
        assert!(page.contains("| `no such place` | `c → d` | unknown | not explained yet |"), "{page}");
    }

    #[test]
    fn a_command_that_does_not_exist_is_noticed() {
        assert!(has_test("takt-rtl", "units::sine", false));
        assert!(!has_test("takt-rtl", "units::tangent", false));
        assert!(!has_test("takt-isa", "fq_", false));
        assert!(has_test("takt-analysis", "accuracy::brute_force", true));
        assert!(!has_test("takt-analysis", "accuracy::force", true));
    }
}
