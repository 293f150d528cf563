// SPDX-License-Identifier: MIT OR Apache-2.0
//! Mutants of Rust sources: compiles a copy of the project with all mutants once, and runs on each mutant the tests that reach it.

use super::Arguments;
use super::results::{KnownOutcomes, Outcome};
use super::run::{CHOICE, REACHED, Test, Verdict, numbers, verdict};
use super::rust::{self, Mutant};
use crate::threads::{at_once, cores};
use anyhow::{Context, Result, bail, ensure};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use takt_automation::command::{cargo, root};
use takt_automation::progress;
use takt_automation::test_program::Program;

/// Sources that are mutated together, with their tests.
pub(super) struct Part {
    pub(super) name: &'static str,
    /// Source files, and folders with all their files.
    sources: &'static [&'static str],
    /// Packages with their test modules; `lib` stands for unit tests.
    tests: &'static [(&'static str, &'static [&'static str])],
    /// Limits in seconds of CPU time: a test that takes more than `longest` is left out; `budget` limits all tests of a mutant, shortest
    /// first.
    longest: u64,
    budget: u64,
}

const ANALYSIS: &str = "takt-analysis";

/// Table of the parts. The emulator's JIT compiler is left out: tests compare it with the interpreter.
pub(super) const PARTS: [Part; 5] = [
    Part {
        name: "timing",
        longest: LONGEST,
        budget: BUDGET,
        sources: &["isa/src/timing.rs"],
        tests: &[
            ("takt-isa", &["lib", "machines", "timing"]),
            ("takt-emu", &["timing", "document", "faults", "agreement"]),
            ("takt-asm", &["schedule", "cycles"]),
            (ANALYSIS, &["bound"]),
        ],
    },
    Part {
        name: "scheduler",
        longest: LONGEST,
        budget: BUDGET,
        sources: &["asm/src/schedule", "asm/src/schedule/pipeline"],
        tests: &[(
            "takt-asm",
            &[
                "lib", "schedule", "pipeline", "cycles", "slots", "memory", "arrays", "banks", "mistakes",
                "spill",
            ],
        )],
    },
    Part {
        name: "bounds",
        longest: LONGEST,
        budget: BUDGET,
        sources: &["emu/analysis/src/bound.rs", "emu/analysis/src/graph.rs"],
        tests: &[(ANALYSIS, &["bound", "accuracy", "enclosures"])],
    },
    Part {
        name: "accuracy",
        longest: LONGEST,
        budget: BUDGET,
        sources: &["emu/analysis/src/accuracy"],
        tests: &[(ANALYSIS, &["lib", "accuracy", "enclosures"])],
    },
    Part {
        name: "emulator",
        longest: LONGEST,
        budget: BUDGET,
        sources: &[
            "emu/src/cycle.rs",
            "emu/src/emulator.rs",
            "emu/src/execute.rs",
            "emu/src/block.rs",
            "emu/src/fast_path.rs",
            "emu/src/io.rs",
            "emu/src/machine.rs",
        ],
        tests: &[
            (
                "takt-emu",
                &[
                    "lib",
                    "timing",
                    "document",
                    "faults",
                    "latched_ports",
                    "periods",
                    "restore",
                    "slices",
                    "agreement",
                    "batch",
                ],
            ),
            (ANALYSIS, &["bound", "trace"]),
        ],
    },
];

/// Default limits in seconds: for one test, and for all tests of a mutant.
const LONGEST: u64 = 12;
const BUDGET: u64 = 30;

/// Selection function, added to the copy of `takt-isa`, on which all other crates depend. It runs in innermost loops: once the selected
/// mutant is known, it costs a single comparison.
const FUNCTION: &str = r#"

/// The chosen mutant; or that it is not known yet, or that all that are reached are written down.
#[doc(hidden)]
pub static MUTANT: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(u32::MAX);

/// True if this mutant is the chosen one.
#[doc(hidden)]
#[inline(always)]
pub fn mutant(number: u32) -> bool {
    let chosen = MUTANT.load(std::sync::atomic::Ordering::Relaxed);
    chosen == number || chosen == u32::MAX && asked(number)
}

