// SPDX-License-Identifier: MIT OR Apache-2.0
//! Test driver: one `cargo test --no-run` compiles every test program; then the modules of all programs run as jobs, each in a
//! process of its own, as many at a time as there are cores, those that take longest first.
//!
//! Cargo itself starts one program after the other, and a core idles whenever a program waits or is down to its last test. A
//! crate's tests are one program, because each program takes seconds to link, and several jobs, because they take minutes to run.

use crate::told::{self, words};
use crate::{EVERYTHING, cargo, output_of};
use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Jobs that take longer than the others together could hide at the end, the longest first.
const FIRST: [&str; 16] = [
    "takt-board top",
    "takt-board system",
    "takt-cosim lockstep",
    "takt commands",
    "takt-asm schedule",
    "takt robot",
    "takt board",
    "takt-board observe",
    "takt-programs assembly",
    "takt-rtl faults",
    "python",
    "takt-asm banks",
    "takt-rtl units",
    "takt-cosim system",
    "takt-cosim faults",
    "takt-programs library",
];

/// Jobs that are listed with their times at the end.
const LISTED: usize = 12;

/// The packages and features of all tests.
pub(crate) const WORKSPACE: [&str; 4] = ["--workspace", "--release", "--features", EVERYTHING];

/// A check that reports in words, and whose tests can be counted.
pub(crate) struct Job<'a> {
    name: String,
    run: Box<dyn FnOnce() -> Result<Report> + Send + 'a>,
}

/// The output of a check, and its verdict.
pub(crate) struct Report {
    pub(crate) text: String,
    pub(crate) is_passed: bool,
}

impl<'a> Job<'a> {
    pub(crate) fn new(name: impl Into<String>, run: impl FnOnce() -> Result<Report> + Send + 'a) -> Job<'a> {
        Job { name: name.into(), run: Box::new(run) }
    }

    fn command(name: impl Into<String>, mut command: Command) -> Job<'a> {
        Job::new(name, move || output(&mut command))
    }
}

/// Runs a program; its two outputs become one text, in the order in which they are written.
pub(crate) fn output(command: &mut Command) -> Result<Report> {
    let (mut reader, writer) = std::io::pipe()?;
    command.stdin(Stdio::null()).stdout(writer.try_clone()?).stderr(writer);
    let child = command.spawn();
    // The command holds the pipe's writing ends, without which the text ends with the program's.
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = child.with_context(|| format!("cannot start {}", command.get_program().display()))?;
    let mut bytes = Vec::new();
    reader.read_to_end(&mut bytes)?;
    let is_passed = child.wait()?.success();
    Ok(Report { text: String::from_utf8_lossy(&bytes).into_owned(), is_passed })
}

/// Runs one test that is ignored otherwise, with these variables, and returns what it says.
pub(crate) fn ignored(package: &str, test: &str, variables: &[(&str, OsString)]) -> Result<String> {
    let mut command = cargo();
    command.args(["test", "--release", "-p", package, "--test", "suite"]);
    command.args(["--", "--ignored", "--nocapture", "--exact", test]);
    output_of(command.envs(variables.iter().map(|(name, value)| (name, value))))
}

/// Compiles the tests. Each module of a crate's tests becomes a job, as do its unit tests, and all tests in documentation comments.
pub(crate) fn compile(environment: &[(&'static str, &'static str)]) -> Result<Vec<Job<'static>>> {
    let mut compile = cargo();
    compile.arg("test").args(WORKSPACE).args(["--no-run", "--message-format=json-render-diagnostics"]);
    let compiled = compile.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    ensure!(compiled.status.success(), "the tests do not compile ({})", compiled.status);
    let text = String::from_utf8(compiled.stdout).context("cargo's messages are no text")?;
    let mut jobs = Vec::new();
    for message in text.lines() {
        let message: Value = serde_json::from_str(message).context("cargo's message is no JSON")?;
        if let Some(program) = Program::of(&message) {
            for (name, tests) in program.parts()? {
                let mut command = program.command();
                command.args(tests).envs(environment.iter().copied());
                jobs.push(Job::command(name, command));
            }
        }
    }
    if jobs.is_empty() {
        bail!("cargo has compiled no test");
    }
    let mut documentation = cargo();
    documentation.arg("test").args(WORKSPACE).args(["--doc", "--no-fail-fast"]);
    jobs.push(Job::command("documentation", documentation));
    Ok(jobs)
}

