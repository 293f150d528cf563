// SPDX-License-Identifier: MIT OR Apache-2.0
//! Signals of a waveform: names, types and values.

use super::{CompletedCycle, Format, Record};
use crate::matches;
use std::sync::Arc;
use takt_asm::nearest;
use takt_emu::{Emulator, Event};
use takt_isa::timing::Cause;
use takt_isa::{BundleAddress, Program, Register, Type};
use takt_system::{End, LinkKind};

/// Origin of a signal's value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Source {
    /// 1 if a bundle issued in the cycle.
    Issue,
    /// Address of the bundle that issued or waits to issue.
    Bundle,
    /// 1 if a tick came in the cycle.
    Tick,
    /// 1 if a deadline was missed or a tick lost in the cycle.
    Missed,
    /// 1 if the cycle is charged to a cause of this kind.
    Stall(usize),
    /// Value of a register.
    Register(Register),
    /// Value that arrived last on a link of a system: link and field.
    Arrived(usize, usize),
    /// Number of entries in a FIFO.
    Count(usize),
}

/// A signal with its place in the hierarchy of the trace.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Signal {
    /// Core of a system, or `links`; `None` in a trace of one core.
    pub(super) part: Option<Arc<str>>,
    /// Group within the part; `None` at the top level.
    pub(super) scope: Option<&'static str>,
    pub(super) name: String,
    pub(super) source: Source,
    pub(super) ty: SignalType,
}

/// Representation of a signal's values.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum SignalType {
    Real,
    Bits(u32),
}

/// Top-level group of all signals.
pub(super) const TOP: &str = "takt";

impl Signal {
    /// Full path of the signal, as viewers show it.
    fn path(&self) -> String {
        let group = |name: Option<&str>| name.map_or(String::new(), |name| format!("{name}."));
        format!("{TOP}.{}{}{}", group(self.part.as_deref()), group(self.scope), self.name)
    }

    /// The pattern matches the name, group and name, or the whole path. Names may contain dots; a `*` before the first dot stands for one
    /// group.
    fn is(&self, pattern: &str) -> bool {
        let grouped = |(group, name): (&str, &str)| {
            self.scope.is_some_and(|scope| matches(group, scope)) && matches(name, &self.name)
        };
        let in_part = |(part, rest): (&str, &str)| {
            self.part.as_deref().is_some_and(|own| matches(part, own))
                && (matches(rest, &self.name) || rest.split_once('.').is_some_and(grouped))
        };
        matches(pattern, &self.name)
            || pattern.split_once('.').is_some_and(in_part)
            || pattern.split_once('.').is_some_and(grouped)
            || pattern.strip_prefix(TOP).is_some_and(|rest| rest.starts_with('.'))
                && matches(pattern, &self.path())
    }

    /// Value after a cycle; `None` while unknown.
    pub(super) fn value(&self, passed: CompletedCycle<'_>) -> Option<u32> {
        let (records, system) = match passed {
            CompletedCycle::Core(record, emulator) => return self.value_in(record, emulator),
            CompletedCycle::System(records, system) => (records, system),
        };
        let description = system.description();
        match self.source {
            Source::Count(link) => Some(system.fifo_entries(link).len() as u32),
            Source::Arrived(link, field) => {
                let link = &description.links[link];
                let names = &link.fields[field];
                if let (End::Core(core), Some(register)) = (link.to, names.input) {
                    return system.core(core).register(register);
                }
                let name = match link.kind {
                    LinkKind::Wire => names.to.clone(),
                    _ => format!("{}.{}", link.name, names.to),
                };
                system.output(&name).ok()
            }
            _ => {
                let core = self.part.as_deref().and_then(|name| description.core_named(name))?;
                self.value_in(&records[core], system.core(core))
            }
        }
    }

