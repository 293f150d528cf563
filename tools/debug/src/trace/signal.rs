// SPDX-License-Identifier: MIT OR Apache-2.0
//! Signals: what a waveform shows.

use super::{Format, Passed, Record};
use crate::matches;
use std::sync::Arc;
use takt_asm::nearest;
use takt_emu::{Emulator, Event};
use takt_isa::timing::Cause;
use takt_isa::{BundleAddress, Program, Register, Type};
use takt_system::{End, LinkKind};

/// The source of a signal's value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Source {
    /// One if a bundle issued.
    Issue,
    /// The bundle that issued or waits to.
    Bundle,
    /// One if the tick was seen.
    Tick,
    /// One if a deadline was missed, or the tick lost.
    Missed,
    /// One if the cycle is charged to this kind of cause.
    Stall(usize),
    /// A register.
    Register(Register),
    /// Of a system: what arrived last on a link, the field.
    Arrived(usize, usize),
    /// The number of entries of a FIFO.
    Count(usize),
}

/// A signal.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Signal {
    /// The core of a system that it belongs to, or `links`; none of a single core.
    pub(super) part: Option<Arc<str>>,
    /// The group that it stands in; none at the top.
    pub(super) scope: Option<&'static str>,
    pub(super) name: String,
    pub(super) source: Source,
    pub(super) ty: SignalType,
}

/// The format of a signal's value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum SignalType {
    Real,
    Bits(u32),
}

/// The group that all signals stand in.
pub(super) const TOP: &str = "takt";

impl Signal {
    /// Its name with the groups that it stands in, as viewers show it.
    fn path(&self) -> String {
        let group = |name: Option<&str>| name.map_or(String::new(), |name| format!("{name}."));
        format!("{TOP}.{}{}{}", group(self.part.as_deref()), group(self.scope), self.name)
    }

    /// True if a pattern means it: by its name, by its group and name, or by its whole path. A name may have points of its
    /// own, and `*` before the first point stands for one group.
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

    /// Its value after a cycle: `None` while unknown.
    pub(super) fn value(&self, passed: Passed<'_>) -> Option<u32> {
        let (records, system) = match passed {
            Passed::Core(record, emulator) => return self.value_in(record, emulator),
            Passed::System(records, system) => (records, system),
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

    /// The value of a core's own signal.
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
            // Those of a system's links.
            Source::Arrived(..) | Source::Count(_) => None,
        }
    }
}

/// The reason why signals cannot be selected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SignalError {
    /// A name that matches nothing.
    #[error("no signal is named `{name}`{}", near.as_ref().map_or(String::new(), |near| format!("; did you mean `{near}`?")))]
    Unknown {
        /// The name.
        name: String,
        /// A name that may be meant.
        near: Option<String>,
    },
    /// A name that matches signals, but no register, and the format selects by registers.
    #[error("`{0}` is no register: a retire log has the operations that write the registers selected")]
    NoRegister(String),
    /// A format without signals.
    #[error("a Kanata trace shows operations; it has no signals to select")]
    None,
}

/// Every signal of a program.
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
    for (scope, ports) in
        [("inputs", &program.inputs), ("outputs", &program.outputs), ("registers", &program.registers)]
    {
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

/// The signals that match the patterns, all if there is none.
pub(super) fn select(
    program: &Program,
    format: Format,
    patterns: &[String],
) -> Result<Vec<Signal>, SignalError> {
    select_of(all(program), format, patterns)
}

/// Those of some signals that match the patterns.
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
            // As much of the path as the pattern has.
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
