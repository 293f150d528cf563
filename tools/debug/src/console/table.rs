// SPDX-License-Identifier: MIT OR Apache-2.0
//! The table of commands, one for every target: it gives dispatch, help and completion.

use super::Console;
use crate::session::Unit;
use crate::target::Target;
use std::fmt::Write as _;
use takt_asm::nearest;

/// The targets that have a command.
#[derive(Clone, Copy)]
enum On {
    All,
    /// All; on a board, as this says.
    Limited(&'static str),
    /// All but a board, for this reason.
    Emulator(&'static str),
    /// This one only, for this reason.
    Only(Target, &'static str),
}

/// The effect of a command.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Does {
    /// Moves the run; an empty line repeats it.
    Steps,
    /// Moves or changes something.
    Changes,
    /// Shows values of a core.
    Shows,
    /// Tells what is known without values.
    Tells,
}

/// The words that complete an argument.
#[derive(Clone, Copy)]
enum Words {
    None,
    Names,
    Cores,
    These(&'static [&'static str]),
}

type Run = fn(&mut Console, &str) -> Result<String, String>;

/// A row of the table.
pub(super) struct Command {
    pub(super) name: &'static str,
    short: &'static str,
    arguments: &'static str,
    words: Words,
    pub(super) does: Does,
    on: On,
    pub(super) run: Run,
    text: &'static str,
}

/// The refusal of what goes back.
pub(super) const BACK: &str =
    "a circuit does not go back; `goto start` starts it again, and `takt debug` without --board goes back";
const ONE_CORE: &str = "it is for the cores of a system, and this is one program";
const NOT_HELD: &str = "it is for a board, which runs by itself; here only commands move the run";
const PLACES: &[&str] = &["cycle", "period", "start"];
/// Of such words, those that a board knows.
const BETWEEN_PERIODS: &[&str] = &["period", "start"];

macro_rules! commands {
    ($($name:literal $short:literal $arguments:literal $words:expr, $does:ident, $on:expr, $run:expr, $text:literal;)*) => {
        const COMMANDS: &[Command] = &[$(Command {
            name: $name, short: $short, arguments: $arguments, words: $words, does: Does::$does, on: $on, run: $run, text: $text,
        }),*];
    };
}

#[rustfmt::skip]
commands! {
    "step" "s" "[UNIT] [N]" Words::These(&Unit::NAMES), Steps, On::Limited("by periods, which need not be said"), |c, a| c.step(a, false), "Step by a cycle, bundle (if nothing is said), line, period or call (calls passed over); `out` of a subroutine.";
    "back" "b" "[UNIT] [N]" Words::These(&Unit::NAMES), Steps, On::Emulator(BACK), |c, a| c.step(a, true), "Step back by the same units.";
    "continue" "c" "" Words::None, Steps, On::Limited("a period at a time; if there is none, freely until Ctrl-C"), |c, _| c.resume(false), "Run on to a breakpoint or watchpoint.";
    "reverse" "rc" "" Words::None, Steps, On::Emulator(BACK), |c, _| c.resume(true), "Run back to one.";
    "until" "u" "EXPR" Words::Names, Changes, On::Limited("a period at a time"), Console::until, "Run on until an expression is not zero.";
    "goto" "g" "PLACE" Words::These(PLACES), Changes, On::Limited("forward to a period; the `start` starts the program again, held at its first `wait`"), Console::go_to, "Go to `cycle N` or `period N` (so many have passed), or to the `start`, whichever way that is.";
    "hold" "" "" Words::None, Changes, On::Only(Target::Board, NOT_HELD), |c, _| c.hold(), "No more ticks: the program waits at the end of its period, and values can be read. Outputs keep what they drive.";
    "go" "" "" Words::None, Changes, On::Only(Target::Board, NOT_HELD), |c, _| c.let_run(), "Let it run.";
    "break" "br" "PLACE [if EXPR]" Words::Names, Changes, On::Limited("at `period N`"), Console::add_break, "Stop where a bundle is about to issue: `label`, `label+2`, `file.s:12`, `:12`, `bundle 3`; or at `cycle N`, `period N`; or, in a system, at `link NAME [EVENT]`.";
    "watch" "w" "EXPR [== EXPR | > EXPR | nan | subnormal]" Words::Names, Changes, On::Limited("after the period in which it does"), Console::add_watch, "Stop when a value changes, or becomes equal, above, a NaN, a subnormal number.";
    "delete" "d" "[N]" Words::None, Changes, On::All, Console::delete, "Remove a breakpoint or watchpoint, or all.";
    "stops" "" "" Words::None, Tells, On::All, |c, _| Ok(c.stops()), "List breakpoints and watchpoints.";
    "cores" "" "" Words::None, Tells, On::Only(Target::System, ONE_CORE), |c, _| Ok(c.cores_text()), "Where each core is; the selected one has a `>`.";
    "core" "" "[NAME]" Words::Cores, Tells, On::Only(Target::System, ONE_CORE), Console::select_named, "Select a core, or the next one: the one that commands are about.";
    "links" "" "[NAME]" Words::None, Tells, On::Only(Target::System, ONE_CORE), |c, a| c.links_text(a), "What is on the links: values that arrived last, sets, entries.";
    "print" "p" "EXPR, …" Words::Names, Shows, On::All, |c, a| c.shown().print(a), "Print values: as float, hexadecimal float, integer, bits. `x:int` reads x as an integer.";
    "info" "i" "NAME" Words::Names, Shows, On::All, |c, a| c.shown().info(a), "What a name stands for: its registers, the bundles that write and read them, and which is the current line's (`>`).";
    "accuracy" "a" "[NAME]" Words::Names, Changes, On::Emulator("it needs every operation from reset on, and the circuit shows only the ends of periods; use `takt debug` without --board"), Console::accuracy, "The error of a register, or of the outputs, against binary64 from reset to here, and the lines that it comes from.";
    "set" "" "PLACE = EXPR" Words::Names, Changes, On::Limited("an input port, for the periods to come"), Console::set_command, "Set a register, port or data word (`table[3]`). What was run beyond this position is forgotten.";
    "ulp" "" "EXPR, EXPR" Words::Names, Shows, On::All, |c, a| c.shown().ulp(a), "The distance of two values in units in the last place of the second.";
    "check" "" "EXPR" Words::Names, Shows, On::All, |c, a| c.shown().check(a), "Fail if an expression is zero: a script then ends with exit status 1.";
    "registers" "r" "[PATTERN]" Words::Names, Shows, On::All, |c, a| Ok(c.shown().registers(a)), "Named registers; `*` stands for any characters.";
    "ports" "" "" Words::None, Shows, On::All, |c, _| Ok(c.shown().ports()), "Input and output ports.";
    "memory" "m" "EXPR [COUNT]" Words::Names, Shows, On::All, |c, a| c.shown().memory(a), "Data words from an address on.";
    "flight" "f" "" Words::None, Shows, On::Emulator("between two periods nothing is in flight"), |c, _| Ok(c.shown().flight()), "Operations in flight, with the cycles until their results are there.";
    "stalls" "" "" Words::None, Shows, On::Emulator("the circuit does not count stalls; `takt bound` and `takt analyse` show them"), |c, _| Ok(c.shown().stalls()), "Where the cycles since reset went.";
    "list" "l" "[LINE]" Words::None, Tells, On::All, |c, a| c.shown().list(a), "Source lines around this position, or a line.";
    "where" "" "" Words::None, Tells, On::All, |c, _| Ok(c.place()), "This position; the calls that lead to it.";
    "display" "" "[EXPR]" Words::Names, Shows, On::All, |c, a| c.shown_mut().display(a), "Show a value at each stop; without one, show none any more.";
    "echo" "" "TEXT" Words::None, Tells, On::All, |_, a| Ok(format!("{a}\n")), "Print a text.";
    "help" "h" "[COMMAND]" Words::None, Tells, On::All, |c, a| help(c.target(), a), "This list, or one command.";
    "quit" "q" "" Words::None, Changes, On::Limited("a program that ran when the session began runs again, unless `hold` or `goto start` was given"), |c, _| { c.quit = true; Ok(String::new()) }, "Leave.";
}

/// Keys of the full-screen view, each with the command that it stands for. One that ends in a blank is left to be completed.
#[rustfmt::skip]
pub const KEYS: &[(char, &str)] = &[
    ('s', "step"), ('S', "back"), ('n', "step call"), ('N', "back call"), ('l', "step line"), ('L', "back line"),
    ('i', "step cycle"), ('I', "back cycle"), ('p', "step period"), ('P', "back period"), ('o', "step out"),
    ('c', "continue"), ('C', "reverse"), ('b', "break "), ('w', "watch "), ('u', "until "), ('d', "display "),
    ('g', "goto "), ('k', "core"), ('q', "quit"),
];

/// The keys whose commands a target has.
pub fn keys(target: Target) -> impl Iterator<Item = (char, &'static str)> {
    KEYS.iter().copied().filter(move |(_, line)| find(line.split(' ').next().unwrap_or(line), target).is_ok())
}

impl Command {
    /// The reason why a target does not have it; `None` if it does.
    fn refusal(&self, target: Target) -> Option<&'static str> {
        match self.on {
            On::Emulator(why) if target == Target::Board => Some(why),
            On::Only(only, why) if target != only => Some(why),
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
            On::Limited(how) if target == Target::Board => format!("{} (On a board: {how}.)", self.text),
            _ => self.text.to_owned(),
        }
    }