/// Compiles the tests in a crate's folder `tests`, as [`compile`] does: the program, and the folder in which it runs.
pub(crate) fn program(package: &str) -> Result<(PathBuf, PathBuf)> {
    let mut compile = cargo();
    compile.args(["test", "--package", package, "--package", "takt", "--test", "suite", "--release"]);
    // With takt's features, for crates as all tests have them.
    compile.args(["--features", EVERYTHING, "--no-run", "--message-format=json-render-diagnostics"]);
    let compiled = output_of(&mut compile)?;
    let messages = compiled.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let mut programs = messages.filter_map(|message| Program::of(&message));
    let program = programs.find(|program| program.is_suite && program.package == package);
    program
        .map(|program| (program.executable, program.folder))
        .with_context(|| format!("{package} has no tests"))
}

/// A test program.
pub(crate) struct Program {
    target: String,
    /// The tests in the crate's folder `tests`, rather than those in its sources.
    is_suite: bool,
    package: String,
    folder: PathBuf,
    executable: PathBuf,
}

impl Program {
    /// The test program that one of cargo's messages announces.
    pub(crate) fn of(message: &Value) -> Option<Program> {
        let executable = message["executable"].as_str()?;
        if message["profile"]["test"] != true {
            return None;
        }
        let id = message["package_id"].as_str()?;
        // `…/isa#takt-isa@0.1.0`, or `…/xtask#0.1.0` where the folder has the package's name.
        let (folder, version) = id.rsplit_once('#')?;
        let package =
            version.split_once('@').map_or_else(|| folder.rsplit('/').next(), |(name, _)| Some(name))?;
        Some(Program {
            target: message["target"]["name"].as_str()?.to_owned(),
            is_suite: message["target"]["kind"][0] == "test",
            package: package.to_owned(),
            folder: Path::new(message["manifest_path"].as_str()?).parent()?.to_owned(),
            executable: PathBuf::from(executable),
        })
    }

    /// The jobs that it is split into: the name of each, and the arguments that choose its tests.
    fn parts(&self) -> Result<Vec<(String, Vec<String>)>> {
        if !self.is_suite {
            return Ok(vec![(format!("{} {}", self.package, self.target), Vec::new())]);
        }
        let list = self.list()?;
        let modules = modules(&list).into_iter().map(|(module, mut tests)| {
            tests.insert(0, "--exact".to_owned());
            (format!("{} {module}", self.package), tests)
        });
        Ok(modules.collect())
    }

    /// Its tests as libtest lists them.
    fn list(&self) -> Result<String> {
        let mut list = self.command();
        let listed = output(list.args(["--list", "--format", "terse"]))?;
        ensure!(listed.is_passed, "{} does not list its tests:\n{}", self.executable.display(), listed.text);
        Ok(listed.text)
    }

    /// The names of its tests.
    pub(crate) fn tests(&self) -> Result<Vec<String>> {
        let text = self.list()?;
        Ok(text.lines().filter_map(|line| line.strip_suffix(": test")).map(str::to_owned).collect())
    }

    /// The package.
    pub(crate) fn package(&self) -> &str {
        &self.package
    }

    /// True if it is the program of the folder `tests`.
    pub(crate) fn is_suite(&self) -> bool {
        self.is_suite
    }

    /// The program with the folder and the variables that cargo would give it.
    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(&self.executable);
        command.current_dir(&self.folder).env("CARGO_MANIFEST_DIR", &self.folder);
        command.env("CARGO_PKG_NAME", &self.package);
        command
    }
}

/// The tests that libtest lists, by the module of the program's root that each is in.
fn modules(list: &str) -> BTreeMap<&str, Vec<String>> {
    let mut modules: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for test in list.lines().filter_map(|line| line.strip_suffix(": test")) {
        let module = test.split_once("::").map_or("suite", |(module, _)| module);
        modules.entry(module).or_default().push(test.to_owned());
    }
    modules
}

/// Tests by their outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Count {
    passed: u64,
    failed: u64,
    skipped: u64,
}

impl Count {
    /// The sum of the lines in which libtest and pytest count.
    fn of(text: &str) -> Count {
        let is_number = |line: &str| line.split(' ').next().is_some_and(|word| word.parse::<u64>().is_ok());
        let is_count =
            |line: &&str| line.starts_with("test result: ") || is_number(line) && line.contains(" in ");
        let mut count = Count::default();
        for line in text.lines().filter(is_count) {
            let words: Vec<&str> = line.split([' ', ';', ',']).filter(|word| !word.is_empty()).collect();
            for pair in words.windows(2) {
                let Ok(number) = pair[0].parse::<u64>() else { continue };
                match pair[1] {
                    "passed" => count.passed += number,
                    "failed" => count.failed += number,
                    "ignored" | "skipped" => count.skipped += number,
                    _ => {}
                }
            }
        }
        count
    }