    /// Value of a signal that belongs to a core.
    fn value_in(&self, record: &Record, emulator: &Emulator) -> Option<u32> {
        let heard = |is: fn(&Event) -> bool| Some(record.events.iter().any(is).into());
        match self.source {
            Source::Issue => Some(record.issued.is_some().into()),
            Source::Bundle => {
                let bundle = record.issued.or(record.stall.map(|(address, _)| address));
                bundle.map(BundleAddress::get)
            }
            Source::Tick => heard(|event| matches!(event, Event::Tick { .. })),
            Source::Missed => {
                heard(|event| matches!(event, Event::DeadlineMissed { .. } | Event::TickLost { .. }))
            }
            Source::Stall(kind) => Some(record.stall.is_some_and(|(_, cause)| cause.kind() == kind).into()),
            Source::Register(register) if emulator.machine().is_output(register) => {
                emulator.output_bits(register)
            }
            Source::Register(register) => emulator.register(register),
            // Signals of links belong to the system, not to a core.
            Source::Arrived(..) | Source::Count(_) => None,
        }
    }
}

/// Errors of the selection of signals.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SignalError {
    /// The pattern matches no signal.
    #[error("no signal is named `{name}`{}", near.as_ref().map_or(String::new(), |near| format!("; did you mean `{near}`?")))]
    Unknown {
        /// Name that matches no signal.
        name: String,
        /// Closest existing name, as a suggestion.
        near: Option<String>,
    },
    /// The name selects signals other than registers, in a format that selects by register.
    #[error("`{0}` is not a register: a retire log has the operations that write the registers selected")]
    NoRegister(String),
    /// Signals were requested in a format that has none.
    #[error("a Kanata trace shows operations; it has no signals to select")]
    None,
}

/// All signals of a program.
pub(super) fn all(program: &Program) -> Vec<Signal> {
    let address_bits = u32::BITS - program.bundles().leading_zeros();
    let wire = |scope, name: &str, source, width| Signal {
        part: None,
        scope,
        name: name.to_owned(),
        source,
        ty: SignalType::Bits(width),
    };
    let mut signals = vec![
        wire(None, "issue", Source::Issue, 1),
        wire(None, "bundle", Source::Bundle, address_bits.max(1)),
        wire(None, "tick", Source::Tick, 1),
        wire(None, "missed", Source::Missed, 1),
    ];
    for (kind, name) in Cause::KINDS.iter().enumerate() {
        signals.push(wire(Some("stall"), &name.replace(' ', "_"), Source::Stall(kind), 1));
    }
    for (scope, ports) in [
        ("inputs", &program.inputs),
        ("parameters", &program.parameters),
        ("outputs", &program.outputs),
        ("registers", &program.registers),
    ] {
        signals.extend(ports.iter().map(|port| Signal {
            part: None,
            scope: Some(scope),
            name: port.name.clone(),
            source: Source::Register(port.register),
            ty: if port.ty == Type::F { SignalType::Real } else { SignalType::Bits(32) },
        }));
    }
    signals
}

/// Signals of a program that match the patterns; all signals if there are none.
pub(super) fn select(
    program: &Program,
    format: Format,
    patterns: &[String],
) -> Result<Vec<Signal>, SignalError> {
    select_of(all(program), format, patterns)
}

/// Subset of `signals` that matches the patterns.
pub(super) fn select_of(
    signals: Vec<Signal>,
    format: Format,
    patterns: &[String],
) -> Result<Vec<Signal>, SignalError> {
    if patterns.is_empty() {
        return Ok(signals);
    }
    if format == Format::Kanata {
        return Err(SignalError::None);
    }
    for pattern in patterns {
        let mut meant = signals.iter().filter(|signal| signal.is(pattern)).peekable();
        if meant.peek().is_none() {
            let paths: Vec<String> = signals.iter().map(Signal::path).collect();
            // Suggest names with as many path components as the pattern.
            let grouped =
                |path: &'_ str| path.split_once('.').map_or(String::new(), |(_, rest)| rest.to_owned());
            let groups: Vec<String> = paths.iter().map(|path| grouped(path)).collect();
            let names = signals.iter().map(|signal| signal.name.as_str());
            let near = nearest(pattern, names.chain(groups.iter().chain(&paths).map(String::as_str)));
            return Err(SignalError::Unknown { name: pattern.clone(), near });
        }
        if format == Format::JsonLines && !meant.any(|signal| matches!(signal.source, Source::Register(_))) {
            return Err(SignalError::NoRegister(pattern.clone()));
        }
    }
    let wanted = |signal: &Signal| patterns.iter().any(|pattern| signal.is(pattern));
    Ok(signals.into_iter().filter(wanted).collect())
}
