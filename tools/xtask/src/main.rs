// SPDX-License-Identifier: MIT OR Apache-2.0
//! Project automation. `cargo xtask --help` lists what there is.
#![allow(clippy::print_stdout, clippy::print_stderr)]

mod book;
mod campaign;
mod clients;
mod dist;
mod docs;
mod figures;
mod formal;
mod fuzz;
mod linuxcnc;
mod litex;
mod mutants;
mod netlist;
mod others;
mod passed;
mod python;
mod reach;
mod release;
mod routed;
mod share;
mod spdx;
mod suite;
mod synth;
mod told;
mod venv;
mod web;

use anyhow::{Context, Result, anyhow, bail};
use clap::{Parser, Subcommand};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

/// Project automation for Takt.
#[derive(Parser)]
#[command(name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Install what the tests need and is not there, then run formal verification's share and every test, optimised, those of the
    /// Python package included.
    Test {
        /// Exhaustive: all 2³² operands of every operation of one operand (about ten minutes on two cores), and the checks that have passed
        /// with the same files before (formal verification, the clients of other makers, the placed and routed board).
        #[arg(long)]
        full: bool,
        /// Passed on to `cargo test`, which then runs alone.
        #[arg(last = true)]
        rest: Vec<String>,
    },
    /// Write the generated documents, or with --check fail if one is stale.
    Docs {
        /// Change nothing; fail if a generated file differs from the specification.
        #[arg(long)]
        check: bool,
    },
    /// Check format, lints, generated files, licences and commits' subjects: what CI does before the tests.
    Lint,
    /// Write the licence's line (SPDX) into each source file that lacks it.
    Spdx,
    /// Synthesise a machine or units, place and route them, and record clock and resources in docs/synthesis.md.
    Synth(synth::Arguments),
    /// Prove for every program, up to a stated number of cycles, that the core keeps the rules of issue, and that its decoders are total;
    /// with --units, that the arithmetic units are correct for all operands.
    Formal(formal::Arguments),
    /// Try every operand of a function that `formal --units` has made of a unit.
    #[command(hide = true)]
    Enumerate(formal::EnumerateArguments),
    /// Plant faults in sources and circuits that nobody chose, let the tests meet them, and record how many are found (mutation score);
    /// stopped, it goes on where it was.
    Mutants(mutants::Arguments),
    /// Map a core to the cells of Lattice ECP5 and run the mapped netlist in lockstep with the emulator.
    Netlist(netlist::Arguments),
    /// Compile for aarch64 Linux, macOS, Windows and wasm32, and run the core crates' tests on aarch64 (installs what it lacks).
    Reach(reach::Arguments),
    /// Build the playground, a page for any file server, in target/playground (installs what it lacks); --test opens it in a browser.
    Web(web::Arguments),
    /// Verify the core's bus slaves and a board's UART with clients that other projects wrote, in Icarus Verilog, and the core in a
    /// SoC of LiteX, in Verilator (a share of `test`; installs what it lacks).
    Clients {
        /// The SoC of LiteX alone.
        #[arg(long)]
        litex: bool,
    },
    /// Let LinuxCNC, without a screen, cut agh.ngc with the hybrid robot on a simulated board, cut its link, stop it, and report
    /// (docs/linuxcnc.md; part of `test --full`; installs LinuxCNC, 2 GB, if it lacks).
    Linuxcnc(linuxcnc::Arguments),
    /// Count the cycles of the kernels of programs/taclebench on a RISC-V core, simulated, and by llvm-mca's model of a Cortex-M7, and
    /// write them beside Takt's into docs/library.md (installs what it lacks).
    Others,
    /// Write an archive for each machine, target/dist/takt-*.tar.gz: its Verilog, a FuseSoC core, headers, the data sheet as PDF.
    Dist(dist::Arguments),
    /// Write the documentation as a site, in target/book/site: docs/, the crates' documentation, the playground (installs mdbook).
    Book(book::Arguments),
    /// Build what a user downloads, with checksums: `takt` for Linux, linked statically, on x86-64 and aarch64; wheel; extension;
    /// playground; book; archives of Verilog (installs what it lacks).
    Release(release::Arguments),
    /// Measure how fast emulator, assembler and lockstep are beside native code, GNU `as` and one another; print it and write
    /// docs/speed.md (a few minutes on an idle machine).
    Speed,
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
    /// Fuzz the assembler and the image loader, one after the other (installs cargo-fuzz if it is not there).
    Fuzz {
        /// Minutes for each target.
        #[arg(long, default_value_t = 10)]
        minutes: u32,
    },
    /// Run a long test or measurement in units, here or on a HyperQueue server's workers; what was interrupted goes on
    /// (docs/campaigns.md). Without a name, list the campaigns.
    Campaign(campaign::Arguments),
    /// Start a HyperQueue server and workers for campaigns, until Ctrl-C (installs HyperQueue in .venv).
    Hyperqueue(campaign::Queue),
}