    fn refused(&self, why: &str) -> String {
        format!("`{}`: {why}", self.name)
    }
}

/// The commands of a target.
fn of(target: Target) -> impl Iterator<Item = &'static Command> {
    COMMANDS.iter().filter(move |command| command.refusal(target).is_none())
}

/// A command by its name, its short name, or an unmistakable beginning.
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

/// The help on some commands, a line for each.
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

/// Every command of a target for the help of the full-screen view: its use, the keys that stand for it, and its text.
pub fn commands(target: Target) -> impl Iterator<Item = (String, String, String)> {
    of(target).map(move |command| {
        let keys = KEYS.iter().filter(|(_, line)| line.split(' ').next() == Some(command.name));
        let keys: Vec<String> = keys.map(|(key, line)| format!("{key} {}", line.trim_end())).collect();
        (command.usage(), keys.join(", "), command.text(target))
    })
}

/// A line's command and its arguments; `None` for a blank line or a comment.
pub(super) fn split(line: &str) -> Option<(&str, &str)> {
    let line = line.trim();
    if line.is_empty() || line.starts_with('#') || line.starts_with(';') {
        return None;
    }
    Some(line.split_once(char::is_whitespace).map_or((line, ""), |(name, rest)| (name, rest.trim())))
}

/// The first line of a script that is no command of a target, and the reason.
pub fn first_mistake(script: &str, target: Target) -> Option<(usize, String)> {
    let mistake = |line| find(split(line)?.0, target).err();
    script.lines().enumerate().find_map(|(i, line)| Some((i + 1, mistake(line)?)))
}

