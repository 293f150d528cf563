// SPDX-License-Identifier: MIT OR Apache-2.0
//! Outcomes of mutants: kept in the target folder while a part is measured; scores and survivors are committed in `mutants.json`.

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use takt_automation::command::root;

/// File of committed scores and survivors.
pub(crate) const RESULTS: &str = "tools/evidence/mutants.json";

/// Outcome of a mutant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// Killed by this test, which failed or timed out.
    Found(String),
    /// Proved equivalent, with the argument.
    Equivalent(String),
    /// All tests that reach the mutant passed.
    Survived,
    /// No test reaches the mutant.
    Unreached,
    /// Rejected by the compiler; excluded from the score.
    Stillborn,
}

impl Outcome {
    fn text(&self) -> String {
        match self {
            Outcome::Found(by) => format!("found {by}"),
            Outcome::Equivalent(how) => format!("equivalent {how}"),
            Outcome::Survived => "survived".to_owned(),
            Outcome::Unreached => "unreached".to_owned(),
            Outcome::Stillborn => "stillborn".to_owned(),
        }
    }

    fn of(text: &str) -> Option<Outcome> {
        Some(match text.split_once(' ').unwrap_or((text, "")) {
            ("found", by) => Outcome::Found(by.to_owned()),
            ("equivalent", how) => Outcome::Equivalent(how.to_owned()),
            ("survived", _) => Outcome::Survived,
            ("unreached", _) => Outcome::Unreached,
            ("stillborn", _) => Outcome::Stillborn,
            _ => return None,
        })
    }
}

/// A mutant that no test has killed, as committed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Survivor {
    /// Key of the mutant: file, function, operator and ordinal in Rust; subject, wire, operator and ordinal in a circuit.
    pub(crate) key: String,
    /// Text of the change when the score was measured, or the place in a circuit's source.
    pub(crate) change: String,
    /// A test reaches the mutant.
    #[serde(default = "yes", skip_serializing_if = "Clone::clone")]
    pub(crate) is_reached: bool,
}

fn yes() -> bool {
    true
}

/// Outcomes of a part's mutants that are known so far.
pub(super) struct KnownOutcomes {
    part: String,
    path: PathBuf,
    outcomes: BTreeMap<String, Outcome>,
}

impl KnownOutcomes {
    /// Reads outcomes of earlier runs; empty if `again`.
    pub(super) fn read(part: &str, again: bool) -> Result<KnownOutcomes> {
        let path = root().join("target/mutants").join(format!("{part}.json"));
        let text = if again { String::new() } else { fs::read_to_string(&path).unwrap_or_default() };
        let all: BTreeMap<String, String> = serde_json::from_str(&text).unwrap_or_default();
        let outcomes = all.into_iter().filter_map(|(key, text)| Some((key, Outcome::of(&text)?))).collect();
        Ok(KnownOutcomes { part: part.to_owned(), path, outcomes })
    }

    /// The outcome is final. A survivor is not: tests added since may kill it.
    pub(super) fn has(&self, key: &str) -> bool {
        !matches!(self.outcomes.get(key), None | Some(Outcome::Survived | Outcome::Unreached))
    }

    pub(super) fn put(&mut self, key: String, outcome: Outcome) {
        self.outcomes.insert(key, outcome);
    }

    /// Records an outcome after some of the tests. If none of them reaches a survivor, it remains a survivor.
    pub(super) fn meet(&mut self, key: String, outcome: Outcome) {
        if outcome != Outcome::Unreached || self.outcomes.get(&key) != Some(&Outcome::Survived) {
            self.put(key, outcome);
        }
    }

    pub(super) fn write(&self) -> Result<()> {
        let all: BTreeMap<&String, String> =
            self.outcomes.iter().map(|(key, outcome)| (key, outcome.text())).collect();
        if let Some(parent) = self.path.parent() {
            fs::create_dir_all(parent)?;
        }
        fs::write(&self.path, serde_json::to_string_pretty(&all)? + "\n")
            .with_context(|| format!("cannot write {}", self.path.display()))
    }

    /// Writes the score of these mutants, given by key and change, to the committed file; returns it in words.
    pub(super) fn record(&self, all: usize, mutants: &[(String, String)]) -> Result<String> {
        let (mut found, mut equivalent, mut stillborn) = (0, 0, 0);
        let mut survivors: Vec<Survivor> = Vec::new();
        for (key, change) in mutants {
            let is_reached = match self.outcomes.get(key) {
                Some(Outcome::Found(_)) => {
                    found += 1;
                    continue;
                }
                Some(Outcome::Equivalent(_)) => {
                    equivalent += 1;
                    continue;
                }
                Some(Outcome::Stillborn) => {
                    stillborn += 1;
                    continue;
                }
                outcome => outcome != Some(&Outcome::Unreached),
            };
            survivors.push(Survivor { key: key.clone(), change: change.clone(), is_reached });
        }
        let tried = mutants.len() - stillborn;
        let mut results = results()?;
        results.insert(
            self.part.clone(),
            json!({ "all": all, "chosen": mutants.len(), "tried": tried, "found": found, "equivalent": equivalent, "survivors": survivors, "date": today()? }),
        );
        fs::write(root().join(RESULTS), serde_json::to_string_pretty(&results)? + "\n")
            .with_context(|| format!("cannot write {RESULTS}"))?;
        let real = tried - equivalent;
        Ok(format!(
            "{found} of {real} mutants found, {:.1} %; {equivalent} more are no faults; {all} in all",
            100.0 * f64::from(found) / real.max(1) as f64
        ))
    }
}

/// Committed scores, by part.
pub(crate) fn results() -> Result<Map<String, Value>> {
    let path = root().join(RESULTS);
    if !path.exists() {
        return Ok(Map::new());
    }
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {RESULTS}"))?;
    serde_json::from_str(&text).with_context(|| format!("{RESULTS} is not a JSON object"))
}

/// Current date in UTC.
fn today() -> Result<String> {
    let output = Command::new("date").args(["-u", "+%F"]).output().context("cannot start date")?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