#[cold]
#[inline(never)]
fn asked(number: u32) -> bool {
    use std::sync::atomic::{AtomicBool, Ordering};
    static SEEN: [AtomicBool; 1 << 14] = [const { AtomicBool::new(false) }; 1 << 14];
    static FILE: std::sync::LazyLock<Option<std::sync::Mutex<std::fs::File>>> = std::sync::LazyLock::new(|| {
        let path = std::env::var("TAKT_MUTANTS_REACHED").ok();
        path.and_then(|path| std::fs::File::create(path).ok()).map(std::sync::Mutex::new)
    });
    let Some(file) = &*FILE else {
        let chosen = std::env::var("TAKT_MUTANT").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
        MUTANT.store(chosen, Ordering::Relaxed);
        return chosen == number;
    };
    let seen = &SEEN[number as usize];
    if !seen.load(Ordering::Relaxed) && !seen.swap(true, Ordering::Relaxed) {
        use std::io::Write;
        let _ = writeln!(file.lock().unwrap_or_else(|poisoned| poisoned.into_inner()), "{number}");
    }
    false
}
"#;

/// File that receives the selection function.
const LIBRARY: &str = "isa/src/lib.rs";

/// A source file with its mutants.
struct Source {
    path: String,
    text: String,
    mutants: Vec<Mutant>,
}

/// Measures the scores of parts. Mutants of all parts are compiled together, so that measuring one part does not make another's programs
/// stale.
pub(super) fn score(parts: &[&Part], arguments: &Arguments) -> Result<()> {
    let sources: Vec<Vec<Source>> = PARTS.iter().map(sources).collect::<Result<_>>()?;
    let every: Vec<&Source> = sources.iter().flatten().collect();
    // Number all mutants, from 1.
    let all: Vec<(&Source, &Mutant)> =
        every.iter().flat_map(|source| source.mutants.iter().map(|mutant| (*source, mutant))).collect();
    ensure!(all.len() < 1 << 14, "{} mutants are more than can be numbered", all.len());
    let copy = Copy::new(&every)?;
    let (programs, stillborn) = progress::step("compiling all mutants", || copy.compile(&every))?;
    for part in parts {
        let own = sources.iter().zip(&PARTS).position(|(_, other)| other.name == part.name);
        let own = own.context("a part is one of the parts")?;
        let first =
            1 + sources[..own].iter().flatten().map(|source| source.mutants.len() as u32).sum::<u32>();
        let count = sources[own].iter().map(|source| source.mutants.len()).sum();
        score_of(
            part,
            arguments,
            &PlantedMutants {
                all: &all,
                first,
                count,
                programs: &programs,
                stillborn: &stillborn,
                reached: &copy.reached,
            },
        )?;
    }
    Ok(())
}

/// Compiled mutants of a part, numbered from `first`.
struct PlantedMutants<'a> {
    all: &'a [(&'a Source, &'a Mutant)],
    first: u32,
    count: usize,
    programs: &'a [Program],
    stillborn: &'a BTreeSet<u32>,
    reached: &'a Path,
}

impl PlantedMutants<'_> {
    fn of(&self, number: u32) -> (&Source, &Mutant) {
        self.all[number as usize - 1]
    }

    fn key(&self, number: u32) -> String {
        let (source, mutant) = self.of(number);
        mutant.key(&source.path)
    }
}

