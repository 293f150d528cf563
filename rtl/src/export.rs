//! The complete circuit of a machine, as Verilog files.
//!
//! Fixed parts are the modules in `rtl/core/` and `rtl/units/`. What follows from the tables is generated here: the decoders,
//! which units a slot has and how long their results take, the wiring of banks, buses, forwarding and hazards, the ports.

use crate::circuit::{CircuitError, Library};
use crate::decode::SlotPlan;
use crate::files::{CORE, ECP5};
use std::fmt::Write as _;
use takt_isa::{Effect, Function, Machine, Unit};
use thiserror::Error;

/// Why a machine has no circuit.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ExportError {
    /// A unit's circuit is missing or does not fit its row.
    #[error(transparent)]
    Circuit(#[from] CircuitError),
    /// The machine asks for something that the core's modules do not do.
    #[error("{machine}: {reason}")]
    Unsupported {
        /// The machine.
        machine: &'static str,
        /// What.
        reason: String,
    },
}

/// Name of the module for a synthesis without a board: the core between a shift register and a parity.
pub fn synthesis_top(machine: &Machine) -> String {
    format!("takt_{}_synthesis", machine.name)
}

/// A file of the design.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DesignFile {
    /// Path inside the design's folder.
    pub name: String,
    /// Contents.
    pub text: String,
}

/// The circuit of a machine.
#[derive(Clone, Debug)]
pub struct Design {
    /// The machine.
    pub machine: &'static Machine,
    /// Name of the core's module.
    pub top: String,
    /// Verilog files, each with the one module of its name.
    pub files: Vec<DesignFile>,
    /// The core on a few pins, for a synthesis without a board.
    pub synthesis: String,
    /// Modules that take the place of those of the same name on Lattice ECP5.
    pub ecp5: Vec<DesignFile>,
    /// The core's parameter of that name: 0, or, for a program whose ports are latched, its
    /// [`latched_inputs`](takt_isa::Program::latched_inputs). The files have 0 for their default.
    pub latched: u16,
}

/// Cycles between a value on the input port and the first bundle that may read it, less 1.
pub const INPUT_DELAY: u64 = 3;
/// The same for latched ports, between a value on the input port and the first tick that takes it.
pub const LATCHED_INPUT_DELAY: u64 = 2;
/// Cycles between the tick on its pin and the cycle in which it is seen.
pub const TICK_DELAY: u64 = 1;
/// Cycles for which reset must be held, so that nothing is left of what was before.
pub const RESET_CYCLES: u64 = takt_isa::spec::units::MAX_LATENCY as u64;

/// A unit whose result is long underway: it works on one operation at a time.
struct Late {
    unit: &'static Unit,
}

struct Plan {
    machine: &'static Machine,
    slots: Vec<SlotPlan>,
    /// For each slot, the places of its `takt_underway`.
    depths: Vec<u32>,
    late: Vec<Vec<Late>>,
    index: u32,
}

impl Plan {
    fn new(machine: &'static Machine, library: &Library) -> Result<Plan, ExportError> {
        let refuse = |reason: String| ExportError::Unsupported { machine: machine.name, reason };
        let mut slots = Vec::new();
        for slot in machine.slots {
            let mut circuits = Vec::new();
            for (u, unit) in slot.units.iter().enumerate() {
                if !unit.functions.iter().all(|f| matches!(f, Function::Control | Function::Memory)) {
                    circuits.push((u, library.circuit(unit)?));
                }
            }
            slots.push(SlotPlan::new(slot, circuits));
        }
        for function in [Function::Control, Function::Memory] {
            let hosts = machine.slots.iter().filter(|slot| slot.unit_for(function).is_some()).count();
            if hosts != 1 {
                return Err(refuse(format!(
                    "{hosts} slots host {function:?}; the core has one sequencer and one memory"
                )));
            }
        }
        let index = machine.banks().map(|bank| bank.depth.trailing_zeros()).max().unwrap_or(0);
        for (i, bank) in machine.banks().enumerate() {
            let place = if i < slots.len() { 1 << index } else { bank.depth };
            if !bank.depth.is_power_of_two() || bank.base % place != 0 {
                return Err(refuse(format!(
                    "bank {} is not a window of a power of two of registers at a multiple of it",
                    bank.name
                )));
            }
        }
        if !machine.outputs_per_bank.is_power_of_two()
            || !machine.code_depth.is_power_of_two()
            || !machine.data_depth.is_power_of_two()
        {
            return Err(refuse(
                "output ports, program memory and data memory must be powers of two".to_owned(),
            ));
        }
        let (mut depths, mut late) = (Vec::new(), Vec::new());
        for plan in &slots {
            let writing = || plan.slot.units.iter().filter(|unit| unit.latency > 0);
            if let Some(unit) = writing().find(|unit| unit.latency < 2) {
                return Err(refuse(format!("unit {} has a latency below 2", unit.name)));
            }
            let pipelined = writing().filter(|unit| unit.interval == 1).map(|unit| unit.latency);
            // A unit that takes the next operation has passed its last result on to the common places, or does now.
            let left = writing()
                .filter(|unit| unit.interval > 1)
                .map(|unit| unit.latency.saturating_sub(unit.interval));
            let depth = pipelined.chain(left).max().unwrap_or(0).max(4);
            depths.push(depth);
            late.push(writing().filter(|unit| unit.interval > 1).map(|unit| Late { unit }).collect());
        }
        Ok(Plan { machine, slots, depths, late, index })
    }

    /// The slot that hosts a function.
    fn host(&self, function: Function) -> usize {
        self.machine.host(function).map_or(0, |(slot, _)| slot)
    }
}

/// The circuit of a machine.
///
/// # Errors
/// If the machine is beyond what the core's modules do, or a unit has no circuit.
pub fn export(machine: &'static Machine, library: &Library) -> Result<Design, ExportError> {
    let plan = Plan::new(machine, library)?;
    let top = format!("takt_{}", machine.name);
    let mut files = Vec::new();
    let mut put = |name: String, text: String| {
        if !files.iter().any(|file: &DesignFile| file.name == name) {
            files.push(DesignFile { name, text });
        }
    };
    put(format!("{top}.v"), plan.core(&top));
    for slot in &plan.slots {
        let name = format!("{top}_decode_{}", slot.slot.name);
        put(format!("{name}.v"), slot.module(machine, &name, plan.index));
    }
    for &(name, text) in CORE {
        put(format!("core/{name}"), text.to_owned());
    }
    for (_, circuit) in plan.slots.iter().flat_map(|slot| &slot.circuits) {
        for file in &circuit.files {
            let text = library.text(file).unwrap_or_default().to_owned();
            let name = file.rsplit('/').next().unwrap_or(file);
            let name = if name.starts_with("takt_") { name.to_owned() } else { format!("takt_{name}") };
            put(format!("units/{name}"), text);
        }
    }
    let ecp5 =
        ECP5.iter().map(|&(name, text)| DesignFile { name: format!("ecp5/{name}"), text: text.to_owned() });
    Ok(Design { machine, synthesis: plan.synthesis(&top), top, files, ecp5: ecp5.collect(), latched: 0 })
}

