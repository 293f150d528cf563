// SPDX-License-Identifier: MIT OR Apache-2.0
//! Generator of the error correction of a core's memories: the scrubber, which repairs words through the loader, and the reports.

use crate::plan::names::net;
use crate::plan::{Plan, SlotPlan};
use crate::verilog::{Expr, Instance, Module, Net, any, choose, concat, decimal, gated, set};

/// A memory that the scrubber repairs.
enum Memory<'a> {
    /// A slot's share of the program memory.
    Program(&'a SlotPlan),
    /// The data memory.
    Data,
    /// All copies of a slot's bank.
    Bank(&'a SlotPlan),
}

/// Sources from whose copies the scrubber takes words: a second one, where the first one's is wrong.
pub(super) const REPAIRING: usize = 2;

impl Plan {
    /// Memories in the order of their bits in the scrubber's ports.
    fn memories(&self) -> Vec<Memory<'_>> {
        let programs = self.slots.iter().map(Memory::Program);
        programs.chain([Memory::Data]).chain(self.slots.iter().map(Memory::Bank)).collect()
    }

    /// Words of a slot's bank at the scrubber's address: the first source's word is sound, the second source's is, one of all sources is not;
    /// the first source's word and the second source's.
    fn copies_of(&self, slot: &SlotPlan) -> ([Expr; 3], [Expr; 2]) {
        let sources: Vec<_> = self.sources().collect();
        let sound = |&(of, operand): &(&SlotPlan, usize)| of.sound(operand).at(slot.number);
        let word = |&(of, operand): &(&SlotPlan, usize)| of.copies(operand).part(32 * slot.number, 32);
        let (first, second) = (&sources[0], sources.get(1).unwrap_or(&sources[0]));
        let damaged = any(sources.iter().map(|source| !sound(source)));
        ([sound(first), sound(second), damaged], [word(first), word(second)])
    }
}

/// Declares the nets between memories, scrubber and loader.
pub(super) fn declare(plan: &Plan, m: &mut Module) {
    m.banner("error correction: nets between memories, scrubber and loader");
    m.comment(
        "docs/safety.md. While the core waits, the scrubber reads all memories at scrub_address; the loader writes those words again that \
         are wrong, as if in reset.",
    );
    m.blank();
    m.wires([net::SCRUBS]);
    m.wires([plan.scrub_address()]);
    m.wires([plan.repair()]);
    m.define(net::REPAIRS, Expr::from(plan.repair()).any_bit());
    m.regs([net::REPAIRED]);
    for slot in &plan.slots {
        m.wires([slot.scrubbed()]);
    }
    m.wires([net::DATA_CORRECTED]);
    for (number, (slot, operand)) in plan.sources().enumerate() {
        if number < REPAIRING {
            m.wires([slot.copies(operand)]);
        }
        m.wires([slot.sound(operand)]);
    }
    let repaired = [net::REPAIR_SPACE, net::REPAIR_SLOT, net::REPAIR_ADDRESS, net::REPAIR_VALUE];
    for (net, terms) in repaired.into_iter().zip(repaired_words(plan)) {
        m.define(net, any(terms));
    }
}

