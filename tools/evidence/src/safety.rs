// SPDX-License-Identifier: MIT OR Apache-2.0
//! Tables of mechanisms against faults of the circuit: what flipped bits did, by program and by structure, as the campaigns `flips` and
//! `words` have recorded it, and the cost.

use crate::campaign::record;
use anyhow::{Context, Result};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use takt_family::Resources;
use takt_rtl::synthesis::{self, Synthesis};

/// Document with the tables.
pub(crate) const DOCUMENT: &str = "docs/safety.md";

/// Device and speed grade of the cost's table.
const REFERENCE_PART: &str = "LFE5U-85F";
const GRADE: u8 = 8;

/// Standard score of a confidence interval of 95 %.
const SCORE: f64 = 1.959_964;

/// Structures in the order of the table: name in the record, and in words.
const STRUCTURES: [(&str, &str); 15] = [
    ("sequencer", "sequencer: addresses, calls, loops, issue"),
    ("fetch", "fetched word"),
    ("pipeline", "pipeline registers between decode and execute, loader, inputs"),
    ("scoreboard", "results in flight, hazards"),
    ("operands", "operands, forwarding"),
    ("units", "arithmetic units"),
    ("data_port", "port of the data memory"),
    ("ports", "output ports, latches"),
    ("memory_program", "program memory"),
    ("memory_data", "data memory"),
    ("memory_registers", "register banks, input ports"),
    ("memory_outputs", "output ports' memory"),
    ("memory_stacks", "return stack, loop stack"),
    ("memory_tables", "tables of units"),
    ("comparison", "delay lines, comparison"),
];

/// Counts of one part: by name.
#[derive(Default)]
struct Counts(BTreeMap<String, u64>);

impl Counts {
    fn of(&self, name: &str) -> u64 {
        self.0.get(name).copied().unwrap_or(0)
    }
}

/// Counts of the record whose names `program.structure` are chosen.
fn summed(record: &BTreeMap<String, u64>, chosen: impl Fn(&str, &str) -> bool) -> Counts {
    let mut counts = Counts::default();
    for (name, count) in record {
        let parts = name.split_once('.').and_then(|(program, rest)| Some((program, rest.rsplit_once('.')?)));
        if let Some((program, (structure, of))) = parts
            && chosen(program, structure)
        {
            *counts.0.entry(of.to_owned()).or_default() += count;
        }
    }
    counts
}

/// Wilson's interval of 95 % for a proportion.
fn interval(hits: u64, of: u64) -> (f64, f64) {
    let (n, p) = (of as f64, hits as f64 / of as f64);
    let middle = (p + SCORE * SCORE / (2.0 * n)) / (1.0 + SCORE * SCORE / n);
    let half = SCORE / (1.0 + SCORE * SCORE / n) * (p * (1.0 - p) / n + SCORE * SCORE / (4.0 * n * n)).sqrt();
    ((middle - half).max(0.0), (middle + half).min(1.0))
}

/// Proportion with its interval, in percent; a dash without cases.
fn share(hits: u64, of: u64, digits: usize) -> String {
    if of == 0 {
        return "–".to_owned();
    }
    let (low, high) = interval(hits, of);
    format!(
        "{:.digits$} ({:.digits$} to {:.digits$})",
        100.0 * hits as f64 / of as f64,
        100.0 * low,
        100.0 * high
    )
}

/// Tables in Markdown.
pub(crate) fn tables() -> Result<String> {
    let record = record::parts("flips")?;
    let mut text = String::from(
        "Shares in percent, with Wilson's interval of 95 %.\n\n\
         | program | flips | harmful | detected without a second core | with it, within a period | before a pin is wrong |\n\
         |---|---|---|---|---|---|\n",
    );
    for program in ["tracking", "servo", "blink", "all"] {
        let counts = summed(&record, |of, _| program == "all" || of == program);
        let harmful = counts.of("harmful");
        let [stopped, told, early] =
            ["harmful_stopped", "harmful_told", "harmful_told_before_a_pin"].map(|name| counts.of(name));
        let _ = writeln!(
            text,
            "| {program} | {} | {harmful} | {} | {} | {} |",
            counts.of("flips"),
            share(stopped, harmful, 1),
            share(told, harmful, 3),
            share(early, harmful, 3)
        );
    }
    text += "\n| structure of the first core | flips | masked | silent | outputs safe without need | harmful | detected without a second core | with it | cycles from flip to detection: below 10, below 100, a period, later |\n\
             |---|---|---|---|---|---|---|---|---|\n";
    for (name, words) in STRUCTURES {
        let full = if name == "comparison" { name.to_owned() } else { format!("first.{name}") };
        let counts = summed(&record, |_, structure| structure == full);
        let harmful = counts.of("harmful");
        let told = ["told_within_10", "told_within_100", "told_within_a_period", "told_later"]
            .map(|name| counts.of(name).to_string());
        let _ = writeln!(
            text,
            "| {words} | {} | {} | {} | {} | {harmful} | {} | {} | {} |",
            counts.of("flips"),
            counts.of("masked"),
            counts.of("silent"),
            counts.of("told") - counts.of("harmful_told"),
            share(counts.of("harmful_stopped"), harmful, 0),
            share(counts.of("harmful_told"), harmful, 1),
            told.join(", ")
        );
    }
    let second = summed(&record, |_, structure| structure.starts_with("second."));
    let _ = writeln!(
        text,
        "\nOf {} flips in the second core {} made the outputs safe without need; none was harmful.",
        second.of("flips"),
        second.of("told")
    );
    Ok(text)
}

