// SPDX-License-Identifier: MIT OR Apache-2.0
//! Takt: assembles, emulates and times controllers for robots. Each command is a module of `commands`; only this crate accesses the
//! terminal.

mod commands;
mod run;
mod terminal;

use anyhow::Result;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use run::machine_mistake;
use std::io::Write;
use std::process::ExitCode;
use terminal::files::Out;
use terminal::groups;
use terminal::interrupt;
use terminal::output::{self, Color, Failure};
use terminal::page::Page;
use terminal::suggest;

/// Robot controllers on a floating-point processor whose every cycle is accounted for.
#[derive(Parser)]
#[command(name = "takt", version, after_help = AFTER_HELP)]
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
`verify`, a `check` of `debug`); 2 an error in the command line; 3 something that --deny names happened in a run; \
130 ended by Ctrl-C.

Examples:
  takt track                         the main job: cycles, accuracy, tracking error
  takt arm                           a six-axis arm's kinematics: cycles and errors
  takt robot                         a robot on three cores: a prompt, scripts, programs
  takt asm prog.s                    assemble prog.s into prog.takt
  takt run prog.s --inputs in.csv    run it, one period for each row
  takt isa fdiv                      look an instruction up";

#[derive(Subcommand)]
enum Command {
    Track(commands::track::Track),
    Arm(commands::arm::Arm),
    Robot(commands::robot::Robot),
    Asm(commands::asm::Asm),
    Model(commands::model::Model),
    Cc(commands::cc::Cc),
    Disasm(commands::disasm::Disasm),
    Verify(commands::verify::Verify),
    Run(commands::run::Run),
    Debug(commands::debug::Debug),
    Analyse(commands::analyse::Analyse),
    Bound(commands::bound::Bound),
    Accuracy(commands::accuracy::Accuracy),
    Eval(commands::eval::Eval),
    Fmt(commands::fmt::Fmt),
    Fmu(commands::fmu::ToFmu),
    Lsp(commands::lsp::Lsp),
    Dap(commands::dap::Dap),
    Editor(commands::editor::Editor),
    Rtl(commands::rtl::Rtl),
    Board(commands::board::Boards),
    Load(commands::live::LoadBoard),
    Live(commands::live::Live),
    Cosim(commands::cosim::Cosim),
    Isa(commands::isa::Isa),
    Machines(commands::machines::Machines),
    Explore(commands::explore::Explore),
    #[cfg(all(unix, feature = "fmu"))]
    #[command(hide = true)]
    FmuProcess(commands::fmu_process::FmuProcess),
    Completions(commands::completions::Completions),
    Man(commands::man::Man),
}

impl Command {
    /// The results are tables and sentences, which are folded to the terminal's width. Other commands print sources, or are interactive.
    fn is_for_people(&self) -> bool {
        #[cfg(feature = "board")]
        if let Command::Board(board) = self {
            return commands::board::is_for_people(board);
        }
        use Command::{
            Accuracy, Analyse, Arm, Asm, Bound, Cc, Cosim, Debug, Explore, Fmu, Isa, Machines, Model, Robot,
            Run, Track, Verify,
        };
        matches!(
            self,
            Accuracy(_)
                | Analyse(_)
                | Arm(_)
                | Asm(_)
                | Bound(_)
                | Cc(_)
                | Cosim(_)
                | Debug(_)
                | Isa(_)
                | Explore(_)
                | Fmu(_)
                | Machines(_)
                | Model(_)
                | Robot(_)
                | Run(_)
                | Track(_)
                | Verify(_)
        )
    }
}

