// SPDX-License-Identifier: MIT OR Apache-2.0
//! Suggestions for command names that users expect from other tools or by meaning. clap handles misspelt names.

use clap::error::{ContextKind, ContextValue, ErrorKind};

/// Names that users try, the command to use instead, and its purpose.
const INSTEAD: &[(&[&str], &str, &str)] = &[
    (
        &["simulate", "sim", "emulate", "emu", "exec", "execute", "start", "go"],
        "run",
        "runs a program on the emulator",
    ),
    (&["batch", "sweep"], "run --batch", "runs a program many times, each with its own inputs"),
    (&["trace", "wave", "waves", "vcd"], "run --trace", "writes what happens in a run as waveforms"),
    (&["assemble", "as", "build", "link"], "asm", "assembles a source"),
    (&["check", "lint"], "asm", "assembles a source and reports its mistakes"),
    (&["disassemble", "dis", "objdump", "dump"], "disasm", "turns an image into source"),
    (&["gdb", "step", "inspect"], "debug", "runs a program under the debugger"),
    (&["analyze", "profile", "prof", "stats", "stalls"], "analyse", "shows where a period's cycles went"),
    (
        &["wcet", "time", "timing", "latency", "worst", "deadline"],
        "bound",
        "bounds the cycles of each section",
    ),
    (&["precision", "errors", "error"], "accuracy", "measures how exact a program's results are"),
    (&["calc", "compute", "fp"], "eval", "evaluates an instruction"),
    (&["format", "indent", "pretty"], "fmt", "sets a source in columns"),
    (&["verilog", "hdl", "generate", "synth", "synthesis", "fpga"], "rtl", "writes a machine's Verilog"),
    (&["bitstream", "pnr", "route", "place"], "board build", "makes a board's bitstream"),
    (&["flash", "upload", "download"], "load", "loads a program into a board"),
    (&["monitor", "watch", "read"], "live", "looks at what runs on a board"),
    (&["lockstep", "compare", "verilator"], "cosim", "compares circuit and emulator"),
    (&["prove", "validate", "certify"], "verify", "establishes that an image is its source"),
    (&["optimise", "optimize", "search", "tune"], "explore", "searches for the best machine for programs"),
    (&["doc", "docs", "manual", "instructions", "opcodes", "ops"], "isa", "looks instructions up"),
    (&["targets", "cpus", "cores", "list"], "machines", "lists the machines"),
    (&["urdf", "derive", "import", "kinematics"], "model", "turns a robot's description into a program"),
    (&["c", "compile", "gcc", "clang"], "cc", "turns a step function in C into a program"),
    (&["monte-carlo", "montecarlo"], "track --monte-carlo", "drives robots that differ"),
    (&["hybrid", "paper"], "track", "drives the hybrid robot along a path"),
    (&["language-server"], "lsp", "is the language server"),
];

/// Suggests the command for a word that users try from other tools, with its description.
fn instead(name: &str) -> Option<(&'static str, &'static str)> {
    let name = name.to_ascii_lowercase();
    let row = INSTEAD.iter().find(|(names, ..)| names.contains(&name.as_str()))?;
    Some((row.1, row.2))
}

/// Adds a suggestion to clap's error on an unknown command.
pub(crate) fn suggest(answer: &mut clap::Error) {
    if answer.kind() != ErrorKind::InvalidSubcommand {
        return;
    }
    let Some(ContextValue::String(name)) = answer.get(ContextKind::InvalidSubcommand) else { return };
    // Only at the top level: some commands have subcommands of their own.
    let usage = answer.get(ContextKind::Usage).map(ToString::to_string);
    let is_first = usage.is_some_and(|usage| usage.contains("takt [OPTIONS] <COMMAND>"));
    if let Some((command, what)) = instead(name).filter(|_| is_first) {
        answer.remove(ContextKind::SuggestedSubcommand);
        let tip = format!("`takt {command}` {what}").into();
        answer.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;
    use std::collections::BTreeSet;

    #[test]
    fn no_command_is_suggested_for_itself_or_missing() {
        let command = crate::Arguments::command();
        let mut names = BTreeSet::new();
        for name in INSTEAD.iter().flat_map(|(names, ..)| *names) {
            assert!(names.insert(name), "`{name}` is there twice");
            assert!(command.find_subcommand(name).is_none(), "`{name}` is a command");
        }
        for (_, instead, _) in INSTEAD {
            let mut words = instead.split(' ');
            let found = command.find_subcommand(words.next().unwrap());
            let found = found.unwrap_or_else(|| panic!("`{instead}` is no command"));
            for word in words {
                let option =
                    found.get_arguments().any(|argument| argument.get_long() == word.strip_prefix("--"));
                let known = option
                    || found.find_subcommand(word).is_some()
                    || found.get_subcommands().next().is_none() && !word.starts_with("--");
                assert!(known, "`{instead}`");
            }
        }
    }
}
