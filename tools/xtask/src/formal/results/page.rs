// SPDX-License-Identifier: MIT OR Apache-2.0
//! The tables of `docs/verification.md` that are made of rows in `verification.toml` and of mutants' outcomes.

use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use serde_json::Value;
use std::fmt::Write as _;

const ROWS: &str = include_str!("verification.toml");
const EXPLAINED: &str = include_str!("../../mutants/explained.toml");

/// A row of the page: a part, and what stands for its correctness.
#[derive(Deserialize, Debug)]
#[serde(deny_unknown_fields)]
pub(super) struct Row {
    section: String,
    part: String,
    oracle: String,
    kind: String,
    how: String,
    /// The day on which all that the row states ran last; none where CI runs it.
    #[serde(default)]
    date: String,
    /// The command that does it again; none if nothing does.
    command: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Rows {
    row: Vec<Row>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Explained {
    mutant: Vec<Explanation>,
}

/// Why mutants survive.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Explanation {
    /// The mutants, each in full.
    of: Vec<String>,
    why: String,
    /// True if they are no faults: every result is the same, or only time or memory of the tool differ.
    no_fault: bool,
}

/// What `results.json` adds to a mutant that no test reaches.
const UNREACHED: &str = " (no test comes there)";

fn explanations() -> Result<Vec<Explanation>> {
    let Explained { mutant } = toml::from_str(EXPLAINED).context("explained.toml")?;
    Ok(mutant)
}

/// The explanation of a survivor.
fn explained<'a>(explanations: &'a [Explanation], survivor: &str) -> Option<&'a Explanation> {
    let survivor = survivor.strip_suffix(UNREACHED).unwrap_or(survivor);
    explanations.iter().find(|explanation| explanation.of.iter().any(|of| of == survivor))
}

/// The survivors of a part.
fn survivors(part: &Value) -> impl Iterator<Item = &str> {
    part["survivors"].as_array().into_iter().flatten().filter_map(Value::as_str)
}

/// The kinds of evidence.
const KINDS: [&str; 4] = ["proved", "exhaustive", "tested", "not verified"];

/// The rows of the page.
///
/// # Errors
/// If the file is damaged.
pub(super) fn rows() -> Result<Vec<Row>> {
    let Rows { row } = toml::from_str(ROWS).context("verification.toml")?;
    for Row { part, kind, command, .. } in &row {
        ensure!(KINDS.contains(&kind.as_str()), "verification.toml: {part}: there is no kind `{kind}`");
        let none = kind == "not verified";
        ensure!(command.is_empty() == none, "verification.toml: {part}: a command, or `not verified`");
    }
    Ok(row)
}

/// The table of a section.
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

/// The table of mutation scores, and the survivors, each with the reason if one is known.
///
/// # Errors
/// If the explanations are damaged.
pub(super) fn mutants(results: &serde_json::Map<String, Value>) -> Result<String> {
    let explanations = explanations()?;
    let mut text = String::from(
        "| part | mutants there are | tried | no faults, by SAT | no faults, by argument | found | score | on | command |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    let mut rows = String::from("| survivor | a fault? | reason |\n|---|---|---|\n");
    for (name, part) in results {
        let of = |key: &str| part[key].as_u64().unwrap_or_default();
        let (tried, equivalent, found) = (of("tried"), of("equivalent"), of("found"));
        let is_none = |survivor: &&str| {
            explained(&explanations, survivor).is_some_and(|explanation| explanation.no_fault)
        };
        let argued = survivors(part).filter(is_none).count() as u64;
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
            "| {name} | {all} | {tried} | {equivalent} | {argued} | {found} | {score:.1} % | {date} | `cargo xtask mutants --part {name}{limit}` |"
        );
        for survivor in survivors(part) {
            let (fault, why) = match explained(&explanations, survivor) {
                Some(explanation) => {
                    (if explanation.no_fault { "no" } else { "yes" }, explanation.why.as_str())
                }
                None => ("unknown", "not explained yet"),
            };
            let _ = writeln!(rows, "| {} | {fault} | {why} |", code(survivor));
        }
    }
    Ok(format!("{text}\n{rows}"))
}

/// A survivor as code in a table's cell.
fn code(text: &str) -> String {
    format!("`{}`", text.replace('|', "\\|").replace('`', "'"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::root;
    use clap::Parser;
    use std::fs;

    /// The folder of a package in the workspace.
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

    /// True if a test of a package has this path, or a module of its tests does.
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
        // A function may be made by a macro: then its name and a colon stand in the list of the macro.
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

    /// A stranger can run every row again: the commands are there, with these options, and so are the tests that they name.
    #[test]
    fn every_command_exists() {
        let mutants = crate::mutants::results::results().unwrap();
        let page = super::mutants(&mutants).unwrap();
        let scores =
            page.split('`').filter(|piece| piece.starts_with("cargo xtask mutants")).map(str::to_owned);
        let commands =
            rows().unwrap().into_iter().map(|row| row.command).filter(|command| !command.is_empty());
        for command in commands.chain(scores) {
            let words: Vec<&str> = command.split(' ').skip_while(|word| word.contains('=')).collect();
            match words[..] {
                ["cargo", "xtask", ..] => {
                    let parsed = crate::Arguments::try_parse_from(&words[1..]);
                    assert!(parsed.is_ok(), "{command}: {}", parsed.err().unwrap());
                }
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

    /// Every survivor has one explanation, and every explanation is of survivors.
    #[test]
    fn survivors_are_explained() {
        let results = crate::mutants::results::results().unwrap();
        let all: Vec<&str> = results
            .values()
            .flat_map(survivors)
            .map(|survivor| survivor.strip_suffix(UNREACHED).unwrap_or(survivor))
            .collect();
        let explanations = explanations().unwrap();
        let mut explained: Vec<&String> =
            explanations.iter().flat_map(|explanation| &explanation.of).collect();
        for survivor in &all {
            assert!(explained.iter().any(|of| of == survivor), "explained.toml does not explain {survivor}");
        }
        explained.sort_unstable();
        assert!(explained.windows(2).all(|pair| pair[0] != pair[1]), "explained twice: {explained:?}");
        for of in explained {
            assert!(all.contains(&of.as_str()), "explained.toml: no survivor is {of}");
        }
    }

    #[test]
    fn a_score_leaves_out_what_is_no_fault() {
        let survivor = explanations().unwrap().into_iter().find(|explanation| explanation.no_fault);
        let survivor = format!("{}{UNREACHED}", survivor.expect("some are no faults").of[0]);
        let part = serde_json::json!({
            "all": 12, "chosen": 12, "tried": 11, "found": 8, "equivalent": 1, "survivors": [survivor, "no such place"], "date": "day"
        });
        let page = super::mutants(&[("timing".to_owned(), part)].into_iter().collect()).unwrap();
        // 8 of 11 - 1 - 1.
        assert!(page.contains("| timing | 12 | 11 | 1 | 1 | 8 | 88.9 % | day |"), "{page}");
        assert!(page.contains("| `no such place` | unknown | not explained yet |"), "{page}");
    }

    #[test]
    fn a_command_that_does_not_exist_is_noticed() {
        assert!(has_test("takt-rtl", "units::sine", false));
        assert!(!has_test("takt-rtl", "units::tangent", false));
        assert!(!has_test("takt-isa", "fq_", false));
        assert!(has_test("takt-analysis", "accuracy::brute", true));
        assert!(!has_test("takt-analysis", "accuracy::force", true));
    }
}
