// SPDX-License-Identifier: MIT OR Apache-2.0
//! Encoder and decoder: exhaustive over opcodes, property-tested over words; the tables are consistent.

use proptest::prelude::*;
use std::collections::HashSet;
use takt_isa::shape::{OPCODE, WORD_BITS};
use takt_isa::{BankIndex, DecodeError, Function, Instruction, MACHINES, Op, ROWS, Register, UNITS};

/// For every opcode of the space, over payloads of zeros, ones and single bits: a row's word decodes to that row, and every
/// word that belongs to no row is refused by name.
#[test]
fn every_opcode_is_one_row_or_refused() {
    let payload_bits = OPCODE.low;
    let payloads = (0..payload_bits).map(|bit| 1u64 << bit).chain([0, (1 << payload_bits) - 1]);
    let mut decoded = HashSet::new();
    for payload in payloads {
        for opcode in 0..=OPCODE.max() {
            let word = OPCODE.put(opcode) | payload;
            let row = ROWS.iter().find(|row| u32::from(row.opcode) == opcode);
            match (Instruction::decode(word), row) {
                (Ok(instruction), Some(row)) => {
                    assert_eq!(instruction.op, row.op);
                    assert_eq!(word & !row.shape.mask(), 0);
                    assert_eq!(instruction.encode(), Ok(word));
                    decoded.insert(row.mnemonic);
                }
                (Err(DecodeError::StrayBits { op, stray }), Some(row)) => {
                    assert_eq!(op, row.op);
                    assert_eq!(stray, word & !row.shape.mask());
                    assert_ne!(stray, 0);
                }
                (Err(DecodeError::UnknownOpcode { opcode: named }), None) => {
                    assert_eq!(u32::from(named), opcode)
                }
                (Err(DecodeError::Unwritten), None) => assert_eq!(word, 0),
                (outcome, row) => {
                    panic!("word {word:012x}: {outcome:?}, row {:?}", row.map(|row| row.mnemonic))
                }
            }
        }
    }
    assert_eq!(decoded.len(), ROWS.len(), "every row decodes");
}

#[test]
fn rows_are_where_their_operation_says() {
    for row in ROWS {
        assert_eq!(row.op.row().mnemonic, row.mnemonic);
        assert_eq!(Op::from_mnemonic(row.mnemonic), Some(row.op));
        assert_eq!(Op::from_opcode(row.opcode), Some(row.op));
        let operands = usize::from(row.shape.has_dest()) + row.shape.sources();
        assert_eq!(row.types.len(), operands, "{}: a type for each register operand", row.mnemonic);
        assert!(row.mnemonic.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit()));
    }
}

/// Arctangent and arccosine may be missing on a machine, but not on all.
#[test]
fn every_row_runs_on_a_unit_and_a_machine() {
    for row in ROWS.iter().filter(|row| row.function != Function::Idle) {
        let function = row.function.name();
        assert!(
            UNITS.iter().any(|unit| unit.functions.contains(&row.function)),
            "`{}` needs a unit that offers {function}: isa/src/spec/units.rs has none",
            row.mnemonic
        );
        assert!(
            MACHINES.iter().any(|machine| machine.host(row.function).is_some()),
            "`{}` runs on no machine: no slot in isa/src/spec/machines.rs hosts a unit that offers {function}",
            row.mnemonic
        );
    }
}

