// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the links in the top, each an instance of its kind's module.

use super::{PinKind, SystemPlan};
use crate::plan::names::net;
use crate::verilog::{Expr, Instance, Module, Net, concat, decimal, no};
use takt_isa::system::{End, Link, LinkKind, Side, Source, Status};

/// Generates every link: its nets and its instance.
pub(super) fn write(plan: &SystemPlan, m: &mut Module, reset: &Net) {
    for (number, link) in plan.description.links.iter().enumerate() {
        m.blank();
        let way = format!("latency {}, {} registers on its way", link.latency, link.transit());
        match &link.kind {
            LinkKind::Wire => {
                m.comment(format!("docs/system.md, Wire: {}; {way}.", link.name));
                wire(plan, m, number, link, reset);
            }
            LinkKind::Snapshot { strobe } => {
                let by = match (strobe, link.from) {
                    (Some(_), _) => "published by its strobe",
                    (None, End::Host) => "published by the host",
                    (None, End::Core(_)) => "published with the sender's outputs",
                };
                m.comment(format!("docs/system.md, Snapshot: {}, {by}; {way}.", link.name));
                snapshot(plan, m, number, link, reset);
            }
            LinkKind::Fifo { depth, .. } => {
                m.comment(format!("docs/system.md, FIFO: {}, {depth} entries; {way}.", link.name));
                fifo(plan, m, number, link, reset);
            }
        }
    }
}

fn instance(plan: &SystemPlan, module: &str, number: usize, link: &Link, reset: &Net) -> Instance {
    Instance::new(module, plan.link_instance(number))
        .parameter("LENGTH", link.transit() as u32)
        .port("clk", net::CLK)
        .port("rst", reset)
}

