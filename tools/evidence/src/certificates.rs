// SPDX-License-Identifier: MIT OR Apache-2.0
//! Certificates of bounds (`takt accuracy --certificate`), checked by Gappa and by `check.py` for five programs; and certificates with a
//! planted mistake, all of which are refused.

use anyhow::{Context, Result, ensure};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_analysis::accuracy::{Certificate, Rounding, Step, certify};
use takt_asm::{FileLoader, Options, Search};
use takt_automation::check_cache::Inputs;
use takt_automation::command::{apt_install, root, works};
use takt_isa::T3;

/// Programs whose certificates are checked, with the outputs that they bound at least.
const PROGRAMS: [(&str, usize); 5] = [
    ("hybrid/tracking.s", 40),
    ("examples/foc.s", 5),
    ("examples/pi.s", 1),
    ("examples/statespace.s", 4),
    ("examples/biquads.s", 1),
];
/// Program whose certificate gets the mistakes, and one with states that only all periods together keep.
const TAMPERED: &str = "examples/foc.s";
const CONVERGING: &str = "examples/biquads.s";

/// A mistake, planted into a certificate or its goals.
type Mistake = (&'static str, fn(&mut Certificate, &mut Vec<(String, String)>));

/// Files that determine the outcome.
pub(crate) fn inputs() -> Result<Inputs> {
    let root = root();
    Inputs::below(&root)
        .tool("gappa", "--version")
        .files("emu/analysis/src")?
        .files("isa/src")?
        .files("asm/src")?
        .files("programs/hybrid")?
        .files("programs/examples")
}

/// Checks the certificates of all programs, and that damaged ones are refused.
pub(crate) fn check() -> Result<()> {
    if !works("gappa", "--version") {
        apt_install(&["gappa"])?;
    }
    let folder = std::env::temp_dir().join(format!("takt-certificates-{}", std::process::id()));
    for (name, least) in PROGRAMS {
        let certificate = certificate(name)?;
        let bounded = certificate.outputs.len();
        ensure!(
            bounded >= least,
            "{name}: the certificate bounds {bounded} outputs, not {least}: {:?}",
            certificate.open
        );
        write(&folder, &certificate.files())?;
        let (accepted, text) = checked(&folder)?;
        ensure!(accepted, "{name}: {text}");
        println!("{name}\n{text}");
    }
    let of_states = MISTAKES_OF_STATES.into_iter().map(|mistake| (CONVERGING, mistake));
    for (name, (mistake, plant)) in MISTAKES.into_iter().map(|mistake| (TAMPERED, mistake)).chain(of_states) {
        let mut certificate = certificate(name)?;
        let (sound, mut goals) = (certificate.files(), certificate.files().split_off(2));
        plant(&mut certificate, &mut goals);
        let mut files = certificate.files();
        files.truncate(2);
        files.append(&mut goals);
        ensure!(files != sound, "{mistake}: nothing was changed");
        write(&folder, &files)?;
        let (accepted, text) = checked(&folder)?;
        ensure!(!accepted, "accepted, with a mistake: {mistake}");
        println!("refused, {mistake}: {}", text.trim());
    }
    Ok(fs::remove_dir_all(folder)?)
}

fn certificate(name: &str) -> Result<Certificate> {
    let path = root().join("programs").join(name);
    let (folder, file) = (path.parent().unwrap_or(&path), path.file_name().unwrap_or_default());
    let loader = Search::new(FileLoader::new(folder.to_owned())).library(takt_programs::LIBRARY);
    let options = Options { machine: &T3, ..Options::default() };
    let assembled = takt_asm::assemble(&file.to_string_lossy(), &loader, &options);
    let program = assembled.map_err(|errors| anyhow::anyhow!("{name}: {}", errors.render(false)))?.program;
    let certificate = certify(&program).with_context(|| name.to_owned())?;
    certificate.map_err(|reason| anyhow::anyhow!("{name}: {reason}"))
}

fn write(folder: &Path, files: &[(String, String)]) -> Result<()> {
    let _ = fs::remove_dir_all(folder);
    fs::create_dir_all(folder)?;
    for (name, text) in files {
        fs::write(folder.join(name), text)?;
    }
    Ok(())
}

/// The checker's verdict, and what it prints.
fn checked(folder: &PathBuf) -> Result<(bool, String)> {
    let output =
        Command::new("python3").arg(folder.join("check.py")).arg(folder).output().context("python3")?;
    let text =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    let refused = text.starts_with("refused: ");
    ensure!(output.status.success() || refused, "check.py failed: {text}");
    Ok((output.status.success(), text))
}

/// The first step of a rule, with an error if `errs`.
fn first<'c>(certificate: &'c mut Certificate, rule: &str, errs: bool) -> &'c mut Step {
    let fits = |step: &&mut Step| step.rule == rule && !(errs && step.error.terms.is_empty());
    certificate.steps.iter_mut().find(fits).expect("a step of this rule")
}