fn main() -> ExitCode {
    match task(Arguments::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        // What failed, and why; the place in this program tells nobody anything.
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn task(task: Task) -> Result<()> {
    match task {
        Task::Test { full, rest } => test(full, &rest),
        Task::Docs { check } => docs(check),
        Task::Lint => lint(),
        Task::Spdx => spdx::fix(),
        Task::Formal(arguments) => formal::formal(&arguments),
        Task::Enumerate(arguments) => formal::enumerate(&arguments),
        Task::Mutants(arguments) => mutants::mutants(&arguments),
        Task::Netlist(arguments) => netlist::lockstep(&arguments),
        Task::Synth(arguments) => synth::synth(&arguments),
        Task::Reach(arguments) => reach::reach(&arguments),
        Task::Web(arguments) => web::web(&arguments),
        Task::Clients { litex } => {
            install()?;
            if !litex {
                passed::once("clients", &clients::inputs()?, true, clients::test)?;
            }
            passed::once("litex", &litex::inputs()?, true, litex::test)
        }
        Task::Linuxcnc(arguments) => linuxcnc::linuxcnc(&arguments),
        Task::Others => others::compare(),
        Task::Dist(arguments) => dist::dist(&arguments),
        Task::Book(arguments) => book::book(&arguments),
        Task::Release(arguments) => release::release(&arguments),
        Task::Speed => speed(),
        Task::Wheel(arguments) => python::wheel(&arguments),
        Task::Extension { workbench, screenshots } => {
            extension()?;
            if workbench { self::workbench(screenshots.as_deref()) } else { Ok(()) }
        }
        Task::Fuzz { minutes } => fuzz::fuzz(minutes),
        Task::Campaign(arguments) => campaign::campaign(&arguments),
        Task::Hyperqueue(arguments) => campaign::queue(&arguments),
    }
}

/// The project's folder.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .nth(2)
        .expect("xtask lies in the project's tools")
        .to_owned()
}

fn run(command: &mut Command) -> Result<()> {
    let text = format!("{command:?}").replace('"', "");
    eprintln!("$ {text}");
    let status = command.status().with_context(|| format!("cannot start `{text}`"))?;
    if !status.success() {
        bail!("`{text}` failed ({status})");
    }
    Ok(())
}

/// A program's standard output; its messages are seen.
fn output_of(command: &mut Command) -> Result<String> {
    let program = command.get_program().display().to_string();
    let output = command.stderr(Stdio::inherit()).output();
    let output = output.with_context(|| format!("cannot start {program}"))?;
    if !output.status.success() {
        bail!("{program} failed ({})", output.status);
    }
    String::from_utf8(output.stdout).with_context(|| format!("{program} writes no text"))
}

/// The features with which takt has all its commands.
const EVERYTHING: &str = "takt/full";

fn cargo() -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root());
    command
}

fn works(program: &str, argument: &str) -> bool {
    Command::new(program).arg(argument).output().is_ok_and(|output| output.status.success())
}

/// The programs that the tests call, the argument with which each shows that it works, and its Debian package.
const TOOLS: [(&str, &str, &str); 10] = [
    // Berkeley SoftFloat, the reference arithmetic, is C.
    ("cc", "--version", "gcc"),
    // The circuit runs in Verilator, which builds with make and a C++ compiler, and in Icarus Verilog.
    ("c++", "--version", "g++"),
    ("make", "--version", "make"),
    ("verilator", "--version", "verilator"),
    ("llvm-mca", "--version", "llvm"),
    ("iverilog", "-V", "iverilog"),
    // The language server is used by the client of an editor.
    ("nvim", "--version", "neovim"),
    // The debug adapter by another one, in JavaScript.
    ("node", "--version", "nodejs"),
    ("npm", "--version", "npm"),
    // The page of `takt analyse` and the extension's view are opened in a browser.
    ("chromium", "--version", "chromium"),
];

/// Installs with apt-get what the tests call and is not there.
fn install() -> Result<()> {
    let missing = TOOLS.iter().filter(|(tool, ask, _)| !works(tool, ask));
    let mut packages: Vec<&str> = missing.map(|(_, _, package)| *package).collect();
    // The debug adapter's third client is Emacs's.
    let emacs = Command::new("emacs").args(["--batch", "--eval", "(require 'dap-mode)"]).output();
    if !emacs.is_ok_and(|output| output.status.success()) {
        packages.extend(["emacs-nox", "elpa-dap-mode"]);
    }
    if packages.is_empty() {
        return Ok(());
    }
    packages.push("libc6-dev");
    apt_install(&packages)
}

/// Installs Debian packages.
fn apt_install(packages: &[&str]) -> Result<()> {
    eprintln!("installing {} with apt-get", packages.join(" "));
    run(Command::new("apt-get").args(["update", "-qq"]))?;
    let mut install = Command::new("apt-get");
    install.args(["install", "-y", "-qq", "--no-install-recommends"]).args(packages);
    run(install.env("DEBIAN_FRONTEND", "noninteractive"))
}