/// Measures the mutation score of a part.
fn score_of(part: &Part, arguments: &Arguments, planted: &PlantedMutants<'_>) -> Result<()> {
    let mut known = KnownOutcomes::read(part.name, arguments.again && arguments.only.is_empty())?;
    let count = planted.count;
    let limit = if arguments.limit == 0 { count } else { arguments.limit.min(count) };
    let spread = (0..limit).map(|i| planted.first + (i * count / limit) as u32);
    let only = &arguments.only;
    ensure!(only.iter().all(|n| (1..=count).contains(n)), "{} has mutants 1 to {count}", part.name);
    let chosen: Vec<u32> = if only.is_empty() {
        spread.collect()
    } else {
        only.iter().map(|n| planted.first + *n as u32 - 1).collect()
    };
    eprintln!("{}: {count} mutants, of which {} are tried", part.name, chosen.len());
    for number in chosen.iter().filter(|number| planted.stillborn.contains(number)) {
        known.put(planted.key(*number), Outcome::Stillborn);
    }
    let is_open = |number: &u32| {
        let is_known = known.has(&planted.key(*number)) && only.is_empty();
        !is_known && !planted.stillborn.contains(number)
    };
    let open: Vec<u32> = chosen.iter().copied().filter(is_open).collect();
    let tests = if open.is_empty() {
        Vec::new()
    } else {
        progress::step(&format!("{}: tests without a mutant", part.name), || {
            baseline(part, arguments.test.as_deref().unwrap_or(""), planted.programs, planted.reached)
        })?
    };
    let begin = Instant::now();
    let shared = Mutex::new((&mut known, 0));
    // Tests are judged by CPU time, so they may run concurrently.
    at_once(&open, cores(), |_, number| {
        let outcome = meet(*number, Duration::from_secs(part.budget), &tests, planted.programs)?;
        let (source, mutant) = planted.of(*number);
        let (known, done) = &mut *shared.lock().unwrap_or_else(PoisonError::into_inner);
        if !only.is_empty() || matches!(outcome, Outcome::Survived | Outcome::Unreached) {
            let number = number - planted.first + 1;
            eprintln!("{outcome:?}: {number}: {}:{}: {}", source.path, mutant.line, mutant.change());
        }
        known.meet(planted.key(*number), outcome);
        *done += 1;
        if *done % 20 == 0 {
            known.write()?;
            let left =
                begin.elapsed().as_secs_f64() / f64::from(*done) * (open.len() - *done as usize) as f64;
            eprintln!("{}: {done} of {}, {} to go", part.name, open.len(), progress::words(left));
        }
        Ok(())
    })?;
    known.write()?;
    if !only.is_empty() {
        return Ok(());
    }
    let named = |number: &u32| (planted.key(*number), planted.of(*number).1.change());
    let score = known.record(count, &chosen.iter().map(named).collect::<Vec<_>>())?;
    println!("{}: {score}", part.name);
    Ok(())
}

/// Sources of a part, without their test modules.
fn sources(part: &Part) -> Result<Vec<Source>> {
    let mut paths = Vec::new();
    for place in part.sources {
        if place.ends_with(".rs") {
            paths.push((*place).to_owned());
            continue;
        }
        for entry in fs::read_dir(root().join(place)).with_context(|| format!("cannot read {place}"))? {
            let name = entry?.file_name().display().to_string();
            // Exclude random number generators and brute-force solvers, which serve tests only.
            if name.ends_with(".rs") && !["random.rs", "brute_force.rs"].contains(&name.as_str()) {
                paths.push(format!("{place}/{name}"));
            }
        }
    }
    paths.sort();
    let read = |path: String| -> Result<Source> {
        let text = fs::read_to_string(root().join(&path)).with_context(|| format!("cannot read {path}"))?;
        let mutants = rust::mutants(&text).with_context(|| path.clone())?;
        Ok(Source { path, text, mutants })
    };
    paths.into_iter().map(read).collect()
}

/// Copy of the project, in the target folder.
struct Copy {
    folder: PathBuf,
    target: PathBuf,
    reached: PathBuf,
}

impl Copy {
    /// Updates the copy except for the mutated sources, which would be compiled twice otherwise.
    fn new(sources: &[&Source]) -> Result<Copy> {
        let own = root().join("target/mutants");
        let copy =
            Copy { folder: own.join("source"), target: own.join("target"), reached: own.join("reached.txt") };
        let mut git = Command::new("git");
        git.current_dir(root()).args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"]);
        let listed = git.output().context("cannot start git")?;
        ensure!(listed.status.success(), "git lists no files");
        for path in String::from_utf8(listed.stdout)?.split_terminator('\0') {
            let planted = path == LIBRARY || sources.iter().any(|source| source.path == path);
            if !planted && let Ok(bytes) = fs::read(root().join(path)) {
                copy.put(path, &bytes)?;
            }
        }
        Ok(copy)
    }

    /// Writes a file only if its contents differ, since cargo compares time stamps.
    fn put(&self, path: &str, bytes: &[u8]) -> Result<()> {
        let file = self.folder.join(path);
        if fs::read(&file).is_ok_and(|old| old == bytes) {
            return Ok(());
        }
        if let Some(parent) = file.parent() {
            fs::create_dir_all(parent)?;
        }
        fs::write(&file, bytes).with_context(|| format!("cannot write {}", file.display()))
    }