    fn and(self, other: Count) -> Count {
        Count {
            passed: self.passed + other.passed,
            failed: self.failed + other.failed,
            skipped: self.skipped + other.skipped,
        }
    }
}

/// A job that has ended.
struct Done {
    name: String,
    time: Duration,
    count: Count,
    is_passed: bool,
}

/// Jobs that are still to be done, for the time to go.
struct ToGo {
    /// Seconds that each took last time; none if it is new.
    jobs: BTreeMap<String, Option<f64>>,
    cores: usize,
}

impl ToGo {
    fn new(jobs: &[Job<'_>], cores: usize) -> ToGo {
        ToGo { jobs: jobs.iter().map(|job| (job.name.clone(), told::last(&job.name))).collect(), cores }
    }

    /// The rest in words: the number of jobs and, if half of them are known from another run, about how long they take.
    fn text(&self) -> String {
        let known: Vec<f64> = self.jobs.values().copied().flatten().collect();
        let jobs = self.jobs.len();
        if jobs == 0 || 2 * known.len() < jobs {
            return format!("{jobs} jobs to go");
        }
        // One that is new takes as long as the others do on average; the longest cannot be shared.
        let all = known.iter().sum::<f64>() * jobs as f64 / known.len() as f64;
        let longest = known.iter().copied().fold(0.0, f64::max);
        format!("{jobs} jobs, about {} to go", words((all / self.cores as f64).max(longest)))
    }
}

/// Runs a job, and says how it went and what is left: in a line, or with all of its output if it failed.
fn finish(Job { name, run }: Job<'_>, to_go: &Mutex<ToGo>) -> Done {
    let start = Instant::now();
    let report = run().unwrap_or_else(|error| Report { text: format!("{error:#}\n"), is_passed: false });
    let (time, mut count) = (start.elapsed(), Count::of(&report.text));
    if !report.is_passed && count.failed == 0 {
        // It ended before it could count.
        count.failed = 1;
    }
    let Count { passed, failed, .. } = count;
    let is_passed = report.is_passed && failed == 0;
    let mut said = format!("{:7.1} s  {name}: {passed} passed", time.as_secs_f64());
    if !is_passed {
        let _ = write!(said, ", {failed} failed\n{}", report.text);
    }
    told::took(&name, time);
    let mut to_go = to_go.lock().unwrap_or_else(PoisonError::into_inner);
    to_go.jobs.remove(&name);
    println!("{said}");
    if !to_go.jobs.is_empty() {
        // Beside the results: what is read by programs stays as it was.
        eprintln!("           {}", to_go.text());
    }
    drop(to_go);
    Done { name, time, count, is_passed }
}

/// Runs all jobs; the last line counts the tests.
///
/// # Errors
/// If one failed: their names.
pub(crate) fn run(mut jobs: Vec<Job<'_>>) -> Result<()> {
    // The next one is taken from the end.
    jobs.sort_by_key(|job| {
        std::cmp::Reverse(FIRST.iter().position(|name| *name == job.name).unwrap_or(FIRST.len()))
    });
    let cores = std::thread::available_parallelism().map_or(2, usize::from);
    let to_go = ToGo::new(&jobs, cores);
    eprintln!("running the tests: {}", to_go.text());
    let (to_go, jobs, done) = (Mutex::new(to_go), Mutex::new(jobs), Mutex::new(Vec::new()));
    let next = || jobs.lock().unwrap_or_else(PoisonError::into_inner).pop();
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(|| {
                while let Some(job) = next() {
                    let ended = finish(job, &to_go);
                    done.lock().unwrap_or_else(PoisonError::into_inner).push(ended);
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|job| std::cmp::Reverse(job.time));
    println!("the slowest:");
    for job in done.iter().take(LISTED) {
        println!("{:7.1} s  {}", job.time.as_secs_f64(), job.name);
    }
    let failed: Vec<&str> = done.iter().filter(|job| !job.is_passed).map(|job| job.name.as_str()).collect();
    if !failed.is_empty() {
        println!("failed: {}", failed.join(", "));
    }
    let Count { passed, failed: tests, skipped } =
        done.iter().fold(Count::default(), |count, job| count.and(job.count));
    println!("tests: {passed} passed, {tests} failed, {skipped} skipped");
    ensure!(failed.is_empty(), "{} of {} jobs failed", failed.len(), done.len());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::root;

    #[test]
    fn tests_are_counted() {
        let text = "running 2 tests\ntest result: FAILED. 1 passed; 2 failed; 3 ignored; 0 measured; 4 filtered out; finished in 0.02s\n\
                    1 failed, 7 passed, 1 skipped in 2.10s\nhe said: 9 passed\n";
        assert_eq!(Count::of(text), Count { passed: 8, failed: 3, skipped: 4 });
    }

    #[test]
    fn failures_are_counted_and_reported() {
        let shell = |script: &str| {
            let mut command = Command::new("sh");
            command.args(["-c", script]);
            command
        };
        let passes = || Job::command("one", shell("echo 'test result: ok. 3 passed; 0 failed; 0 ignored'"));
        assert!(run(vec![passes()]).is_ok());
        // One that crashes counts nothing.
        let one = Job::command("two", shell("exit 3"));
        let to_go = Mutex::new(ToGo::new(std::slice::from_ref(&one), 1));
        let crash = finish(one, &to_go);
        assert_eq!((crash.is_passed, crash.count.failed), (false, 1));
        assert!(run(vec![passes(), Job::command("two", shell("exit 3"))]).is_err());
        assert!(run(vec![Job::new("three", || bail!("no such thing"))]).is_err());
    }

    #[test]
    fn the_time_to_go_is_that_of_the_last_run() {
        let of = |jobs: &[(&str, Option<f64>)]| {
            let jobs = jobs.iter().map(|(name, last)| ((*name).to_owned(), *last)).collect();
            ToGo { jobs, cores: 2 }.text()
        };
        assert_eq!(of(&[("a", None), ("b", None), ("c", Some(4.0))]), "3 jobs to go");
        assert_eq!(
            of(&[("a", Some(30.0)), ("b", Some(50.0)), ("c", Some(40.0))]),
            "3 jobs, about 60 s to go"
        );
        assert_eq!(of(&[("a", Some(30.0)), ("b", None)]), "2 jobs, about 30 s to go");
        assert_eq!(of(&[("a", Some(500.0)), ("b", Some(2.0))]), "2 jobs, about 8 min to go");
    }

    #[test]
    fn a_program_is_split_by_its_modules() {
        let list = "banks::a_bank: test\nbanks::deep::another: test\nslots::one: test\nlone: test\nslots::speed: benchmark\n";
        let expected = [
            ("banks", vec!["banks::a_bank".to_owned(), "banks::deep::another".to_owned()]),
            ("slots", vec!["slots::one".to_owned()]),
            ("suite", vec!["lone".to_owned()]),
        ];
        assert_eq!(modules(list), BTreeMap::from(expected));
    }

    /// Cargo finds no test by itself where `autotests` is false, and the compiler does not miss a file that no `mod` names.
    #[test]
    fn every_test_file_is_a_module_of_its_crates_program() {
        let files =
            Command::new("git").current_dir(root()).args(["ls-files", "*/tests/*"]).output().expect("git");
        let files = String::from_utf8(files.stdout).expect("paths are UTF-8");
        let mut found = 0;
        for path in files.lines() {
            let Some((folder, file)) = path.split_once("/tests/") else { continue };
            let Some(module) = file.strip_suffix("/mod.rs").or(file.strip_suffix(".rs")) else { continue };
            if module == "main" || module.contains('/') {
                continue;
            }
            found += 1;
            let main = std::fs::read_to_string(root().join(folder).join("tests/main.rs")).unwrap_or_default();
            let is_module = main.lines().any(|line| line == format!("mod {module};"));
            assert!(is_module, "{path} is not compiled: {folder}/tests/main.rs has no `mod {module};`");
        }
        assert!(found > 100, "{found} files");
    }

    #[test]
    fn programs_have_their_package_and_folder() {
        let message = |id: &str, test: bool| {
            serde_json::json!({
                "package_id": id, "manifest_path": "/p/isa/Cargo.toml", "executable": "/t/deps/encoding-1234",
                "target": { "name": "encoding" }, "profile": { "test": test },
            })
        };
        let name = |id| Program::of(&message(id, true)).map(|program| (program.package, program.folder));
        let folder = PathBuf::from("/p/isa");
        assert_eq!(name("path+file:///p/isa#takt-isa@0.1.0"), Some(("takt-isa".to_owned(), folder.clone())));
        assert_eq!(name("path+file:///p/isa#0.1.0"), Some(("isa".to_owned(), folder)));
        assert!(Program::of(&message("path+file:///p/isa#0.1.0", false)).is_none());
    }
}
