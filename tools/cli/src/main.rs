// SPDX-License-Identifier: MIT OR Apache-2.0
//! Takt: assemble, emulate and time controllers for robots. One command per module; this is the only crate that knows the
//! terminal.

mod absent;
mod account;
mod accuracy;
mod analyse;
mod application;
mod arm;
mod asm;
mod batch;
#[cfg(feature = "board")]
mod board;
mod bound;
mod cache;
mod completions;
mod controller;
mod cosim;
#[cfg(feature = "editor")]
mod dap;
mod debug;
mod deny;
mod disasm;
mod drive;
mod eval;
mod explore;
mod fault;
mod files;
mod fmt;
mod friction;
mod interrupt;
mod isa;
#[cfg(feature = "board")]
mod live;
mod load;
#[cfg(feature = "editor")]
mod lsp;
mod machine_mistake;
mod machines;
mod man;
#[cfg(feature = "model")]
mod model;
mod monte_carlo;
mod nan;
mod number;
mod output;
mod page;
mod plot;
mod ports;
mod progress;
mod ran;
mod report;
#[cfg(feature = "robot")]
mod robot;
mod rtl;
mod run;
mod select;
#[cfg(feature = "board")]
mod shadow;
mod spills;
mod synthesis;
mod system;
mod trace;
mod track;
mod verify;
mod wrong;

#[cfg(not(feature = "model"))]
use absent::model;
#[cfg(not(feature = "robot"))]
use absent::robot;
#[cfg(not(feature = "board"))]
use absent::{board, live};
#[cfg(not(feature = "editor"))]
use absent::{dap, lsp};
use anyhow::Result;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use files::Out;
use output::{Color, Failure};
use page::Page;
use std::io::Write;
use std::process::ExitCode;

/// Robot controllers on a floating-point processor whose every cycle is accounted for.
#[derive(Parser)]
#[command(name = "takt", version, max_term_width = 110, after_help = AFTER_HELP)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Colour of messages, and bold figures: auto (on a terminal, unless NO_COLOR is set), always or never.
    #[arg(long, global = true, value_enum, default_value_t = Color::Auto, value_name = "WHEN", hide_possible_values = true)]
    color: Color,
    /// Switch off the emulator's just-in-time compiler: slower, with identical results.
    #[cfg(feature = "jit")]
    #[arg(long, global = true)]
    no_jit: bool,
}

const AFTER_HELP: &str = "\
Results go to standard output, messages to standard error. \
Exit status: 0 success; 1 an error in a file or while running, or a check failed (`bound --deadline`, `cosim`, \
`verify`, a `check` of `debug`); 2 an error in the command line; 3 something that --deny names happened in a run.

Examples:
  takt track                         the main job: cycles, accuracy, tracking error
  takt arm                           a six-axis arm's kinematics: cycles and errors
  takt robot                         a robot on three cores: a prompt, scripts, programs
  takt asm prog.s                    assemble prog.s into prog.takt
  takt run prog.s --inputs in.csv    run it, one period for each row
  takt isa fdiv                      look an instruction up";

#[derive(Subcommand)]
enum Command {
    Track(track::Track),
    Arm(arm::Arm),
    Robot(robot::Robot),
    Asm(asm::Asm),
    Model(model::Model),
    Disasm(disasm::Disasm),
    Verify(verify::Verify),
    Run(run::Run),
    Debug(debug::Debug),
    Analyse(analyse::Analyse),
    Bound(bound::Bound),
    Accuracy(accuracy::Accuracy),
    Eval(eval::Eval),
    Fmt(fmt::Fmt),
    Lsp(lsp::Lsp),
    Dap(dap::Dap),
    Rtl(rtl::Rtl),
    Board(board::Boards),
    Load(live::LoadBoard),
    Live(live::Live),
    Cosim(cosim::Cosim),
    Isa(isa::Isa),
    Machines(machines::Machines),
    Explore(explore::Explore),
    Completions(completions::Completions),
    Man(man::Man),
}

impl Command {
    /// True if results are tables and sentences, which are folded at a terminal's width; others are sources, or go on interactively.
    fn is_for_people(&self) -> bool {
        use Command::{
            Accuracy, Analyse, Arm, Asm, Bound, Cosim, Explore, Isa, Machines, Robot, Run, Track, Verify,
        };
        matches!(
            self,
            Accuracy(_)
                | Analyse(_)
                | Arm(_)
                | Asm(_)
                | Bound(_)
                | Cosim(_)
                | Isa(_)
                | Explore(_)
                | Machines(_)
                | Robot(_)
                | Run(_)
                | Track(_)
                | Verify(_)
        )
    }
}

