// SPDX-License-Identifier: MIT OR Apache-2.0
//! The `info` command: meaning of a name, and lifetimes of its values, as text.

use crate::session::{BreakpointLocation, LiveRange, Session};
use std::fmt::Write as _;
use takt_asm::expr::Value;
use takt_isa::{BundleAddress, Program, Register};

/// Maximum number of bundles listed as writers or readers of a register.
const LISTED: usize = 6;

/// Describes a name: its registers, the bundles that write and read them, and the register that the current line uses.
///
/// # Errors
/// If the name is unknown.
pub(crate) fn info(session: &Session, name: &str) -> Result<String, String> {
    let live = session.parse(name)?;
    let program = session.program();
    let lives = session.lives(&live);
    let mut text = String::new();
    if lives.is_empty() {
        let value = session.evaluate(&live)?;
        let symbol = program.symbols.iter().find(|symbol| symbol.name == live.text());
        let _ = match (symbol, value) {
            (Some(symbol), _) if symbol.space == takt_isa::program::Space::Code => {
                writeln!(text, "{name} is {}", program.bundle_text(BundleAddress::new(symbol.address)))
            }
            (Some(symbol), _) => writeln!(text, "{name} is data word {}", symbol.address),
            (None, Value::Int(value)) => writeln!(text, "{name} is {value}"),
            (None, Value::Real(value)) => writeln!(text, "{name} is {value:?}"),
        };
        return Ok(text);
    }
    let width = lives.iter().map(|life| life.label.len()).max().unwrap_or(0);
    if let [only] = &lives[..] {
        let place = place(program, only);
        let _ = writeln!(text, "{name} is {}, {}: {}", kind(program, only.register), place, only.ty.name());
    } else {
        let at_hand = lives.iter().any(|life| life.at_hand);
        let at_hand = if at_hand { "; > marks the current line's" } else { "; none is the current line's" };
        let _ = writeln!(text, "{name} has {} values{at_hand}", lives.len());
    }
    for life in &lives {
        let mark = if life.at_hand { '>' } else { ' ' };
        let head = format!("{mark} {:<width$}  {:<5}", life.label, place(program, life));
        let head = if lives.len() == 1 { " ".to_owned() } else { head };
        let _ = writeln!(text, "{head} {}", lifetime(program, life));
    }
    Ok(text)
}

fn place(program: &Program, life: &LiveRange) -> String {
    program.machine.register_name(life.register).unwrap_or_default()
}

fn kind(program: &Program, register: Register) -> &'static str {
    let among = |ports: &[takt_isa::program::Port]| ports.iter().any(|port| port.register == register);
    match () {
        () if among(&program.inputs) => "an input port",
        () if among(&program.outputs) => "an output port",
        () => "a register",
    }
}

/// Bundles that write and read a value, with the source lines of the operations.
fn lifetime(program: &Program, life: &LiveRange) -> String {
    let (mut written, mut read) = (Vec::new(), Vec::new());
    let end = BundleAddress::new(program.bundles());
    let (first, last) = life.bundles.unwrap_or((BundleAddress::RESET, end.previous()));
    for address in first.until(last.next()) {
        let Some(Ok(instructions)) = program.bundle(address) else { continue };
        for (instruction, (number, slot)) in instructions.iter().zip(program.machine.numbered_slots()) {
            let place = || {
                let line = program.operation_place(address, number);
                let line = line.map_or(String::new(), |line| format!(" ({line})"));
                format!("bundle {address}{line}")
            };
            // If values share a register, the bundle of a value's last use may write the next value.
            let next = life.bundles.is_some() && address == last && address != first;
            if instruction.writes(slot) == Some(life.register) && !next {
                written.push(place());
            }
            // The bundle of a value's first write may still read the previous value.
            let before = life.bundles.is_some() && address == first;
            if instruction.reads().contains(&life.register) && !before {
                read.push(place());
            }
        }
    }
    format!("written in {}; read in {}", listed(written), listed(read))
}

/// Text for the places of a breakpoint: `bundle 12 (a.s:4)`, or `3 places: …`.
pub(crate) fn places(program: &Program, at: &BreakpointLocation) -> String {
    match at {
        BreakpointLocation::Bundle(address) => program.bundle_text(*address),
        BreakpointLocation::Line(line, bundles) => {
            let line = program.place_text(*line);
            listed(bundles.iter().map(|address| format!("bundle {address} ({line})")).collect())
        }
        BreakpointLocation::Cycle(cycle) => format!("cycle {cycle}"),
        BreakpointLocation::Period(period) => format!("period {period}"),
    }
}

/// The first [`LISTED`] places; if there are more, also their number.
fn listed(mut places: Vec<String>) -> String {
    places.dedup();
    let shown = || places.iter().take(LISTED).map(String::as_str).collect::<Vec<_>>().join(", ");
    match places.len() {
        0 => "no bundle".to_owned(),
        1 => shown(),
        count if count > LISTED => format!("{count} places: {}, …", shown()),
        count => format!("{count} places: {}", shown()),
    }
}
