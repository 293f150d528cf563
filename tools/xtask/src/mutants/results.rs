// SPDX-License-Identifier: MIT OR Apache-2.0
//! Outcomes of mutants: those of a part in the target folder, while it is measured; scores and survivors in `results.json`, committed.

use crate::root;
use anyhow::{Context, Result};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

/// Scores and survivors.
pub(crate) const RESULTS: &str = "tools/xtask/src/mutants/results.json";

/// The outcome of a mutant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// A test failed, or did not end: which.
    Found(String),
    /// It was shown to be no fault: how.
    Equivalent(String),
    /// All tests passed.
    Survived,
    /// No test comes to the place.
    Unreached,
    /// The compiler refuses it, so that it is none.
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

/// What is known of a part's mutants.
pub(super) struct Known {
    part: String,
    path: PathBuf,
    outcomes: BTreeMap<String, Outcome>,
}

impl Known {
    /// What earlier runs have left; nothing if it is to be measured again.
    pub(super) fn read(part: &str, again: bool) -> Result<Known> {
        let path = root().join("target/mutants").join(format!("{part}.json"));
        let text = if again { String::new() } else { fs::read_to_string(&path).unwrap_or_default() };
        let all: BTreeMap<String, String> = serde_json::from_str(&text).unwrap_or_default();
        let outcomes = all.into_iter().filter_map(|(key, text)| Some((key, Outcome::of(&text)?))).collect();
        Ok(Known { part: part.to_owned(), path, outcomes })
    }

    /// True if a mutant's outcome is known. One that survived meets tests that have come since.
    pub(super) fn has(&self, key: &str) -> bool {
        !matches!(self.outcomes.get(key), None | Some(Outcome::Survived | Outcome::Unreached))
    }

    pub(super) fn put(&mut self, key: String, outcome: Outcome) {
        self.outcomes.insert(key, outcome);
    }

    /// Puts the outcome of a mutant that has met tests, perhaps not all: others may come to its place.
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

    /// Writes the score of these mutants to the committed file. Returns it in words.
    pub(super) fn record(&self, all: usize, keys: &[String]) -> Result<String> {
        let (mut found, mut equivalent, mut stillborn) = (0, 0, 0);
        let mut survivors: Vec<String> = Vec::new();
        for key in keys {
            match self.outcomes.get(key) {
                Some(Outcome::Found(_)) => found += 1,
                Some(Outcome::Equivalent(_)) => equivalent += 1,
                Some(Outcome::Stillborn) => stillborn += 1,
                Some(Outcome::Unreached) => survivors.push(format!("{key} (no test comes there)")),
                _ => survivors.push(key.clone()),
            }
        }
        let tried = keys.len() - stillborn;
        let mut results = results()?;
        results.insert(
            self.part.clone(),
            json!({ "all": all, "chosen": keys.len(), "tried": tried, "found": found, "equivalent": equivalent, "survivors": survivors, "date": today()? }),
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

/// The committed scores by part.
pub(crate) fn results() -> Result<Map<String, Value>> {
    let path = root().join(RESULTS);
    if !path.exists() {
        return Ok(Map::new());
    }
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {RESULTS}"))?;
    serde_json::from_str(&text).with_context(|| format!("{RESULTS} is no JSON object"))
}

/// The date, in UTC.
fn today() -> Result<String> {
    let output = Command::new("date").args(["-u", "+%F"]).output().context("cannot start date")?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