    /// Compiles the tests with all compilable mutants. Returns the programs, and the numbers of rejected mutants. Rejections are
    /// remembered by source text, so that an unchanged project is not compiled again.
    fn compile(&self, sources: &[&Source]) -> Result<(Vec<Program>, BTreeSet<u32>)> {
        let memory = self.folder.with_file_name("stillborn.json");
        let mut stillborn = remembered(&fs::read_to_string(&memory).unwrap_or_default(), sources);
        let choice = "isa/src/lib.rs";
        let library =
            fs::read_to_string(root().join(choice)).with_context(|| format!("cannot read {choice}"))?;
        self.put(choice, (library + FUNCTION).as_bytes())?;
        for _ in 0..12 {
            let mut first = 1;
            for source in sources {
                let numbered: Vec<(u32, &Mutant)> = (first..)
                    .zip(&source.mutants)
                    .filter(|(number, _)| !stillborn.contains(number))
                    .collect();
                first += source.mutants.len() as u32;
                let function =
                    if source.path.starts_with("isa/") { "crate::mutant" } else { "takt_isa::mutant" };
                self.put(&source.path, rust::planted(&source.text, &numbered, function).as_bytes())?;
            }
            let mut command = cargo();
            command.current_dir(&self.folder).env("CARGO_TARGET_DIR", &self.target);
            command.env("RUSTFLAGS", "-Awarnings -Aarithmetic_overflow -Aunconditional_panic");
            command.args(["test", "--release", "--no-run", "--message-format=json"]);
            let packages: BTreeSet<&str> =
                PARTS.iter().flat_map(|part| part.tests).map(|(package, _)| *package).collect();
            command.args(packages.into_iter().flat_map(|package| ["-p", package]));
            let output = command
                .stderr(fs::File::create(self.folder.with_extension("log"))?)
                .output()
                .context("cannot start cargo")?;
            let text = String::from_utf8(output.stdout).context("cargo's output is not UTF-8")?;
            let messages: Vec<Value> =
                text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
            if output.status.success() {
                fs::write(&memory, memories(&stillborn, sources).to_string())?;
                return Ok((messages.iter().filter_map(Program::of).collect(), stillborn));
            }
            let refused = refused(&messages, sources, &stillborn);
            ensure!(
                !refused.is_empty(),
                "the mutants do not compile, and the compiler names none of them; see {}",
                self.folder.with_extension("log").display()
            );
            stillborn.extend(refused);
        }
        bail!("mutants are still refused by the compiler after twelve attempts")
    }
}

/// Rejected mutants in the format of the stored file: for each source its text, and mutant numbers within it from 0.
fn memories(stillborn: &BTreeSet<u32>, sources: &[&Source]) -> Value {
    let mut first = 1;
    let mut all = serde_json::Map::new();
    for source in sources {
        let next = first + source.mutants.len() as u32;
        let own: Vec<u32> = stillborn.range(first..next).map(|number| number - first).collect();
        all.insert(source.path.clone(), json!({ "text": source.text, "refused": own }));
        first = next;
    }
    Value::Object(all)
}

/// Stored rejections of sources whose text is unchanged, as global numbers.
fn remembered(text: &str, sources: &[&Source]) -> BTreeSet<u32> {
    let all: Value = serde_json::from_str(text).unwrap_or_default();
    let mut first = 1;
    let mut stillborn = BTreeSet::new();
    for source in sources {
        let known = &all[&source.path];
        if known["text"] == source.text.as_str() {
            let own = known["refused"].as_array().into_iter().flatten().filter_map(Value::as_u64);
            stillborn.extend(own.map(|number| first + number as u32));
        }
        first += source.mutants.len() as u32;
    }
    stillborn
}

/// Mutants on lines for which the compiler reports errors.
fn refused(messages: &[Value], sources: &[&Source], known: &BTreeSet<u32>) -> BTreeSet<u32> {
    let mut lines: BTreeMap<&str, BTreeSet<usize>> = BTreeMap::new();
    for message in messages.iter().filter(|message| message["message"]["level"] == "error") {
        for span in message["message"]["spans"].as_array().into_iter().flatten() {
            let (Some(file), Some(first), Some(last)) =
                (span["file_name"].as_str(), span["line_start"].as_u64(), span["line_end"].as_u64())
            else {
                continue;
            };
            if span["is_primary"] == true {
                lines.entry(file).or_default().extend(first as usize..=last as usize);
            }
        }
    }
    let mut number = 0;
    let mut found = BTreeSet::new();
    for source in sources {
        for mutant in &source.mutants {
            number += 1;
            let at =
                lines.iter().any(|(file, lines)| source.path.ends_with(file) && lines.contains(&mutant.line));
            if at && !known.contains(&number) {
                found.insert(number);
            }
        }
    }
    found
}

