// SPDX-License-Identifier: MIT OR Apache-2.0
//! The `accuracy` command: errors of registers against binary64, as text.

use crate::session::{Place, Session, noted};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use takt_analysis::accuracy::{ErrorShare, Shadow, ulp};
use takt_isa::{Program, Register, Type};

/// Maximum number of source lines listed as origins of an error.
const LISTED: usize = 3;

/// Looks up a register by name; without a name, all binary32 outputs. Returns each with its name.
///
/// # Errors
/// If the name is not a register.
pub(crate) fn registers(session: &Session, name: &str) -> Result<Vec<(String, Register)>, String> {
    if name.is_empty() {
        let ports = session.program().outputs.iter().filter(|port| port.ty == Type::F);
        return Ok(ports.map(|port| (port.name.clone(), port.register)).collect());
    }
    let live = session.parse(name)?;
    match session.place(&live)? {
        Some((Place::Register(register), Type::F, _)) => Ok(vec![(live.text().to_owned(), register)]),
        Some((Place::Register(_), ..)) => Err(format!("`{name}` is not a float: integers have no error")),
        _ => Err(format!("`{name}` is not a register")),
    }
}

/// Errors of registers at this position, up to which `shadow` has run from reset.
pub(crate) fn report(session: &Session, shadow: &Shadow, registers: &[(String, Register)]) -> String {
    let mut text = String::new();
    let width = registers.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    for (name, register) in registers {
        let flies = noted(session.stale(*register).map(|stale| stale.text(session.program())));
        let _ = match shadow.value(session.emulator(), *register) {
            None => writeln!(text, "{name:<width$}  no finite number{flies}"),
            Some((_, _, parts)) if parts.is_empty() => writeln!(text, "{name:<width$}  exact{flies}"),
            Some((value, exact, parts)) => {
                let error = value - exact;
                let (ulps, lines) = (error.abs() / ulp(exact), lines(session.program(), &parts));
                writeln!(text, "{name:<width$}  {error:+.3e} ({ulps:.2} ulp) of {exact:e}: {lines}{flies}")
            }
        };
    }
    text
}

/// Error contribution of each source line, largest first, as text for the console.
fn lines(program: &Program, parts: &[ErrorShare]) -> String {
    let mut lines: BTreeMap<String, f64> = BTreeMap::new();
    for part in parts {
        let location = program.lines.get(part.word as usize).copied().flatten();
        let place = location.map_or_else(|| "(no source line)".to_owned(), |at| program.place_text(at));
        *lines.entry(place).or_default() += part.error;
    }
    let mut lines: Vec<(String, f64)> = lines.into_iter().collect();
    lines.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    let shown: Vec<String> =
        lines.iter().take(LISTED).map(|(place, error)| format!("{place} {error:+.2e}")).collect();
    shown.join(", ")
}
