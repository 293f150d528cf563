// SPDX-License-Identifier: MIT OR Apache-2.0
//! Speed of circuit and emulator in lockstep, compared with the emulator alone.

use crate::tracking::{recorded, tracking};
use crate::{Outcome, ROUNDS, Ratios};
use std::fmt::Write as _;
use std::process::Command;
use std::time::Instant;
use takt_cosim::{Lockstep, Model};
use takt_emu::Emulator;
use takt_programs::hybrid::closed_loop::Inputs;
use takt_rtl::{Library, export};

/// Periods in lockstep.
const PERIODS: usize = 300;

pub(crate) fn measure(text: &mut String) -> Outcome<()> {
    if !Command::new("verilator").arg("--version").output().is_ok_and(|output| output.status.success()) {
        writeln!(text, "## Circuit\n\nNot measured: there is no Verilator here.")?;
        return Ok(());
    }
    let inputs = recorded()?;
    let (program, registers) = tracking()?;
    let row = |inputs: &Inputs| registers.iter().copied().zip(inputs.to_words()).collect::<Vec<_>>();
    let rows: Vec<_> = inputs[..PERIODS].iter().map(row).collect();
    let design = export(program.machine, &Library::builtin())?.latching(program.latched_inputs())?;
    let model = Model::build(&design, &takt_cache::folder()?, false)?;
    let (mut ratios, mut rate) = (Ratios::default(), Ratios::default());
    for _ in 0..ROUNDS {
        let simulation = model.start(&[])?;
        let start = Instant::now();
        let mut lockstep = Lockstep::new(&program, simulation, &rows[0])?;
        for row in &rows {
            lockstep.run_period(row);
            lockstep.compare()?;
        }
        lockstep.finish()?;
        let both = start.elapsed().as_secs_f64();
        let cycles = lockstep.emulator().now();
        drop(lockstep);
        let mut alone = Emulator::new(&program)?;
        let start = Instant::now();
        for row in &rows {
            for &(register, bits) in row {
                alone.set_input_bits(register, bits)?;
            }
            alone.run_period(&[])?;
        }
        ratios.0.push(both / start.elapsed().as_secs_f64());
        rate.0.push(cycles as f64 / both / 1e3);
    }
    writeln!(
        text,
        "## Circuit\n\nThe tracking program on the circuit (Verilator) and on the emulator in lockstep, every event compared \
         (`takt cosim`), beside the emulator alone: {PERIODS} periods, the circuit's model compiled before.\n\n\
         | | times the emulator alone | rounds |\n|---|---|---|\n| lockstep | {} |\n\n\
         That was {} thousand cycles a second (median, range of the rounds).",
        ratios.text(),
        rate.text().replace(" | ", ", "),
    )?;
    Ok(())
}
