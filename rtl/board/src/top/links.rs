// SPDX-License-Identifier: MIT OR Apache-2.0
//! The connections of cores with links: host endpoints, ticks, and outputs at the `wait` of each core.

use super::peripherals::{PeripheralConnections, net, scale};
use super::shadow_memory::Shadow;
use super::template::Values;
use crate::endpoints::Endpoints;
use crate::sinks::{Sink, transit};
use crate::wiring::Wiring;
use std::fmt::Write as _;
use takt_rtl::system::{Pin, PinKind, SystemPlan};
use takt_rtl::verilog;
use takt_system::{LinkKind, Status};

/// The section that is being written.
struct Section<'a> {
    plan: &'a SystemPlan,
    connected: &'a PeripheralConnections<'a>,
    endpoints: &'a Endpoints,
    wiring: &'a Wiring,
}

/// The placeholders of the section; `to_integer` is the converter's code for float to integer.
pub(super) fn section(
    plan: &SystemPlan,
    connected: &PeripheralConnections<'_>,
    wiring: &Wiring,
    to_integer: &str,
) -> Values {
    let section = Section { plan, connected, endpoints: connected.application.endpoints(), wiring };
    let cores = (0..plan.description.cores.len()).map(|core| section.core(core, to_integer));
    let mut values = vec![
        ("CONNECTIONS", include_str!("links.v.in").to_owned()),
        ("CORE", plan.top.clone()),
        ("PORT_WRITABLE", "1'b0".to_owned()),
        ("CORES_TICKS", cores.collect()),
        ("SYSTEM", section.system()),
    ];
    values.extend(section.endpoints());
    values
}

impl Section<'_> {
    /// The host endpoints: declarations, writes and reads.
    fn endpoints(&self) -> Values {
        let (mut nets, mut acts, mut writes) = (String::new(), String::new(), String::new());
        let (mut resets, mut reads, mut writable) = (String::new(), String::new(), String::new());
        let mut can = |address: u16| {
            let _ = writeln!(writable, "            16'd{address}: writable <= 1'b1;");
        };
        for i in 0..self.endpoints.inputs.len() {
            let at = Endpoints::input(i);
            match self.connected.driven.get(&i) {
                Some(net) => {
                    let _ = writeln!(nets, "    wire [31:0] drive{i} = {net};");
                }
                None => {
                    let _ = writeln!(nets, "    reg  [31:0] drive{i};");
                    let _ = writeln!(writes, "            16'd{at}: drive{i} <= bus_value;");
                    can(at);
                    let _ = writeln!(resets, "        if (starts) drive{i} <= 32'd0;");
                }
            }
            let _ = writeln!(reads, "            16'd{at}: link_read <= drive{i};");
        }
        for i in 0..self.endpoints.outputs.len() {
            let _ = writeln!(nets, "    wire [31:0] shows{i};");
            let _ = writeln!(reads, "            16'd{}: link_read <= shows{i};", Endpoints::output(i));
        }
        for (n, fifo) in self.endpoints.fifos.iter().enumerate() {
            let LinkKind::Fifo { depth, .. } = self.plan.description.links[fifo.link].kind else { continue };
            let count = SystemPlan::count_bits(depth);
            let _ = writeln!(nets, "    reg         fifo{n}_acts;");
            let _ = writeln!(nets, "    wire [{}:0] fifo{n}_count;", count - 1);
            let _ =
                writeln!(nets, "    wire fifo{n}_empty, fifo{n}_full, fifo{n}_overflow, fifo{n}_underflow;");
            can(fifo.act());
            let _ = writeln!(acts, "        fifo{n}_acts <= bus_write & address == 16'd{};", fifo.act());
            let _ = writeln!(
                reads,
                "            16'd{}: link_read <= {{{}'d0, fifo{n}_count, 12'd0, fifo{n}_underflow, fifo{n}_overflow, fifo{n}_full, fifo{n}_empty}};",
                fifo.address,
                16 - count
            );
            for i in 0..fifo.fields.len() {
                let at = fifo.field(i);
                let kind = if fifo.to_host { "wire" } else { "reg " };
                let _ = writeln!(nets, "    {kind} [31:0] fifo{n}_{i};");
                let _ = writeln!(reads, "            16'd{at}: link_read <= fifo{n}_{i};");
                if !fifo.to_host {
                    let _ = writeln!(writes, "            16'd{at}: fifo{n}_{i} <= bus_value;");
                    can(at);
                }
            }
        }
        vec![
            ("ENDPOINTS", nets),
            ("ACTS", acts),
            ("WRITES", writes),
            ("RESETS", resets),
            ("READS", reads),
            ("WRITABLE", writable),
        ]
    }

    /// The tick divider of a core, and the latch of its outputs.
    fn core(&self, k: usize, to_integer: &str) -> String {
        let (description, sinks) = (&self.plan.description, &self.connected.sinks[k]);
        let core = &description.cores[k];
        let n = sinks.len();
        // The first sink is the lowest element; an extra element is above the last sink.
        let vector = |of: &dyn Fn(&Sink<'_>) -> String, extra: &str| {
            let each = sinks.iter().rev().map(of);
            format!("{{{}}}", std::iter::once(extra.to_owned()).chain(each).collect::<Vec<_>>().join(", "))
        };
        let mut text = format!(
            "    takt_tick_divider #(.EVERY({}), .OFFSET({}), .LEAD({}), .SNAPSHOTS({})) divider{k} (
        .clk(clk), .rst(core_rst), .due(due), .stop(|fault), .begins(divided[{k}]), .dropped(dropped[{k}]), .tick(core_ticks[{k}]),
        .take(core_takes[{k}]), .pending(pending[{k}])
    );
    wire [{}:0] held{k};
    takt_output_latch #(.OUTPUTS({n}), .DELAY({}), .FLOATS({}), .EXPONENTS({}), .FTOI({to_integer})) latch{k} (
        .clk(clk), .rst(core_rst), .begins(divided[{k}]), .tick(core_ticks[{k}]), .published(published[{k}]),
        .ended(ended[{k}]), .waiting(waiting[{k}]), .values({}), .held(held{k}), .put(puts[{k}]), .nan(nans[{k}]), .idle(idle[{k}]),
        .periods(periods{k}), .cycles(cycles{k}), .most_cycles(most_cycles{k})
    );