/// Table of what became of flipped bits in words with codes, in Markdown.
pub(crate) fn words() -> Result<String> {
    let record = record::parts("words")?;
    let mut text = String::from(
        "| memory | wrong bits of the word | words | corrected or repaired | told, by `memory error` | harmful | of these told before a pin is wrong | not read and not reached by the scrubber |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    for (name, words) in STRUCTURES.iter().filter(|(name, _)| name.starts_with("memory_")) {
        for (bits, number) in [("one", 1), ("two", 2)] {
            let counts = summed(&record, |_, structure| structure == format!("{bits}.{name}"));
            if counts.of("flips") > 0 {
                let [flips, corrected, told, harmful, early, silent, masked] = [
                    "flips",
                    "corrected",
                    "told",
                    "harmful",
                    "harmful_told_before_a_pin",
                    "silent",
                    "masked",
                ]
                .map(|of| counts.of(of));
                let left = silent + masked;
                let _ = writeln!(
                    text,
                    "| {words} | {number} | {flips} | {corrected} | {told} | {harmful} | {early} | {left} |"
                );
            }
        }
    }
    Ok(text)
}

/// Table of the cost of each mechanism on t1, in Markdown, from `rtl/synthesis.json`.
pub(crate) fn cost() -> Result<String> {
    let rows = synthesis::committed();
    let placed = |mechanism: &str| {
        let own = format!("t1{mechanism}");
        let row = rows
            .iter()
            .find(|row| row.design == own && row.device == REFERENCE_PART && row.grade == Some(GRADE));
        row.with_context(|| format!("{own} is not placed on the {REFERENCE_PART}"))
    };
    let (plain, others) =
        (placed("")?, [placed(" with error correction")?, placed(" and a second core, 2 cycles later")?]);
    let mut text = format!(
        "On the {REFERENCE_PART}, speed grade {GRADE}, with one bus slave, after place and route (`cargo evidence synth --machine t1 --device \
         {REFERENCE_PART} --grade {GRADE}`, with `--ecc`, with `--second-core`):\n\n\
         | | t1 | with error correction | with a second core |\n|---|---|---|---|\n"
    );
    let names = ["LUT4", "LUT4 and halves of carry cells", "flip-flops", "multipliers", "block RAMs"];
    let counts = |row: &Synthesis| {
        let Resources { luts, carries, flip_flops, multipliers, block_rams } = row.resources;
        [luts - carries.unwrap_or(0), luts, flip_flops, multipliers, block_rams]
    };
    let [plain_counts, with_codes, paired] = [plain, others[0], others[1]].map(counts);
    for (k, name) in names.into_iter().enumerate() {
        let _ = write!(text, "| {name} | {} |", plain_counts[k]);
        for count in [with_codes[k], paired[k]] {
            let _ = write!(text, " {count} (× {:.2}) |", count as f64 / plain_counts[k] as f64);
        }
        text.push('\n');
    }
    let clock =
        |row: &Synthesis| row.mhz.iter().map(|mhz| format!("{mhz:.1}")).collect::<Vec<_>>().join(", ");
    let _ =
        writeln!(text, "| MHz, by seed | {} | {} | {} |", clock(plain), clock(others[0]), clock(others[1]));
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_wilsons() {
        // Newcombe, Statistics in Medicine 17 (1998), table I: 81 of 263, 0 of 20, 1 of 29.
        for (hits, of, expected) in
            [(81, 263, (0.2553, 0.3662)), (0, 20, (0.0, 0.1611)), (1, 29, (0.0061, 0.1718))]
        {
            let (low, high) = interval(hits, of);
            assert!((low - expected.0).abs() < 5e-5 && (high - expected.1).abs() < 5e-5, "{low} to {high}");
        }
    }

    #[test]
    fn counts_are_summed_over_programs() {
        let record = [
            ("a.first.units.flips", 3),
            ("b.first.units.flips", 4),
            ("b.comparison.flips", 5),
            ("a.flips", 9),
        ];
        let record = record.map(|(name, count)| (name.to_owned(), count)).into();
        assert_eq!(summed(&record, |_, structure| structure == "first.units").of("flips"), 7);
        assert_eq!(summed(&record, |program, _| program == "b").of("flips"), 9);
    }
}
