// SPDX-License-Identifier: MIT OR Apache-2.0
//! Project automation; `cargo xtask --help` lists the commands.
#![allow(clippy::print_stdout, clippy::print_stderr)]

mod book;
mod changes;
mod dist;
mod docs;
mod figures;
mod pages;
mod python;
mod reach;
mod release;
mod share;
mod spdx;
mod suite;
mod web;

use anyhow::{Context, Result, anyhow, bail};
use clap::{Parser, Subcommand};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use takt_automation::command::{EVERYTHING, cargo, install, npm_install, root, run, works};
use takt_automation::test_program::WORKSPACE;
use takt_automation::{check_cache, fuzz, progress, venv};

/// Project automation for Takt.
#[derive(Parser)]
#[command(name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Install what the tests need and is not there, then run every test, optimised, those of the Python package included. Proofs and
    /// other checks that take minutes are named with their commands.
    Test {
        /// Exhaustive: all 2³² operands of every operation of one operand (about ten minutes on two cores), then all of `cargo evidence
        /// check`.
        #[arg(long)]
        full: bool,
        /// Passed on to `cargo test`, which then runs alone.
        #[arg(last = true)]
        rest: Vec<String>,
    },
    /// Check format, lints, generated files, licences and commits' subjects: what CI does before the tests.
    Lint {
        /// Write the licence's line (SPDX) into each source file that lacks it, and format; check nothing.
        #[arg(long)]
        fix: bool,
    },
    /// Write the generated documents, or with --check fail if one is stale.
    Docs {
        /// Change nothing; fail if a generated file differs from the specification.
        #[arg(long)]
        check: bool,
    },
    /// Write the documentation as a site, in target/book/site: docs/, the crates' documentation, the playground (installs mdbook).
    Book(book::Arguments),
    /// Build the playground, a page for any file server, in target/playground (installs missing tools); --test opens it in a browser.
    Web(web::Arguments),
    /// Write the folder that a static host serves, target/pages: the book, the playground and the examples, with relative links, all of
    /// which are followed; --test opens it in a browser.
    Pages(pages::Arguments),
    /// Build the Python package's wheel, for every Python from 3.10 on (installs maturin in .venv).
    Wheel(python::Arguments),
    /// Build the extension for VS Code, editors/vscode/dist/takt.vsix, with its tests (installs with npm what it lacks).
    Extension {
        /// Install it in VS Code's workbench, in a headless browser, and use it there (installs 300 MB with npm, once).
        #[arg(long)]
        workbench: bool,
        /// Keep pictures of the workbench in this folder.
        #[arg(long, value_name = "FOLDER", requires = "workbench")]
        screenshots: Option<PathBuf>,
    },
    /// Build what a user downloads, with checksums: `takt` for Linux, linked statically, on x86-64 and aarch64; wheel; extension;
    /// playground; book; archives of Verilog (installs missing tools). With --archives, only those; with --changelog, only write the
    /// changelog's section.
    Release(release::Arguments),
    /// Compile for aarch64 Linux, macOS, Windows and wasm32, and run the core crates' tests on aarch64 (installs missing tools).
    Reach(reach::Arguments),
    /// Fuzz the assembler and the image loader, one after the other (installs cargo-fuzz if it is not there).
    Fuzz {
        /// Minutes for each target.
        #[arg(long, default_value_t = 10)]
        minutes: u32,
    },
    /// A command that has moved.
    #[command(external_subcommand)]
    Other(Vec<OsString>),
}

/// Commands that were moved, with their replacements.
const MOVED: [(&str, &str); 11] = [
    ("formal", "cargo evidence formal"),
    ("mutants", "cargo evidence mutants"),
    ("campaign", "cargo evidence campaign"),
    ("hyperqueue", "cargo evidence hyperqueue"),
    ("synth", "cargo evidence synth"),
    ("netlist", "cargo evidence netlist"),
    ("speed", "cargo evidence speed"),
    ("clients", "cargo evidence check clients litex"),
    ("linuxcnc", "cargo evidence linuxcnc"),
    ("dist", "cargo xtask release --archives"),
    ("spdx", "cargo xtask lint --fix"),
];

