// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sources that state their memory sizes, and the cycles of these sources.

use super::{Cycles, Model};
use crate::run::load::Load;
use crate::terminal::files;
use anyhow::{Result, anyhow};
use std::path::PathBuf;
use takt_asm::AssembledProgram;
use takt_isa::Machine;

/// A source that states its machine.
pub(super) trait MachineSource {
    /// Text of the source.
    fn text(&self) -> &str;
    /// Machine that the source states.
    fn machine(&self) -> &'static Machine;
}

/// Figures of an assembled source.
pub(super) struct Figures {
    pub(super) cycles: Cycles,
    pub(super) bundles: usize,
}

/// Program memory depths to try, in bundles: enough for pipelined loops, and the maximum.
const TRIED: [usize; 2] = [4096, 65_535];

/// Assembles the source with the smallest program memory that suffices.
pub(super) fn sized<S: MachineSource>(
    arguments: &Model,
    color: bool,
    make: impl Fn(usize) -> Result<S, takt_front::Error>,
) -> Result<(S, Figures)> {
    let named = |error: takt_front::Error| anyhow!("{}: {error}", files::input_name(&arguments.file));
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
    // With less program memory, the assembler pipelines fewer loops.
    let again = self::figures(&load(&source).finish(assemble(&source))?)?;
    Ok(if again.cycles.worst > figures.cycles.worst { (deep, figures) } else { (source, again) })
}

fn figures(assembled: &AssembledProgram) -> Result<Figures> {
    let program = &assembled.program;
    let bounds = takt_analysis::bound(program).map_err(|error| anyhow!("no bound: {error}"))?;
    Ok(Figures { cycles: Cycles::of(program, &bounds), bundles: program.bundles() as usize })
}
