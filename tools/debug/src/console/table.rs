// SPDX-License-Identifier: MIT OR Apache-2.0
//! Command table, shared by all targets: basis of dispatch, help and completion.

use super::Console;
use crate::session::Unit;
use crate::target::Target;
use std::fmt::Write as _;
use takt_asm::nearest;

/// Targets on which a command is available.
#[derive(Clone, Copy)]
enum Availability {
    All,
    /// Every target; the text states the limitation on boards.
    Limited(&'static str),
    /// Every target except boards; the text states the reason.
    Emulator(&'static str),
    /// This target only; the text states the reason.
    Only(Target, &'static str),
}

/// Effect of a command.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum CommandEffect {
    /// Moves the run; an empty line repeats it.
    Steps,
    /// Moves the run, or changes a value.
    Changes,
    /// Shows values of a core without changing the run.
    Shows,
    /// Prints static facts, independent of the state of a core.
    Tells,
}

/// Candidates for the completion of an argument.
#[derive(Clone, Copy)]
enum Words {
    None,
    Names,
    Cores,
    These(&'static [&'static str]),
}

type Run = fn(&mut Console, &str) -> Result<String, String>;

/// A row of the command table.
pub(super) struct Command {
    pub(super) name: &'static str,
    short: &'static str,
    arguments: &'static str,
    words: Words,
    pub(super) does: CommandEffect,
    on: Availability,
    pub(super) run: Run,
    text: &'static str,
}

/// Error message on boards for commands that go back.
pub(super) const BACK: &str =
    "a circuit does not go back; `goto start` starts it again, and `takt debug` without --board goes back";
const ONE_CORE: &str = "it is for the cores of a system, and this is one program";
const NOT_HELD: &str = "it is for a board, which runs by itself; here only commands move the run";
const PLACES: &[&str] = &["cycle", "period", "start"];
/// Positions that can be reached on a board.
const BETWEEN_PERIODS: &[&str] = &["period", "start"];

macro_rules! commands {
    ($($name:literal $short:literal $arguments:literal $words:expr, $does:ident, $on:expr, $run:expr, $text:literal;)*) => {
        const COMMANDS: &[Command] = &[$(Command {
            name: $name, short: $short, arguments: $arguments, words: $words, does: CommandEffect::$does, on: $on, run: $run, text: $text,
        }),*];
    };
}

#[rustfmt::skip]
commands! {
    "step" "s" "[UNIT] [N]" Words::These(&Unit::NAMES), Steps, Availability::Limited("by periods, the default unit"), |c, a| c.step(a, false), "Step by a cycle, bundle (if nothing is said), line, period or call (calls passed over); `out` of a subroutine.";
    "back" "b" "[UNIT] [N]" Words::These(&Unit::NAMES), Steps, Availability::Emulator(BACK), |c, a| c.step(a, true), "Step back by the same units.";
    "continue" "c" "" Words::None, Steps, Availability::Limited("a period at a time; if there is none, freely until Ctrl-C"), |c, _| c.resume(false), "Run on to a breakpoint or watchpoint.";
    "reverse" "rc" "" Words::None, Steps, Availability::Emulator(BACK), |c, _| c.resume(true), "Run back to one.";
    "until" "u" "EXPR" Words::Names, Changes, Availability::Limited("a period at a time"), Console::until, "Run on until an expression is not zero.";
    "goto" "g" "PLACE" Words::These(PLACES), Changes, Availability::Limited("forward to a period; the `start` starts the program again, held at its first `wait`"), Console::go_to, "Go to `cycle N` or `period N` (so many have passed), or to the `start`, whichever way that is.";
    "hold" "" "" Words::None, Changes, Availability::Only(Target::Board, NOT_HELD), |c, _| c.hold(), "No more ticks: the program waits at the end of its period, and values can be read. Outputs keep what they drive.";
    "go" "" "" Words::None, Changes, Availability::Only(Target::Board, NOT_HELD), |c, _| c.let_run(), "Let it run.";
    "break" "br" "PLACE [if EXPR]" Words::Names, Changes, Availability::Limited("at `period N`"), Console::add_break, "Stop where a bundle is about to issue: `label`, `label+2`, `file.s:12`, `:12`, `bundle 3`; or at `cycle N`, `period N`; or, in a system, at `link NAME [EVENT]`.";
    "watch" "w" "EXPR [== EXPR | > EXPR | nan | subnormal]" Words::Names, Changes, Availability::Limited("after the period in which it does"), Console::add_watch, "Stop when a value changes, or becomes equal, above, a NaN, a subnormal number.";
    "delete" "d" "[N]" Words::None, Changes, Availability::All, Console::delete, "Remove a breakpoint or watchpoint, or all.";
    "stops" "" "" Words::None, Tells, Availability::All, |c, _| Ok(c.stops()), "List breakpoints and watchpoints.";
    "cores" "" "" Words::None, Tells, Availability::Only(Target::System, ONE_CORE), |c, _| Ok(c.cores_text()), "Position of each core; the selected core has a `>`.";
    "core" "" "[NAME]" Words::Cores, Tells, Availability::Only(Target::System, ONE_CORE), Console::select_named, "Select the core that commands apply to; without a name, the next core.";
    "links" "" "[NAME]" Words::None, Tells, Availability::Only(Target::System, ONE_CORE), |c, a| c.links_text(a), "State of the links: values that arrived last, sets, entries.";
    "print" "p" "EXPR, …" Words::Names, Shows, Availability::All, |c, a| c.inspector().print(a), "Print values: as float, hexadecimal float, integer, bits. `x:int` reads x as an integer.";
    "info" "i" "NAME" Words::Names, Shows, Availability::All, |c, a| c.inspector().info(a), "What a name stands for: its registers, the bundles that write and read them, and which is the current line's (`>`).";
    "accuracy" "a" "[NAME]" Words::Names, Changes, Availability::Emulator("it needs every operation from reset on, and the circuit shows only the ends of periods; use `takt debug` without --board"), Console::accuracy, "The error of a register, or of the outputs, against binary64 from reset to here, and the lines that it comes from.";
    "set" "" "PLACE = EXPR" Words::Names, Changes, Availability::Limited("an input port, for the periods to come"), Console::set_command, "Set a register, port or data word (`table[3]`). The run beyond this position is discarded.";
    "ulp" "" "EXPR, EXPR" Words::Names, Shows, Availability::All, |c, a| c.inspector().ulp(a), "The distance of two values in units in the last place of the second.";
    "check" "" "EXPR" Words::Names, Shows, Availability::All, |c, a| c.inspector().check(a), "Fail if an expression is zero: a script then ends with exit status 1.";
    "registers" "r" "[PATTERN]" Words::Names, Shows, Availability::All, |c, a| Ok(c.inspector().registers(a)), "Named registers; `*` stands for any characters.";
    "ports" "" "" Words::None, Shows, Availability::All, |c, _| Ok(c.inspector().ports()), "Input and output ports.";
    "memory" "m" "EXPR [COUNT]" Words::Names, Shows, Availability::All, |c, a| c.inspector().memory(a), "Data words from an address on.";
    "flight" "f" "" Words::None, Shows, Availability::Emulator("between two periods nothing is in flight"), |c, _| Ok(c.inspector().flight()), "Operations in flight, with the cycles until their results are there.";
    "stalls" "" "" Words::None, Shows, Availability::Emulator("the circuit does not count stalls; `takt bound` and `takt analyse` show them"), |c, _| Ok(c.inspector().stalls()), "Account of the cycles since reset.";
    "list" "l" "[LINE]" Words::None, Tells, Availability::All, |c, a| c.inspector().list(a), "Source lines around this position, or a line.";
    "where" "" "" Words::None, Tells, Availability::All, |c, _| Ok(c.place()), "This position; the calls that lead to it.";
    "display" "" "[EXPR]" Words::Names, Shows, Availability::All, |c, a| c.inspector_mut().display(a), "Show a value at each stop; without one, show none any more.";
    "echo" "" "TEXT" Words::None, Tells, Availability::All, |_, a| Ok(format!("{a}\n")), "Print a text.";
    "help" "h" "[COMMAND]" Words::None, Tells, Availability::All, |c, a| help(c.target(), a), "This list, or one command.";
    "quit" "q" "" Words::None, Changes, Availability::Limited("a program that ran when the session began runs again, unless `hold` or `goto start` was given"), |c, _| { c.quit = true; Ok(String::new()) }, "Leave.";
}

/// Key bindings of the full-screen view. A binding that ends in a blank waits for the rest of the command.
#[rustfmt::skip]
pub const KEYS: &[(char, &str)] = &[
    ('s', "step"), ('S', "back"), ('n', "step call"), ('N', "back call"), ('l', "step line"), ('L', "back line"),
    ('i', "step cycle"), ('I', "back cycle"), ('p', "step period"), ('P', "back period"), ('o', "step out"),
    ('c', "continue"), ('C', "reverse"), ('b', "break "), ('w', "watch "), ('u', "until "), ('d', "display "),
    ('g', "goto "), ('k', "core"), ('q', "quit"),
];

/// Keys whose commands are available on a target.
pub fn keys(target: Target) -> impl Iterator<Item = (char, &'static str)> {
    KEYS.iter().copied().filter(move |(_, line)| find(line.split(' ').next().unwrap_or(line), target).is_ok())
}

impl Command {
    /// Reason why the command is unavailable on a target; `None` if it is available.
    fn refusal(&self, target: Target) -> Option<&'static str> {
        match self.on {
            Availability::Emulator(why) if target == Target::Board => Some(why),
            Availability::Only(only, why) if target != only => Some(why),
            _ => None,
        }
    }