macro_rules! line {
    ($out:expr) => { $out.push('\n') };
    ($out:expr, $($argument:tt)*) => { let _ = writeln!($out, $($argument)*); };
}

/// `{a, b}`, the last element first; an element alone as it is.
fn concat(elements: &[String]) -> String {
    match elements {
        [one] => one.clone(),
        _ => format!("{{{}}}", elements.iter().rev().cloned().collect::<Vec<_>>().join(", ")),
    }
}

fn any(terms: &[String]) -> String {
    if terms.is_empty() { "1'b0".to_owned() } else { terms.join(" | ") }
}

impl Plan {
    /// A control bit of a stage: `i_aux_control[AUX_LOAD]`.
    fn bit(&self, stage: &str, s: usize, name: &str) -> String {
        let slot = self.slots[s].slot.name;
        format!("{stage}_{slot}_control[{}_{}]", slot.to_uppercase(), name.to_uppercase())
    }

    /// Likewise, or constant 0 if the slot has no such bit.
    fn bit_or_0(&self, stage: &str, s: usize, name: &str) -> String {
        if self.slots[s].has(name) { self.bit(stage, s, name) } else { "1'b0".to_owned() }
    }

    /// Whether a result has its writeback in slot `s` in `place` cycles.
    fn booked(&self, s: usize, place: u32) -> Vec<String> {
        let name = self.slots[s].slot.name;
        if place < self.depths[s] {
            return vec![format!("{name}_underway[{place}]")];
        }
        let late = self.late[s].iter().filter(|late| late.unit.latency > place);
        late.map(|late| format!("{name}_{}_at[{}]", late.unit.name, late.unit.latency - place)).collect()
    }

    /// The core on a few pins, for a place-and-route run without a board. The retire port is left open, so that what serves
    /// verification only goes.
    fn synthesis(&self, top: &str) -> String {
        let machine = self.machine;
        let mut v = String::new();
        let input_bits = machine.inputs.depth.trailing_zeros();
        let port_bits = machine.outputs_per_bank.trailing_zeros();
        let inputs: Vec<(String, u32)> = [
            ("load", 1),
            ("load_space", 2),
            ("load_slot", 3),
            ("load_address", 16),
            ("load_value", 48),
            ("input_write", 1),
            ("input_index", input_bits),
            ("input_value", 32),
            ("tick", 1),
        ]
        .map(|(name, width)| (name.to_owned(), width))
        .into();
        let mut outputs: Vec<(String, u32)> = Vec::new();
        for slot in machine.slots {
            let bank = slot.bank.name;
            outputs.push((format!("output_{bank}_write"), 1));
            outputs.push((format!("output_{bank}_index"), port_bits));
            outputs.push((format!("output_{bank}_value"), 32));
        }
        for (name, width) in [
            ("waiting", 1),
            ("deadline_missed", 1),
            ("tick_missed", 1),
            ("tick_lost", 1),
            ("halted", 1),
            ("fault", 1),
            ("fault_kind", 3),
            ("fault_slot", 3),
            ("fault_address", 16),
            ("status", 3),
        ] {
            outputs.push((name.to_owned(), width));
        }
        let total = |ports: &[(String, u32)]| ports.iter().map(|(_, width)| width).sum::<u32>();
        let (wide, out) = (total(&inputs), total(&outputs));
        let groups = out.div_ceil(8);
        let name = synthesis_top(machine);
        line!(
            v,
            "// {name}: {top} on a few pins, to be placed and routed without a board. Generated by `takt rtl`.\n"
        );
        line!(
            v,
            "module {name} (\n    input  wire clk,\n    input  wire rst,\n    input  wire serial_in,\n    output reg  serial_out\n);\n"
        );
        line!(
            v,
            "    reg          reset;\n    reg  [{}:0] in;\n    wire [{}:0] out;\n    reg  [{}:0] held;\n    reg  [{}:0] parity;\n",
            wide - 1,
            out - 1,
            groups * 8 - 1,
            groups - 1
        );
        let mut ports = vec![".clk(clk), .rst(reset)".to_owned()];
        for (list, vector) in [(&inputs, "in"), (&outputs, "out")] {
            let mut low = 0;
            for (port, width) in list {
                ports.push(format!(".{port}({vector}[{low} +: {width}])"));
                low += width;
            }
        }
        let slots = machine.slots.len();
        let open = [
            ("issued", 1),
            ("issued_address", 16),
            ("stored", 1),
            ("stored_address", 16),
            ("stored_value", 32),
            ("retire", slots),
            ("retire_address", 16 * slots),
            ("retire_register", 10 * slots),
            ("retire_value", 32 * slots),
            ("retire_flags", 3 * slots),
            ("ended", 1),
            ("read_value", 32),
        ];
        ports.push(format!(".read_output({port_bits}'d0)"));
        for (port, width) in open {
            line!(v, "    wire [{}:0] unused_{port};", width - 1);
            ports.push(format!(".{port}(unused_{port})"));
        }
        line!(v, "\n    {top} core (\n        {}\n    );\n", ports.join(",\n        "));
        line!(
            v,
            "    integer i;\n    always @(posedge clk) begin\n        reset <= rst;\n        in    <= {{in[{}:0], serial_in}};\n        held  <= {};",
            wide - 2,
            if groups * 8 > out { format!("{{{}'d0, out}}", groups * 8 - out) } else { "out".to_owned() }
        );
        line!(
            v,
            "        for (i = 0; i < {groups}; i = i + 1) parity[i] <= ^held[8*i +: 8];\n        serial_out <= ^parity;\n    end\n\nendmodule"
        );
        v
    }

