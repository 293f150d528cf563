// SPDX-License-Identifier: MIT OR Apache-2.0
//! JSON representation of the debug session, for the page.

use crate::Playground;
use serde::Deserialize;
use serde_json::{Value, json};
use takt_debug::console::Console;
use takt_debug::panes::NamedRegister;
use takt_debug::session::{BreakpointLocation, Stop};

/// Request to execute a console command.
#[derive(Deserialize)]
pub(crate) struct Execute {
    line: String,
}

impl Playground {
    pub(crate) fn execute(&mut self, wanted: Execute) -> Result<Value, String> {
        let console = self.console.as_mut().ok_or("there is no program to step through")?;
        let text = console.execute(&wanted.line)?;
        Ok(json!({ "text": text, "view": view(console) }))
    }
}

fn named(row: &NamedRegister) -> Value {
    json!({
        "name": row.name, "place": row.place, "type": row.ty.name(), "value": row.value(),
        "every_way": row.every_way(), "note": row.note, "changed": row.changed, "used": row.used,
    })
}

/// Contents of all panes at this position.
pub(crate) fn view(console: &mut Console) -> Value {
    let panes = console.panes();
    let session = console.session();
    let next = panes.lines.iter().find(|line| line.next).map(|line| line.number);
    let part: Vec<u32> = panes.lines.iter().filter(|line| line.part).map(|line| line.number).collect();
    let program = session.program();
    let breaks = session.stops().iter().filter_map(|(id, stop)| {
        let at = match stop {
            Stop::Break { at: BreakpointLocation::Line(at, _), .. } => *at,
            Stop::Break { at: BreakpointLocation::Bundle(bundle), .. } => program.location(*bundle)?,
            _ => return None,
        };
        Some(json!({ "id": id, "file": program.files.get(at.file as usize), "line": at.line }))
    });
    let rows = |rows: &[NamedRegister]| rows.iter().map(named).collect::<Vec<_>>();
    let flight = panes.flight.iter().map(|one| {
        json!({ "left": one.left, "register": one.register, "mnemonic": one.mnemonic, "from": one.from })
    });
    let bundle = panes.bundle.iter().map(|(slot, text)| json!({ "slot": slot, "text": text }));
    let stalls = panes.stalls.iter().map(|(cycles, text)| json!({ "cycles": cycles, "text": text }));
    let displays = panes.displays.iter().map(|(text, value)| json!({ "text": text, "value": value }));
    json!({
        "head": panes.head,
        "address": session.emulator().next_address(),
        "cycle": session.cycle(),
        "period": session.period(),
        "last": session.report().map(|report| report.cycles),
        "missed": session.emulator().statistics().missed,
        "flags": session.emulator().flags().to_string(),
        "file": panes.file,
        "line": next,
        "part": part,
        "breaks": breaks.collect::<Vec<_>>(),
        "bundle": bundle.collect::<Vec<_>>(),
        "registers": rows(&panes.registers),
        "inputs": rows(&panes.inputs),
        "outputs": rows(&panes.outputs),
        "flight": flight.collect::<Vec<_>>(),
        "cause": panes.cause,
        "stalls": stalls.collect::<Vec<_>>(),
        "displays": displays.collect::<Vec<_>>(),
    })
}
