// SPDX-License-Identifier: MIT OR Apache-2.0
//! Writer of system files: a description as the text that [`read`](crate::read) makes it of.

use crate::{Description, End, Field, Link, LinkKind, MIN_LATENCY, Status};
use std::fmt::Write as _;
use takt_isa::Register;
use takt_isa::program::Port;

/// Text of a system's file. `program` is the path of each core's program, by the core's index; a program that is an image knows its
/// machine, which the text does not name.
pub fn write(description: &Description, program: impl Fn(usize) -> String) -> String {
    let mut out = format!("tick = {}\n", description.tick);
    for (number, core) in description.cores.iter().enumerate() {
        let _ = write!(out, "\n[[core]]\nname = {:?}\nprogram = {:?}\n", core.name, program(number));
        let _ = write!(out, "tick = {}\noffset = {}\n", core.every, core.offset);
    }
    description.links.iter().for_each(|link| self::link(&mut out, description, link));
    out
}

fn end(description: &Description, end: End) -> &str {
    description.core(end).map_or("host", |core| &core.name)
}

/// Name of the core's port, output or input, at a register.
fn port(description: &Description, end: End, is_output: bool, register: Register) -> &str {
    let ports = description.core(end).map(|core| match is_output {
        true => core.program.outputs.as_slice(),
        false => core.program.inputs.as_slice(),
    });
    // Links lead to registers of ports only.
    let found = ports.unwrap_or_default().iter().find(|port| port.register == register);
    found.map_or("", |port: &Port| &port.name)
}

fn link(out: &mut String, description: &Description, link: &Link) {
    let Link { name, from, to, latency, fields, kind } = link;
    let (sender, receiver) = (end(description, *from), end(description, *to));
    let table = match kind {
        LinkKind::Wire => "wire",
        LinkKind::Snapshot { .. } => "snapshot",
        LinkKind::Fifo { .. } => "fifo",
    };
    let _ = writeln!(out, "\n[[{table}]]");
    if let (LinkKind::Wire, [Field { from, to, .. }]) = (kind, fields.as_slice()) {
        let _ = write!(out, "from = \"{sender}.{from}\"\nto = \"{receiver}.{to}\"\n");
    } else {
        let ports = fields.iter().map(|Field { from, to, .. }| format!("\"{from} -> {to}\""));
        let ports = ports.collect::<Vec<_>>().join(", ");
        let _ = write!(out, "name = {name:?}\nfrom = {sender:?}\nto = {receiver:?}\nports = [{ports}]\n");
    }
    let output = |end, register| port(description, end, true, register);
    let input = |end, register| port(description, end, false, register);
    match kind {
        LinkKind::Wire => {}
        LinkKind::Snapshot { strobe } => {
            if let Some(strobe) = strobe {
                let _ = writeln!(out, "strobe = {:?}", output(*from, *strobe));
            }
        }
        LinkKind::Fifo { depth, push, pop, sender, receiver } => {
            let _ = writeln!(out, "depth = {depth}");
            for (key, end, action) in [("push", *from, push), ("pop", *to, pop)] {
                if let Some(action) = action {
                    let _ = writeln!(out, "{key} = {:?}", output(end, *action));
                }
            }
            for (key, end, list) in [("sender", *from, sender), ("receiver", *to, receiver)] {
                let one = |(status, register): &(Status, Register)| {
                    format!("{} = {:?}", status.name(), input(end, *register))
                };
                if !list.is_empty() {
                    let list: Vec<String> = list.iter().map(one).collect();
                    let _ = writeln!(out, "{key} = {{ {} }}", list.join(", "));
                }
            }
        }
    }
    if *latency != MIN_LATENCY {
        let _ = writeln!(out, "latency = {latency}");
    }
}
