// SPDX-License-Identifier: MIT OR Apache-2.0
//! How many functions of C projects `takt cc` translates: each function as the step, in checkouts at the commits of `c.toml`.

use anyhow::{Context, Result, bail};
use clap::Args;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_automation::command::{root, run};
use takt_front::c::{Candidate, Options, Preprocessor, candidates};

const PROJECTS: &str = include_str!("../c.toml");
/// Document with the tables.
const DOCUMENT: &str = "docs/c.md";
/// Number of reasons in the table of refusals.
const REASONS: usize = 12;

#[derive(Args)]
pub(crate) struct Arguments {
    /// Folder with the projects' checkouts, or where to clone them.
    #[arg(long, value_name = "DIR", default_value = "target/checkouts")]
    checkouts: PathBuf,
    /// Print every function that is refused.
    #[arg(long)]
    refused: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Projects {
    project: Vec<Project>,
}

/// A project, with what its build gives the compiler.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Project {
    /// Name of the checkout's folder.
    folder: String,
    /// Name in the table.
    name: String,
    repository: String,
    commit: String,
    /// Files that are translated together.
    files: Vec<Vec<String>>,
    #[serde(default)]
    include: Vec<String>,
    #[serde(default)]
    define: Vec<String>,
    /// Headers of a system or of generated code, and what is needed of them.
    #[serde(default)]
    headers: BTreeMap<String, String>,
    /// Lengths and orders that callers give.
    #[serde(default)]
    set: BTreeMap<String, Numbers>,
}

/// The number of a scalar, or the numbers of an array.
#[derive(Deserialize)]
#[serde(untagged)]
enum Numbers {
    One(f64),
    Many(Vec<f64>),
}

impl Numbers {
    fn list(&self) -> Vec<f64> {
        match self {
            Numbers::One(number) => vec![*number],
            Numbers::Many(numbers) => numbers.clone(),
        }
    }
}

/// Counts, prints both tables and writes them to the document.
pub(crate) fn count(arguments: &Arguments) -> Result<()> {
    let projects: Projects = toml::from_str(PROJECTS).context("tools/evidence/c.toml")?;
    let mut table = "| project | functions | translated | share |\n|---|---|---|---|\n".to_owned();
    let mut reasons: BTreeMap<String, usize> = BTreeMap::new();
    let (mut functions, mut translated) = (0, 0);
    for project in &projects.project {
        let folder = arguments.checkouts.join(&project.folder);
        check_out(project, &folder)?;
        let found = tried(project, &folder).with_context(|| project.name.clone())?;
        let good = found.iter().filter(|candidate| candidate.translation.is_ok()).count();
        (functions, translated) = (functions + found.len(), translated + good);
        let _ =
            writeln!(table, "| {} | {} | {good} | {} |", project.name, found.len(), share(good, found.len()));
        for candidate in &found {
            if let Err(error) = &candidate.translation {
                if arguments.refused {
                    println!("{}:{} {}: {error}", candidate.file, candidate.line, candidate.name);
                }
                *reasons.entry(reason(&error.text)).or_default() += 1;
            }
        }
    }
    let _ = writeln!(table, "| all | {functions} | {translated} | {} |", share(translated, functions));
    let mut reasons: Vec<(String, usize)> = reasons.into_iter().collect();
    reasons.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    let others: usize = reasons.iter().skip(REASONS).map(|(_, count)| count).sum();
    table.push_str("\n| refused | functions |\n|---|---|\n");
    for (reason, count) in reasons.iter().take(REASONS) {
        let _ = writeln!(table, "| {reason} | {count} |");
    }
    if others > 0 {
        let _ = writeln!(table, "| others | {others} |");
    }
    print!("{table}");
    let path = root().join(DOCUMENT);
    let text = fs::read_to_string(&path)?;
    fs::write(&path, crate::documents::between(DOCUMENT, &text, ("functions", "c"), &table)?)?;
    Ok(())
}

fn share(good: usize, of: usize) -> String {
    if of == 0 { "-".to_owned() } else { format!("{:.0} %", 100.0 * good as f64 / of as f64) }
}

/// The reason of a refusal without the names and the mend.
fn reason(text: &str) -> String {
    let text = text.split(" (called:").next().unwrap_or(text);
    let text = text.split(": ").next().unwrap_or(text);
    let mut plain = String::new();
    for (index, part) in text.split('`').enumerate() {
        plain.push_str(if index % 2 == 0 { part } else { "…" });
    }
    plain
}

/// Clones a project at its commit, unless its folder exists.
fn check_out(project: &Project, folder: &Path) -> Result<()> {
    if folder.exists() {
        return Ok(());
    }
    fs::create_dir_all(folder)?;
    let git = |arguments: &[&str]| run(Command::new("git").arg("-C").arg(folder).args(arguments));
    git(&["init", "--quiet"])?;
    let cloned = git(&["fetch", "--quiet", "--depth", "1", &project.repository, &project.commit])
        .and_then(|()| git(&["checkout", "--quiet", "FETCH_HEAD"]));
    if cloned.is_err() {
        fs::remove_dir_all(folder)?;
        bail!("{} cannot be cloned: give folders of checkouts with --checkouts", project.repository);
    }
    Ok(())
}

/// All functions of a project's files, each tried as the step.
fn tried(project: &Project, folder: &Path) -> Result<Vec<Candidate>> {
    let headers = root().join("target/c-headers").join(&project.folder);
    for (name, text) in &project.headers {
        let path = headers.join(name);
        fs::create_dir_all(path.parent().unwrap_or(&headers))?;
        fs::write(path, text)?;
    }
    let mut options = vec!["-DTAKT_DOUBLE_IS_FLOAT=1".to_owned(), format!("-I{}", headers.display())];
    options.extend(project.include.iter().map(|include| format!("-I{}", folder.join(include).display())));
    options.extend(project.define.iter().map(|define| format!("-D{define}")));
    let preprocessor = Preprocessor::new(&options)?;
    let options = Options {
        step: String::new(),
        init: None,
        set: project.set.iter().map(|(name, numbers)| (name.clone(), numbers.list())).collect(),
        ignore: Vec::new(),
        loop_bound: None,
        double_is_float: true,
    };
    let mut found = Vec::new();
    for files in &project.files {
        let sources =
            files.iter().map(|file| preprocessor.run(&folder.join(file))).collect::<Result<Vec<_>, _>>();
        found.extend(sources.and_then(|sources| candidates(&sources, &options))?);
    }
    Ok(found)
}
