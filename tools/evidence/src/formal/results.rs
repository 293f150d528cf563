// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generated parts of `docs/verification.md`: proved properties of units and mapped netlists, from `rtl/formal/results.json`, and test
//! modules with the first sentence of each.

mod page;

use super::core::LATCHED;
use crate::documents::between;
use anyhow::{Context, Result, ensure};
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use takt_automation::command::root;
use takt_isa::UNITS;
use takt_isa::spec::machines::MACHINES;

const DOCUMENT: &str = "docs/verification.md";
const RESULTS: &str = "rtl/formal/results.json";
/// Program folders that the document must mention.
const PROGRAMS: [&str; 8] = ["arm", "examples", "hybrid", "kernels", "library", "systems", "three", "robot"];

/// Document updated with the current results.
///
/// # Errors
/// If the document does not mention a unit, a crate, or a folder of programs.
pub(crate) fn document() -> Result<(&'static str, String)> {
    let text =
        fs::read_to_string(root().join(DOCUMENT)).with_context(|| format!("cannot read {DOCUMENT}"))?;
    let results =
        fs::read_to_string(root().join(RESULTS)).with_context(|| format!("cannot read {RESULTS}"))?;
    let results: Value = serde_json::from_str(&results).with_context(|| format!("{RESULTS} is no JSON"))?;
    let manifest: String = fs::read_to_string(root().join("Cargo.toml")).context("cannot read Cargo.toml")?;
    let members =
        manifest.lines().find(|line| line.starts_with("members")).context("the workspace has members")?;
    let members: Vec<&str> = members.split('"').skip(1).step_by(2).collect();
    let whole = between(DOCUMENT, &text, ("proofs", "docs"), &table(&results))?;
    let whole = between(DOCUMENT, &whole, ("cores", "docs"), &cores(&results))?;
    let whole = between(DOCUMENT, &whole, ("bridges", "docs"), &bridges(&results))?;
    let whole = between(DOCUMENT, &whole, ("mapped", "docs"), &mapped(&results))?;
    let whole = between(DOCUMENT, &whole, ("readings", "docs"), &readings(&results))?;
    let whole = between(DOCUMENT, &whole, ("tests", "docs"), &modules(&members)?)?;
    let rows = page::rows()?;
    let whole = ["units", "core", "tools", "programs"].into_iter().try_fold(whole, |whole, section| {
        between(DOCUMENT, &whole, (section, "docs"), &page::table(&rows, section))
    })?;
    let whole = between(
        DOCUMENT,
        &whole,
        ("mutants", "docs"),
        &page::mutants(&crate::mutants::results::results()?)?,
    )?;
    for unit in UNITS {
        ensure!(
            whole.contains(&format!("`{}`", unit.name)),
            "{DOCUMENT} does not tell of the unit `{}`",
            unit.name
        );
    }
    for folder in members {
        ensure!(
            whole.contains(&format!("`{folder}`")),
            "{DOCUMENT} does not tell of the crate in `{folder}`"
        );
    }
    for folder in PROGRAMS {
        ensure!(
            whole.contains(&format!("`programs/{folder}")),
            "{DOCUMENT} does not tell of `programs/{folder}`"
        );
    }
    Ok((DOCUMENT, whole))
}

/// Table of all test modules of all crates, as listed in `tests/main.rs`.
fn modules(members: &[&str]) -> Result<String> {
    let mut text = String::from("| crate's folder | module | what it compares |\n|---|---|---|\n");
    for folder in members {
        let tests = root().join(folder).join("tests");
        let Ok(list) = fs::read_to_string(tests.join("main.rs")) else { continue };
        let names = list.lines().filter_map(|line| line.trim().strip_prefix("mod ")?.strip_suffix(';'));
        for name in names {
            let file = [format!("{name}.rs"), format!("{name}/mod.rs")];
            let file = file.iter().map(|file| tests.join(file)).find(|file| file.is_file());
            // A module with a `#[path]` is shared code without tests.
            let Some(file) = file else { continue };
            let source =
                fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
            if source.contains("#[test]") || name_has_tests(&file) {
                let _ = writeln!(text, "| {folder} | {name} | {} |", first_sentence(&source));
            }
        }
    }
    Ok(text)
}