    fn is(&self, name: &str) -> bool {
        self.name == name || self.short == name
    }

    fn usage(&self) -> String {
        format!("{} {}", self.name, self.arguments)
    }

    fn text(&self, target: Target) -> String {
        match self.on {
            Availability::Limited(how) if target == Target::Board => {
                format!("{} (On a board: {how}.)", self.text)
            }
            _ => self.text.to_owned(),
        }
    }

    fn refused(&self, why: &str) -> String {
        format!("`{}`: {why}", self.name)
    }
}

/// Commands available on a target.
fn of(target: Target) -> impl Iterator<Item = &'static Command> {
    COMMANDS.iter().filter(move |command| command.refusal(target).is_none())
}

/// Looks up a command by name, short name, or unambiguous prefix.
pub(super) fn find(name: &str, target: Target) -> Result<&'static Command, String> {
    let begins = |command: &&Command| command.name.starts_with(name);
    let exact = COMMANDS.iter().find(|command| command.is(name));
    let mut meant = of(target).filter(begins);
    let command = match (exact, meant.next(), meant.next()) {
        (Some(command), ..) | (None, Some(command), None) => command,
        (None, Some(a), Some(b)) => return Err(format!("`{name}` may be `{}` or `{}`", a.name, b.name)),
        (None, None, _) => COMMANDS.iter().find(begins).ok_or_else(|| {
            let near = nearest(name, of(target).map(|command| command.name));
            let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            format!("there is no command `{name}`{near} (`help` lists them)")
        })?,
    };
    command.refusal(target).map_or(Ok(command), |why| Err(command.refused(why)))
}

