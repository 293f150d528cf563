// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sources that state how deep memories they need, and the cycles that they take.

use super::Model;
use crate::files;
use crate::load::Load;
use anyhow::{Result, anyhow};
use std::path::PathBuf;
use takt_asm::Assembled;
use takt_isa::Machine;
use takt_isa::timing::Cycle;

/// A source that states its machine.
pub(super) trait Stated {
    /// Its text.
    fn text(&self) -> &str;
    /// The machine that it states.
    fn machine(&self) -> &'static Machine;
}

/// What is known of a source that was assembled.
pub(super) struct Figures {
    pub(super) cycles: Cycle,
    pub(super) bundles: usize,
}

/// Bundles of the program memories that are tried: room for pipelined loops, and for whatever fits at all.
const TRIED: [usize; 2] = [4096, 65_535];

/// The source with a program memory no deeper than it needs, assembled.
pub(super) fn sized<S: Stated>(
    arguments: &Model,
    color: bool,
    make: impl Fn(usize) -> Result<S, takt_model::Error>,
) -> Result<(S, Figures)> {
    let named = |error: takt_model::Error| anyhow!("{}: {error}", files::input_name(&arguments.file));
    let name = arguments.output.clone().filter(|path| !files::is_dash(path));
    let name = name.unwrap_or_else(|| PathBuf::from("model.s"));
    let load = |source: &S| Load::new(source.machine(), color);
    let assemble = |source: &S| load(source).assemble(&name, source.text().as_bytes().to_vec());
    let [first, last] = TRIED;
    let mut deep = make(first).map_err(named)?;
    let mut assembled = assemble(&deep);
    if assembled.is_err() {
        deep = make(last).map_err(named)?;
        assembled = assemble(&deep);
    }
    let figures = figures(&load(&deep).finish(assembled)?)?;
    let source = make(figures.bundles).map_err(named)?;
    if source.machine().name == deep.machine().name {
        return Ok((source, figures));
    }
    // The assembler pipelines fewer loops where that would fill the memory.
    let again = self::figures(&load(&source).finish(assemble(&source))?)?;
    Ok(if again.cycles > figures.cycles { (deep, figures) } else { (source, again) })
}

fn figures(assembled: &Assembled) -> Result<Figures> {
    let program = &assembled.program;
    let bounds = takt_analysis::bound(program).map_err(|error| anyhow!("no bound: {error}"))?;
    Ok(Figures { cycles: bounds.worst_period().unwrap_or(0), bundles: program.bundles() as usize })
}
