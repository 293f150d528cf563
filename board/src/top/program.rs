//! The module around the core of a single program, with its peripherals.

use super::observer::Observer;
use super::parts::{common, fill, instance, net, setting, to_integer, values};
use super::{IMAGE_BITS, RECORDS};
use crate::application::Application;
use crate::kind::Direction;
use crate::protocol;
use crate::wiring::Wiring;
use std::fmt::Write as _;
use takt_isa::Program;
use takt_rtl::Library;
use takt_rtl::wishbone::open_streams;

/// Core, peripherals and what is between them.
pub(super) fn around(
    wiring: &Wiring,
    program: &Program,
    core: &str,
    records: usize,
    library: &Library,
) -> String {
    let machine = program.machine;
    let input_bits = machine.inputs.depth.trailing_zeros();
    let port_bits = machine.outputs_per_bank.trailing_zeros();
    let number = |direction: Direction, name: &str| {
        Application::Program(program).connect(direction, name).ok().map(|found| found.number)
    };
    let (mut nets, mut parts, mut driven) = (String::new(), String::new(), String::new());
    let (mut inputs, mut outputs, mut taken, mut settings) =
        (String::new(), String::new(), String::new(), String::new());
    let (mut in_count, mut out_count) = (0, 0);
    for peripheral in &wiring.peripherals {
        let kind = peripheral.kind;
        let mut connected = Vec::new();
        for (register, port) in kind.reads.iter().zip(&peripheral.reads) {
            let Some(index) = port.as_deref().and_then(|port| number(Direction::Input, port)) else {
                continue;
            };
            let net = net(peripheral, register.name);
            let _ = writeln!(nets, "    wire [31:0] {net};");
            let _ = writeln!(
                inputs,
                "            8'd{in_count}: {{in_index, in_value}} <= {{{input_bits}'d{index}, {net}}};"
            );
            let _ =
                writeln!(driven, "            16'd{}: writable <= 1'b0;", protocol::INPUTS + index as u16);
            in_count += 1;
            connected.push(register.name);
        }
        for (register, write) in kind.writes.iter().zip(&peripheral.writes) {
            let Some(write) = write else { continue };
            let Some(number) = number(Direction::Output, &write.port) else { continue };
            let net = net(peripheral, register.name);
            let _ = writeln!(nets, "    reg  [31:0] {net};");
            let _ = writeln!(outputs, "            8'd{out_count}: out_index <= {port_bits}'d{number};");
            let _ = writeln!(
                settings,
                "            8'd{out_count}: {{is_float, exponent}} = {};",
                setting(write)
            );
            let _ = writeln!(taken, "            8'd{out_count}: {net} <= result;");
            out_count += 1;
            connected.push(register.name);
        }
        parts += &instance(peripheral, "put", &|register| connected.contains(&register));
    }
    let observer = Observer::of_program();
    let mut all = common(wiring, ["fault", "|misses"]);
    all.extend(values([
        ("ID", format!("{:08x}", protocol::ID)),
        ("RECORDS", format!("{}'d{records}", IMAGE_BITS + 1)),
        ("RECORD_PAD", (31 - IMAGE_BITS).to_string()),
        ("ROOM", RECORDS.to_string()),
        ("IMAGE_BITS", IMAGE_BITS.to_string()),
        ("IMAGE_HIGH", (IMAGE_BITS + 1).to_string()),
        ("SLOTS", machine.slots.len().to_string()),
        ("CODE", machine.code_depth.trailing_zeros().to_string()),
        ("DATA", machine.data_depth.trailing_zeros().to_string()),
        ("IN_BITS", input_bits.to_string()),
        ("IN_HIGH", (input_bits - 1).to_string()),
        ("IN_LAST", ((1_u32 << input_bits) - 1).to_string()),
        ("PORT_BITS", port_bits.to_string()),
        ("PORT_HIGH", (port_bits - 1).to_string()),
        ("IN_COUNT", in_count.to_string()),
        ("OUT_COUNT", out_count.to_string()),
        ("NETS", nets.trim_end().to_owned()),
        ("INPUTS", inputs),
        ("DRIVEN", driven),
        ("OUTPUTS", outputs),
        ("SETTINGS", settings),
        ("TAKEN", taken),
        ("PARTS", parts),
        ("CORE", core.to_owned()),
        ("STREAMS", open_streams(machine)),
        ("OBSERVE", observer.instance(machine, wiring.observe)),
        ("WATCHED", observer.pins("", wiring.observe)),
        ("FTOI", to_integer(library)),
    ]));
    fill(include_str!("program.v.in"), &all)
}