fn run(arguments: &Arguments, color: bool, out: &mut Out) -> Result<()> {
    match &arguments.command {
        Command::Track(track) => commands::track::run(track, color, out),
        Command::Arm(arm) => commands::arm::run(arm, color, out),
        Command::Robot(robot) => commands::robot::run(robot, color, out),
        Command::Asm(asm) => commands::asm::run(asm, color, out),
        Command::Model(model) => commands::model::run(model, color, out),
        Command::Cc(cc) => commands::cc::run(cc, color, out),
        Command::Disasm(disasm) => commands::disasm::run(disasm, color),
        Command::Verify(verify) => commands::verify::run(verify, color, out),
        Command::Run(run) => commands::run::run(run, color, out),
        Command::Debug(debug) => commands::debug::run(debug, color, out),
        Command::Analyse(analyse) => commands::analyse::run(analyse, color, out),
        Command::Bound(bound) => commands::bound::run(bound, color, out),
        Command::Accuracy(accuracy) => commands::accuracy::run(accuracy, color, out),
        Command::Eval(eval) => commands::eval::run(eval, out),
        Command::Fmt(fmt) => commands::fmt::run(fmt, out),
        Command::Fmu(fmu) => commands::fmu::run(fmu, color, out),
        Command::Lsp(lsp) => commands::lsp::run(lsp, color, out),
        Command::Dap(dap) => commands::dap::run(dap, color, out),
        Command::Editor(editor) => commands::editor::run(editor, out),
        Command::Rtl(rtl) => commands::rtl::run(rtl, color, out),
        Command::Board(board) => commands::board::run(board, color, out),
        Command::Load(load) => commands::live::load(load, color, out),
        Command::Live(live) => commands::live::live(live, color, out),
        Command::Cosim(cosim) => commands::cosim::run(cosim, color, out),
        Command::Isa(isa) => commands::isa::run(isa, out),
        Command::Machines(machines) => commands::machines::run(machines, color, out),
        Command::Explore(explore) => commands::explore::run(explore, color, out),
        #[cfg(all(unix, feature = "fmu"))]
        Command::FmuProcess(process) => commands::fmu_process::run(process),
        Command::Completions(completions) => commands::completions::run(completions, out),
        Command::Man(man) => commands::man::run(man, out),
    }
}

/// Folds the examples in the help of a command and its subcommands to the terminal's width.
fn fit(command: clap::Command, page: Page) -> clap::Command {
    let below = command.get_after_help().map(|text| page.below_help(&text.to_string()));
    let command = below.into_iter().fold(command, clap::Command::after_help);
    command.mut_subcommands(|command| fit(command, page))
}

/// Parses the arguments. If clap has answered instead (help, version, a mistake), the error is the exit status.
fn parse(out: &mut Out) -> Result<Arguments, ExitCode> {
    let page = Page::of_help();
    // One width for clap's lines and those that it does not fold.
    let command = Arguments::command().term_width(page.columns());
    let command = groups::grouped(fit(command, page), page);
    let parsed = command.try_get_matches().and_then(|matches| Arguments::from_arg_matches(&matches));
    parsed.map_err(|mut answer| {
        suggest::suggest(&mut answer);
        if answer.use_stderr() {
            let text = answer.render();
            let color = Color::Auto.on_stderr();
            output::message(&output::folded(&if color { text.ansi().to_string() } else { text.to_string() }));
            return ExitCode::from(2);
        }
        // Print help in the same way as results, so that a full disk or a closed pipe has the same effect.
        end(write!(out, "{}", answer.render()).and_then(|()| out.flush()).map_err(Into::into), false)
    })
}

/// Reports an error and returns the exit status. A closed pipe, as in `| head`, is not an error.
fn end(result: Result<()>, color: bool) -> ExitCode {
    let Err(error) = result else { return ExitCode::SUCCESS };
    if output::is_closed_pipe(&error) {
        return ExitCode::SUCCESS;
    }
    let failure = error.downcast_ref::<Failure>();
    match failure {
        Some(Failure::Reported) => {}
        Some(Failure::Diagnostics(text) | Failure::Interrupted(text)) => output::message(text),
        Some(Failure::Denied(messages)) => messages.iter().for_each(|text| output::error(text, color)),
        Some(Failure::Usage(_)) | None => match machine_mistake::of(&error) {
            Some(mistake) => output::message(&mistake.render(color)),
            None => output::error(&takt_diagnostics::describe(error.as_ref()), color),
        },
    }
    if let Some(Failure::Interrupted(_)) = failure {
        interrupt::end();
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
        out.set_page(Page::of_stdout(arguments.color.explicit_choice()));
    }
    let result = run(&arguments, color, &mut out);
    // Write the results before the error; the first error determines the status.
    let flushed = out.flush().map_err(anyhow::Error::from);
    end(result.and(flushed), color)
}
