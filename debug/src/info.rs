//! `info`: what a name stands for and where its values live, as text.

use crate::session::{Life, Session};
use std::fmt::Write as _;
use takt_asm::expr::Value;
use takt_isa::timing::Address;
use takt_isa::{Program, Type};

/// Bundles that are listed of those that write or read a register.
const LISTED: usize = 6;

/// What a name stands for: its registers, the bundles that write and read them, which of them is at hand.
///
/// # Errors
/// If nothing is named so.
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
                writeln!(text, "{name} is {}", program.bundle_text(symbol.address))
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
        let _ =
            writeln!(text, "{name} is {}, {}: {}", kind(program, only.register), place, type_name(only.ty));
    } else {
        let _ = writeln!(text, "{name} stands for {} registers here and there; > is at hand", lives.len());
    }
    for life in &lives {
        let mark = if life.at_hand { '>' } else { ' ' };
        let head = format!("{mark} {:<width$}  {:<5}", life.label, place(program, life));
        let head = if lives.len() == 1 { " ".to_owned() } else { head };
        let _ = writeln!(text, "{head} {}", lifetime(program, life));
    }
    Ok(text)
}

fn place(program: &Program, life: &Life) -> String {
    program.machine.register_name(life.register).unwrap_or_default()
}

fn kind(program: &Program, register: u16) -> &'static str {
    let among = |ports: &[takt_isa::program::Port]| ports.iter().any(|port| port.register == register);
    match () {
        () if among(&program.inputs) => "an input port",
        () if among(&program.outputs) => "an output port",
        () => "a register",
    }
}

const fn type_name(ty: Type) -> &'static str {
    match ty {
        Type::F => "float",
        Type::I => "int",
        Type::B => "bits",
    }
}

/// Where a value is written and read.
fn lifetime(program: &Program, life: &Life) -> String {
    if let Some((first, last)) = life.bundles {
        let first_text = program.bundle_text(first);
        return match first == last {
            true => format!("{first_text} writes it, nothing reads it"),
            false => format!("{first_text} to {}", program.bundle_text(last)),
        };
    }
    let (mut written, mut read) = (Vec::new(), Vec::new());
    for address in 0..program.bundles() {
        let Some(Ok(instructions)) = program.bundle(address) else { continue };
        for (instruction, slot) in instructions.iter().zip(program.machine.slots) {
            if instruction.writes(slot) == Some(life.register) {
                written.push(address);
            }
            if instruction.reads().contains(&life.register) {
                read.push(address);
            }
        }
    }
    format!("written in {}; read in {}", places(program, written), places(program, read))
}

/// The first of some bundles, and how many there are: `3 places: bundle 12 (a.s:4), …`.
pub(crate) fn places(program: &Program, mut bundles: Vec<Address>) -> String {
    bundles.dedup();
    let shown = bundles.iter().take(LISTED).map(|address| program.bundle_text(*address));
    let shown = shown.collect::<Vec<_>>().join(", ");
    match bundles.len() {
        0 => "no bundle".to_owned(),
        1 => shown,
        count if count > LISTED => format!("{count} places: {shown}, …"),
        count => format!("{count} places: {shown}"),
    }
}