impl Console {
    /// Names that complete the word that a line ends with, and where that word begins.
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
            Ok(Words::Names) => self.shown().session.names(word),
            Ok(Words::Cores) => matching(&mut (0..self.cores()).map(|core| self.name(core))),
            Ok(Words::These(words)) => matching(&mut words.iter().copied().filter(known)),
            Ok(Words::None) | Err(_) => Vec::new(),
        };
        (start, found)
    }

    /// Executes a line if it is a command that only looks, as an editor's console has them; `None` if it is no command. Names
    /// are not abbreviated but to their short names, since the line may be something else.
    pub fn look(&mut self, line: &str) -> Option<Result<String, String>> {
        let (name, arguments) = split(line)?;
        let target = self.target();
        let only_looks = |command: &Command| matches!(command.does, Does::Shows | Does::Tells);
        let command = COMMANDS.iter().find(|command| command.is(name))?;
        if let Some(why) = command.refusal(target) {
            return Some(Err(command.refused(why)));
        }
        if !only_looks(command) {
            let text = "is not for an editor's console, which only looks (`help` lists what it has)";
            return Some(Err(format!("`{}` {text}", command.name)));
        }
        if (command.name, arguments) == ("help", "") {
            return Some(Ok(usages(target, only_looks)));
        }
        Some(self.execute(line))
    }
}

/// The refusal of a stop or a step within a period, on a board.
pub(super) fn inside(what: &str) -> String {
    format!("`{what}`: a board stops only between two periods; `takt debug` without --board stops anywhere")
}
