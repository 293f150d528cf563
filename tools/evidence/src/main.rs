// SPDX-License-Identifier: MIT OR Apache-2.0
//! Evidence of the project: proofs, planted faults, campaigns, synthesis, speed, and clients from other vendors, recorded for the
//! documents. `cargo evidence --help` lists the commands.
#![allow(clippy::print_stdout, clippy::print_stderr)]

mod boards;
mod c;
mod campaign;
mod certificates;
mod check;
mod clients;
mod documents;
mod fmu_windows;
mod formal;
mod fpbench;
mod linuxcnc;
mod litex;
mod mutants;
mod netlist;
mod other_processors;
mod routed;
mod safety;
mod speed;
mod synth;
mod threads;

use anyhow::Result;
use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Proofs and measurements for Takt.
#[derive(Parser)]
#[command(name = "cargo evidence")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Run the checks that CI makes beside the tests, a share of what follows; a check that has passed with the same files is left out.
    Check(check::Arguments),
    /// Write the documents of evidence (synthesis, verification, campaigns), or with --check fail if one is stale.
    Docs {
        /// Change nothing; fail if a document differs from the record.
        #[arg(long)]
        check: bool,
    },
    /// Prove for every program, and any number of cycles, that the core keeps the rules of issue, and that its decoders are total;
    /// with --units, that the arithmetic units are correct for all operands.
    Formal(formal::Arguments),
    /// Try every operand of a function that `formal --units` has made of a unit.
    #[command(hide = true)]
    Enumerate(formal::EnumerateArguments),
    /// Print the words of the units' tables, which `formal --units` compares with those of the circuits.
    #[command(hide = true)]
    Tables,
    /// Plant faults in sources and circuits that nobody chose, let the tests meet them, and record how many are found (mutation score);
    /// stopped, it goes on where it was.
    Mutants(mutants::Arguments),
    /// Synthesise a machine or units, place and route them, and record clock and resources in docs/synthesis.md.
    Synth(synth::Arguments),
    /// Build a program on the boards, to the bitstream, and record resources and clock in docs/board.md.
    Boards(boards::Arguments),
    /// Map a core to the cells of an FPGA and run the mapped netlist in lockstep with the emulator; with --prove, prove that it equals the
    /// Verilog.
    Netlist(netlist::Arguments),
    /// Let LinuxCNC, without a screen, cut agh.ngc with the hybrid robot on a simulated board, cut its link, stop it, and report
    /// (docs/linuxcnc.md; installs LinuxCNC, 2 GB, if it lacks).
    Linuxcnc(linuxcnc::Arguments),
    /// Count the cycles of the kernels of programs/taclebench on a RISC-V core, simulated, and by llvm-mca's model of a Cortex-M7, and
    /// write them beside Takt's into docs/library.md (installs missing tools).
    Others,
    /// Count the functions of C projects that `takt cc` translates, each as the step, in checkouts at the commits of tools/evidence/c.toml,
    /// and write the table into docs/c.md (clones what it lacks from GitHub).
    C(c::Arguments),
    /// Bound the errors of FPBench's kernels beside Gappa, which runs on the same operations, and beside published figures of FPTaylor and
    /// Daisy, and write the table into docs/accuracy.md (installs Gappa if it lacks).
    Fpbench(fpbench::Arguments),
    /// Measure how fast emulator, assembler and lockstep are beside native code, GNU `as` and one another; print it and write
    /// docs/speed.md (a few minutes on an idle machine). The emulator is compared with the last release's, too, which is built in
    /// target/releases the first time.
    Speed(speed::Arguments),
    /// Run a long test or measurement in units, here or on a HyperQueue server's workers; what was interrupted goes on
    /// (docs/campaigns.md). Without a name, list the campaigns.
    Campaign(campaign::Arguments),
    /// Start a HyperQueue server and workers for campaigns, until Ctrl-C (installs HyperQueue in .venv).
    Hyperqueue(campaign::Queue),
}

fn main() -> ExitCode {
    match task(Arguments::parse().task) {
        Ok(()) => ExitCode::SUCCESS,
        // Print only the error chain; source locations in this program do not help users.
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn task(task: Task) -> Result<()> {
    match task {
        Task::Check(arguments) => check::check(&arguments),
        Task::Docs { check } => documents::run(check),
        Task::Formal(arguments) => formal::formal(&arguments),
        Task::Enumerate(arguments) => formal::enumerate(&arguments),
        Task::Tables => formal::tables(),
        Task::Mutants(arguments) => mutants::mutants(&arguments),
        Task::Synth(arguments) => synth::synth(&arguments),
        Task::Boards(arguments) => boards::boards(&arguments),
        Task::Netlist(arguments) => netlist::netlist(&arguments),
        Task::Linuxcnc(arguments) => linuxcnc::linuxcnc(&arguments),
        Task::Fpbench(arguments) => fpbench::compare(&arguments),
        Task::C(arguments) => c::count(&arguments),
        Task::Others => other_processors::compare(),
        Task::Speed(arguments) => speed::speed(arguments),
        Task::Campaign(arguments) => campaign::campaign(&arguments),
        Task::Hyperqueue(arguments) => campaign::queue(&arguments),
    }
}