/// The module is a folder, and one of its files contains tests.
fn name_has_tests(file: &Path) -> bool {
    let files = file
        .ends_with("mod.rs")
        .then(|| file.parent().and_then(|folder| fs::read_dir(folder).ok()))
        .flatten();
    let mut paths = files.into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    paths.any(|path| {
        fs::read_to_string(path).is_ok_and(|text| text.contains("#[test]") || text.contains("proptest!"))
    })
}

/// First sentence of a file's documentation, escaped for a table cell.
fn first_sentence(source: &str) -> String {
    let lines = source.lines().skip_while(|line| !line.starts_with("//!"));
    let lines = lines.map_while(|line| line.strip_prefix("//! "));
    let text = lines.collect::<Vec<_>>().join(" ");
    let end = text.find(". ").map_or(text.len(), |end| end + 1);
    text[..end].replace('|', "\\|")
}

/// Table of the machines with the proofs of their cores.
fn cores(results: &Value) -> String {
    let mut text = String::from(
        "| machine | properties | invariants | registers | a bundle waits for at most | s of solving | proofs checked | planted faults refuted | on |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    let names =
        MACHINES.iter().flat_map(|machine| ["", LATCHED].map(|ports| format!("{}{ports}", machine.name)));
    for name in names {
        let core = &results["core"][&name];
        let [properties, invariants, registers, waits, seconds, checking, refuted, tried] =
            ["properties", "invariants", "registers", "waits", "seconds", "checking", "refuted", "tried"]
                .map(|key| core[key].to_string());
        if core.is_null() {
            let _ = writeln!(text, "| {name} | not proved | | | | | | | |");
            continue;
        }
        let megabytes = core["bytes"].as_f64().unwrap_or_default() / 1e6;
        let faults = if core["tried"].is_null() { "–".to_owned() } else { format!("{refuted} of {tried}") };
        let date = core["date"].as_str().unwrap_or_default();
        let _ = writeln!(
            text,
            "| {name} | {properties} | {invariants} | {registers} | {waits} cycles | {seconds} | {megabytes:.0} MB, {checking} s | {faults} | {date} |"
        );
    }
    text
}

/// Table of the proofs of half bridges and trips.
fn bridges(results: &Value) -> String {
    let mut text = String::from(
        "| what is proved | settings | s of solving | proofs checked | planted faults refuted | on |\n|---|---|---|---|---|---|\n",
    );
    for proof in results["motor"].as_object().into_iter().flatten().map(|(_, proof)| proof) {
        let [settings, seconds, checking, refuted, tried] =
            ["settings", "seconds", "checking", "refuted", "tried"].map(|key| proof[key].to_string());
        let [said, date] = ["text", "date"].map(|key| proof[key].as_str().unwrap_or_default());
        let megabytes = proof["bytes"].as_f64().unwrap_or_default() / 1e6;
        let _ = writeln!(
            text,
            "| {said} | {settings} | {seconds} | {megabytes:.1} MB, {checking} s | {refuted} of {tried} | {date} |"
        );
    }
    text
}

/// Table of the machines whose circuits Verilator and yosys read alike.
fn readings(results: &Value) -> String {
    let mut text = String::from(
        "| machine | circuits | registers | output bits | pins of cells cut out | equal by structure | proofs checked | planted faults refuted | on |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    for (machine, of) in results["reading"].as_object().into_iter().flatten() {
        let numbers = ["circuits", "registers", "outputs", "pins", "structure"];
        let numbers = numbers.map(|key| of[key].to_string()).join(" | ");
        let [proofs, seconds, checking, refuted] =
            ["proofs", "seconds", "checking", "refuted"].map(|key| of[key].to_string());
        let size = of["bytes"].as_f64().unwrap_or_default() / 1e6;
        let date = of["date"].as_str().unwrap_or("–");
        let _ = writeln!(
            text,
            "| {machine} | {numbers} | {proofs}: {size:.1} MB, {seconds} s, checking {checking} s | {refuted} | {date} |"
        );
    }
    text
}

/// Table of the mapped netlists that are proved to equal the Verilog, and list of the cells that were cut out of each.
fn mapped(results: &Value) -> String {
    let mut text = String::from(
        "| machine | registers | mapped | merged | constant | unread | output bits | pins of cells cut out | equal by structure | proofs \
         checked | planted faults refuted | changes that are none | on |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let mut lists = String::new();
    for (machine, of) in results["mapped"].as_object().into_iter().flatten() {
        let numbers = ["registers", "mapped", "merged", "constant", "unread", "outputs", "pins", "structure"];
        let numbers = numbers.map(|key| of[key].to_string()).join(" | ");
        let [proofs, seconds, checking] = ["proofs", "seconds", "checking"].map(|key| of[key].to_string());
        let size = of["bytes"].as_f64().unwrap_or_default() / 1e6;
        let faults = |wanted: &[&str]| {
            let kinds = of["mutants"].as_object().into_iter().flatten();
            let counted = kinds.map(|(kind, of)| {
                let count: u64 = wanted.iter().filter_map(|key| of[key].as_u64()).sum();
                format!("{count} in {kind}")
            });
            counted.collect::<Vec<_>>().join(", ")
        };
        let (refuted, none) = (faults(&["refuted"]), faults(&["unused", "masked"]));
        let date = of["date"].as_str().unwrap_or("–");
        let _ = writeln!(
            text,
            "| {machine} | {numbers} | {proofs}: {size:.1} MB, {seconds} s, checking {checking} s | {refuted} | {none} | {date} |"
        );
        let cut = of["cut"].as_object().into_iter().flatten();
        let cut = cut.map(|(name, count)| format!("`{name}` {}", count.as_str().unwrap_or_default()));
        let _ = writeln!(lists, "\nCut out of {machine}: {}.", cut.collect::<Vec<_>>().join(", "));
    }
    text + &lists
}

/// Table of the units with their proofs.
fn table(results: &Value) -> String {
    let mut text = String::from(
        "| unit | what is compared | cases proved | s of solving | proofs checked | on | timing | mutants refuted |\n|---|---|---|---|---|---|---|---|\n",
    );
    let of = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let proofs = || results["results"].as_object().into_iter().flatten();
    for unit in UNITS {
        let about = |proof: &Value| {
            proof["units"].as_array().is_some_and(|units| units.iter().any(|name| name == unit.name))
        };
        let timing = &results["timing"][unit.name];
        let mutants = &results["mutants"][unit.name];
        let timing = if timing.is_null() {
            "not proved".to_owned()
        } else {
            format!("proved {}", of(&timing["date"]))
        };
        let mutants = if mutants.is_null() {
            "not run".to_owned()
        } else {
            let [refuted, tried, all] = ["refuted", "tried", "of"].map(|key| of(&mutants[key]));
            if tried == all {
                format!("{refuted} of {all}")
            } else {
                format!("{refuted} of the first {tried} of {all}")
            }
        };
        let mut shared = format!("{timing} | {mutants}");
        let mut any = false;
        for (name, proof) in proofs().filter(|(_, proof)| about(proof)) {
            any = true;
            // Tables are compared word by word, and operands enumerated: there is no proof by a solver.
            let certified = match [&proof["proofs"], &proof["bytes"], &proof["checking"]].map(Value::as_f64) {
                [Some(count), Some(bytes), Some(seconds)] if count > 0.0 => {
                    format!("{count}: {:.1} MB, {seconds} s", bytes / 1e6)
                }
                [Some(_), ..] => "none".to_owned(),
                _ => "–".to_owned(),
            };
            let _ = writeln!(
                text,
                "| `{}` | {}: {} | {} of {} | {} | {certified} | {} | {shared} |",
                unit.name,
                name,
                of(&proof["text"]),
                of(&proof["decided"]),
                of(&proof["cases"]),
                of(&proof["seconds"]),
                of(&proof["date"]),
            );
            shared = " | ".to_owned();
        }
        if !any && !results["timing"][unit.name].is_null() {
            let _ = writeln!(text, "| `{}` | timing alone | – | – | – | – | {shared} |", unit.name);
        }
    }
    text
}