/// Runs each test whose name contains `test_name` without a mutant, to measure its time and the mutants that it reaches.
fn baseline(part: &Part, test_name: &str, programs: &[Program], reached: &Path) -> Result<Vec<Test>> {
    let mut names = Vec::new();
    for (index, program) in programs.iter().enumerate() {
        let Some((_, modules)) = part.tests.iter().find(|(package, _)| *package == program.package()) else {
            continue;
        };
        for name in program.tests()? {
            let module = if program.is_suite() { name.split("::").next().unwrap_or_default() } else { "lib" };
            if modules.contains(&module) && name.contains(test_name) {
                names.push((index, name));
            }
        }
    }
    let tests = Mutex::new(Vec::new());
    at_once(&names, cores(), |thread, (index, name)| {
        let program = &programs[*index];
        // Another part may be measured at the same time.
        let reached = reached.with_extension(format!("{}.{thread}.txt", part.name));
        let _ = fs::remove_file(&reached);
        let (verdict, time) =
            verdict(test(program, name).env(REACHED, &reached), Duration::from_secs(part.longest))?;
        ensure!(verdict != Verdict::Failed, "{} {name} fails without a mutant", program.package());
        if verdict == Verdict::TooLong {
            eprintln!("{} {name} takes too long and is left out", program.package());
            return Ok(());
        }
        let test = Test { program: *index, name: name.clone(), time, reaches: numbers(&reached) };
        tests.lock().unwrap_or_else(PoisonError::into_inner).push(test);
        Ok(())
    })?;
    let mut tests = tests.into_inner().unwrap_or_else(PoisonError::into_inner);
    tests.sort_by_key(|test| test.time);
    Ok(tests)
}

/// Command of a single test, which must not update snapshots.
fn test(program: &Program, name: &str) -> Command {
    let mut command = program.command();
    command.args(["--exact", name, "--test-threads=1"]).env("INSTA_UPDATE", "no");
    // Use few random programs, since the first ones kill most mutants, and a fixed seed for reproducible outcomes.
    command.env("TAKT_FEW", "1").env("PROPTEST_RNG_SEED", "1");
    command
}

/// Runs the tests that reach a mutant, shortest first, until one fails.
fn meet(number: u32, budget: Duration, tests: &[Test], programs: &[Program]) -> Result<Outcome> {
    let mut left = budget;
    let mut is_reached = false;
    for found in tests.iter().filter(|test| test.reaches.contains(&number)) {
        is_reached = true;
        let most = found.time * 10 + Duration::from_secs(5);
        let Some(rest) = left.checked_sub(found.time) else { break };
        left = rest;
        let mut command = test(&programs[found.program], &found.name);
        let (verdict, _) = verdict(command.env(CHOICE, number.to_string()), most)?;
        if verdict != Verdict::Passed {
            let package = programs[found.program].package();
            return Ok(Outcome::Found(format!("{package} {}", found.name)));
        }
    }
    Ok(if is_reached { Outcome::Survived } else { Outcome::Unreached })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rejected_mutants_are_cached_by_source() {
        let source = |path: &str, text: &str| Source {
            path: path.to_owned(),
            text: text.to_owned(),
            mutants: rust::mutants(text).unwrap(),
        };
        let (first, second) =
            (source("a.rs", "fn f() -> u32 { 1 + 2 }"), source("b.rs", "fn g() -> u32 { 3 }"));
        assert_eq!((first.mutants.len(), second.mutants.len()), (3, 1));
        let text = memories(&BTreeSet::from([2, 4]), &[&first, &second]).to_string();
        assert_eq!(remembered(&text, &[&first, &second]), BTreeSet::from([2, 4]));
        // The second source is now the first, so its mutant has number 1.
        assert_eq!(remembered(&text, &[&second]), BTreeSet::from([1]));
        let changed = source("a.rs", "fn f() -> u32 { 1 + 3 }");
        assert_eq!(remembered(&text, &[&changed, &second]), BTreeSet::from([4]));
        assert!(remembered("", &[&first, &second]).is_empty());
    }
}
