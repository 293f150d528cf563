// SPDX-License-Identifier: MIT OR Apache-2.0
//! Words decoded by the tables of instructions and units, as modules that share nothing with the core's decoders.

use super::rules::any;
use std::fmt::Write as _;
use takt_isa::shape::{Field, OPCODE};
use takt_isa::{Bank, Effect, Register, Row, Unit};
use takt_rtl::plan::names::LETTERS;
use takt_rtl::plan::{Plan, SlotPlan, Stage};

/// Effects that the reference knows.
pub(super) const EFFECTS: [Effect; 14] = [
    Effect::Load,
    Effect::Store,
    Effect::ReadFlags,
    Effect::ClearFlags,
    Effect::Immediate,
    Effect::Jump,
    Effect::BranchZero,
    Effect::BranchNonzero,
    Effect::Call,
    Effect::Return,
    Effect::Loop,
    Effect::Publish,
    Effect::Wait,
    Effect::Halt,
];

/// The word of a slot in a stage, and the nets of what the tables say of it.
#[derive(Clone, Copy)]
pub(super) struct Decoded<'p> {
    pub(super) slot: &'p SlotPlan,
    pub(super) stage: Stage,
}

impl Decoded<'_> {
    fn net(self, what: &str) -> String {
        format!("f_{}_{}_{what}", self.stage, self.slot.name())
    }

    pub(super) fn word(self) -> String {
        self.net("word")
    }

    /// The word is an operation that the slot can execute.
    pub(super) fn legal(self) -> String {
        self.net("legal")
    }

    /// For each latency of the slot, ascending: the operation has a result of this latency.
    pub(super) fn result(self) -> String {
        self.net("result")
    }

    /// The operation goes to a unit.
    pub(super) fn uses(self, unit: &Unit) -> String {
        let place = self.slot.circuits.iter().position(|circuit| circuit.unit.name == unit.name);
        format!("{}[{}]", self.net("units"), place.expect("the slot hosts the unit"))
    }

    /// Operation code for the unit.
    pub(super) fn code(self) -> String {
        self.net("code")
    }

    pub(super) fn drains(self) -> String {
        self.net("drains")
    }

    /// The operation has this effect.
    pub(super) fn effect(self, effect: Effect) -> String {
        let place = EFFECTS.iter().position(|&other| other == effect).expect("the rules know the effect");
        format!("{}[{place}]", self.net("effects"))
    }

    pub(super) fn writes(self) -> String {
        format!("(|{})", self.result())
    }

    /// Index of the register that the operation writes.
    pub(super) fn dest(self) -> String {
        self.net("dest")
    }

    /// Slot whose bank a source is in, or the inputs after them, one-hot; none: the operation has no such source, or it is `zero`.
    pub(super) fn bank(self, operand: usize) -> String {
        self.net(&format!("{}_bank", LETTERS[operand]))
    }

    /// Index of the source in its bank.
    pub(super) fn index(self, operand: usize) -> String {
        self.net(&format!("{}_index", LETTERS[operand]))
    }

    /// Text that declares the word and decodes it.
    pub(super) fn declared(self, plan: &Plan) -> String {
        let (slot, last) = (self.slot, plan.index - 1);
        let mut text = format!("    reg [47:0] {};\n", self.word());
        let mut ports = String::new();
        for (port, range) in outputs(plan, slot, last) {
            let _ = writeln!(text, "    wire {range} {};", self.net(&port));
            let _ = write!(ports, ", .{port}({})", self.net(&port));
        }
        let _ = writeln!(
            text,
            "    takt_rules_{} {} (.word({}){ports});",
            slot.name(),
            self.net("decoded"),
            self.word()
        );
        text
    }
}

/// Outputs of a slot's module, with their ranges.
fn outputs(plan: &Plan, slot: &SlotPlan, last: u32) -> Vec<(String, String)> {
    let bits = |count: usize| format!("[{}:0]", count.max(1) - 1);
    let mut list = vec![
        ("legal".to_owned(), String::new()),
        ("result".to_owned(), bits(slot.latencies.len())),
        ("units".to_owned(), bits(slot.circuits.len())),
        ("code".to_owned(), bits(slot.code_bits() as usize)),
        ("drains".to_owned(), String::new()),
        ("effects".to_owned(), bits(EFFECTS.len())),
        ("dest".to_owned(), format!("[{last}:0]")),
    ];
    for letter in &LETTERS[..slot.sources] {
        list.push((format!("{letter}_bank"), bits(plan.slots.len() + 1)));
        list.push((format!("{letter}_index"), format!("[{last}:0]")));
    }
    list
}