/// Help on the selected commands, one line each.
fn usages(target: Target, wanted: impl Fn(&Command) -> bool) -> String {
    let commands = || of(target).filter(|command| wanted(command));
    let width =
        commands().map(|command| command.usage().len()).filter(|width| *width < 24).max().unwrap_or(0);
    commands().fold(String::new(), |mut text, command| {
        let _ = writeln!(text, "{:<2} {:<width$}  {}", command.short, command.usage(), command.text(target));
        text
    })
}

fn help(target: Target, name: &str) -> Result<String, String> {
    if !name.is_empty() {
        let command = find(name, target)?;
        let short =
            if command.short.is_empty() { String::new() } else { format!("  (short: {})", command.short) };
        return Ok(format!("{}{short}\n  {}\n", command.usage().trim_end(), command.text(target)));
    }
    let mut text = usages(target, |_| true);
    text.push_str("An empty line repeats a step. Expressions are the assembler's, over live values; also ");
    text.push_str(match target {
        Target::Program => "`cycle period address depth`.\n",
        Target::System => "`cycle period address depth`, and `core.name` of another core.\n",
        Target::Board => "`period address`.\n",
    });
    Ok(text)
}

/// Commands of a target for the help of the full-screen view: syntax, keys, and description.
pub fn commands(target: Target) -> impl Iterator<Item = (String, String, String)> {
    of(target).map(move |command| {
        let keys = KEYS.iter().filter(|(_, line)| line.split(' ').next() == Some(command.name));
        let keys: Vec<String> = keys.map(|(key, line)| format!("{key} {}", line.trim_end())).collect();
        (command.usage(), keys.join(", "), command.text(target))
    })
}

