//! A slot's decoder: from a word to the control bits that accompany the operation.

use crate::circuit::Circuit;
use std::fmt::Write as _;
use takt_isa::shape::{Field, OPCODE, Shape};
use takt_isa::spec::machines::{Machine, Slot, ZERO};
use takt_isa::{Effect, Function, ROWS, Row};

/// One control bit, or a few.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Control {
    /// Its name: `unit_add`, `result_5`, `code`, `load`.
    pub(crate) name: String,
    pub(crate) low: u32,
    pub(crate) width: u32,
}

/// What the generator must know of a slot.
#[derive(Debug)]
pub(crate) struct SlotPlan {
    pub(crate) slot: &'static Slot,
    /// Circuits of the units that compute, by index into the slot's units.
    pub(crate) circuits: Vec<(usize, Circuit)>,
    pub(crate) controls: Vec<Control>,
    /// Sources of the operation that has most.
    pub(crate) sources: usize,
    /// Latencies of results, ascending.
    pub(crate) latencies: Vec<u32>,
    /// Instructions that may stand in the slot.
    rows: Vec<&'static Row>,
}

/// The control bit of an effect, unless it is nothing but arithmetic.
fn effect_name(effect: Effect) -> Option<&'static str> {
    Some(match effect {
        Effect::Compute | Effect::Nothing | Effect::Immediate => return None,
        Effect::Load => "load",
        Effect::Store => "store",
        Effect::Jump => "jump",
        Effect::BranchZero => "branch_zero",
        Effect::BranchNonzero => "branch_nonzero",
        Effect::Call => "call",
        Effect::Return => "return",
        Effect::Wait => "wait",
        Effect::Halt => "halt",
        Effect::ReadFlags => "read_flags",
        Effect::ClearFlags => "clear_flags",
    })
}

impl SlotPlan {
    pub(crate) fn new(slot: &'static Slot, circuits: Vec<(usize, Circuit)>) -> SlotPlan {
        let rows: Vec<&Row> = ROWS
            .iter()
            .filter(|row| row.function == Function::Idle || slot.unit_for(row.function).is_some())
            .collect();
        let mut plan =
            SlotPlan { slot, circuits, controls: Vec::new(), sources: 0, latencies: Vec::new(), rows };
        plan.sources = plan.rows.iter().map(|row| row.shape.sources()).max().unwrap_or(0);
        let dests = plan.rows.iter().filter(|row| row.shape.has_dest());
        plan.latencies = dests.map(|row| plan.latency(row)).collect();
        plan.latencies.sort_unstable();
        plan.latencies.dedup();

        let mut names: Vec<(String, u32)> = Vec::new();
        names.extend(plan.circuits.iter().map(|(_, circuit)| (format!("unit_{}", circuit.unit.name), 1)));
        names.extend(plan.latencies.iter().map(|latency| (format!("result_{latency}"), 1)));
        let code = plan.circuits.iter().map(|(_, circuit)| circuit.op_bits).max().unwrap_or(0);
        names.extend((code > 0).then(|| ("code".to_owned(), code)));
        if plan.rows.iter().any(|row| row.effect.drains()) {
            names.push(("drains".to_owned(), 1));
        }
        for row in &plan.rows {
            if let Some(name) = effect_name(row.effect)
                && names.iter().all(|(other, _)| other != name)
            {
                names.push((name.to_owned(), 1));
            }
        }
        let mut low = 0;
        for (name, width) in names {
            plan.controls.push(Control { name, low, width });
            low += width;
        }
        plan
    }

    fn latency(&self, row: &Row) -> u32 {
        self.slot.unit_for(row.function).map_or(0, |unit| self.slot.units[unit].latency)
    }

    /// Bits of control.
    pub(crate) fn width(&self) -> u32 {
        self.controls.last().map_or(0, |control| control.low + control.width)
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.controls.iter().any(|control| control.name == name)
    }

    pub(crate) fn has_effect(&self, effect: Effect) -> bool {
        self.rows.iter().any(|row| row.effect == effect)
    }

    /// Bits of constant: an immediate, or a target or offset, or none.
    pub(crate) fn constant_bits(&self) -> u32 {
        let fields = self.rows.iter().flat_map(|row| row.shape.fields());
        let wide = |field: &Field| matches!(field, Field::Immediate | Field::Target | Field::Offset);
        fields.filter(|field| wide(field)).map(|field| field.bits().width).max().unwrap_or(0)
    }

    /// The value of the control bits for an instruction.
    fn control(&self, row: &Row) -> u64 {
        let mut value = 0;
        let mut set = |name: &str, bits: u64| {
            if let Some(control) = self.controls.iter().find(|control| control.name == name) {
                value |= bits << control.low;
            }
        };
        if row.shape.has_dest() {
            set(&format!("result_{}", self.latency(row)), 1);
        }
        for (_, circuit) in &self.circuits {
            if let Some(operation) = circuit.operations.iter().find(|operation| operation.op == row.op) {
                set(&format!("unit_{}", circuit.unit.name), 1);
                set("code", operation.code.into());
            }
        }
        if row.effect.drains() {
            set("drains", 1);
        }
        if let Some(name) = effect_name(row.effect) {
            set(name, 1);
        }
        value
    }