    fn core(&self, top: &str) -> String {
        let machine = self.machine;
        let mut v = String::new();
        let slots = self.slots.len();
        let n = |s: usize| self.slots[s].slot.name;
        let index = self.index;
        let (code_bits, data_bits) =
            (machine.code_depth.trailing_zeros(), machine.data_depth.trailing_zeros());
        let control_slot = self.host(Function::Control);
        let memory_slot = self.host(Function::Memory);
        let (c, m) = (n(control_slot), n(memory_slot));
        let depth = *self.depths.iter().max().unwrap_or(&4);
        let late = self.late.iter().map(Vec::len).max().unwrap_or(0).max(1);
        let port_bits = machine.outputs_per_bank.trailing_zeros();
        let input_bits = machine.inputs.depth.trailing_zeros();

        line!(v, "// {top}: the machine {}. {}", machine.name, machine.text);
        line!(v, "// Generated by `takt rtl` from the specification: do not edit.");
        line!(v, "//");
        line!(
            v,
            "// Contract: docs/hardware.md in Takt's repository. Stages: fetch, decode (d_), match (m_), read (r_), issue (i_), execute (x_). A bundle issues in the"
        );
        line!(
            v,
            "// cycle that it spends in issue last; its operands are in the operand registers in execute."
        );
        line!(
            v,
            "// Slots: {}.",
            (0..slots)
                .map(|s| format!("{} {} (bank {})", s, n(s), self.slots[s].slot.bank.name))
                .collect::<Vec<_>>()
                .join(", ")
        );
        line!(v);
        line!(v, "module {top} #(");
        line!(
            v,
            "    parameter LATCHED = 0                  // 0, or how many input ports are latched, from port 0 on: a power of two; then outputs are, too"
        );
        line!(v, ") (");
        line!(v, "    input  wire        clk,");
        line!(
            v,
            "    input  wire        rst,                // synchronous; held for {RESET_CYCLES} cycles or more"
        );
        line!(
            v,
            "    // Loader, in reset. space: 0 program memory (address of the bundle, slot), 1 data memory, 2 registers but the inputs."
        );
        line!(v, "    input  wire        load,");
        line!(v, "    input  wire [1:0]  load_space,");
        line!(v, "    input  wire [2:0]  load_slot,");
        line!(v, "    input  wire [15:0] load_address,");
        line!(v, "    input  wire [47:0] load_value,");
        line!(
            v,
            "    // Input ports: written in cycle t, read by bundles that issue in t + {INPUT_DELAY} or later. If latched, by those of the period"
        );
        line!(v, "    // whose tick is high in t + 1 or later.");
        line!(v, "    input  wire        input_write,");
        line!(v, "    input  wire [{}:0]  input_index,", input_bits - 1);
        line!(v, "    input  wire [31:0] input_value,");
        line!(
            v,
            "    // Output ports, the last {} registers of each bank: what is written, in the cycle of writeback, latched or not.",
            machine.outputs_per_bank
        );
        for slot in &self.slots {
            let b = slot.slot.bank.name;
            line!(v, "    output wire        output_{b}_write,");
            line!(v, "    output wire [{}:0]  output_{b}_index,", port_bits - 1);
            line!(v, "    output wire [31:0] output_{b}_value,");
        }
        line!(
            v,
            "    // The ports by number, whichever bank has them, as the outside is to see them: if latched, as last published."
        );
        line!(v, "    input  wire [{}:0]  read_output,", port_bits - 1);
        line!(v, "    output wire [31:0] read_value,");
        line!(
            v,
            "    output wire        ended,              // a `wait` issued two cycles ago: read_value is of the period that it ended"
        );
        line!(v, "    // The tick: high for one cycle, seen in the next one.");
        line!(v, "    input  wire        tick,");
        line!(v, "    output wire        waiting,");
        line!(v, "    output wire        deadline_missed,    // sticky");
        line!(
            v,
            "    output wire        tick_missed,        // in the cycle in which a tick is seen too early"
        );
        line!(v, "    output wire        tick_lost,          // in the cycle in which a tick is lost");
        line!(v, "    output wire        halted,");
        line!(v, "    output wire        fault,");
        line!(
            v,
            "    output wire [2:0]  fault_kind,         // 1 illegal word, 2 data address, 3 return stack full, 4 return stack empty"
        );
        line!(v, "    output wire [2:0]  fault_slot,");
        line!(v, "    output wire [15:0] fault_address,");
        line!(
            v,
            "    // For verification: a bundle two cycles after its issue, a store likewise, and each slot's writeback."
        );
        line!(v, "    output wire        issued,");
        line!(v, "    output wire [15:0] issued_address,");
        line!(v, "    output wire        stored,");
        line!(v, "    output wire [15:0] stored_address,");
        line!(v, "    output wire [31:0] stored_value,");
        line!(v, "    output wire [{}:0] retire,", slots - 1);
        line!(v, "    output wire [{}:0] retire_address,", 16 * slots - 1);
        line!(v, "    output wire [{}:0] retire_register,", 10 * slots - 1);
        line!(v, "    output wire [{}:0] retire_value,", 32 * slots - 1);
        line!(
            v,
            "    output wire [{}:0] retire_flags,       // {{invalid, divide by zero, overflow}}",
            3 * slots - 1
        );
        line!(v, "    output wire [2:0]  status              // the sticky flags");
        line!(v, ");\n");

        line!(v, "    // ---- control bits of each slot, from its decoder\n");
        for (s, slot) in self.slots.iter().enumerate() {
            for control in &slot.controls {
                line!(
                    v,
                    "    localparam {}_{} = {};",
                    n(s).to_uppercase(),
                    control.name.to_uppercase(),
                    control.low
                );
            }
        }

        // ---- Loader, inputs.
        line!(v, "\n    // ---- loader and input ports\n");
        line!(
            v,
            "    reg         loads;\n    reg [1:0]   loads_space;\n    reg [2:0]   loads_slot;\n    reg [15:0]  loads_address;\n    reg [47:0]  loads_value;"
        );
        line!(
            v,
            "    reg         input1;\n    reg [{0}:0]   input1_index;\n    reg [31:0]  input1_value, input2_value;\n    reg         ticks;",
            index - 1
        );
        line!(v, "    always @(posedge clk) begin");
        line!(
            v,
            "        loads         <= load & rst;\n        loads_space   <= load_space;\n        loads_slot    <= load_slot;\n        loads_address <= load_address;\n        loads_value   <= load_value;"
        );
        let base = u32::from(machine.inputs.base) & ((1 << index) - 1);
        let extended = if index > input_bits {
            format!("{{{}'d{}, input_index}}", index - input_bits, base >> input_bits)
        } else {
            "input_index".to_owned()
        };
        line!(
            v,
            "        input1        <= input_write;\n        input1_index  <= {extended};\n        input1_value  <= input_value;"
        );
        line!(v, "        input2_value  <= input1_value;");
        line!(v, "        ticks         <= tick & ~rst;\n    end");
        line!(
            v,
            "    wire load_data     = loads & (loads_space == 2'd1);\n    wire load_register = loads & (loads_space == 2'd2);"
        );
        for slot in &self.slots {
            let bank = slot.slot.bank;
            let log = bank.depth.trailing_zeros();
            line!(
                v,
                "    wire {}_load = load_register & (loads_address[15:{log}] == {}'d{});",
                slot.slot.name,
                16 - log,
                bank.base >> log
            );
        }

        // ---- Fetch.
        line!(v, "\n    // ---- fetch and decode\n");
        line!(
            v,
            "    wire        advance, issue, flush, block, refused, m_valid, f_outside;\n    wire [{}:0] fetch;",
            code_bits - 1
        );
        line!(v, "    reg         d_outside;  // beyond the program memory");
        line!(v, "    always @(posedge clk) if (advance) d_outside <= f_outside;");
        for (s, slot) in self.slots.iter().enumerate() {
            let name = n(s);
            line!(v);
            line!(v, "    wire [47:0] {name}_fetched;\n    reg  [47:0] d_{name}_word;");
            line!(
                v,
                "    takt_program #(.DEPTH({}), .ADDRESS({code_bits})) {name}_program (",
                machine.code_depth
            );
            line!(
                v,
                "        .clk(clk), .write(loads & (loads_space == 2'd0) & (loads_slot == 3'd{s})),\n        .write_address(loads_address[{0}:0]), .write_word(loads_value),\n        .read(flush | advance), .read_address(fetch), .word({name}_fetched)\n    );",
                code_bits - 1
            );
            line!(v, "    always @(posedge clk) if (advance) d_{name}_word <= {name}_fetched;");
            let width = slot.width();
            line!(
                v,
                "    wire [{}:0] d_{name}_control;\n    wire d_{name}_illegal;\n    wire [{}:0] d_{name}_dest;",
                width - 1,
                index - 1
            );
            let mut ports = String::new();
            for letter in ["a", "b", "c"].iter().take(slot.sources) {
                line!(
                    v,
                    "    wire [{slots}:0] d_{name}_{letter}_bank;\n    wire [{}:0] d_{name}_{letter}_index;",
                    index - 1
                );
                let _ = write!(
                    ports,
                    "\n        .{letter}_bank(d_{name}_{letter}_bank), .{letter}_index(d_{name}_{letter}_index),"
                );
            }
            let constant = slot.constant_bits();
            if constant > 0 {
                line!(v, "    wire [{}:0] d_{name}_constant;", constant - 1);
                let _ = write!(ports, " .constant(d_{name}_constant),");
            }
            if slot.has_effect(Effect::Immediate) {
                line!(v, "    wire d_{name}_immediate;");
                let _ = write!(ports, " .immediate(d_{name}_immediate),");
            }
            line!(
                v,
                "    {top}_decode_{name} {name}_decode (\n        .word(d_{name}_word),{ports}\n        .dest(d_{name}_dest), .control(d_{name}_control), .illegal(d_{name}_illegal)\n    );"
            );
        }

        // ---- Pipeline of control.
        line!(v, "\n    // ---- from decode to issue");
        let mut sources: Vec<String> = Vec::new();
        for (s, slot) in self.slots.iter().enumerate() {
            sources
                .extend(["a", "b", "c"].iter().take(slot.sources).map(|letter| format!("{}_{letter}", n(s))));
        }
        let looked_up: Vec<String> =
            sources.iter().map(|o| format!("d_{o}_index[{}:0]", input_bits - 1)).collect();
        line!(
            v,
            "\n    wire inputs_open, inputs_taken, input1_place;\n    wire [{}:0] d_place;",
            sources.len() - 1
        );
        line!(
            v,
            "    takt_places #(.PORTS(LATCHED), .INDEX({input_bits}), .WRITES(1), .READS({})) inputs (\n        .clk(clk), .flip(inputs_taken | rst), .open(inputs_open | rst), .drop(1'b0),\n        .write(input1), .write_index(input1_index[{}:0]), .write_place(input1_place),\n        .read_index({}), .read_place(d_place)\n    );",
            sources.len(),
            input_bits - 1,
            concat(&looked_up)
        );
        line!(v, "    wire input1_now = input1 & (LATCHED == 0 | inputs_open | rst);");
        line!(
            v,
            "    reg  [{}:0] m_place;\n    always @(posedge clk) if (advance) m_place <= d_place;",
            sources.len() - 1
        );
        for (s, slot) in self.slots.iter().enumerate() {
            let name = n(s);
            let width = slot.width();
            let constant = slot.constant_bits();
            let immediate = slot.has_effect(Effect::Immediate);
            line!(v);
            line!(v, "    reg [{}:0] m_{name}_control, r_{name}_control, i_{name}_control;", width - 1);
            line!(v, "    reg m_{name}_illegal, r_{name}_illegal, i_{name}_illegal;");
            line!(v, "    reg [{}:0] m_{name}_dest, r_{name}_dest, i_{name}_dest;", index - 1);
            for letter in ["a", "b", "c"].iter().take(slot.sources) {
                line!(
                    v,
                    "    reg [{slots}:0] m_{name}_{letter}_bank;\n    reg [{}:0] m_{name}_{letter}_index;",
                    index - 1
                );
            }
            if constant > 0 {
                let kept = constant.min(16);
                line!(
                    v,
                    "    reg [{}:0] m_{name}_constant;\n    reg [{}:0] r_{name}_constant, i_{name}_constant;",
                    constant - 1,
                    kept - 1
                );
            }
            if immediate {
                line!(v, "    reg m_{name}_immediate;\n    reg [31:0] r_{name}_immediate;");
            }
            line!(v, "    always @(posedge clk) begin");
            line!(v, "        if (advance) begin");
            line!(
                v,
                "            m_{name}_control <= d_{name}_control;\n            m_{name}_illegal <= d_{name}_illegal | d_outside;\n            m_{name}_dest    <= d_{name}_dest;"
            );
            for letter in ["a", "b", "c"].iter().take(slot.sources) {
                line!(
                    v,
                    "            m_{name}_{letter}_bank  <= d_{name}_{letter}_bank;\n            m_{name}_{letter}_index <= d_{name}_{letter}_index;"
                );
            }
            line!(
                v,
                "            r_{name}_control <= m_valid ? m_{name}_control : {width}'d0;  // what is no bundle does nothing"
            );
            line!(v, "            i_{name}_control <= r_{name}_control;");
            line!(
                v,
                "            r_{name}_illegal <= m_{name}_illegal;\n            i_{name}_illegal <= r_{name}_illegal;"
            );
            line!(
                v,
                "            r_{name}_dest    <= m_{name}_dest;\n            i_{name}_dest    <= r_{name}_dest;"
            );
            if constant > 0 {
                let kept = constant.min(16);
                line!(
                    v,
                    "            m_{name}_constant <= d_{name}_constant;\n            r_{name}_constant <= m_{name}_constant[{}:0];\n            i_{name}_constant <= r_{name}_constant;",
                    kept - 1
                );
            }
            if immediate {
                line!(
                    v,
                    "            m_{name}_immediate <= d_{name}_immediate;\n            r_{name}_immediate <= m_{name}_immediate ? m_{name}_constant : 32'd0;"
                );
            }
            line!(v, "        end\n    end");
            let writes = |stage: &str| {
                any(&slot
                    .latencies
                    .iter()
                    .map(|l| self.bit(stage, s, &format!("result_{l}")))
                    .collect::<Vec<_>>())
            };
            for stage in ["m", "r", "i"] {
                line!(v, "    wire {stage}_{name}_writes = {};", writes(stage));
            }
            for stage in ["r", "i"] {
                line!(v, "    wire {stage}_{name}_early = {};", self.bit_or_0(stage, s, "result_2"));
            }
        }

        // ---- Results underway.
        line!(v, "\n    // ---- results underway, and the buses");
        line!(v, "\n    wire [15:0] i_address;");
        for (s, slot) in self.slots.iter().enumerate() {
            let name = n(s);
            let d = self.depths[s];
            line!(v);
            let mut lasts = Vec::new();
            for unit in self.late[s].iter().map(|late| late.unit) {
                let u = format!("{name}_{}", unit.name);
                let span = unit.latency - d;
                line!(
                    v,
                    "    wire [{span}:1] {u}_at;\n    wire {u}_underway, {u}_last, {u}_busy;\n    wire [{}:0] {u}_index;\n    wire [15:0] {u}_address;\n    wire {u}_unused = &{{1'b0, {u}_at}};  // of which some bits are",
                    index - 1
                );
                line!(
                    v,
                    "    takt_late #(.LATENCY({}), .INTERVAL({}), .DEPTH({d}), .INDEX({index})) {u}_late (",
                    unit.latency,
                    unit.interval
                );
                line!(
                    v,
                    "        .clk(clk), .rst(rst), .cancel(fault), .insert(issue & {}),\n        .insert_index(i_{name}_dest), .insert_address(i_address),",
                    self.bit("i", s, &format!("unit_{}", unit.name))
                );
                line!(
                    v,
                    "        .at({u}_at), .underway({u}_underway), .index({u}_index), .address({u}_address), .last({u}_last), .busy({u}_busy)\n    );"
                );
                lasts.push(u);
            }
            let select = |what: &str, width: u32| match lasts.as_slice() {
                [] => format!("{width}'d0"),
                [one] => format!("{one}_{what}"),
                _ => lasts
                    .iter()
                    .map(|u| format!("({{{width}{{{u}_last}}}} & {u}_{what})"))
                    .collect::<Vec<_>>()
                    .join(" | "),
            };
            let insert: Vec<String> = (1..=d)
                .map(|l| {
                    if slot.latencies.contains(&l) {
                        format!("issue & {}", self.bit("i", s, &format!("result_{l}")))
                    } else {
                        "1'b0".to_owned()
                    }
                })
                .collect();
            line!(
                v,
                "    wire [{}:0] {name}_underway;\n    wire {name}_writes;\n    wire [{}:0] {name}_underway_index;\n    wire [15:0] {name}_retire_address;",
                d - 1,
                d * index - 1
            );
            line!(v, "    takt_underway #(.DEPTH({d}), .INDEX({index})) {name}_results (");
            line!(
                v,
                "        .clk(clk), .rst(rst), .cancel(fault), .load({name}_load), .load_index(loads_address[{}:0]),",
                index - 1
            );
            line!(v, "        .insert({}),", concat(&insert));
            line!(v, "        .insert_index(i_{name}_dest), .insert_address(i_address),");
            line!(
                v,
                "        .late({}), .late_index({}), .late_address({}),",
                any(&lasts.iter().map(|u| format!("{u}_last")).collect::<Vec<_>>()),
                select("index", index),
                select("address", 16)
            );
            line!(
                v,
                "        .writes({name}_writes), .valid({name}_underway), .index({name}_underway_index), .address({name}_retire_address)\n    );"
            );
            line!(
                v,
                "    wire [31:0] {name}_result;\n    reg  [31:0] {name}_was_result;\n    always @(posedge clk) {name}_was_result <= {name}_result;\n    wire [2:0] {name}_flags;"
            );
        }
        let vector = |text: &dyn Fn(usize) -> String| concat(&(0..slots).map(text).collect::<Vec<_>>());
        line!(v);
        line!(v, "    // The same for all slots, slot 0 first, each padded to {depth} places.");
        let padded = |s: usize, width: u32, what: &str| {
            let missing = (depth - self.depths[s]) * width;
            let name = format!("{}_{what}", n(s));
            if missing == 0 { name } else { format!("{missing}'d0, {name}") }
        };
        line!(
            v,
            "    wire [{}:0] underway = {{{}}};",
            slots as u32 * depth - 1,
            (0..slots).rev().map(|s| padded(s, 1, "underway")).collect::<Vec<_>>().join(", ")
        );
        line!(
            v,
            "    wire [{}:0] underway_index = {{{}}};",
            slots as u32 * depth * index - 1,
            (0..slots).rev().map(|s| padded(s, index, "underway_index")).collect::<Vec<_>>().join(", ")
        );
        let lates = |what: &str, width: u32| {
            let all: Vec<String> = (0..slots)
                .flat_map(|s| (0..late).map(move |u| (s, u)))
                .map(|(s, u)| {
                    self.late[s]
                        .get(u)
                        .map_or(format!("{width}'d0"), |late| format!("{}_{}_{what}", n(s), late.unit.name))
                })
                .collect();
            concat(&all)
        };
        line!(v, "    wire [{}:0] late = {};", slots * late - 1, lates("underway", 1));
        line!(
            v,
            "    wire [{}:0] late_index = {};",
            slots * late * index as usize - 1,
            lates("index", index)
        );
        for stage in ["r", "i"] {
            for what in ["writes", "early"] {
                line!(
                    v,
                    "    wire [{}:0] {stage}_{what} = {};",
                    slots - 1,
                    vector(&|s| format!("{stage}_{}_{what}", n(s)))
                );
            }
            line!(
                v,
                "    wire [{}:0] {stage}_dest = {};",
                slots * index as usize - 1,
                vector(&|s| format!("{stage}_{}_dest", n(s)))
            );
        }
        line!(v, "    wire [{}:0] result = {};", 32 * slots - 1, vector(&|s| format!("{}_result", n(s))));
        line!(
            v,
            "    wire [{}:0] was_result = {};",
            32 * slots - 1,
            vector(&|s| format!("{}_was_result", n(s)))
        );
        line!(
            v,
            "    wire [{}:0] writes = {};\n    wire [2:0] new_flags = {};",
            slots - 1,
            vector(&|s| format!("{}_writes", n(s))),
            any(&(0..slots).map(|s| format!("({{3{{{0}_writes}}}} & {0}_flags)", n(s))).collect::<Vec<_>>())
        );

        // ---- Operands.
        line!(v, "\n    // ---- operands: banks, forwarding, hazards");
        let flags_slots: Vec<usize> = (0..slots).filter(|&s| self.slots[s].has("read_flags")).collect();
        line!(v, "\n    reg  [2:0] sticky;\n    wire [2:0] sticky_now;");
        let (mut r_waits, mut i_waits) = (Vec::new(), Vec::new());
        for (s, slot) in self.slots.iter().enumerate() {
            let name = n(s);
            for (k, letter) in ["a", "b", "c"].iter().enumerate().take(slot.sources) {
                let o = format!("{name}_{letter}");
                let constant = if k == 0 && slot.has_effect(Effect::Immediate) {
                    format!("r_{name}_immediate")
                } else {
                    "32'd0".to_owned()
                };
                let (reads_status, status) = if k == 0 && flags_slots.contains(&s) {
                    let reads = self.bit("i", s, "read_flags");
                    (reads.clone(), format!("{{27'd0, {{3{{{reads}}}}} & sticky_now, 2'd0}}"))
                } else {
                    ("1'b0".to_owned(), "32'd0".to_owned())
                };
                line!(v);
                line!(v, "    wire [31:0] x_{o};\n    wire {o}_r_waits, {o}_i_waits;");
                line!(
                    v,
                    "    takt_source #(.SLOTS({slots}), .DEPTH({depth}), .LATE({late}), .INDEX({index}), .LATCHED(LATCHED), .INPUTS({input_bits})) {o} ("
                );
                line!(
                    v,
                    "        .clk(clk), .advance(advance), .m_bank(m_{o}_bank), .m_index(m_{o}_index), .m_place(m_place[{}]),",
                    sources.iter().position(|source| *source == o).unwrap_or(0)
                );
                line!(
                    v,
                    "        .underway(underway), .underway_index(underway_index), .writes(writes), .late(late), .late_index(late_index),"
                );
                line!(
                    v,
                    "        .r_writes(r_writes), .r_early(r_early), .r_dest(r_dest), .i_writes(i_writes), .i_early(i_early), .i_dest(i_dest),"
                );
                line!(v, "        .result(result), .was_result(was_result),");
                line!(
                    v,
                    "        .input_write(input1), .input_write_place(input1_place), .input_now(input1_now), .input_write_index(input1_index), .input_write_value(input1_value),"
                );
                line!(v, "        .input_next_value(input2_value),");
                line!(
                    v,
                    "        .r_constant({constant}), .i_reads_status({reads_status}), .i_status({status}),"
                );
                line!(v, "        .r_waits({o}_r_waits), .i_waits({o}_i_waits), .operand(x_{o})\n    );");
                r_waits.push(format!("{o}_r_waits"));
                i_waits.push(format!("{o}_i_waits"));
            }
        }
        line!(v, "\n    // ---- destinations");
        for s in 0..slots {
            let name = n(s);
            let range = |stage: &str, what: &str| format!(".{stage}_{what}({stage}_{name}_{what})");
            line!(v);
            line!(
                v,
                "    wire {name}_r_waits, {name}_i_waits, {name}_unused_copy, {name}_unused_past, {name}_unused_taken, {name}_unused_i_taken, {name}_unused_next, {name}_unused_next_past;"
            );
            line!(
                v,
                "    takt_hazard #(.SLOTS(1), .DEPTH({}), .LATE({late}), .INDEX({index})) {name}_dest (",
                self.depths[s]
            );
            line!(
                v,
                "        .clk(clk), .advance(advance), .m_bank(m_{name}_writes), .m_index(m_{name}_dest), .r_bank(r_{name}_writes), .r_index(r_{name}_dest),"
            );
            line!(
                v,
                "        .i_bank(i_{name}_writes), .i_index(i_{name}_dest), .underway({name}_underway), .underway_index({name}_underway_index),"
            );
            line!(
                v,
                "        .late(late[{}:{}]), .late_index(late_index[{}:{}]),",
                (s + 1) * late - 1,
                s * late,
                (s + 1) * late * index as usize - 1,
                s * late * index as usize
            );
            line!(
                v,
                "        {}, {}, {}, {}, {}, {},",
                range("r", "writes"),
                range("r", "early"),
                range("r", "dest"),
                range("i", "writes"),
                range("i", "early"),
                range("i", "dest")
            );
            line!(
                v,
                "        .r_waits({name}_r_waits), .i_waits({name}_i_waits), .r_copy({name}_unused_copy), .r_past({name}_unused_past), .r_taken({name}_unused_taken), .i_taken({name}_unused_i_taken),"
            );
            line!(v, "        .next_now({name}_unused_next), .next_past({name}_unused_next_past)\n    );");
            r_waits.push(format!("{name}_r_waits"));
            i_waits.push(format!("{name}_i_waits"));
        }

        // ---- Other rules.
        line!(
            v,
            "\n    // ---- units, write ports, drain: for the bundle in read and for the one in issue, in the next cycle\n"
        );
        let mut pending = Vec::new();
        for (s, slot) in self.slots.iter().enumerate() {
            let name = n(s);
            let (mut r_unit, mut i_unit) = (Vec::new(), Vec::new());
            for unit in self.late[s].iter().map(|late| late.unit) {
                let bit = |stage| self.bit(stage, s, &format!("unit_{}", unit.name));
                r_unit.push(format!("({} & ({} | {name}_{}_busy))", bit("r"), bit("i"), unit.name));
                i_unit.push(format!("({} & {name}_{}_busy)", bit("i"), unit.name));
                pending.push(format!("{name}_{}_underway", unit.name));
            }
            let (mut r_port, mut i_port) = (Vec::new(), Vec::new());
            for &l in &slot.latencies {
                let mut taken = self.booked(s, l + 1);
                if !taken.is_empty() {
                    i_port.push(format!(
                        "({} & ({}))",
                        self.bit("i", s, &format!("result_{l}")),
                        any(&taken)
                    ));
                }
                if slot.latencies.contains(&(l + 1)) {
                    taken.push(self.bit("i", s, &format!("result_{}", l + 1)));
                }
                if !taken.is_empty() {
                    r_port.push(format!(
                        "({} & ({}))",
                        self.bit("r", s, &format!("result_{l}")),
                        any(&taken)
                    ));
                }
            }
            pending.push(format!("(|{name}_underway[{}:2])", self.depths[s] - 1));
            line!(
                v,
                "    wire {name}_r_busy = {};\n    wire {name}_i_busy = {};",
                any(&r_unit),
                any(&i_unit)
            );
            line!(
                v,
                "    wire {name}_r_port = {};\n    wire {name}_i_port = {};",
                any(&r_port),
                any(&i_port)
            );
            for (stage, waits) in [("r", &mut r_waits), ("i", &mut i_waits)] {
                waits.push(format!("{name}_{stage}_busy"));
                waits.push(format!("{name}_{stage}_port"));
            }
        }
        line!(v, "    wire pending = {};", any(&pending));
        let drains = |stage: &str| {
            any(&(0..slots)
                .filter(|&s| self.slots[s].has("drains"))
                .map(|s| self.bit(stage, s, "drains"))
                .collect::<Vec<_>>())
        };
        line!(
            v,
            "    wire r_drain = ({}) & (pending | (|i_writes));\n    wire i_drain = ({}) & pending;",
            drains("r"),
            drains("i")
        );
        r_waits.push("r_drain".to_owned());
        i_waits.push("i_drain".to_owned());
        line!(v, "    wire r_ready = ~({});", r_waits.join(" | "));
        line!(v, "    wire i_ready = ~({});", i_waits.join(" | "));
        line!(
            v,
            "    wire r_illegal = {};",
            vector(&|s| format!("r_{}_illegal", n(s))).replace(['{', '}'], "").replace(", ", " | ")
        );
        line!(v, "    wire [{}:0] i_illegal = {};", slots - 1, vector(&|s| format!("i_{}_illegal", n(s))));
        line!(v, "    takt_issue issuing (");
        line!(
            v,
            "        .clk(clk), .rst(rst), .flush(flush), .block(block), .r_ready(r_ready), .i_ready(i_ready), .r_illegal(r_illegal), .i_illegal(|i_illegal),"
        );
        line!(v, "        .m_valid(m_valid), .issue(issue), .advance(advance), .refused(refused)\n    );");
        let _ = &c;

        // ---- Execute.
        line!(v, "\n    // ---- execute: the sequencer and the data memory\n");
        line!(v, "    wire [15:0] x_address;\n    wire x_address_fault;");
        line!(
            v,
            "    takt_sequencer #(\n        .PROGRAM({code_bits}), .STACK({}), .REFILL({}), .RESOLVE({}), .SLOT({control_slot}), .MEMORY({memory_slot}), .SLOTS({slots})\n    ) sequencer (",
            machine.stack_depth,
            machine.refill,
            machine.resolve
        );
        line!(
            v,
            "        .clk(clk), .rst(rst), .advance(advance), .issue(issue), .refused(refused), .i_illegal(i_illegal),"
        );
        for flow in ["jump", "branch_zero", "branch_nonzero", "call", "return", "wait", "halt"] {
            line!(v, "        .i_{flow}({}),", self.bit_or_0("i", control_slot, flow));
        }
        line!(
            v,
            "        .i_target(i_{c}_constant), .x_operand(x_{c}_a), .x_address_fault(x_address_fault), .tick(ticks),"
        );
        line!(
            v,
            "        .flush(flush), .fetch(fetch), .f_outside(f_outside), .block(block), .i_address(i_address),"
        );
        line!(
            v,
            "        .x_issued(x_issued), .x_address(x_address), .waiting(waiting), .open(inputs_open), .ends(inputs_taken), .ended(ended), .missed(tick_missed), .lost(tick_lost),"
        );
        line!(
            v,
            "        .deadline_missed(deadline_missed), .halted(halted), .fault(fault), .fault_kind(fault_kind), .fault_slot(fault_slot),"
        );
        line!(v, "        .fault_address(fault_address)\n    );");
        let marker = "\n    // ---- execute: the sequencer and the data memory\n";
        v = v.replace(marker, &format!("{marker}\n    wire x_issued;"));
        line!(
            v,
            "    reg        was_issued;\n    reg [15:0] was_address;\n    always @(posedge clk) begin\n        was_issued  <= x_issued;\n        was_address <= x_address;\n    end\n    assign issued = was_issued & ~fault;\n    assign issued_address = was_address;\n"
        );
        line!(v, "    reg x_load, x_store;\n    reg [11:0] x_offset;\n    always @(posedge clk) begin");
        line!(
            v,
            "        x_load   <= issue & ~fault & {};\n        x_store  <= issue & ~fault & {};\n        x_offset <= i_{m}_constant[11:0];\n    end",
            self.bit_or_0("i", memory_slot, "load"),
            self.bit_or_0("i", memory_slot, "store")
        );
        let memory =
            self.slots[memory_slot].slot.units.iter().find(|unit| unit.functions.contains(&Function::Memory));
        line!(
            v,
            "    wire load_valid;\n    wire [31:0] load_result;\n    wire [{}:0] memory_address;",
            data_bits - 1
        );
        line!(
            v,
            "    takt_memory #(.LATENCY({}), .DEPTH({}), .ADDRESS({data_bits})) memory (",
            memory.map_or(0, |unit| unit.latency),
            machine.data_depth
        );
        line!(
            v,
            "        .clk(clk), .rst(rst), .load_write(load_data), .load_address(loads_address[{}:0]), .load_value(loads_value[31:0]),",
            data_bits - 1
        );
        line!(
            v,
            "        .x_load(x_load), .x_store(x_store), .offset(x_offset), .a(x_{m}_a), .b(x_{m}_b), .cancel(fault), .fault(x_address_fault),"
        );
        line!(
            v,
            "        .out_valid(load_valid), .result(load_result), .write(stored), .address(memory_address), .value(stored_value)\n    );"
        );
        line!(v, "    assign stored_address = {{{}'d0, memory_address}};", 16 - data_bits);

        // ---- Units.
        line!(v, "\n    // ---- units");
        for (s, slot) in self.slots.iter().enumerate() {
            let name = n(s);
            line!(v);
            let code = slot.controls.iter().find(|control| control.name == "code");
            let units: Vec<&str> = slot.circuits.iter().map(|(_, circuit)| circuit.unit.name).collect();
            line!(
                v,
                "    reg {};",
                units.iter().map(|unit| format!("x_{name}_{unit}")).collect::<Vec<_>>().join(", ")
            );
            if let Some(code) = code {
                line!(v, "    reg [{}:0] x_{name}_code;", code.width - 1);
            }
            line!(v, "    always @(posedge clk) begin");
            for unit in &units {
                line!(v, "        x_{name}_{unit} <= issue & {};", self.bit("i", s, &format!("unit_{unit}")));
            }
            if let Some(code) = code {
                line!(
                    v,
                    "        x_{name}_code <= i_{name}_control[{}_CODE +: {}];",
                    name.to_uppercase(),
                    code.width
                );
            }
            line!(v, "    end");
            let (mut results, mut flags) = (Vec::new(), Vec::new());
            for (_, circuit) in &slot.circuits {
                let unit = &circuit.unit;
                let u = format!("{name}_{}", unit.name);
                line!(v, "    wire {u}_valid;\n    wire [31:0] {u}_result;\n    wire [2:0] {u}_flags;");
                let parameters: Vec<String> =
                    circuit.parameters().map(|(name, value)| format!(".{name}({value})")).collect();
                let mut ports = vec![".clk(clk)".to_owned(), format!(".in_valid(x_{u})")];
                if circuit.op_bits > 0 {
                    ports.push(format!(".op(x_{name}_code[{}:0])", circuit.op_bits - 1));
                }
                ports.extend(
                    ["a", "b", "c"]
                        .iter()
                        .take(circuit.operands)
                        .map(|letter| format!(".{letter}(x_{name}_{letter})")),
                );
                ports.push(format!(".out_valid({u}_valid), .result({u}_result), .flags({u}_flags)"));
                line!(
                    v,
                    "    {} #({}) {u} (\n        {}\n    );",
                    unit.rtl,
                    parameters.join(", "),
                    ports.join(", ")
                );
                results.push(format!("({{32{{{u}_valid}}}} & {u}_result)"));
                flags.push(format!("({{3{{{u}_valid}}}} & {u}_flags)"));
            }
            if s == memory_slot {
                results.push("({32{load_valid}} & load_result)".to_owned());
            }
            results.push(format!("({{32{{{name}_loaded}}}} & loaded_value)"));
            line!(v, "    reg {name}_loaded;\n    always @(posedge clk) {name}_loaded <= {name}_load;");
            line!(v, "    assign {name}_result = {};", results.join("\n        | "));
            line!(v, "    assign {name}_flags = {};", any(&flags));
        }
        let units_marker = "\n    // ---- units\n";
        v = v.replacen(units_marker, &format!("{units_marker}\n    reg [31:0] loaded_value;\n    always @(posedge clk) loaded_value <= loads_value[31:0];\n"), 1);

        line!(v, "\n    // ---- the status register\n");
        let clears: Vec<String> = (0..slots)
            .filter(|&s| self.slots[s].has("clear_flags"))
            .map(|s| self.bit("i", s, "clear_flags"))
            .collect();
        line!(
            v,
            "    reg x_clear_flags;\n    assign sticky_now = (sticky & {{3{{~x_clear_flags | fault}}}}) | new_flags;\n    assign status = sticky_now;"
        );
        line!(
            v,
            "    always @(posedge clk) begin\n        x_clear_flags <= issue & ~fault & ({});\n        sticky <= rst ? 3'd0 : sticky_now;\n    end",
            any(&clears)
        );

        line!(v, "\n    // ---- output and retire ports\n");
        for (s, slot) in self.slots.iter().enumerate() {
            let (name, bank) = (n(s), slot.slot.bank);
            let log = bank.depth.trailing_zeros();
            line!(
                v,
                "    assign output_{}_write = {name}_writes & (&{name}_underway_index[{}:{port_bits}]);",
                bank.name,
                log - 1
            );
            line!(
                v,
                "    assign output_{}_index = {name}_underway_index[{}:0];\n    assign output_{}_value = {name}_result;",
                bank.name,
                port_bits - 1,
                bank.name
            );
        }
        let banks = |what: &str| vector(&|s| format!("output_{}_{what}", self.slots[s].slot.bank.name));
        line!(
            v,
            "    takt_outputs #(.LATCHED(LATCHED), .BANKS({slots}), .INDEX({port_bits})) outputs (\n        .clk(clk), .rst(rst), .publish(ended), .write({}), .index({}),\n        .value({}), .number(read_output), .shown(read_value)\n    );",
            banks("write"),
            banks("index"),
            banks("value")
        );
        line!(v, "    assign retire         = {};", vector(&|s| format!("{}_writes & ~rst", n(s))));
        line!(v, "    assign retire_address = {};", vector(&|s| format!("{}_retire_address", n(s))));
        line!(
            v,
            "    assign retire_register = {};",
            vector(&|s| {
                let bank = self.slots[s].slot.bank;
                format!("10'd{} | {{{}'d0, {}_underway_index[{}:0]}}", bank.base, 10 - index, n(s), index - 1)
            })
        );
        line!(v, "    assign retire_value   = result;");
        line!(v, "    assign retire_flags   = {};", vector(&|s| format!("{}_flags", n(s))));
        line!(v, "\nendmodule");
        v
    }
}
