// SPDX-License-Identifier: MIT OR Apache-2.0
//! Records of campaign runs: one line per run in the folder's `runs.jsonl`, and the track record `tools/evidence/campaigns.json`, shown
//! as a table in `docs/figures.md`.

use crate::campaign::figures::MergedResults;
use crate::campaign::plan::Plan;
use crate::campaign::table::Campaign;
use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::ops::Range;
use std::path::PathBuf;
use std::process::Command;
use takt_automation::command::{output_of, root};
use takt_automation::progress;

/// Document with the table of the track record.
pub(crate) const DOCUMENT: &str = "docs/figures.md";

/// A run of a campaign: data that varies between runs, and hence is not in the report.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Run {
    /// Start, date and time in UTC.
    pub(super) begun: String,
    pub(super) seconds: u64,
    /// Executor of the units, as text: local workers or a HyperQueue server.
    pub(super) by: String,
    pub(super) units: [u64; 2],
    /// Number of units finished in this run.
    pub(super) done: u64,
}

impl Run {
    pub(super) fn append(&self, plan: &Plan) -> Result<()> {
        let path = plan.folder().join("runs.jsonl");
        let mut file = OpenOptions::new().create(true).append(true).open(&path)?;
        writeln!(file, "{}", serde_json::to_string(self)?)
            .with_context(|| format!("cannot write {}", path.display()))
    }
}

/// A row of the track record.
#[derive(Debug, Serialize, Deserialize)]
struct Row {
    campaign: String,
    command: String,
    /// Figures of the campaign, in words.
    figures: String,
    failed: u64,
    /// Hosts, and the CPU time used.
    place: String,
    date: String,
}

fn path() -> PathBuf {
    root().join("tools/evidence/campaigns.json")
}

/// Record of the counts of a campaign's parts.
fn path_of_parts(campaign: &str) -> PathBuf {
    root().join(format!("tools/evidence/{campaign}.json"))
}

/// Recorded counts of the parts that a campaign examines.
pub(crate) fn parts(campaign: &str) -> Result<BTreeMap<String, u64>> {
    let path = path_of_parts(campaign);
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("{} is not a record of counts", path.display()))
}

fn rows() -> Result<Vec<Row>> {
    let text =
        std::fs::read_to_string(path()).with_context(|| format!("cannot read {}", path().display()))?;
    serde_json::from_str(&text).with_context(|| format!("{} is not a track record", path().display()))
}

/// Current date and time in UTC.
pub(super) fn now() -> Result<String> {
    Ok(output_of(Command::new("date").args(["-u", "+%FT%TZ"]))?.trim().to_owned())
}

/// CPU time in seconds of this process and its waited-for children; `None` on systems without /proc.
pub(super) fn cpu_seconds() -> Option<f64> {
    // Fields 14 to 17 of proc_pid_stat(5), in hundredths of a second; skip the name, which may contain spaces.
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields = text.rsplit_once(')')?.1.split_whitespace().skip(11).take(4);
    fields.map(|ticks| ticks.parse::<f64>().ok()).sum::<Option<f64>>().map(|ticks| ticks / 100.0)
}

/// Model name of this computer's processor.
pub(super) fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let model = model.map_or(std::env::consts::ARCH, |(_, name)| name.split(" @").next().unwrap_or(name));
    format!("{} cores, {model}", super::cores())
}

/// Adds a campaign to the track record; replaces an earlier row of the same command.
pub(super) fn add(
    campaign: &Campaign,
    plan: &Plan,
    units: &Range<u64>,
    merged: &MergedResults,
    failed: u64,
) -> Result<()> {
    let mut command =
        format!("cargo evidence campaign {} --units {}..{}", campaign.name, units.start, units.end);
    if plan.size != campaign.size {
        let _ = write!(command, " --size {}", plan.size);
    }
    if !plan.rest.is_empty() {
        let _ = write!(command, " -- {}", plan.rest.join(" "));
    }
    let hosts = merged.hosts.iter().cloned().collect::<Vec<_>>().join("; ");
    let time = match merged.timed {
        timed if timed == merged.units => format!("; {} of CPU time", progress::words(merged.seconds)),
        _ => String::new(),
    };
    let row = Row {
        campaign: campaign.name.to_owned(),
        figures: format!("{} units; {}", merged.units, merged.summary()),
        failed,
        place: hosts + &time,
        date: now()?.split('T').next().unwrap_or_default().to_owned(),
        command,
    };
    let parts = merged.parts();
    if !parts.is_empty() {
        std::fs::write(path_of_parts(campaign.name), serde_json::to_string_pretty(&parts)? + "\n")?;
    }
    let mut rows = rows()?;
    rows.retain(|old| old.command != row.command);
    rows.push(row);
    rows.sort_by(|one, other| (&one.campaign, &one.command).cmp(&(&other.campaign, &other.command)));
    std::fs::write(path(), serde_json::to_string_pretty(&rows)? + "\n")?;
    println!("recorded in {}; `cargo xtask docs` writes {DOCUMENT}", super::relative(&path()));
    Ok(())
}

/// Track record as a Markdown table.
pub(crate) fn table() -> Result<String> {
    let mut text = String::from(
        "| campaign | what ran | failed | command | where | when |\n|---|---|---|---|---|---|\n",
    );
    for Row { campaign, command, figures, failed, place, date } in rows()? {
        let _ = writeln!(text, "| {campaign} | {figures} | {failed} | `{command}` | {place} | {date} |");
    }
    Ok(text)
}