/// Installs with npm what a folder's package-lock.json writes down.
fn npm_install(folder: &Path) -> Result<()> {
    if folder.join("node_modules").is_dir() {
        return Ok(());
    }
    run(Command::new("npm").args(["ci", "--no-audit", "--no-fund", "--ignore-scripts"]).current_dir(folder))
}

/// Writes the generated documents, or checks them.
fn docs(check: bool) -> Result<()> {
    told::step("generated documents", || docs::run(&root(), check))
}

/// Checks, tests and packs the extension for VS Code.
fn extension() -> Result<()> {
    install()?;
    let folder = root().join("tools/editors/vscode");
    npm_install(&folder)?;
    for script in ["check", "test", "package"] {
        run(Command::new("npm").args(["run", "--silent", script]).current_dir(&folder))?;
    }
    Ok(())
}

/// Uses the extension in VS Code's workbench, as the package code-server has it. Of its native modules only the terminal's is
/// compiled, which tasks run in: the others would take minutes.
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
        // Its last step asks npx for a package.
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

/// Runs the checks that are no tests of cargo's, and installs the packages that they need.
fn beside_tests(full: bool) -> Result<()> {
    told::step("extension for VS Code", extension)?;
    let share = formal::Arguments::SHARE;
    passed::once("formal", &formal::inputs(&share)?, full, || formal::formal(&share))?;
    passed::once("units", &formal::unit_inputs()?, full, formal::unit_share)?;
    passed::once("clients", &clients::inputs()?, full, clients::test)?;
    passed::once("book", &book::inputs()?, full, || book::book(&book::Arguments::DOCUMENTS))?;
    passed::once("litex", &litex::inputs()?, full, litex::test)?;
    told::step("archives of Verilog", dist::test)?;
    if full { linuxcnc::linuxcnc(&linuxcnc::Arguments::default()) } else { Ok(()) }
}

/// Installs what the tests call.
fn install_for_tests() -> Result<()> {
    install()?;
    let packages: Vec<&str> = venv::MODELS.into_iter().chain([takt_work::HYPERQUEUE]).collect();
    venv::Venv::with(&packages)?;
    // The debug adapter's client.
    npm_install(&root().join("tools/cli/tests/clients/dap"))
}

fn test(full: bool, rest: &[String]) -> Result<()> {
    let routed = routed::inputs()?;
    let is_routed = full || !passed::has_passed("routed", &routed);
    let mut environment = Vec::new();
    environment.extend(is_routed.then_some(("TAKT_ROUTED", "1")));
    environment.extend(full.then_some(("TAKT_FULL", "1")));
    if !rest.is_empty() {
        install_for_tests()?;
        return run(cargo().arg("test").args(suite::WORKSPACE).args(rest).envs(environment));
    }
    // Compiling needs no more than a C compiler; all else is installed, and what is no test of cargo's runs, while cargo compiles.
    if !works("cc", "--version") {
        install()?;
    }
    let mut jobs = std::thread::scope(|scope| {
        let compiling = scope.spawn(|| told::step("compiling the tests", || suite::compile(&environment)));
        let beside = install_for_tests().and_then(|()| beside_tests(full));
        let jobs = compiling.join().map_err(|_| anyhow!("compiling the tests panicked"))?;
        beside.and(jobs)
    })?;
    jobs.push(suite::Job::new("python", python::test));
    suite::run(jobs)?;
    if is_routed { passed::passes("routed", &routed) } else { Ok(()) }
}

/// Measures, prints, writes docs/speed.md.
fn speed() -> Result<()> {
    install()?;
    if !works("customasm", "--version") {
        eprintln!("customasm is missing: installing it");
        run(cargo().args(["install", "customasm", "--locked", "--version", "0.14.2"]))?;
    }
    let mut measure = cargo();
    measure.args(["run", "--release", "--package", "takt-benches", "--features", "jit", "--bin", "speed"]);
    let text = output_of(&mut measure)?;
    print!("{text}");
    let path = root().join("docs/speed.md");
    std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
}

fn lint() -> Result<()> {
    spdx::check()?;
    subjects()?;
    run(cargo().args(["fmt", "--all", "--check"]))?;
    run(cargo().arg("clippy").args(suite::WORKSPACE).args(["--all-targets", "--", "-D", "warnings"]))?;
    // `cargo run` compiles takt with fewer commands: without any feature, so that this also shows that isa, asm and emu stand
    // without C, which is Berkeley SoftFloat.
    run(cargo().args(["clippy", "--release", "-p", "takt", "--", "-D", "warnings"]))?;
    share::check()?;
    docs(true)
}

/// Columns of a commit's subject, at most.
const SUBJECT: usize = 72;
/// The rule's beginning.
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