    /// The decoder as a module.
    pub(crate) fn module(&self, machine: &Machine, name: &str, index: u32) -> String {
        let mut v = String::new();
        let slots = machine.slots.len();
        let letters = ["a", "b", "c"];
        let fields = [Field::A, Field::B, Field::C];
        let width = self.width();
        let constant = self.constant_bits();
        let _ = writeln!(
            v,
            "// {name}: decodes the words of slot {}. Generated by `takt rtl` from the table of instructions.\n//\n\
             // Contract\n\
             //   control, from bit 0: {}.\n\
             //   <source>_bank: one-hot, the slots' banks, then the inputs; none if the operation has no such source, or it is `zero`.\n\
             //   illegal: no instruction, or none that the slot can execute; then the other outputs mean nothing.\n",
            self.slot.name,
            self.controls.iter().map(|c| c.name.as_str()).collect::<Vec<_>>().join(", ")
        );
        let _ = writeln!(v, "module {name} (\n    input  wire [47:0] word,");
        for letter in &letters[..self.sources] {
            let _ = writeln!(
                v,
                "    output wire [{slots}:0]  {letter}_bank,\n    output wire [{}:0]  {letter}_index,",
                index - 1
            );
        }
        let _ = writeln!(v, "    output wire [{}:0]  dest,", index - 1);
        if constant > 0 {
            let _ = writeln!(v, "    output wire [{}:0] constant,", constant - 1);
        }
        if self.has_effect(Effect::Immediate) {
            let _ = writeln!(v, "    output reg         immediate,");
        }
        let _ =
            writeln!(v, "    output reg  [{}:0] control,\n    output wire        illegal\n);\n", width - 1);

        // What a shape leaves unused.
        let mut shapes: Vec<Shape> = Vec::new();
        for row in &self.rows {
            if !shapes.contains(&row.shape) {
                shapes.push(row.shape);
            }
        }
        let _ = writeln!(v, "    // A bit is set that the shape does not use.");
        let stray = |shape: Shape| format!("stray_{}", format!("{shape:?}").to_lowercase());
        for &shape in &shapes {
            let unused = !shape.mask() & ((1 << OPCODE.low) - 1);
            let text = match unused {
                0 => "1'b0".to_owned(),
                _ => format!("|(word[40:0] & 41'h{unused:011x})"),
            };
            let _ = writeln!(v, "    wire {} = {text};", stray(shape));
        }
        let _ = writeln!(
            v,
            "\n    reg       bad;\n    reg       writes;\n    reg [2:0] reads;\n    always @* begin"
        );
        let idle = |v: &mut String, indent: &str| {
            let _ = writeln!(v, "{indent}control = {width}'d0;");
            if self.has_effect(Effect::Immediate) {
                let _ = writeln!(v, "{indent}immediate = 1'b0;");
            }
        };
        idle(&mut v, "        ");
        let _ = writeln!(v, "        {{bad, writes, reads}} = 5'b1_0_000;");
        let _ = writeln!(v, "        case (word[{}:{}])", OPCODE.low + OPCODE.width - 1, OPCODE.low);
        for row in &self.rows {
            let reads = (1u32 << row.shape.sources()) - 1;
            let control = format!("{:0width$b}", self.control(row), width = width as usize);
            let immediate = if row.effect == Effect::Immediate { " immediate = 1'b1;" } else { "" };
            let _ = writeln!(
                v,
                "            7'h{:02x}: begin bad = {}; {{writes, reads}} = 4'b{}_{reads:03b}; control = {width}'b{control};{immediate} end  // {}",
                row.opcode,
                stray(row.shape),
                u8::from(row.shape.has_dest()),
                row.mnemonic
            );
        }
        let _ = writeln!(v, "            default: bad = 1'b1;\n        endcase\n    end\n");

        let mut illegal = vec!["bad".to_owned()];
        for (letter, field) in letters.iter().zip(fields).take(self.sources) {
            let bits = field.bits();
            let (low, high) = (bits.low, bits.low + bits.width - 1);
            let windows: Vec<String> = machine
                .banks()
                .map(|bank| {
                    let log = bank.depth.trailing_zeros();
                    format!("word[{high}:{}] == {}'d{}", low + log, bits.width - log, bank.base >> log)
                })
                .collect();
            let mut text: Vec<String> =
                windows.iter().map(|window| format!("{letter}_read & ({window})")).collect();
            if let Some(inputs) = text.last_mut() {
                let _ = write!(inputs, " & (word[{high}:{low}] != {}'d{ZERO})", bits.width);
            }
            text.reverse();
            let n = letters.iter().position(|l| l == letter).unwrap_or(0);
            let _ = writeln!(v, "    wire {letter}_read = reads[{n}];");
            let _ = writeln!(v, "    assign {letter}_bank  = {{{}}};", text.join(",\n        "));
            let _ = writeln!(v, "    assign {letter}_index = word[{}:{low}];", low + index - 1);
            let covered: u32 = machine.banks().map(|bank| u32::from(bank.depth)).sum();
            if covered < 1 << bits.width {
                illegal.push(format!(
                    "({letter}_read & ~({}))",
                    windows.iter().map(|w| format!("({w})")).collect::<Vec<_>>().join(" | ")
                ));
            }
        }
        let dest = Field::Dest.bits();
        let _ = writeln!(v, "    assign dest    = word[{}:{}];", dest.low + index - 1, dest.low);
        let log = self.slot.bank.depth.trailing_zeros();
        if log < dest.width {
            illegal.push(format!("(writes & |word[{}:{}])", dest.low + dest.width - 1, dest.low + log));
        }
        if constant > 0 {
            let _ = writeln!(v, "    assign constant = word[{}:0];", constant - 1);
        }
        let _ = writeln!(v, "    assign illegal = {};", illegal.join("\n        | "));
        let mut unused = Vec::new();
        if log >= dest.width {
            unused.push("writes".to_owned());
        }
        if self.sources < 3 {
            unused.push(format!("reads[2:{}]", self.sources));
        }
        if !unused.is_empty() {
            let _ = writeln!(v, "\n    wire unused = &{{1'b0, {}}};", unused.join(", "));
        }
        let _ = writeln!(v, "\nendmodule");
        v
    }
}
