// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plan of a campaign: copies of the programs at its start, and the parameters of all units.

use crate::campaign::figures::Outcome;
use crate::campaign::record;
use crate::campaign::table::{Call, Campaign, Runs, TARGETS};
use anyhow::{Context, Result, bail, ensure};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_automation::check_cache::Inputs;
use takt_automation::command::{EVERYTHING, cargo, output, root};
use takt_automation::fuzz;
use takt_automation::test_program;
use takt_board::place;
use takt_family::REFERENCE;
use takt_work::Unit;

/// Plan of a campaign, stored as `plan.json`.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Plan {
    /// Folder of the campaign.
    folder: PathBuf,
    pub(super) campaign: String,
    /// Size of a unit, in the campaign's `unit`.
    pub(super) size: u64,
    /// Additional arguments for the program.
    pub(super) rest: Vec<String>,
    /// Working directories of the programs.
    folders: BTreeMap<String, PathBuf>,
}

impl Plan {
    /// Builds the programs, and creates the campaign's folder below `base`; programs and parameters determine its name.
    pub(super) fn make(campaign: &Campaign, size: u64, rest: &[String], base: &Path) -> Result<Plan> {
        let mut inputs = Inputs::default().and((campaign.name, size, rest));
        if campaign.runs == Runs::Seed {
            inputs = inputs.and(place::packages(REFERENCE)?).files("rtl")?.files("isa/src")?;
            // Hash the contents of arguments that are files, such as a machine description.
            for file in rest.iter().filter(|text| Path::new(text).is_file()) {
                inputs = inputs.and(fs::read(file)?);
            }
        }
        if campaign.runs == Runs::Mutants {
            for folder in ["asm", "emu", "isa", "rtl", "tools/evidence"] {
                inputs = inputs.files(folder)?;
            }
        }
        let mut programs = Vec::new();
        for name in campaign.programs() {
            let (path, folder) = build(campaign.runs, name)?;
            inputs = inputs.and(fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?);
            programs.push((name, path, folder));
        }
        let folder = base.join(format!("{}-{}", campaign.name, inputs.text()));
        let folders = programs.iter().map(|(name, _, folder)| ((*name).to_owned(), folder.clone())).collect();
        let plan = Plan { folder, campaign: campaign.name.to_owned(), size, rest: rest.to_vec(), folders };
        fs::create_dir_all(plan.results())
            .with_context(|| format!("cannot make {}", plan.results().display()))?;
        fs::create_dir_all(plan.folder.join("programs"))?;
        programs.push((
            "xtask",
            std::env::current_exe().context("cannot determine the path of this program")?,
            root(),
        ));
        for (name, path, _) in programs {
            copy(&path, &plan.program(name))?;
        }
        if campaign.runs == Runs::Fuzz && !plan.corpus(TARGETS[0]).is_dir() {
            fuzz::corpus(&plan.folder.join("corpus"))?;
        }
        takt_work::write(&plan.path(), &serde_json::to_vec_pretty(&plan)?)?;
        Ok(plan)
    }

    /// Reads the plan; called in the process of a unit.
    pub(super) fn read(path: &Path) -> Result<Plan> {
        let text = fs::read(path).with_context(|| format!("cannot read the plan {}", path.display()))?;
        serde_json::from_slice(&text)
            .with_context(|| format!("{} is not a plan of a campaign", path.display()))
    }

    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    fn path(&self) -> PathBuf {
        self.folder.join("plan.json")
    }

    fn program(&self, name: &str) -> PathBuf {
        self.folder.join("programs").join(name)
    }

    pub(super) fn results(&self) -> PathBuf {
        self.folder.join("results")
    }

    pub(super) fn result(&self, unit: u64) -> PathBuf {
        self.results().join(format!("{unit:06}.json"))
    }

    /// Seed corpus of a fuzz target.
    pub(super) fn corpus(&self, target: &str) -> PathBuf {
        self.folder.join("corpus").join(target)
    }

    /// Command of a unit: runs the copy of this program made with the plan.
    pub(super) fn unit(&self, campaign: &Campaign, unit: u64) -> Unit {
        let texts = [
            self.program("xtask").display().to_string(),
            "campaign".to_owned(),
            campaign.name.to_owned(),
            "--plan".to_owned(),
            self.path().display().to_string(),
            "--unit".to_owned(),
            unit.to_string(),
        ];
        Unit {
            name: format!("{unit:06}"),
            command: texts.to_vec(),
            folder: root(),
            result: self.result(unit),
            cpus: 1,
            time: campaign.time(self.size),
        }
    }

    /// Executes a unit in this process, and writes its result.
    pub(super) fn run(&self, campaign: &Campaign, unit: u64) -> Result<()> {
        ensure!(self.campaign == campaign.name, "the plan is of {}", self.campaign);
        let call = campaign.call(self, unit)?;
        let report = output(&mut self.command(&call))?;
        if !report.is_passed {
            eprint!("{}", report.text);
            bail!("failed: {}", self.command_text(&call));
        }
        let figures = campaign.figures(unit, &report.text).with_context(|| self.command_text(&call))?;
        let outcome = Outcome { figures, seconds: record::cpu_seconds(), host: record::processor() };
        takt_work::write(&self.result(unit), &serde_json::to_vec(&outcome)?)?;
        let scratch = self.scratch(unit);
        if scratch.is_dir() {
            fs::remove_dir_all(scratch)?;
        }
        Ok(())
    }

    /// Private folder of a unit for its program's files.
    pub(super) fn scratch(&self, unit: u64) -> PathBuf {
        self.results().join(format!("{unit:06}.files"))
    }

    fn command(&self, call: &Call) -> Command {
        let folder = self.folders.get(&call.program).cloned().unwrap_or_else(root);
        let mut command = Command::new(self.program(&call.program));
        // Set the environment that cargo would set.
        command.env("CARGO_MANIFEST_DIR", &folder).env("CARGO_PKG_NAME", &call.program).current_dir(folder);
        command.args(&call.arguments).envs(call.variables.iter().map(|(name, value)| (name, value)));
        command
    }

    /// The call as a shell command line.
    fn command_text(&self, call: &Call) -> String {
        let variables = call.variables.iter().map(|(name, value)| format!("{name}={value} "));
        let program = self.program(&call.program).display().to_string();
        let words = [program].into_iter().chain(call.arguments.iter().cloned()).collect::<Vec<_>>();
        variables.collect::<String>() + &words.join(" ")
    }
}

/// Builds a program; returns its path and its working directory.
fn build(runs: Runs, name: &str) -> Result<(PathBuf, PathBuf)> {
    match runs {
        Runs::Fuzz => Ok((fuzz::build(name)?, root())),
        Runs::Test(..) => test_program::program(name),
        Runs::Robots | Runs::Seed | Runs::Mutants => {
            takt_automation::command::run(cargo().args([
                "build",
                "--quiet",
                "--release",
                "--package",
                name,
                "--features",
                EVERYTHING,
            ]))?;
            Ok((root().join("target/release").join(name), root()))
        }
    }
}

/// Copies a program under another name and then renames it, since the old file may be running.
fn copy(from: &Path, to: &Path) -> Result<()> {
    if from == to {
        return Ok(());
    }
    let partial = to.with_extension(format!("{}.partial", std::process::id()));
    fs::copy(from, &partial)
        .and_then(|_| fs::rename(&partial, to))
        .with_context(|| format!("cannot write {}", to.display()))
}