fn rounding(certificate: &mut Certificate) -> &mut Rounding {
    first(certificate, "round", true).rounding.as_mut().expect("a rounding")
}

/// Twenty mistakes.
const MISTAKES: [Mistake; 20] = [
    ("an output's bound is halved", |c, _| c.outputs[0].bound *= 0.5),
    ("an output's bound is a millionth smaller", |c, _| c.outputs[1].bound *= 1.0 - 1e-6),
    ("a product's range in the run is narrower", |c, _| first(c, "mul", true).run[1] *= 0.9),
    ("a sum's exact range is narrower", |c, _| first(c, "add", true).exact[0] *= 0.9),
    ("a product's error loses a term", |c, _| _ = first(c, "mul", true).error.terms.pop()),
    ("a sum's coefficient is smaller", |c, _| first(c, "add", true).error.terms[0].1 *= 0.5),
    ("a sum's coefficient has the other sign", |c, _| first(c, "add", true).error.terms[0].1 *= -1.0),
    ("a product's error has no slack", |c, _| first(c, "mul", true).error.slack = 0.0),
    ("a product's error has another center", |c, _| first(c, "mul", true).error.center = 1e-3),
    ("a rounding's bound is halved", |c, _| rounding(c).bound *= 0.5),
    ("a rounding's bound and its term are halved", |c, _| {
        rounding(c).bound *= 0.5;
        first(c, "round", true).error.terms.iter_mut().for_each(|term| term.1 *= 0.5);
    }),
    ("two roundings have one symbol", |c, _| {
        let symbol = rounding(c).symbol;
        c.steps
            .iter_mut()
            .filter_map(|step| step.rounding.as_mut())
            .for_each(|rounding| rounding.symbol = symbol);
    }),
    ("a sum counts as rounded to a quarter ulp", |c, _| {
        let sums: Vec<usize> = (0..c.steps.len()).filter(|place| c.steps[*place].rule == "add").collect();
        let step = c.steps.iter_mut().find(|step| step.rule == "round" && sums.contains(&step.of[0]));
        step.and_then(|step| step.rounding.as_mut()).expect("a rounded sum").ulps = 0.25;
    }),
    ("an input's range is narrower than its promise", |c, _| first(c, "promise", false).run[1] *= 0.5),
    ("a promise is wider than the input's range", |c, _| {
        let promise = first(c, "promise", false).promise.unwrap_or(0);
        c.promises[promise].range[1] *= 2.0;
    }),
    ("a root's error is smaller", |c, _| {
        let root =
            c.steps.iter_mut().find(|step| step.rule == "sqrt" || step.rule == "steep").expect("a root");
        root.error.slack *= 0.5;
        root.error.terms.iter_mut().for_each(|term| term.1 *= 0.5);
    }),
    ("a product counts as a sum", |c, _| first(c, "mul", true).rule = "add"),
    ("a step refers to a later one", |c, _| {
        let last = c.steps.len() - 1;
        first(c, "add", false).of[0] = last;
    }),
    ("a goal is missing", |_, goals| _ = goals.pop()),
    ("a goal of Gappa states something else", |_, goals| {
        let (_, text) = goals.last_mut().expect("a goal");
        *text = text.replace("-> r in", "-> r - r in");
    }),
];

/// Mistakes in the proof that states converge.
const MISTAKES_OF_STATES: [Mistake; 4] = [
    ("states may begin anywhere in their ranges", |c, _| {
        for state in &mut c.converging {
            state.first = c.promises[state.promise].range;
        }
    }),
    ("the states' ranges are an eighth", |c, _| {
        for state in &c.converging {
            c.promises[state.promise].range = c.promises[state.promise].range.map(|end| end / 8.0);
        }
    }),
    ("a state never changes", |c, _| {
        let promise = Some(c.converging[0].promise);
        let begins = c.steps.iter().position(|step| step.promise == promise);
        c.converging[0].step = begins.expect("it is read");
    }),
    ("a state occurs twice", |c, _| c.converging[1] = c.converging[0].clone()),
];
