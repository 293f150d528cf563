// SPDX-License-Identifier: MIT OR Apache-2.0
//! Exported test bench in a second simulator, Icarus Verilog, with the tracking program.

use crate::common::{assemble, drive, folder};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;
use takt_emu::{Emulator, Event};
use takt_isa::{Program, Register, T3};
use takt_rtl::{Design, Library, bench, export};

const PERIODS: usize = 4;

fn run(folder: &Path, program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).current_dir(folder).args(arguments).output();
    let output = output.unwrap_or_else(|error| panic!("{program}: {error}"));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{program}: {text}{}", String::from_utf8_lossy(&output.stderr));
    text
}

#[test]
fn tracking_gives_the_same_outputs() {
    tracking(false);
}

#[test]
fn latched_outputs_come_together() {
    tracking(true);
}

fn tracking(latched: bool) {
    let program = Program { latched, ..assemble(&T3, "hybrid/tracking.s") };
    // Reference from the emulator: inputs of each period; outputs by number with value, and the cycles from the write to the period's end.
    let mut emulator = Emulator::new(&program).expect("it fits");
    let mut periods = Vec::new();
    let mut expected = Vec::new();
    drive(&program, PERIODS, |inputs| -> Result<Vec<(Register, u32)>, takt_emu::PeriodError> {
        let mut writes = Vec::new();
        let mut sink = |event: &Event| {
            if let Event::PortWrite(write) = event {
                writes.push(*write);
            }
        };
        for &(register, bits) in inputs {
            emulator.set_input_bits(register, bits).expect("an input");
        }
        let report = emulator.observed(&mut sink).run_period(&[])?;
        let number = |register| T3.output_number(register).expect("an output");
        let first = expected.len();
        if latched {
            // Latched: only the last value of each port, in the order of numbers.
            let last: BTreeMap<u16, u32> =
                writes.iter().map(|write| (number(write.register), write.value)).collect();
            expected.extend(last.into_iter().map(|(number, value)| (0, number, value)));
        } else {
            expected.extend(
                writes.iter().map(|write| (report.wait - write.cycle, number(write.register), write.value)),
            );
        }
        assert!(expected.len() > first);
        periods.push(inputs.to_vec());
        Ok(writes.iter().map(|write| (write.register, write.value)).collect())
    });
    assert!(expected.len() >= 20 * PERIODS, "{} values", expected.len());

    let folder = folder().join(if latched { "icarus-latched" } else { "icarus" });
    let design = export(&T3, &Library::builtin()).expect("t3 has a circuit");
    let design = Design { latched: program.latched_inputs(), ..design };
    for file in bench::folder(&design, Some(&program), &periods) {
        let path = folder.join(&file.name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("the target folder can be written");
        fs::write(&path, &file.text).expect("the target folder can be written");
    }
    run(&folder, "iverilog", &["-g2005", "-s", "takt_t3_bench", "-f", "takt_t3_bench.f", "-o", "bench"]);
    let text = run(&folder, "vvp", &["-n", "bench"]);

    let (mut found, mut open) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |i: usize| words.get(i).and_then(|word| word.parse::<u64>().ok()).unwrap_or(0);
        match words.get(1) {
            Some(&"output") => open.push((number(0), number(2) as u16, words[3].to_owned())),
            Some(&"wait") => found.extend(open.drain(..).map(|(cycle, register, value)| {
                let value = u32::from_str_radix(&value, 16).unwrap_or_else(|_| panic!("{line}"));
                (number(0) - cycle, register, value)
            })),
            _ => {}
        }
    }
    assert_eq!(found, expected, "{text}");
    assert!(text.trim_end().ends_with("end"), "{text}");
}
