// SPDX-License-Identifier: MIT OR Apache-2.0
//! Checks of links: their ends, their ports, and the keys of each kind.

use super::{Checker, span};
use crate::file::{FifoTable, SnapshotTable, StatusTable, WireTable};
use std::ops::Range;
use takt_isa::system::{End, Field, Link, LinkKind, MAX_DEPTH, Status};
use takt_isa::{Register, Type};
use toml::Spanned;

impl Checker<'_> {
    pub(super) fn wire(&mut self, table: &WireTable) {
        let mut ends = Vec::new();
        for (input, value) in [(false, &table.from), (true, &table.to)] {
            let Some((core, port)) = value.get_ref().split_once('.') else {
                let text = format!("`{}` does not name a port", value.get_ref());
                self.mistakes.add("port", value.span(), text).help =
                    Some("the core and its port, `core.port`; outside of the system, `host.name`".to_owned());
                return;
            };
            let Some(end) = self.end(core, value.span()) else { return };
            let found = self.port(end, port, input, value.span());
            ends.push((end, found));
        }
        let (Some((to, to_port)), Some((from, from_port))) = (ends.pop(), ends.pop()) else { return };
        if !self.one_inside(from, to, table.to.span()) {
            return;
        }
        let latency = self.latency(table.latency.as_ref());
        let named = to_port.as_ref().map(|port| port.name.clone());
        let field = self.field((from_port, table.from.span()), (to_port, table.to.span()), (from, to));
        let Some(name) = named else { return };
        if !self.drive(to, None, &name, table.to.span()) {
            return;
        }
        let (Some(field), Some(latency)) = (field, latency) else { return };
        if from == End::Host {
            let ty = *self.host_types.entry(field.from.clone()).or_insert(field.ty);
            if ty != field.ty && ty != Type::B && field.ty != Type::B {
                let text = format!(
                    "`host.{}` is {} elsewhere, and `{}` takes {}",
                    field.from,
                    ty.name(),
                    field.to,
                    field.ty.name()
                );
                self.mistakes.add("type", table.to.span(), text).help =
                    Some("choose another name".to_owned());
                return;
            }
        }
        let name = format!("{} -> {}", table.from.get_ref(), table.to.get_ref());
        let link = Link { name, from, to, latency, fields: vec![field], kind: LinkKind::Wire };
        self.add(link, table.latency.as_ref());
    }

    fn one_inside(&mut self, from: End, to: End, place: Range<usize>) -> bool {
        let inside = from != End::Host || to != End::Host;
        if !inside {
            self.mistakes.add("core", place, "a link from the host to the host".to_owned()).help =
                Some("one end is a core".to_owned());
        }
        inside
    }

    /// Name, ends and latency of a named link.
    fn named(
        &mut self,
        name: &Spanned<String>,
        what: &str,
        from: &Spanned<String>,
        to: &Spanned<String>,
    ) -> Option<(End, End)> {
        let good = self.name(name, what);
        if let Some(first) = self.link_names.insert(name.get_ref().clone(), name.span()) {
            let text = format!("`{}` is the name of something else", name.get_ref());
            let diagnostic = self.mistakes.add("name", name.span(), text);
            *diagnostic = diagnostic.clone().also(span(first), "the first").help("rename one of them");
            return None;
        }
        let (sender, receiver) = (self.end(from.get_ref(), from.span()), self.end(to.get_ref(), to.span()));
        let (sender, receiver) = (sender?, receiver?);
        (good && self.one_inside(sender, receiver, to.span())).then_some((sender, receiver))
    }

    /// Fields of a named link: `port`, or `port -> port` where the two are named differently.
    fn fields(
        &mut self,
        link: &str,
        ports: &Spanned<Vec<Spanned<String>>>,
        (from, to): (End, End),
    ) -> Option<Vec<Field>> {
        if ports.get_ref().is_empty() {
            self.mistakes.add("port", ports.span(), "a link without a port".to_owned()).help =
                Some("`ports = [\"x\", \"y -> y_reference\"]`".to_owned());
            return None;
        }
        let mut fields = Vec::new();
        for entry in ports.get_ref() {
            let (a, b) = match entry.get_ref().split_once("->") {
                Some((a, b)) => (a.trim(), b.trim()),
                None => (entry.get_ref().trim(), entry.get_ref().trim()),
            };
            let sender = self.port(from, a, false, entry.span());
            let receiver = self.port(to, b, true, entry.span());
            let named = receiver.as_ref().map(|port| port.name.clone());
            let field = self.field((sender, entry.span()), (receiver, entry.span()), (from, to));
            let Some(name) = named else { continue };
            if self.drive(to, Some(link), &name, entry.span()) {
                fields.extend(field);
            }
        }
        (fields.len() == ports.get_ref().len()).then_some(fields)
    }

    /// Output port of a core that triggers an action of the link (strobe, push, pop); `None` at the host, which has no ports.
    fn action(
        &mut self,
        key: &str,
        end: End,
        port: Option<&Spanned<String>>,
        place: Range<usize>,
    ) -> Option<Option<Register>> {
        match (end, port) {
            (End::Host, None) => Some(None),
            (End::Host, Some(port)) => {
                self.mistakes
                    .add("port", port.span(), format!("`{key}` at the host, which has no such port"))
                    .help = Some(format!("leave `{key}` out"));
                None
            }
            (End::Core(_), Some(port)) => {
                let found = self.port(end, port.get_ref(), false, port.span())?;
                Some(found.port.map(|port| port.register))
            }
            (End::Core(number), None) => {
                let text = format!("no `{key}` port");
                let help = format!(
                    "`{key} = \"port\"`: the output port of `{}` whose writes trigger it",
                    self.cores[number].name
                );
                self.mistakes.add("port", place, text).help = Some(help);
                None
            }
        }
    }

    pub(super) fn snapshot(&mut self, table: &SnapshotTable) {
        let Some((from, to)) = self.named(&table.name, "snapshot", &table.from, &table.to) else { return };
        let latency = self.latency(table.latency.as_ref());
        let name = table.name.get_ref();
        let fields = self.fields(name, &table.ports, (from, to));
        let strobe = match &table.strobe {
            None => Some(None),
            Some(port) => self.action("strobe", from, Some(port), table.name.span()),
        };
        let (Some(latency), Some(fields), Some(strobe)) = (latency, fields, strobe) else { return };
        let link =
            Link { name: name.clone(), from, to, latency, fields, kind: LinkKind::Snapshot { strobe } };
        self.add(link, table.latency.as_ref());
    }

    pub(super) fn fifo(&mut self, table: &FifoTable) {
        let Some((from, to)) = self.named(&table.name, "FIFO", &table.from, &table.to) else { return };
        let latency = self.latency(table.latency.as_ref());
        let depth = self.number(&table.depth, "a FIFO's depth", 1, MAX_DEPTH.into());
        if depth.is_none()
            && let Some(last) = self.mistakes.list.last_mut()
        {
            last.help = Some("the entries that it holds".to_owned());
        }
        let name = table.name.get_ref();
        let fields = self.fields(name, &table.ports, (from, to));
        let push = self.action("push", from, table.push.as_ref(), table.name.span());
        let pop = self.action("pop", to, table.pop.as_ref(), table.name.span());
        let sender = self.status(name, from, table.sender.as_ref());
        let receiver = self.status(name, to, table.receiver.as_ref());
        let (Some(latency), Some(depth), Some(fields)) = (latency, depth, fields) else { return };
        let (Some(push), Some(pop), Some(sender), Some(receiver)) = (push, pop, sender, receiver) else {
            return;
        };
        let kind = LinkKind::Fifo { depth: depth as u32, push, pop, sender, receiver };
        let link = Link { name: name.clone(), from, to, latency, fields, kind };
        self.add(link, table.latency.as_ref());
    }

    fn status(
        &mut self,
        link: &str,
        end: End,
        table: Option<&StatusTable>,
    ) -> Option<Vec<(Status, Register)>> {
        let Some(table) = table else { return Some(Vec::new()) };
        let ports = [&table.empty, &table.full, &table.count, &table.overflow, &table.underflow];
        let mut list = Vec::new();
        let mut good = true;
        for (status, port) in Status::ALL.into_iter().zip(ports) {
            let Some(port) = port else { continue };
            if end == End::Host {
                let text = format!("`{}` at the host, which has no ports", status.name());
                self.mistakes.add("port", port.span(), text).help =
                    Some("leave it out: the host is notified in any case".to_owned());
                good = false;
                continue;
            }
            let found = self.port(end, port.get_ref(), true, port.span()).and_then(|found| found.port);
            let Some(found) = found else {
                good = false;
                continue;
            };
            if found.ty == Type::F {
                let text = format!(
                    "`{}` takes {}, and `{}` is an integer",
                    found.name,
                    found.ty.name(),
                    status.name()
                );
                self.mistakes.add("type", port.span(), text).help =
                    Some(format!("declare it `.input {}:int`", found.name));
                good = false;
            }
            good &= self.drive(end, Some(link), &found.name, port.span());
            list.push((status, found.register));
        }
        good.then_some(list)
    }
}