fn run(arguments: &Arguments, color: bool, out: &mut Out) -> Result<()> {
    match &arguments.command {
        Command::Track(track) => track::run(track, color, out),
        Command::Arm(arm) => arm::run(arm, color, out),
        Command::Robot(robot) => robot::run(robot, color, out),
        Command::Asm(asm) => asm::run(asm, color, out),
        Command::Model(model) => model::run(model, color, out),
        Command::Disasm(disasm) => disasm::run(disasm, color),
        Command::Verify(verify) => verify::run(verify, color, out),
        Command::Run(run) => run::run(run, color, out),
        Command::Debug(debug) => debug::run(debug, color, out),
        Command::Analyse(analyse) => analyse::run(analyse, color, out),
        Command::Bound(bound) => bound::run(bound, color, out),
        Command::Accuracy(accuracy) => accuracy::run(accuracy, color, out),
        Command::Eval(eval) => eval::run(eval, out),
        Command::Fmt(fmt) => fmt::run(fmt, out),
        Command::Lsp(lsp) => lsp::run(lsp, color, out),
        Command::Dap(dap) => dap::run(dap, color, out),
        Command::Rtl(rtl) => rtl::run(rtl, color, out),
        Command::Board(board) => board::run(board, color, out),
        Command::Load(load) => live::load(load, color, out),
        Command::Live(live) => live::live(live, color, out),
        Command::Cosim(cosim) => cosim::run(cosim, color, out),
        Command::Isa(isa) => isa::run(isa, out),
        Command::Machines(machines) => machines::run(machines, color, out),
        Command::Explore(explore) => explore::run(explore, color, out),
        Command::Completions(completions) => completions::run(completions, out),
        Command::Man(man) => man::run(man, out),
    }
}

/// A command, and those below it, with examples that fit the terminal.
fn fit(command: clap::Command, page: Page) -> clap::Command {
    let below = command.get_after_help().map(|text| page.below_help(&text.to_string()));
    let command = below.into_iter().fold(command, clap::Command::after_help);
    command.mut_subcommands(|command| fit(command, page))
}

/// The arguments, or the status to end with where clap has already answered (help, version, a mistake).
fn parse(out: &mut Out) -> Result<Arguments, ExitCode> {
    let command = fit(Arguments::command(), Page::of_stdout(None));
    let parsed = command.try_get_matches().and_then(|matches| Arguments::from_arg_matches(&matches));
    parsed.map_err(|mut answer| {
        wrong::suggest(&mut answer);
        if answer.use_stderr() {
            let text = answer.render();
            let color = Color::Auto.on_stderr();
            output::message(&if color { text.ansi().to_string() } else { text.to_string() });
            return ExitCode::from(2);
        }
        // Help goes where results go, so that a full disk or a closed pipe is treated alike.
        end(write!(out, "{}", answer.render()).and_then(|()| out.flush()).map_err(Into::into), false)
    })
}

/// Reports an error, if there is one, and gives the exit status. A closed pipe, as under `| head`, is none.
fn end(result: Result<()>, color: bool) -> ExitCode {
    let Err(error) = result else { return ExitCode::SUCCESS };
    if output::is_closed_pipe(&error) {
        return ExitCode::SUCCESS;
    }
    let failure = error.downcast_ref::<Failure>();
    match failure {
        Some(Failure::Reported) => {}
        Some(Failure::Diagnostics(text)) => output::message(text),
        Some(Failure::Denied(messages)) => messages.iter().for_each(|text| output::error(text, color)),
        Some(Failure::Usage(_)) | None => match machine_mistake::of(&error) {
            Some(mistake) => output::message(&mistake.render(color)),
            None => output::error(&output::describe(&error), color),
        },
    }
    ExitCode::from(match failure {
        Some(Failure::Usage(_)) => 2,
        Some(Failure::Denied(_)) => 3,
        _ => 1,
    })
}

fn main() -> ExitCode {
    let mut out = Out::results();
    let arguments = match parse(&mut out) {
        Ok(arguments) => arguments,
        Err(status) => return status,
    };
    let color = arguments.color.on_stderr();
    #[cfg(feature = "jit")]
    if arguments.no_jit {
        takt_emu::Emulator::switch_compiler_off();
    }
    if arguments.command.is_for_people() {
        out.set_page(Page::of_stdout(arguments.color.asked()));
    }
    let result = run(&arguments, color, &mut out);
    // Results written before an error still go out; the first error is the one that counts.
    let flushed = out.flush().map_err(anyhow::Error::from);
    end(result.and(flushed), color)
}
