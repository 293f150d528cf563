// SPDX-License-Identifier: MIT OR Apache-2.0
//! Fault diagnostics: the fault at its source line, in the form of a compiler error.

use std::sync::Arc;
use takt_asm::diag::{Diagnostic, Diagnostics};
use takt_asm::source::{Lines, Sources, Span};
use takt_emu::{Fault, FaultKind};
use takt_isa::Program;
use takt_isa::program::Location;

/// Diagnostic of a fault: cause and source line. `sources` maps the program's file names to texts; without the text, the message gives
/// the place as `FILE:LINE`.
pub fn diagnose(fault: &Fault, program: &Program, sources: &[(String, String)]) -> Diagnostics {
    const CODE: &str = "fault";
    let shown = fault.show(program);
    let found = fault.location(program).and_then(|location| line(program, location, sources));
    let (sources, mut diagnostic) = match found {
        Some((sources, span)) => {
            (sources, Diagnostic::error(CODE, span, shown.message()).here(shown.place()))
        }
        None => (Sources::default(), Diagnostic::placeless(CODE, shown.to_string())),
    };
    diagnostic.help = mend(&fault.kind, program);
    Diagnostics { sources: Arc::new(sources), list: vec![diagnostic], ..Diagnostics::default() }
}

/// Suggested fix, if one is known.
fn mend(kind: &FaultKind, program: &Program) -> Option<String> {
    Some(match kind {
        FaultKind::ProgramCounter { .. } => {
            "end a program with `halt`, and each period with `wait`".to_owned()
        }
        FaultKind::CycleLimit { .. } => "does the program come to its `wait` or `halt`?".to_owned(),
        FaultKind::UnwrittenRegister { register } if program.machine.is_input(*register) => {
            "the host sets an input port before it is read".to_owned()
        }
        FaultKind::UnwrittenRegister { register } => {
            let name = program.register_text(*register);
            format!("write it before, or let the loader set it: `.preset {name} = 0`")
        }
        _ => return None,
    })
}

/// Statement on a source line, without the comment. `texts` maps the program's file names to texts.
pub fn line(program: &Program, location: Location, texts: &[(String, String)]) -> Option<(Sources, Span)> {
    let name = program.files.get(location.file as usize)?;
    let (_, text) = texts.iter().find(|(known, _)| known == name)?;
    let lines = Lines::of(text);
    let start = lines.range((location.line as usize).checked_sub(1)?)?.start;
    let line = lines.text(text, location.line)?;
    let statement = line.split(';').next().unwrap_or(line).trim_end();
    let start = start + (statement.len() - statement.trim_start().len());
    let end = start + statement.trim_start().len();
    let mut sources = Sources::default();
    sources.add(name, text.as_str().into())?;
    Some((sources, Span::new(start as u32, end as u32)))
}
