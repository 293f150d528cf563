// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cost of each macro, in `docs/library.md`.

use super::functions::{bare, functions, replacements};
use super::pairs::{ANGLE_ERROR, POW_ERROR};
use super::{assemble, one_use};
use crate::common::check_table;
use takt_isa::{MACHINES, Machine};

/// Number of independent uses scheduled together.
const TOGETHER: u32 = 8;

/// Operations, and cycles from operand to result, of one use.
fn block(assembled: &takt_asm::AssembledProgram) -> (u32, u32) {
    let block = assembled.blocks.iter().find(|block| block.label.as_deref() == Some("period"));
    let block = block.expect("it is scheduled");
    // Exclude the `wait`, whose bundle issues when the result is written.
    (block.operations - 1, block.cycles - 1)
}

/// Cost of a single use, for a macro that fills the program memory with eight uses.
fn one_use_cost(usage: &str) -> String {
    let costs = MACHINES.iter().map(|machine| {
        let (operations, latency) = block(&one_use(machine, usage, 2, ""));
        format!("{operations} | {latency} | -")
    });
    costs.collect::<Vec<_>>().join(" | ")
}

/// Cost of a macro: operations, cycles from operand to result, and cycles per use with eight independent uses.
fn cost(machine: &'static Machine, usage: &dyn Fn(&str, &str) -> String, operands: usize) -> String {
    let (operations, latency) = block(&one_use(machine, &usage("d", "x"), operands, ""));
    let mut text = String::from(".input y\n");
    for i in 0..TOGETHER {
        text += &format!(".input x{i}\n.output d{i}\n");
    }
    text += ".once\n wait period\n.period\nperiod:\n";
    for i in 0..TOGETHER {
        text += &format!(" {}\n", usage(&format!("d{i}"), &format!("x{i}")));
    }
    text += " wait period\n";
    if operands == 1 {
        text = text.replace(".input y\n", "");
    }
    let (_, together) = block(&assemble(machine, &text));
    format!("{operations} | {latency} | {:.1}", f64::from(together) / f64::from(TOGETHER))
}

#[test]
fn documented_costs_equal_the_measured_ones() {
    // The source also states the errors.
    let source = takt_programs::LIBRARY.iter().find(|(name, _)| *name == "math.s").expect("it is there").1;
    let states = |name: &str, error: f64| {
        let (before, _) = source.split_once(&format!("\n.macro {name} ")).expect("it is there");
        let comment = before.rsplit("\n\n").next().unwrap_or(before);
        let figure = if error == 0.0 { "exact".to_owned() } else { format!("{error} ulp") };
        assert!(
            comment.to_lowercase().contains(&figure),
            "{name}: the comment does not say {figure}: {comment}"
        );
    };
    for machine in MACHINES {
        functions(machine).iter().for_each(|function| states(function.name, function.error));
    }
    replacements(bare()).iter().for_each(|function| states(function.name, function.error));
    states("atan2", ANGLE_ERROR);
    states("pow", POW_ERROR);
    states("fmod", 0.0);
    let mut table = String::from("| macro | error, ulp |");
    let mut rule = String::from("|---|---|");
    for machine in MACHINES {
        table += &format!(" {0}: operations | latency | each of {TOGETHER} |", machine.name);
        rule += "---|---|---|";
    }
    table += &format!("\n{rule}\n");
    let row = |usage: &str, error: String, operands: usize| {
        let costs = MACHINES.iter().map(|machine| {
            let of = |d: &str, x: &str| {
                let (name, rest) = usage.split_once(' ').expect("it has operands");
                let operands = rest.split(", ").map(|operand| match operand {
                    "d" => d,
                    "x" => x,
                    other => other,
                });
                format!("{name} {}", operands.collect::<Vec<_>>().join(", "))
            };
            cost(machine, &of, operands)
        });
        let costs: Vec<String> = costs.collect();
        format!("| `{usage}` | {error} | {} |\n", costs.join(" | "))
    };
    let error = |name: &str| {
        let mut errors: Vec<String> = MACHINES
            .iter()
            .flat_map(|machine| functions(machine).into_iter().filter(|function| function.name == name))
            .map(
                |function| {
                    if function.error == 0.0 { "exact".to_owned() } else { format!("{}", function.error) }
                },
            )
            .collect();
        errors.dedup();
        errors.join(", ")
    };
    for function in functions(MACHINES[0]) {
        table += &row(&format!("{} d, x", function.name), error(function.name), 1);
    }
    table += &row("pow d, x, y", POW_ERROR.to_string(), 2);
    table += &row("fmod_in d, x, y, 2", "exact".to_owned(), 2);
    let whole = one_use_cost("fmod d, x, y");
    table += &format!("| `fmod d, x, y` | exact | {whole} |\n");
    check_table("docs/library.md", "cost", &table);

    let mut table =
        String::from("| macro | error, ulp | operations | latency | each of 8 |\n|---|---|---|---|---|\n");
    let replaced =
        replacements(bare()).into_iter().map(|function| (function.name, "d, x", function.error, 1));
    for (name, operands, error, count) in replaced.chain([("atan2", "d, y, x", ANGLE_ERROR, 2)]) {
        let of = |d: &str, x: &str| match count {
            1 => format!("{name} {d}, {x}"),
            _ => format!("{name} {d}, {x}, y"),
        };
        table += &format!("| `{name} {operands}` | {error} | {} |\n", cost(bare(), &of, count));
    }
    check_table("docs/library.md", "replacements", &table);
}