/// Splits a line into command and arguments; `None` for a blank line or a comment.
pub(super) fn split(line: &str) -> Option<(&str, &str)> {
    let line = line.trim();
    if line.is_empty() || line.starts_with('#') || line.starts_with(';') {
        return None;
    }
    Some(line.split_once(char::is_whitespace).map_or((line, ""), |(name, rest)| (name, rest.trim())))
}

/// First line of a script that is not a valid command of the target, with the reason.
pub fn first_mistake(script: &str, target: Target) -> Option<(usize, String)> {
    let mistake = |line| find(split(line)?.0, target).err();
    script.lines().enumerate().find_map(|(i, line)| Some((i + 1, mistake(line)?)))
}

impl Console {
    /// Completions of the last word of a line, and the column at which the word starts.
    pub fn complete(&self, line: &str) -> (usize, Vec<String>) {
        let target = self.target();
        let start =
            line.rfind(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.')).map_or(0, |at| at + 1);
        let word = &line[start..];
        let matching = |names: &mut dyn Iterator<Item = &str>| {
            names.filter(|name| name.starts_with(word)).map(str::to_owned).collect::<Vec<_>>()
        };
        let Some((command, _)) = line.trim_start().split_once(' ') else {
            return (start, matching(&mut of(target).map(|command| command.name)));
        };
        let known = |word: &&str| target != Target::Board || BETWEEN_PERIODS.contains(word);
        let found = match find(command, target).map(|command| command.words) {
            Ok(Words::Names) => self.inspector().session.names(word),
            Ok(Words::Cores) => matching(&mut (0..self.cores()).map(|core| self.name(core))),
            Ok(Words::These(words)) => matching(&mut words.iter().copied().filter(known)),
            Ok(Words::None) | Err(_) => Vec::new(),
        };
        (start, found)
    }

    /// For an editor's console: executes a line if it is a command that does not affect the run, otherwise returns `None`. Only full and
    /// short command names are accepted, since the line may also be an expression.
    pub fn look(&mut self, line: &str) -> Option<Result<String, String>> {
        let (name, arguments) = split(line)?;
        let target = self.target();
        let only_looks =
            |command: &Command| matches!(command.does, CommandEffect::Shows | CommandEffect::Tells);
        let command = COMMANDS.iter().find(|command| command.is(name))?;
        if let Some(why) = command.refusal(target) {
            return Some(Err(command.refused(why)));
        }
        if !only_looks(command) {
            let text =
                "is not available in an editor's console, which only inspects (`help` lists its commands)";
            return Some(Err(format!("`{}` {text}", command.name)));
        }
        if (command.name, arguments) == ("help", "") {
            return Some(Ok(usages(target, only_looks)));
        }
        Some(self.execute(line))
    }
}

/// Error message on boards for a stop or a step within a period.
pub(super) fn inside(what: &str) -> String {
    format!("`{what}`: a board stops only between two periods; `takt debug` without --board stops anywhere")
}
