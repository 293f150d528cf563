//! How long the tests of each target take: cargo starts them through this program, which writes it down.

use crate::root;
use anyhow::{Context, Result};
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::time::Instant;

/// Targets that are listed.
const LISTED: usize = 12;

/// A program to run, and where its time is written.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    program: PathBuf,
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    arguments: Vec<OsString>,
}

fn list() -> PathBuf {
    root().join("target/test-times")
}

/// Forgets the times of the last run. What cargo must be told to start tests through this program.
pub(crate) fn watch() -> Result<[String; 2]> {
    // Cargo may build elsewhere.
    fs::create_dir_all(root().join("target")).context("cannot make target")?;
    fs::write(list(), "").context("cannot write target/test-times")?;
    let this = std::env::current_exe().context("xtask does not know where it lies")?;
    let this = this.to_str().context("xtask's path is not Unicode")?;
    // A text in TOML as in Rust.
    Ok(["--config".to_owned(), format!("target.'cfg(all())'.runner = [{this:?}, \"timed\"]")])
}

/// Runs a target's tests and writes down how long they took.
pub(crate) fn timed(Arguments { program, arguments }: &Arguments) -> Result<ExitCode> {
    let started = Instant::now();
    let status = Command::new(program).args(arguments).status();
    let status = status.with_context(|| format!("cannot start {}", program.display()))?;
    let seconds = started.elapsed().as_secs_f64();
    let package = std::env::var("CARGO_PKG_NAME").unwrap_or_default();
    // Without the hash that cargo appends.
    let target = program.file_stem().and_then(|name| name.to_str()).unwrap_or_default();
    let target = target.rsplit_once('-').map_or(target, |(name, _)| name);
    let list = OpenOptions::new().append(true).open(list());
    let mut list = list.context("cannot write target/test-times")?;
    writeln!(list, "{seconds:.1} {package} {target}")?;
    Ok(status.code().and_then(|code| u8::try_from(code).ok()).map_or(ExitCode::FAILURE, ExitCode::from))
}

/// The targets whose tests took longest.
pub(crate) fn slowest() -> Result<String> {
    let text = fs::read_to_string(list()).context("cannot read target/test-times")?;
    let mut times: Vec<(f64, &str)> = text
        .lines()
        .filter_map(|line| line.split_once(' '))
        .filter_map(|(time, name)| Some((time.parse().ok()?, name)))
        .collect();
    times.sort_by(|(one, _), (other, _)| other.total_cmp(one));
    let all: f64 = times.iter().map(|(time, _)| time).sum();
    let mut text = format!("tests: {all:.0} s in {} targets; the slowest:\n", times.len());
    for (time, name) in times.iter().take(LISTED) {
        writeln!(text, "{time:8.1} s  {name}")?;
    }
    Ok(text)
}
