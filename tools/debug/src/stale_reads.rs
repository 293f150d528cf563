// SPDX-License-Identifier: MIT OR Apache-2.0
//! Warning of a stale FIFO read: a field read after its entry was popped, with a suggested fix.

use crate::fault::line;
use std::sync::Arc;
use takt_asm::diag::{Diagnostic, Diagnostics, Severity};
use takt_asm::levels::{Level, Levels};
use takt_asm::source::Sources;
use takt_system::Description;
use takt_system::stale_reads::{Doubt, StaleRead};

/// Diagnostic of a stale read, at its source line if `sources` has the text (keyed by the file names in the core's program). `None` if
/// `levels` allow the read.
pub fn diagnose(
    read: &StaleRead,
    description: &Description,
    sources: &[(String, String)],
    levels: &Levels,
) -> Option<Diagnostics> {
    const CODE: &str = "next-head";
    let level = levels.of(CODE);
    if level == Level::Allow {
        return None;
    }
    let core = &description.cores[read.core];
    let program = &core.program;
    let [field, pop] = [read.field, read.pop].map(|register| program.register_text(register));
    let link = &description.links[read.link].name;
    let StaleRead { after, complete, .. } = read;
    let message = match read.doubt {
        Doubt::Moved => format!(
            "stale read: `{field}` of `{link}` is read {after} cycles after the pop that stands below it, so it may be the next entry's"
        ),
        Doubt::Between => format!(
            "stale read: `{field}` of `{link}` is read {after} cycles after a pop, which is neither before the next entry nor after it"
        ),
    };
    let place = |at| line(program, at, sources);
    let (sources, mut warning) = match read.read.and_then(place) {
        Some((sources, span)) => (sources, Diagnostic::warning(CODE, span, message)),
        None => {
            let message = format!("bundle {}: {message}", read.read_at);
            let placeless = Diagnostic::placeless(CODE, message);
            (Sources::default(), Diagnostic { severity: Severity::Warning, ..placeless })
        }
    };
    if let (Some(popped), Some(read)) = (read.popped, read.read)
        && popped.file == read.file
        && let Some((_, span)) = place(popped)
    {
        warning = warning.also(span, "the pop");
    }
    if level == Level::Error {
        warning.severity = Severity::Error;
    }
    let mend = match read.doubt {
        Doubt::Moved => format!("keep the read before the pop: `.order {field}, {pop}`"),
        Doubt::Between => format!(
            "read it before the pop, with `.order {field}, {pop}` where code is scheduled, or {complete} cycles after the pop's \
             writeback or later, when the next entry is complete"
        ),
    };
    Some(Diagnostics {
        sources: Arc::new(sources),
        list: vec![warning.note(format!("core {}", core.name)).help(mend)],
        ..Diagnostics::default()
    })
}