/// Error message for an unknown command.
fn no_such(words: &[OsString]) -> Result<()> {
    let name = words.first().map(|word| word.display().to_string()).unwrap_or_default();
    match MOVED.iter().find(|(old, _)| *old == name) {
        Some((_, new)) => bail!("`cargo xtask {name}` is now `{new}`"),
        None => bail!("there is no command `{name}`; `cargo xtask --help` lists the commands"),
    }
}

fn main() -> ExitCode {
    match task(Arguments::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        // Print only the error chain; source locations in this program do not help users.
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn task(task: Task) -> Result<()> {
    match task {
        Task::Test { full, rest } => test(full, &rest),
        Task::Lint { fix } => {
            if fix {
                spdx::fix()
            } else {
                lint()
            }
        }
        Task::Docs { check } => docs(check),
        Task::Book(arguments) => book::book(&arguments),
        Task::Web(arguments) => web::web(&arguments),
        Task::Pages(arguments) => pages::pages(&arguments),
        Task::Wheel(arguments) => python::wheel(&arguments),
        Task::Extension { workbench, screenshots } => {
            extension()?;
            if workbench { self::workbench(screenshots.as_deref()) } else { Ok(()) }
        }
        Task::Release(arguments) => release::release(&arguments),
        Task::Reach(arguments) => reach::reach(&arguments),
        Task::Fuzz { minutes } => fuzz::fuzz(minutes),
        Task::Other(words) => no_such(&words),
    }
}

/// Writes the generated documents, or checks that they are current.
fn docs(check: bool) -> Result<()> {
    progress::step("generated documents", || docs::run(&root(), check))
}

/// Checks, tests and packs the VS Code extension.
fn extension() -> Result<()> {
    install()?;
    let folder = root().join("tools/editors/vscode");
    npm_install(&folder)?;
    for script in ["check", "test", "package"] {
        run(Command::new("npm").args(["run", "--silent", script]).current_dir(&folder))?;
    }
    Ok(())
}

/// Tests the extension in VS Code's workbench, provided by the package code-server. Of code-server's native modules, only the terminal's
/// is compiled, which tasks need; the others would take minutes.
fn workbench(screenshots: Option<&Path>) -> Result<()> {
    let folder = root().join("tools/editors/vscode/workbench");
    npm_install(&folder)?;
    let code = folder.join("node_modules/code-server/lib/vscode");
    for part in [code.clone(), code.join("extensions")] {
        if !part.join("node_modules").is_dir() {
            let install = ["install", "--omit=dev", "--no-audit", "--no-fund", "--ignore-scripts"];
            run(Command::new("npm").args(install).current_dir(part))?;
        }
    }
    let terminal = code.join("node_modules/node-pty/build/Release/pty.node");
    if !terminal.is_file() {
        // The last build step fetches a package with npx.
        let mut rebuild = Command::new("npm");
        rebuild.args(["rebuild", "node-pty"]).env("npm_config_yes", "true").current_dir(&code);
        run(&mut rebuild).context("the terminal's module could not be compiled")?;
    }
    run(cargo().args(["build", "--release", "--package", "takt", "--features", EVERYTHING]))?;
    let mut tests = Command::new("node");
    tests.args(["--test", "--test-reporter=spec", "workbench.test.mjs"]).current_dir(folder);
    tests.env("TAKT", root().join("target/release/takt"));
    if let Some(folder) = screenshots {
        tests.env("TAKT_SCREENSHOTS", std::path::absolute(folder)?);
    }
    run(&mut tests)
}

/// Runs the checks outside cargo's tests, after installing the packages that they need.
fn beside_tests(full: bool) -> Result<()> {
    progress::step("extension for VS Code", extension)?;
    check_cache::once("book", &book::inputs()?, full, || book::book(&book::Arguments::DOCUMENTS))?;
    progress::step("archives of Verilog", dist::test)
}

/// Installs the programs that the tests call.
fn install_for_tests() -> Result<()> {
    install()?;
    let packages: Vec<&str> = venv::MODELS.into_iter().chain([takt_work::HYPERQUEUE]).collect();
    venv::Venv::with(&packages)?;
    // JavaScript client of the debug adapter.
    npm_install(&root().join("tools/cli/tests/clients/dap"))
}

fn test(full: bool, rest: &[String]) -> Result<()> {
    let mut environment = Vec::new();
    environment.extend(full.then_some(("TAKT_FULL", "1")));
    if !rest.is_empty() {
        install_for_tests()?;
        return run(cargo().arg("test").args(WORKSPACE).args(rest).envs(environment));
    }
    // Compilation needs only a C compiler. Meanwhile, install programs and run the checks outside cargo's tests.
    if !works("cc", "--version") {
        install()?;
    }
    let mut jobs = std::thread::scope(|scope| {
        let compiling =
            scope.spawn(|| progress::step("compiling the tests", || suite::compile(&environment)));
        let beside = install_for_tests().and_then(|()| beside_tests(full));
        let jobs = compiling.join().map_err(|_| anyhow!("compiling the tests panicked"))?;
        beside.and(jobs)
    })?;
    jobs.push(suite::Job::new("python", python::test));
    let evidence = || check_cache::CHECKS.iter().filter(|check| check.command.starts_with("cargo evidence"));
    if !full {
        for check in evidence() {
            check_cache::leave_out(check.name, "evidence, not a test");
        }
        check_cache::leave_out(check_cache::EXHAUSTIVE, "part of --full");
    }
    let result = suite::run(jobs);
    print!("{}", check_cache::left_out());
    result?;
    if full { run(cargo().args(["evidence", "check", "--all"])) } else { Ok(()) }
}

fn lint() -> Result<()> {
    spdx::check()?;
    changes::check()?;
    subjects()?;
    run(cargo().args(["fmt", "--all", "--check"]))?;
    run(cargo().arg("clippy").args(WORKSPACE).args(["--all-targets", "--", "-D", "warnings"]))?;
    // `cargo run` compiles takt with fewer commands. Lint it also without any feature, which shows that isa, asm and emu build without C
    // code (Berkeley SoftFloat).
    run(cargo().args(["clippy", "--release", "-p", "takt", "--", "-D", "warnings"]))?;
    deny()?;
    share::check()?;
    docs(true)
}

/// Checks the dependencies against deny.toml; prints which checks cannot run here.
fn deny() -> Result<()> {
    if !works("cargo-deny", "--version") {
        eprintln!(
            "skipped: licences, bans, sources and advisories of dependencies, as cargo-deny is missing (cargo install cargo-deny)"
        );
        return Ok(());
    }
    let deny = |arguments: &[&str]| {
        let mut command = cargo();
        command.args(["deny", "--locked", "--log-level", "error"]).args(arguments);
        command
    };
    run(&mut deny(&["check", "--hide-inclusion-graph", "licenses", "bans", "sources"]))?;
    // The advisory database needs the network.
    if !deny(&["fetch", "db"]).status().context("cannot start cargo")?.success() {
        eprintln!("skipped: advisories about dependencies, as their database cannot be fetched");
        return Ok(());
    }
    run(&mut deny(&["check", "advisories"]))
}

/// Maximum length of a commit's subject, in columns.
const SUBJECT: usize = 72;
/// Commits before this date are exempt.
const SINCE: &str = "--since=2026-11-25T03:00:00Z";

/// Checks the length of commits' subjects.
fn subjects() -> Result<()> {
    let mut git = Command::new("git");
    let log =
        git.current_dir(root()).args(["log", SINCE, "--format=%s"]).output().context("cannot start git")?;
    let log = String::from_utf8_lossy(&log.stdout).into_owned();
    let long: Vec<&str> = log.lines().filter(|subject| subject.chars().count() > SUBJECT).collect();
    anyhow::ensure!(long.is_empty(), "subjects of more than {SUBJECT} columns:\n{}", long.join("\n"));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;
    use takt_automation::XTASK;

    #[test]
    fn commands_are_listed() {
        let command = Arguments::command();
        let names: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
        assert_eq!(names, XTASK);
    }

    #[test]
    fn commands_that_have_moved_name_their_successors() {
        for (old, new) in MOVED {
            assert!(Arguments::command().find_subcommand(old).is_none(), "{old}");
            let error = no_such(&[old.into(), "--machine".into()]).expect_err("it has moved").to_string();
            assert_eq!(error, format!("`cargo xtask {old}` is now `{new}`"));
        }
        assert!(no_such(&["simulate".into()]).is_err());
    }
}