/// Forms of instructions in equations name existing sources, each once, and no two instructions share a form and a choice of
/// types.
#[test]
fn forms_of_equations_are_told_apart_by_their_types() {
    let mut seen = HashSet::new();
    for row in ROWS {
        for (form, text) in row.forms().zip(row.forms) {
            let mut sources = form.sources.clone();
            sources.sort_unstable();
            sources.dedup();
            assert_eq!(sources.len(), form.sources.len(), "`{text}` has a source twice");
            assert!(!sources.is_empty(), "`{text}` has no source");
            assert!(
                sources.iter().all(|source| *source < row.shape.sources()),
                "`{text}` of {}",
                row.mnemonic
            );
            assert!(row.shape.has_dest() && row.effect == takt_isa::Effect::Compute, "{}", row.mnemonic);
            let types: Vec<String> =
                form.sources.iter().map(|source| format!("{:?}", row.source_type(*source))).collect();
            assert!(seen.insert((form.symbol, types)), "`{text}` means two instructions");
        }
    }
    let forms = |op: Op| op.row().forms().map(|form| (form.symbol, form.sources)).collect::<Vec<_>>();
    assert_eq!(forms(Op::flt), [("<".to_owned(), vec![0, 1]), (">".to_owned(), vec![1, 0])]);
    assert_eq!(forms(Op::sel), [("?:".to_owned(), vec![0, 1, 2])]);
    assert_eq!(forms(Op::fatan2), [("atan2".to_owned(), vec![0, 1])]);
    assert_eq!(forms(Op::isub), [("-".to_owned(), vec![0, 1]), ("-".to_owned(), vec![1])]);
}

#[test]
fn pipelined_units_name_each_of_their_registers() {
    for unit in UNITS {
        if !unit.cuts.is_empty() {
            assert_eq!(
                unit.cuts.len() as u32,
                unit.latency - 1,
                "{}: a name for each pipeline register behind the operands' (isa/src/spec/units.rs)",
                unit.name
            );
        }
        assert!(unit.latency < takt_isa::spec::units::MAX_LATENCY);
        assert!(unit.interval >= 1);
    }
}

#[test]
fn banks_do_not_overlap_and_names_lead_back() {
    for machine in MACHINES {
        let mut seen = HashSet::new();
        for bank in machine.banks() {
            for (place, address) in bank.registers().enumerate() {
                assert!(seen.insert(address), "{}: address {address} in two banks", machine.name);
                let index = bank.index(address).expect("it is in this bank");
                assert_eq!((index.index(), bank.register(index)), (place, Some(address)));
                let name = machine.register_name(address).expect("it is in a bank");
                assert_eq!(machine.register_address(&name), Some(address));
            }
        }
        for strange in ["", "m", "m01", "q3", "m99999", "3", "zero1", "m-1"] {
            assert_eq!(machine.register_address(strange), None, "{strange}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200_000))]

    /// A word that decodes encodes to itself; no word panics.
    #[test]
    fn encode_inverts_decode(word in 0u64..1 << WORD_BITS) {
        if let Ok(instruction) = Instruction::decode(word) {
            prop_assert_eq!(instruction.encode(), Ok(word));
        }
    }

    /// Repeats the test with legal opcodes, which random words rarely have.
    #[test]
    fn encode_inverts_decode_of_rows(row in 0..ROWS.len(), payload: u64) {
        let word = OPCODE.put(ROWS[row].opcode.into()) | (payload & ROWS[row].shape.mask() & !OPCODE.mask());
        let instruction = Instruction::decode(word).expect("only the row's own bits are set");
        prop_assert_eq!(instruction.op, ROWS[row].op);
        prop_assert_eq!(instruction.encode(), Ok(word));
    }

    /// decode(encode(x)) = x, and values that do not fit are refused.
    #[test]
    fn decode_inverts_encode(
        row in 0..ROWS.len(),
        dest in 0..BankIndex::COUNT,
        sources in [0..Register::COUNT, 0..Register::COUNT, 0..Register::COUNT],
        constant: u32,
    ) {
        let op = ROWS[row].op;
        let dest = BankIndex::new(dest).expect("in range");
        let sources = sources.map(|source| Register::new(source).expect("in range"));
        let mut instruction = Instruction { op, dest, sources, constant };
        let fits = op.row().shape.fields().iter().all(|&field| instruction.field(field) <= field.bits().max());
        match instruction.encode() {
            Ok(word) => {
                prop_assert!(fits);
                let decoded = Instruction::decode(word).expect("an encoded word decodes");
                for &field in op.row().shape.fields() {
                    prop_assert_eq!(decoded.field(field), instruction.field(field));
                }
                instruction = decoded;
                prop_assert_eq!(instruction.encode(), Ok(word));
            }
            Err(error) => {
                prop_assert!(!fits);
                prop_assert!(error.value > error.field.bits().max());
            }
        }
    }
}
