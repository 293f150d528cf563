// SPDX-License-Identifier: MIT OR Apache-2.0
//! C99: a step function and its callees become a program; each period is one call.
//!
//! The C is executed while it is translated (`exec`): known integers, pointers, sizes and counters are computed; floats and values that
//! depend on inputs become nodes (`ir`), which `write` spells. Paths that depend on data become choices or branches; loops are written
//! out while they are short. `ports` decides the roles of the step's parameters and of variables that outlive it.

mod exec;
mod ir;
mod live;
mod ports;
mod preprocess;
mod types;
mod unit;
mod value;
mod write;

pub use ports::Port;
pub use preprocess::{HEADERS, Preprocessor};

use crate::Error;
use exec::{Exec, Facts};
use unit::Unit;

/// Limit on the translations until their facts no longer grow.
const MAX_ROUNDS: usize = 64;
/// Bytes of stack while translating: statements and expressions nest.
const STACK: usize = 512 << 20;

/// A preprocessed file.
#[derive(Clone, Debug)]
pub struct Source {
    /// Name of the file, for messages.
    pub name: String,
    /// Preprocessed text with line markers.
    pub text: String,
}

/// Options of a translation.
#[derive(Clone, Debug)]
pub struct Options {
    /// Name of the function that is a period.
    pub step: String,
    /// Name of the function that runs once, before the first period.
    pub init: Option<String>,
    /// Numbers that the step is given in every period, by the scalars and arrays as C writes them (`n`, `conf->taps`): they are computed
    /// with while translating. An array gets as many as are given, from its first element on.
    pub set: Vec<(String, Vec<f64>)>,
    /// Functions whose calls are left out where no result is used.
    pub ignore: Vec<String>,
    /// Bound of the loops whose end data decide and that have no other; more iterations are a fault.
    pub loop_bound: Option<u64>,
    /// Read `double` as `float`, and every number as binary32.
    pub double_is_float: bool,
}

/// A program in the language, with its ports.
#[derive(Clone, Debug)]
pub struct Translation {
    /// The source.
    pub text: String,
    /// Input ports.
    pub inputs: Vec<Port>,
    /// Output ports.
    pub outputs: Vec<Port>,
}

/// A function that the sources define, and the result of its translation as the step.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Name of the function.
    pub name: String,
    /// File that defines the function.
    pub file: String,
    /// Line of its definition.
    pub line: usize,
    /// The program, or the reason why there is none.
    pub translation: Result<Translation, Error>,
}

/// Translates C.
///
/// # Errors
/// If the text is not supported C: with file, line, reason and remedy.
pub fn translate(sources: &[Source], options: &Options) -> Result<Translation, Error> {
    on_own_stack(|| translated(&units(sources)?, options, true))
}

/// Tries every function that the sources themselves define (not their includes) as the step; `options.step` is not read, and
/// `options.set` holds where a function has such a scalar.
///
/// # Errors
/// If a source cannot be read as C. A function that is refused is no error of the list.
pub fn candidates(sources: &[Source], options: &Options) -> Result<Vec<Candidate>, Error> {
    let units = on_own_stack(|| units(sources))?;
    let mut candidates = Vec::new();
    for unit in &units {
        for (name, line) in unit.functions() {
            let options = Options { step: name.clone(), ..options.clone() };
            let translation = on_own_stack(|| translated(&units, &options, false));
            candidates.push(Candidate { name, file: unit.files[0].clone(), line, translation });
        }
    }
    Ok(candidates)
}

/// Parsing and execution recurse with the nesting of the C: on a stack of their own.
fn on_own_stack<T: Send>(work: impl FnOnce() -> Result<T, Error> + Send) -> Result<T, Error> {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(STACK).spawn_scoped(scope, work);
        match thread {
            Ok(thread) => thread
                .join()
                .unwrap_or_else(|_| Err(Error::plain("the translation failed: this is a defect, report it"))),
            Err(error) => Err(Error::plain(format!("cannot start a thread for the translation: {error}"))),
        }
    })
}

fn units(sources: &[Source]) -> Result<Vec<Unit>, Error> {
    sources.iter().map(|source| Unit::read(&source.name, &source.text)).collect()
}

fn translated(units: &[Unit], options: &Options, strict: bool) -> Result<Translation, Error> {
    let mut facts = Facts::default();
    for _ in 0..MAX_ROUNDS {
        let mut exec = Exec::new(units, options, facts);
        match round(&mut exec, options) {
            _ if exec.again => facts = exec.facts,
            // A name that is wrong says more than its consequences.
            result => {
                if let (Some(name), true) = (exec.missing, strict) {
                    return Err(Error::plain(format!(
                        "--set {name}: the step reads no such scalar; write it as C does: `n`, `conf->taps`, `x[0]`"
                    )));
                }
                match result? {
                    Some(translation) => return Ok(translation),
                    None => facts = exec.facts,
                }
            }
        }
    }
    Err(Error::plain(format!(
        "after {MAX_ROUNDS} translations it is still not known which data index what: split the step"
    )))
}

/// One translation, with the facts of the earlier ones.
fn round(exec: &mut Exec<'_>, options: &Options) -> Result<Option<Translation>, Error> {
    let before = exec.facts.clone();
    for unit in 0..exec.units.len() {
        exec.file(unit)?;
    }
    let (step, signature) = exec.entry(&options.step, "step")?;
    let init = options.init.as_ref().map(|name| exec.entry(name, "init")).transpose()?;
    exec.prepare_all()?;
    let objects = exec.parameters(&signature, None)?;
    if let Some((init, signature)) = init {
        let own = exec.parameters(&signature, Some(&objects))?;
        exec.bound(&init, &signature, &own)?;
        exec.run(&init)?;
    }
    exec.behind()?;
    exec.missing = exec.set(&options.set)?;
    exec.bound(&step, &signature, &objects)?;
    exec.here(&step);
    let begun = exec.begin()?;
    let result = exec.run(&step)?;
    if exec.again && exec.facts != before {
        return Ok(None);
    }
    let roles = exec.end(begun, result)?;
    if exec.again {
        return Ok(None);
    }
    write::program(exec, roles, options).map(Some)
}
