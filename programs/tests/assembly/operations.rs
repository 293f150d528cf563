// SPDX-License-Identifier: MIT OR Apache-2.0
//! Operations of one period, compared with Table 1 of the paper.

use super::inputs::{moves, recorded};
use super::processor::{PROGRAMS, Processor};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use takt_isa::{MACHINES, ROWS};

/// Table 1 of the paper: operation, count, and our mnemonics for the operation.
const PAPER: [(&str, u64, &[&str]); 7] = [
    ("+ -", 186, &["fadd", "fsub"]),
    ("*", 216, &["fmul"]),
    ("/", 31, &["fdiv"]),
    ("sqrt", 13, &["fsqrt"]),
    ("sin", 1, &["fsin"]),
    ("float(int)", 5, &["itof"]),
    ("saturation", 5, &["fsat"]),
];

/// Operations in the second period by mnemonic, counted by the emulator.
fn counts(processor: &mut Processor) -> BTreeMap<&'static str, u64> {
    let inputs = recorded(&moves(..), 2);
    let before: Vec<_> = inputs
        .iter()
        .map(|inputs| {
            let before = processor.emulator().statistics();
            processor.period(&inputs.to_words()).expect("no input makes the program fault");
            before
        })
        .collect();
    let after = processor.emulator().statistics();
    ROWS.iter()
        .map(|row| (row.mnemonic, after.operation(row.op) - before[1].operation(row.op)))
        .filter(|(_, count)| *count > 0)
        .collect()
}

#[test]
fn operations_beside_the_papers() {
    let mut columns = Vec::new();
    for path in PROGRAMS {
        let [one, other] = [0, 1].map(|i| counts(&mut Processor::shipped(path, MACHINES[i])));
        assert_eq!(one, other, "{path}: the machines do the same work");
        columns.push(one);
    }
    let [a, b, c] = ["tracking", "literal", "friction"];
    let mut table = format!("{:<12}{:>8}{a:>10}{b:>10}{c:>10}\n", "", "paper");
    let mut line = |name: &str, paper: &str, count: &dyn Fn(&BTreeMap<&str, u64>) -> u64| {
        let [a, b, c] = [0, 1, 2].map(|i| count(&columns[i]));
        let _ = writeln!(table, "{name:<12}{paper:>8}{a:>10}{b:>10}{c:>10}");
    };
    for (name, paper, mnemonics) in PAPER {
        line(name, &paper.to_string(), &|counts| mnemonics.iter().filter_map(|m| counts.get(m)).sum());
    }
    let listed: Vec<&str> = PAPER.iter().flat_map(|(_, _, mnemonics)| mnemonics.iter().copied()).collect();
    let mut others: Vec<&str> = columns.iter().flat_map(|column| column.keys().copied()).collect();
    others.sort_unstable();
    others.dedup();
    for mnemonic in others.iter().filter(|mnemonic| !listed.contains(mnemonic)) {
        line(mnemonic, "-", &|counts| counts.get(mnemonic).copied().unwrap_or(0));
    }
    line("all", "457", &|counts| counts.values().sum());
    insta::assert_snapshot!(table);
}