",
            core.every,
            core.offset,
            description.lead(),
            description.snapshot_mailboxes(k),
            32 * n + 31,
            1 + transit(self.connected.application, sinks),
            vector(&|sink| format!("1'b{}", scale(sink.written).0), "1'b0"),
            vector(&|sink| format!("10'd{}", scale(sink.written).1), "10'd0"),
            vector(&|sink| format!("shows{}", sink.number), "32'd0"),
        );
        for (i, sink) in sinks.iter().enumerate() {
            let net = net(sink.peripheral, sink.register);
            let _ = writeln!(text, "    assign {net} = held{k}[{} +: 32];", 32 * i);
        }
        text
    }

    /// The connections of the system's top.
    fn system(&self) -> String {
        let mut text = String::new();
        for pin in self.plan.pins() {
            let value = self.pin(&pin).unwrap_or_default();
            let _ = writeln!(text, "        .{}({value}),", pin.net.name());
        }
        for (k, core) in self.plan.description.cores.iter().enumerate() {
            let port_bits = core.program.machine.outputs_per_bank.trailing_zeros();
            let own = [
                ("read_output", format!("address[{}:0]", port_bits - 1)),
                ("read_value", format!("read{k}")),
                ("input_write", format!("in_write{k}")),
                ("input_index", format!("in_index{k}")),
                ("input_value", format!("in_value{k}")),
                ("tick_missed", format!("tick_missed[{k}]")),
                ("tick_lost", format!("tick_lost[{k}]")),
                ("status", format!("flags{k}")),
            ];
            let safety = self
                .wiring
                .safety
                .ports()
                .into_iter()
                .map(|net| (net.name().to_owned(), format!("{}{k}", net.name())));
            let own = own.into_iter().map(|(port, net)| (port.to_owned(), net));
            for (port, net) in own.chain(safety) {
                let _ = writeln!(text, "        .board{k}_{port}({net}),");
            }
            text += &Shadow::of(self.connected.application, k, self.wiring).pins(&format!("board{k}_"));
        }
        text.trim_end().to_owned()
    }

    /// The net at a pin of the system's top.
    fn pin(&self, pin: &Pin) -> Option<String> {
        let link = &self.plan.description.links[pin.link];
        if let Some(n) = self.endpoints.fifos.iter().position(|fifo| fifo.link == pin.link) {
            return Some(match pin.kind {
                PinKind::Field(field) => format!("fifo{n}_{field}"),
                PinKind::Send | PinKind::Pop => format!("fifo{n}_acts"),
                PinKind::Status(status) => format!("fifo{n}_{}", Status::name(status)),
            });
        }
        let PinKind::Field(field) = pin.kind else { return Some("due".to_owned()) };
        if pin.direction == verilog::Direction::Output {
            let mut outputs = self.endpoints.outputs.iter();
            let at = outputs.position(|end| end.link == pin.link && end.field == field)?;
            return Some(format!("shows{at}"));
        }
        let name = match link.kind {
            LinkKind::Wire => link.fields[field].from.clone(),
            _ => format!("{}.{}", link.name, link.fields[field].from),
        };
        let at = self.endpoints.inputs.iter().position(|end| end.name == name)?;
        Some(format!("drive{at}"))
    }
}