/// Declares nets for the outputs of a link's instance, and connects them.
fn outputs(
    plan: &SystemPlan,
    m: &mut Module,
    number: usize,
    mut instance: Instance,
    ports: &[(&'static str, u32)],
) {
    for &(port, width) in ports {
        let net = plan.of_link(number, port);
        let net = if width > 1 { net.wide(width) } else { net };
        m.wires([net.clone()]);
        instance = instance.port(port, net);
    }
    m.instance(instance);
}

/// Write enables and values of the link's fields, each concatenated.
fn fields(plan: &SystemPlan, number: usize, link: &Link) -> (Expr, Expr) {
    let write = link.fields.iter().map(|field| plan.write(link.from, field.output));
    let value = link.fields.iter().enumerate().map(|(i, field)| {
        let pin = || plan.pin(number, PinKind::Field(i)).map(Expr::from);
        plan.value(link.from, field.output).or_else(pin).unwrap_or_else(|| decimal(32, 0_u32))
    });
    (concat(write.collect::<Vec<_>>()), concat(value.collect::<Vec<_>>()))
}

/// The host's pin of this kind; constant 0 without one.
fn pin(plan: &SystemPlan, number: usize, kind: PinKind) -> Expr {
    plan.pin(number, kind).map_or_else(no, Expr::from)
}

/// Expression that is 1 if a core published its outputs two cycles ago.
fn published(plan: &SystemPlan, end: End) -> Expr {
    match end {
        End::Core(core) => plan.of_core(core, net::PUBLISHED.name()).into(),
        End::Host => no(),
    }
}

fn initial(link: &Link) -> Expr {
    concat(link.fields.iter().map(|field| decimal(32, field.initial)).collect::<Vec<_>>())
}

fn wire(plan: &SystemPlan, m: &mut Module, number: usize, link: &Link, reset: &Net) {
    let latched = plan.description.core(link.from).is_some_and(|core| core.program.latched);
    let (write, value) = match link.from {
        End::Host => (pin(plan, number, PinKind::Send), pin(plan, number, PinKind::Field(0))),
        End::Core(_) => fields(plan, number, link),
    };
    let instance = instance(plan, "takt_wire", number, link, reset)
        .parameter("LATCHED", latched.into())
        .port("write", write)
        .port("value", value)
        .port("publish", if latched { published(plan, link.from) } else { no() });
    outputs(plan, m, number, instance, &[("arrives", 1), ("arrived", 32)]);
    if let (End::Host, Some(shown)) = (link.to, plan.pin(number, PinKind::Field(0))) {
        m.comment("The host sees what arrives in a cycle from the next one on.");
        let (arrives, arrived) = (plan.of_link(number, "arrives"), plan.of_link(number, "arrived").wide(32));
        let seen = plan.of_link(number, "seen").wide(32);
        m.regs([seen.clone()]);
        m.clocked(vec![
            crate::verilog::when(arrives, vec![crate::verilog::set(&seen, arrived)]),
            crate::verilog::when(
                reset,
                vec![crate::verilog::set(&seen, decimal(32, link.fields[0].initial))],
            ),
        ]);
        m.assign(shown, seen);
    }
}

fn snapshot(plan: &SystemPlan, m: &mut Module, number: usize, link: &Link, reset: &Net) {
    let LinkKind::Snapshot { strobe } = link.kind else { return };
    let (write, value) = fields(plan, number, link);
    let publish = match (link.from, strobe) {
        (End::Host, _) => pin(plan, number, PinKind::Send),
        (from, Some(_)) => plan.write(from, strobe),
        (from, None) => published(plan, from),
    };
    let count = link.fields.len() as u32;
    let instance = instance(plan, "takt_snapshot", number, link, reset)
        .parameter("FIELDS", count)
        .parameter("STROBE", strobe.is_some().into())
        .parameter("HOST", (link.from == End::Host).into())
        .parameter_is("INITIAL", initial(link))
        .port("write", write)
        .port("value", value)
        .port("publish", publish)
        .open(["published"]);
    outputs(plan, m, number, instance, &[("shown", 32 * count)]);
    host_fields(plan, m, number, link, "shown");
}

/// Assigns the host's pins of a link's fields.
fn host_fields(plan: &SystemPlan, m: &mut Module, number: usize, link: &Link, port: &str) {
    let shown = plan.of_link(number, port).wide(32 * link.fields.len() as u32);
    if link.to == End::Host {
        for i in 0..link.fields.len() {
            if let Some(pin) = plan.pin(number, PinKind::Field(i)) {
                m.assign(pin, shown.slice(32 * i as u32 + 31, 32 * i as u32));
            }
        }
    }
}

fn fifo(plan: &SystemPlan, m: &mut Module, number: usize, link: &Link, reset: &Net) {
    let LinkKind::Fifo { depth, push, pop, .. } = link.kind else { return };
    let (write, value) = fields(plan, number, link);
    let push = match link.from {
        End::Host => pin(plan, number, PinKind::Send),
        from => plan.write(from, push),
    };
    let pop = match link.to {
        End::Host => pin(plan, number, PinKind::Pop),
        to => plan.write(to, pop),
    };
    let (fields, count) = (link.fields.len() as u32, SystemPlan::count_bits(depth));
    let instance = instance(plan, "takt_fifo", number, link, reset)
        .parameter("FIELDS", fields)
        .parameter("DEPTH", depth)
        .parameter("COUNT", count)
        .parameter("HOST", (link.from == End::Host).into())
        .parameter_is("INITIAL", initial(link))
        .port("write", write)
        .port("value", value)
        .port("push", push)
        .port("pop", pop)
        .open(["pushed", "popped", "refused", "missed"]);
    let ports = [
        ("head", 32 * fields),
        ("another", 1),
        ("changed", 1),
        ("empty", 1),
        ("full", 1),
        ("count", count),
        ("overflow", 1),
        ("underflow", 1),
        ("told", 1),
        ("told_empty", 1),
        ("told_full", 1),
        ("told_count", count),
        ("told_overflow", 1),
        ("told_underflow", 1),
    ];
    outputs(plan, m, number, instance, &ports);
    host_fields(plan, m, number, link, "head");
    for status in Status::ALL {
        if let Some(pin) = plan.pin(number, PinKind::Status(status)) {
            m.assign(pin, status_net(plan, number, "", status, count));
        }
    }
    let nets = ports.iter().map(|&(port, width)| {
        let net = plan.of_link(number, port);
        Expr::from(if width > 1 { net.wide(width) } else { net })
    });
    m.unused(plan.of_link(number, "unused"), concat(nets.collect::<Vec<_>>()), None);
}

fn status_net(plan: &SystemPlan, link: usize, prefix: &str, status: Status, count: u32) -> Net {
    let net = plan.of_link(link, &format!("{prefix}{}", status.name()));
    if status == Status::Count { net.wide(count) } else { net }
}

/// Arrival at a mailbox of a core's gate: valid bit and value.
pub(super) fn arrival(plan: &SystemPlan, core: usize, source: Source) -> (Expr, Expr) {
    let link = source.link();
    let known = &plan.description.links[link];
    let field = |port: &str, field: usize| {
        let low = 32 * field as u32;
        plan.of_link(link, port).wide(32 * known.fields.len() as u32).slice(low + 31, low)
    };
    match (source, &known.kind) {
        (Source::Field { .. }, LinkKind::Wire) => {
            (plan.of_link(link, "arrives").into(), plan.of_link(link, "arrived").wide(32).into())
        }
        (Source::Field { field: i, .. }, LinkKind::Snapshot { .. }) => {
            (plan.of_core(core, "takes").into(), field("shown", i))
        }
        (Source::Field { field: i, .. }, LinkKind::Fifo { .. }) => {
            (plan.of_link(link, "another").into(), field("head", i))
        }
        (Source::Status { side, status, .. }, kind) => {
            let depth = if let LinkKind::Fifo { depth, .. } = kind { *depth } else { 0 };
            let count = SystemPlan::count_bits(depth);
            let (valid, prefix) = match side {
                Side::Sender => ("told", "told_"),
                Side::Receiver => ("changed", ""),
            };
            let net = status_net(plan, link, prefix, status, count);
            let missing = 32 - net.width();
            (plan.of_link(link, valid).into(), concat([net.into(), decimal(missing, 0_u32)]))
        }
    }
}
