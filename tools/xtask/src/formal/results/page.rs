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

/// Why a mutant survives.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Explanation {
    of: String,
    why: String,
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
    let Explained { mutant: explanations } = toml::from_str(EXPLAINED).context("explained.toml")?;
    let mut text = String::from(
        "| part | mutants there are | tried | no faults, by SAT | found | score | on | command |\n|---|---|---|---|---|---|---|---|\n",
    );
    let mut survivors = String::from("| survivor | reason |\n|---|---|\n");
    for (name, part) in results {
        let of = |key: &str| part[key].as_u64().unwrap_or_default();
        let (tried, equivalent, found) = (of("tried"), of("equivalent"), of("found"));
        let real = tried.saturating_sub(equivalent).max(1);
        let score = 100.0 * found as f64 / real as f64;
        let date = part["date"].as_str().unwrap_or("–");
        let all =
            if ["units", "core"].contains(&name.as_str()) { "–".to_owned() } else { of("all").to_string() };
        let chosen = of("chosen");
        let limit =
            if all == "–" || chosen == of("all") { String::new() } else { format!(" --limit {chosen}") };
        let _ = writeln!(
            text,
            "| {name} | {all} | {tried} | {equivalent} | {found} | {score:.1} % | {date} | `cargo xtask mutants --part {name}{limit}` |"
        );
        for survivor in part["survivors"].as_array().into_iter().flatten().filter_map(Value::as_str) {
            let why = explanations.iter().find(|explanation| survivor.starts_with(&explanation.of));
            let why = why.map_or("not explained yet", |explanation| &explanation.why);
            let _ = writeln!(survivors, "| {} | {why} |", code(survivor));
        }
    }
    Ok(format!("{text}\n{survivors}"))
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

    #[test]
    fn a_command_that_does_not_exist_is_noticed() {
        assert!(has_test("takt-rtl", "every_operand::sine", false));
        assert!(!has_test("takt-rtl", "every_operand::tangent", false));
        assert!(!has_test("takt-isa", "fq_", false));
        assert!(has_test("takt-analysis", "accuracy::brute", true));
        assert!(!has_test("takt-analysis", "accuracy::force", true));
    }
}
