// SPDX-License-Identifier: MIT OR Apache-2.0
//! Machines and units as designs for synthesis.

use super::{Arguments, Design, system};
use anyhow::{Context, Result, ensure};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use takt_automation::command::root;
use takt_board::place;
use takt_family::{Family, Mapping, Resources};
use takt_isa::{Machine, UNITS, Unit};
use takt_rtl::{Circuit, Library, Safety, wishbone};

/// Designs selected by the arguments.
pub(super) fn designs(arguments: &Arguments) -> Result<Vec<Design>> {
    let mut library = Library::load(&root().join("rtl/units")).context("cannot read rtl/units")?;
    let family = arguments.family;
    // Replace shared modules of the units by the family's versions. A core's files already contain them.
    for (name, text) in family.modules {
        let shared = format!("common/{name}");
        if library.text(&shared).is_some() {
            library.put(&shared, (*text).to_owned());
        }
    }
    if let Some(file) = &arguments.system {
        return Ok(vec![system::system(file, &library, family)?]);
    }
    if arguments.unit.is_empty() {
        let machine = takt_asm::machine(&arguments.machine).map_err(anyhow::Error::msg)?;
        let file = Path::new(&arguments.machine);
        let own = if file.is_file() { system::own_path(file)? } else { None };
        return Ok(vec![core(
            machine,
            own,
            &library,
            family,
            Safety { ecc: arguments.ecc, second_core: arguments.second_core },
        )?]);
    }
    let all = |unit: &&Unit| library.text(&format!("{}.v", unit.name)).is_some();
    let offered: Vec<&Unit> = UNITS.iter().filter(all).collect();
    let mut designs = Vec::new();
    for name in &arguments.unit {
        let wanted = offered.iter().filter(|unit| name == "all" || unit.name == name);
        let before = designs.len();
        for unit in wanted {
            designs.push(between_registers(&library, &library.circuit(unit)?)?);
        }
        let names = || offered.iter().map(|unit| unit.name).collect::<Vec<_>>().join(", ");
        ensure!(designs.len() > before, "there is no unit `{name}`; there are {} and `all`", names());
    }
    Ok(designs)
}

/// Core of a machine, which may be a file of this repository.
fn core(
    machine: &'static Machine,
    own: Option<String>,
    library: &Library,
    family: &Family,
    safety: Safety,
) -> Result<Design> {
    let place::Core { files, top } = place::core(machine, library, family, safety)?;
    Ok(Design {
        // Record only machines of the table or of this repository, with their original memory sizes; others belong to their authors.
        recorded: machine == machine.row() && (machine.is_builtin() || own.is_some()),
        name: own.unwrap_or_else(|| machine.name.to_owned()) + &safety.text(),
        files,
        top,
        mapping: Mapping::of(machine),
        has_pins: true,
        wrapper: wishbone::PINS,
        parts: Vec::new(),
    })
}

/// A unit between registers, with few pins: operands come from a shift register and a second register; results go to a register and an
/// XOR tree.
fn between_registers(library: &Library, circuit: &Circuit) -> Result<Design> {
    let text = |name: &String| Some((name.replace('/', "_"), library.text(name)?.to_owned()));
    let mut files: BTreeMap<_, _> = circuit.files.iter().filter_map(text).collect();
    let operands = ["a", "b", "c"].into_iter().take(circuit.operands).map(|name| (name, 32));
    let inputs: Vec<_> = [("in_valid", 1), ("op", circuit.op_bits)]
        .into_iter()
        .filter(|port| port.1 > 0)
        .chain(operands)
        .collect();
    let bits: u32 = inputs.iter().map(|port| port.1).sum();
    let mut connections = String::new();
    let mut low = 0;
    for (name, width) in inputs {
        write!(connections, ".{name}(operands[{low} +: {width}]), ")?;
        low += width;
    }
    let parameters: Vec<_> = circuit.parameters().map(|(name, value)| format!(".{name}({value})")).collect();
    let (module, parameters, last) = (circuit.unit.rtl, parameters.join(", "), bits - 2);
    files.insert(
        "wrapper.v".to_owned(),
        format!(
            "module wrapper (input wire clk, input wire serial_in, input wire load, output reg serial_out);
    reg [{bits}-1:0] shift, operands;
    wire out_valid;
    wire [31:0] result;
    wire [2:0] flags;
    reg [35:0] outputs;
    reg [8:0] parity;
    {module} #({parameters}) unit (.clk(clk), {connections}.out_valid(out_valid), .result(result), .flags(flags));
    integer i;
    always @(posedge clk) begin
        shift <= {{shift[{last}:0], serial_in}};
        if (load) operands <= shift;  // unconditionally it would be the shift register one bit on, and be merged with it
        outputs <= {{out_valid, flags, result}};
        for (i = 0; i < 9; i = i + 1) parity[i] <= ^outputs[4 * i +: 4];
        serial_out <= ^parity;
    end
endmodule
"
        ),
    );
    // Size of the wrapper: 9 LUT4 for the groups of four, 3 for the rest. A constant output needs no register, so the number of
    // flip-flops may be overestimated by two.
    let wrapper = Resources { luts: 12, flip_flops: u64::from(2 * bits) + 46, ..Resources::default() };
    let (name, top) = (circuit.unit.name.to_owned(), "wrapper".to_owned());
    Ok(Design {
        name,
        files,
        top,
        mapping: Mapping::Small,
        has_pins: false,
        wrapper,
        parts: Vec::new(),
        recorded: true,
    })
}
