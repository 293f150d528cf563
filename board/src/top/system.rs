//! The module around a system of several cores, with its peripherals.

use super::observer::Observer;
use super::parts::{Values, common, fill, instance, net, to_integer, values};
use super::{Contents, bits};
use crate::application::{Application, CORE};
use crate::ends::{Ends, INPUT_ENDS};
use crate::kind::Direction;
use crate::protocol;
use crate::taken::{Taken, taken, transit};
use crate::wiring::Wiring;
use std::fmt::Write as _;
use takt_rtl::system::{Pin, PinKind, SystemPlan};
use takt_rtl::{Library, verilog};
use takt_system::{Description, Link, LinkKind, Status};

/// Cycles of reset after the last record: as long as anything can be under way in a core, or on a link.
const SETTLE: u64 = 128;

/// What is known before anything is written.
struct Around<'a> {
    plan: &'a SystemPlan,
    description: &'a Description,
    ends: Ends,
    /// Of each value that the host drives, the peripheral's net that does instead.
    driven: Vec<Option<String>>,
    /// Of each core, what peripherals take at its `wait`.
    taken: Vec<Vec<Taken<'a>>>,
}

/// The system, peripherals and what is between them; `circuit` is the number by which the host knows it again.
pub(super) fn around(
    wiring: &Wiring,
    plan: &SystemPlan,
    contents: &Contents,
    circuit: u32,
    library: &Library,
) -> String {
    let description = &plan.description;
    let ends = Ends::of(description);
    let cores = description.cores.len();
    let driven = vec![None; ends.inputs.len()];
    let mut around = Around { plan, description, driven, ends, taken: taken(description, wiring) };
    let (nets, parts) = around.peripherals(wiring);
    let all_misses = (0..cores).map(|core| format!("misses{core}")).collect::<Vec<_>>().join(", ");
    let deadline = format!("|{{{all_misses}}}");
    let most = |of: fn(&takt_isa::Machine) -> u32| {
        description.cores.iter().map(|core| of(core.program.machine)).max().unwrap_or(1)
    };
    let transit = description.links.iter().map(Link::transit).max().unwrap_or(0);
    let image_bits = bits(contents.room);
    let mut all = common(wiring, ["|fault", &deadline]);
    all.extend(values([
        ("ID", format!("{:08x}", protocol::SYSTEM_ID)),
        ("CORES", cores.to_string()),
        ("LAST_CORE", (cores - 1).to_string()),
        ("RECORDS", contents.records.len().to_string()),
        ("ROOM", contents.room.to_string()),
        ("IMAGE_BITS", image_bits.to_string()),
        ("IMAGE_LAST", (image_bits - 1).to_string()),
        ("SLOTS", most(|machine| machine.slots.len() as u32).to_string()),
        ("CODE", most(|machine| machine.code_depth.trailing_zeros()).to_string()),
        ("DATA", most(|machine| machine.data_depth.trailing_zeros()).to_string()),
        ("IN_BITS", most(|machine| machine.inputs.depth.trailing_zeros()).to_string()),
        ("SETTLE", (transit + 8).max(SETTLE).to_string()),
        ("CIRCUIT", format!("{circuit:08x}")),
        ("ENDS_AT", (INPUT_ENDS >> 12).to_string()),
        ("ALL_MISSES", all_misses),
        ("NETS", nets),
        ("PARTS", parts),
        ("CORE", plan.top.clone()),
        ("SYSTEM", around.system(wiring.observe)),
    ]));
    all.extend(around.ends());
    all.extend(around.cores(wiring, &to_integer(library)));
    fill(include_str!("system.v.in"), &all)
}

impl<'a> Around<'a> {
    /// Nets and instances of the peripherals.
    fn peripherals(&mut self, wiring: &Wiring) -> (String, String) {
        let system = Application::System(self.description);
        let (mut nets, mut parts) = (String::new(), String::new());
        for peripheral in &wiring.peripherals {
            let (kind, mut connected, mut put) = (peripheral.kind, Vec::new(), "puts[0]".to_owned());
            for (register, port) in kind.reads.iter().zip(&peripheral.reads) {
                let Some(port) = port else { continue };
                let Ok(found) = system.connect(Direction::Input, port) else { continue };
                let net = net(peripheral, register.name);
                let _ = writeln!(nets, "    wire [31:0] {net};");
                self.driven[found.number] = Some(net);
                connected.push(register.name);
            }
            for (core, taken) in self.taken.iter().enumerate() {
                for taken in taken.iter().filter(|taken| taken.peripheral.name == peripheral.name) {
                    let _ = writeln!(nets, "    wire [31:0] {};", net(peripheral, taken.register));
                    put = format!("puts[{core}]");
                    connected.push(taken.register);
                }
            }
            parts += &instance(peripheral, &put, &|register| connected.contains(&register));
        }
        (nets, parts)
    }