/// Module that decodes a slot's words.
pub(super) fn module(plan: &Plan, slot: &SlotPlan) -> String {
    let outs: Vec<_> = outputs(plan, slot, plan.index - 1)
        .into_iter()
        .map(|(port, range)| format!("output wire {range} {port}"))
        .collect();
    let mut v = format!("module takt_rules_{} (input wire [47:0] word, {});\n", slot.name(), outs.join(", "));
    let is = |wanted: &dyn Fn(&Row) -> bool| {
        any(slot.rows.iter().filter(|row| wanted(row)).map(|row| {
            format!("(word[{}:{}] == 7'h{:02x})", OPCODE.low + OPCODE.width - 1, OPCODE.low, row.opcode)
        }))
    };
    let range = |field: Field| {
        let bits = field.bits();
        format!("word[{}:{}]", bits.low + bits.width - 1, bits.low)
    };
    let within = |bank: &Bank, field: Field| {
        format!(
            "(11'd{} <= {at} & {at} <= 11'd{})",
            bank.base,
            bank.base + (bank.depth - 1),
            at = range(field)
        )
    };
    let legal = slot.rows.iter().map(|row| {
        // Bits that the shape does not use are zero; operands lie in a bank of the machine or in the input ports.
        let unused = !row.shape.mask() & ((1 << 41) - 1);
        let mut text =
            format!("(word[47:41] == 7'h{:02x} & (word[40:0] & 41'h{unused:x}) == 41'd0", row.opcode);
        if row.shape.has_dest() {
            let _ = write!(text, " & {{1'b0, {}}} < 10'd{}", range(Field::Dest), slot.slot.bank.depth);
        }
        for field in [Field::A, Field::B, Field::C].into_iter().take(row.shape.sources()) {
            let _ = write!(text, " & {}", any(plan.machine.banks().map(|bank| within(bank, field))));
        }
        text + ")"
    });
    let _ = writeln!(v, "    assign legal = {};", any(legal));
    let unit = |row: &Row| slot.slot.unit(row.function);
    for (number, &latency) in slot.latencies.iter().enumerate() {
        let own = is(&|row| row.shape.has_dest() && unit(row).is_some_and(|unit| unit.latency == latency));
        let _ = writeln!(v, "    assign result[{number}] = {own};");
    }
    let mut codes = vec![format!("{}'d0", slot.code_bits().max(1))];
    for (number, circuit) in slot.circuits.iter().enumerate() {
        let _ = writeln!(
            v,
            "    assign units[{number}] = {};",
            is(&|row| row.shape.has_dest() && unit(row).is_some_and(|unit| unit.name == circuit.unit.name))
        );
        for operation in circuit.operations.iter().filter(|operation| operation.code != 0) {
            let own = is(&|row| row.op == operation.op);
            codes.push(format!("({{{0}{{{own}}}}} & {0}'d{1})", slot.code_bits(), operation.code));
        }
    }
    let _ = writeln!(v, "    assign code = {};", any(codes));
    if slot.circuits.is_empty() {
        v += "    assign units = 1'b0;\n";
    }
    if slot.latencies.is_empty() {
        v += "    assign result = 1'b0;\n";
    }
    let _ = writeln!(v, "    assign drains = {};", is(&|row| row.effect.drains()));
    for (number, effect) in EFFECTS.iter().enumerate() {
        let _ = writeln!(v, "    assign effects[{number}] = {};", is(&|row| row.effect == *effect));
    }
    let low = |field: Field, width: u32| {
        let bits = field.bits();
        format!("word[{} +: {}]", bits.low, width.min(bits.width))
    };
    let _ = writeln!(v, "    assign dest = {};", low(Field::Dest, plan.index));
    for (operand, letter) in LETTERS[..slot.sources].iter().enumerate() {
        let field = [Field::A, Field::B, Field::C][operand];
        let reads = is(&|row| row.shape.sources() > operand);
        for producer in &plan.slots {
            let _ = writeln!(
                v,
                "    assign {letter}_bank[{}] = {reads} & {};",
                producer.number,
                within(&producer.slot.bank, field)
            );
        }
        let (inputs, zero) = (&plan.machine.inputs, Register::ZERO.index());
        let _ = writeln!(
            v,
            "    assign {letter}_bank[{}] = {reads} & {} & {} != 10'd{zero};",
            plan.slots.len(),
            within(inputs, field),
            range(field)
        );
        let _ = writeln!(v, "    assign {letter}_index = {};", low(field, plan.index));
    }
    v + "endmodule\n"
}