/// Space, slot, address and value of the word that is repaired, each as terms to be combined with OR.
fn repaired_words(plan: &Plan) -> [Vec<Expr>; 4] {
    let wide = |value: Expr, missing: u32| match missing {
        0 => value,
        _ => concat([value, decimal(missing, 0_u32)]),
    };
    let address = plan.scrub_address();
    let constant = |terms: &mut Vec<Expr>, width: u32, of: Expr, value: u32| {
        terms.extend((value > 0).then(|| gated(width, of, decimal(width, value))));
    };
    let (mut spaces, mut slots, mut values) = (Vec::new(), Vec::new(), Vec::new());
    let mut addresses = vec![wide(Expr::from(&address), 16 - address.width())];
    for (k, memory) in plan.memories().iter().enumerate() {
        let repairs = || plan.repair().at(k as u32);
        match memory {
            Memory::Program(slot) => {
                constant(&mut slots, 3, repairs(), slot.number);
                values.push(gated(48, repairs(), slot.scrubbed()));
            }
            Memory::Data => {
                constant(&mut spaces, 2, repairs(), 1);
                values.push(wide(gated(32, repairs(), net::DATA_CORRECTED), 16));
            }
            Memory::Bank(slot) => {
                let ([sound, ..], [first, second]) = plan.copies_of(slot);
                constant(&mut spaces, 2, repairs(), 2);
                constant(&mut addresses, 16, repairs(), slot.slot.bank.base.into());
                values.push(wide(gated(32, repairs(), choose(sound, first, second)), 16));
            }
        }
    }
    if slots.is_empty() {
        slots.push(decimal(3, 0_u32));
    }
    [spaces, slots, addresses, values]
}

/// Generates the scrubber and the reports.
pub(super) fn write(plan: &Plan, m: &mut Module) {
    m.banner("error correction: scrubber and reports");
    m.comment(
        "A word with one wrong bit is corrected where it is read; a bank's word with a wrong parity is not, and the program must not go on. \
         A wait of 64 cycles and more repairs both.",
    );
    m.blank();
    let memories = plan.memories();
    let wrong = memories.iter().map(|memory| match memory {
        Memory::Program(slot) => slot.scrub_one_wrong().into(),
        Memory::Data => plan.data_one_wrong().at(0),
        Memory::Bank(slot) => {
            let ([first, second, damaged], _) = plan.copies_of(slot);
            // The bank's words stand at the first addresses.
            let (address, index) = (plan.scrub_address(), plan.index);
            let beyond =
                (address.width() > index).then(|| address.slice(address.width() - 1, index).any_bit());
            beyond.into_iter().fold(damaged & (first | second), |wrong, beyond| wrong & !beyond)
        }
    });
    let lost = memories.iter().map(|memory| match memory {
        Memory::Program(slot) => slot.scrub_two_wrong().into(),
        Memory::Data => plan.data_two_wrong().at(0),
        Memory::Bank(slot) => {
            let ([first, second, _], _) = plan.copies_of(slot);
            !(first | second)
        }
    });
    m.wires([net::SCRUB_FAILED]);
    m.instance(
        Instance::new("takt_ecc_scrub", "scrubber")
            .parameter("ADDRESS", plan.scrub_address().width())
            .parameter("MEMORIES", memories.len() as u32)
            .same([net::CLK, net::RST, net::WAITING, net::TICK])
            .port("wrong", concat(wrong.collect::<Vec<_>>()))
            .port("lost", any(lost))
            .port("reads", net::SCRUBS)
            .port("address", plan.scrub_address())
            .same([plan.repair()])
            .port("failed", net::SCRUB_FAILED),
    );
    let fetched =
        |of: fn(&SlotPlan) -> Net| net::ADVANCE & any(plan.slots.iter().map(|slot| Expr::from(of(slot))));
    let loaded = |of: Net| (Expr::from(plan.load_valid()) & of).any_bit();
    let sources = any(plan.sources().map(|(slot, operand)| Expr::from(slot.source_wrong(operand))));
    m.define(
        net::CORRECTED,
        any([net::REPAIRS.into(), loaded(plan.data_one_wrong()), fetched(SlotPlan::word_one_wrong)]),
    );
    m.define(
        net::WRONG,
        any([
            sources,
            net::SCRUB_FAILED.into(),
            loaded(plan.data_two_wrong()),
            fetched(SlotPlan::word_two_wrong),
        ]),
    );
    m.instance(Instance::new("takt_ecc_report", "report").same([
        net::CLK,
        net::RST,
        net::CORRECTED,
        net::WRONG,
        net::CORRECTIONS,
        net::UPSET,
    ]));
    m.clocked(vec![set(net::REPAIRED, net::SCRUBS & net::LOADS)]);
}