    /// The host's ends: what is declared, written and read.
    fn ends(&self) -> Values {
        let (mut nets, mut acts, mut writes) = (String::new(), String::new(), String::new());
        let (mut resets, mut reads, mut writable) = (String::new(), String::new(), String::new());
        let mut can = |address: u16| {
            let _ = writeln!(writable, "            16'd{address}: writable <= 1'b1;");
        };
        for (i, driven) in self.driven.iter().enumerate() {
            let at = Ends::input(i);
            match driven {
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
            let _ = writeln!(reads, "            16'd{at}: end_value <= drive{i};");
        }
        for i in 0..self.ends.outputs.len() {
            let _ = writeln!(nets, "    wire [31:0] shows{i};");
            let _ = writeln!(reads, "            16'd{}: end_value <= shows{i};", Ends::output(i));
        }
        for (n, fifo) in self.ends.fifos.iter().enumerate() {
            let LinkKind::Fifo { depth, .. } = self.description.links[fifo.link].kind else { continue };
            let count = SystemPlan::count_bits(depth);
            let _ = writeln!(nets, "    reg         fifo{n}_acts;");
            let _ = writeln!(nets, "    wire [{}:0] fifo{n}_count;", count - 1);
            let _ =
                writeln!(nets, "    wire fifo{n}_empty, fifo{n}_full, fifo{n}_overflow, fifo{n}_underflow;");
            can(fifo.act());
            let _ = writeln!(acts, "        fifo{n}_acts <= bus_write & address == 16'd{};", fifo.act());
            let _ = writeln!(
                reads,
                "            16'd{}: end_value <= {{{}'d0, fifo{n}_count, 12'd0, fifo{n}_underflow, fifo{n}_overflow, fifo{n}_full, fifo{n}_empty}};",
                fifo.address,
                16 - count
            );
            for i in 0..fifo.fields.len() {
                let at = fifo.field(i);
                let kind = if fifo.to_host { "wire" } else { "reg " };
                let _ = writeln!(nets, "    {kind} [31:0] fifo{n}_{i};");
                let _ = writeln!(reads, "            16'd{at}: end_value <= fifo{n}_{i};");
                if !fifo.to_host {
                    let _ = writeln!(writes, "            16'd{at}: fifo{n}_{i} <= bus_value;");
                    can(at);
                }
            }
        }
        values([
            ("ENDS", nets),
            ("END_ACTS", acts),
            ("END_WRITES", writes),
            ("END_RESETS", resets),
            ("END_READS", reads),
            ("WRITABLE", writable),
        ])
    }

    /// What is for each core: its ticks, its periods, its guard, its ports.
    fn cores(&self, wiring: &Wiring, to_integer: &str) -> Values {
        let (mut parts, mut reads, mut seen) = (String::new(), String::new(), String::new());
        for (k, core) in self.description.cores.iter().enumerate() {
            let machine = core.program.machine;
            let inputs = machine.inputs.depth.trailing_zeros();
            let _ = writeln!(
                parts,
                "    // {}
    wire [31:0] misses{k}, periods{k}, cycles{k}, most_cycles{k}, read{k}, in_value{k};
    wire [5:0]  cause{k};
    wire [2:0]  flags{k};
    wire        in_write{k};
    wire [{}:0] in_index{k};
    wire [31:0] status{k} = {{14'd0, cause{k}, drive, core_rst, flags{k}, fault_slot[{} +: 3], 1'b0, fault[{k}], halted[{k}], waiting[{k}]}};
    reg  [31:0] seen{k} [0:{}];
    reg  [31:0] seen_there{k};
    always @(posedge clk) begin
        if (in_write{k}) seen{k}[in_index{k}] <= in_value{k};
        seen_there{k} <= seen{k}[address[{}:0]];
    end
    takt_follow #(.EVERY({}), .OFFSET({}), .LEAD({}), .SNAPSHOTS({})) follow{k} (
        .clk(clk), .rst(core_rst), .due(due), .stop(|fault), .begins(begins[{k}]), .dropped(dropped[{k}]), .tick(core_ticks[{k}]),
        .take(core_takes[{k}]), .pending(pending[{k}])
    );",
                core.name,
                inputs - 1,
                3 * k,
                (1_u32 << inputs) - 1,
                inputs - 1,
                core.every,
                core.offset,
                self.description.lead(),
                self.description.snapshot_mailboxes(k),
            );
            parts += &self.turn(k, to_integer);
            let _ = writeln!(
                parts,
                "    takt_guard #(.DEADLINES({}), .HOST({})) guard{k} (
        .clk(clk), .rst(core_rst), .enable(enable), .fault(fault[{k}]), .halted(halted[{k}]), .missed(late[{k}]), .done(puts[{k}]),
        .ticks(take), .heard(heard), .stop(stop), .nan(nans[{k}]), .drive(drives[{k}]), .cause(cause{k}), .misses(misses{k})
    );",
                wiring.deadlines, wiring.host
            );
            let observer = Observer::of_core(k);
            let _ = writeln!(
                parts,
                "    wire [15:0] last_issued{k};\n    wire [31:0] core_register{k}, core_data{k};"
            );
            parts += &observer.instance(machine, wiring.observe);
            let fault = format!("{{13'd0, fault_kind[{} +: 3], fault_address[{} +: 16]}}", 3 * k, 16 * k);
            let own = [
                ("status", "status"),
                ("misses", "misses"),
                ("periods", "periods"),
                ("cycles", "cycles"),
                ("most_cycles", "most_cycles"),
            ];
            let own = own.map(|(register, net)| (register, format!("{net}{k}")));
            let issued = format!("{{16'd0, last_issued{k}}}");
            for (register, value) in own.into_iter().chain([("fault", fault), ("issued", issued)]) {
                let at = protocol::address(register) + CORE * k as u16;
                let _ = writeln!(reads, "            16'd{at}: register_value <= {value};");
            }
            let _ = writeln!(
                seen,
                "            4'd{k}: {{seen_value, read_value, core_register, core_data}} <= {{seen_there{k}, read{k}, core_register{k}, core_data{k}}};"
            );
        }
        values([("CORE_PARTS", parts), ("CORE_READS", reads), ("SEEN", seen)])
    }

    /// A core's periods, and what peripherals take from it.
    fn turn(&self, core: usize, to_integer: &str) -> String {
        let taken = &self.taken[core];
        let delay = 1 + transit(self.description, taken);
        // The first is the lowest.
        let vector = |of: &dyn Fn(&Taken<'_>) -> String, extra: &str| {
            let each = taken.iter().rev().map(of);
            format!("{{{}}}", std::iter::once(extra.to_owned()).chain(each).collect::<Vec<_>>().join(", "))
        };
        let floats = vector(&|taken| format!("1'b{}", u8::from(taken.written.scale.is_some())), "1'b0");
        let exponents =
            vector(&|taken| format!("10'd{}", taken.written.scale.unwrap_or(0).rem_euclid(1024)), "10'd0");
        let values = vector(&|taken| format!("shows{}", taken.end), "32'd0");
        let n = taken.len();
        let mut text = format!(
            "    wire [{}:0] held{core};
    takt_turn #(.OUTPUTS({n}), .DELAY({delay}), .FLOATS({floats}), .EXPONENTS({exponents}), .FTOI({to_integer})) turn{core} (
        .clk(clk), .rst(core_rst), .begins(begins[{core}]), .tick(core_ticks[{core}]), .ended(ended[{core}]), .waiting(waiting[{core}]),
        .values({values}), .held(held{core}), .put(puts[{core}]), .nan(nans[{core}]), .idle(idle[{core}]),
        .periods(periods{core}), .cycles(cycles{core}), .most_cycles(most_cycles{core})
    );
",
            32 * n + 31
        );
        for (i, taken) in taken.iter().enumerate() {
            let _ = writeln!(
                text,
                "    assign {} = held{core}[{} +: 32];",
                net(taken.peripheral, taken.register),
                32 * i
            );
        }
        text
    }

    /// Connections of the system's top.
    fn system(&self, observe: bool) -> String {
        let mut text = String::new();
        for pin in self.plan.pins() {
            let value = self.pin(&pin).unwrap_or_default();
            let _ = writeln!(text, "        .{}({value}),", pin.net.name());
        }
        for (k, core) in self.description.cores.iter().enumerate() {
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
            for (port, net) in own {
                let _ = writeln!(text, "        .board{k}_{port}({net}),");
            }
            text += &Observer::of_core(k).pins(&format!("board{k}_"), observe);
        }
        text.trim_end().to_owned()
    }

    /// What a pin of the system's top is connected to.
    fn pin(&self, pin: &Pin) -> Option<String> {
        let link = &self.description.links[pin.link];
        if let Some(n) = self.ends.fifos.iter().position(|fifo| fifo.link == pin.link) {
            return Some(match pin.kind {
                PinKind::Field(field) => format!("fifo{n}_{field}"),
                PinKind::Send | PinKind::Pop => format!("fifo{n}_acts"),
                PinKind::Status(status) => format!("fifo{n}_{}", Status::name(status)),
            });
        }
        let PinKind::Field(field) = pin.kind else { return Some("due".to_owned()) };
        if pin.direction == verilog::Direction::Output {
            let at = self.ends.outputs.iter().position(|end| end.link == pin.link && end.field == field)?;
            return Some(format!("shows{at}"));
        }
        let name = match link.kind {
            LinkKind::Wire => link.fields[field].from.clone(),
            _ => format!("{}.{}", link.name, link.fields[field].from),
        };
        let at = self.ends.inputs.iter().position(|end| end.name == name)?;
        Some(format!("drive{at}"))
    }
}
