//! Commands in, text out: what a prompt, a script and the command line of a full-screen view share. One table gives
//! dispatch, help and completion.

mod stops;
mod values;

pub(crate) use stops::told;

use crate::accuracy;
use crate::panes::{self, Flying, Panes};
use crate::session::{Live, Session, Shown, Unit, Why, hex_float};
use std::fmt::Write as _;
use takt_asm::expr::Value;
use takt_asm::nearest;

/// What completes an argument.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Completion {
    None,
    Names,
    Words(&'static [&'static str]),
}

type Run = fn(&mut Console, &str) -> Result<String, String>;

/// A row of the table.
struct Command {
    name: &'static str,
    short: &'static str,
    arguments: &'static str,
    text: &'static str,
    completion: Completion,
    run: Run,
}

const UNITS: &[&str] = &["cycle", "bundle", "line", "period", "call", "out"];

macro_rules! commands {
    ($($name:literal $short:literal $arguments:literal $completion:expr, $run:expr, $text:literal;)*) => {
        const COMMANDS: &[Command] = &[$(Command {
            name: $name, short: $short, arguments: $arguments, text: $text, completion: $completion, run: $run,
        }),*];
    };
}

#[rustfmt::skip]
commands! {
    "step" "s" "[UNIT] [N]" Completion::Words(UNITS), |c, a| c.step(a, false), "Step by a cycle, bundle (if nothing is said), line, period or call (calls passed over); `out` of a subroutine.";
    "back" "b" "[UNIT] [N]" Completion::Words(UNITS), |c, a| c.step(a, true), "Step back by the same units.";
    "continue" "c" "" Completion::None, |c, _| { let why = c.session.resume(); c.arrive(why) }, "Run on to a breakpoint or watchpoint.";
    "reverse" "rc" "" Completion::None, |c, _| { let why = c.session.resume_back(); c.arrive(why) }, "Run back to one.";
    "until" "u" "EXPR" Completion::Names, |c, a| { let live = c.session.parse(a)?; let why = c.session.run_until(&live); c.arrive(why) }, "Run on until an expression is not zero.";
    "goto" "g" "PLACE" Completion::Words(&["cycle", "period", "start"]), Console::go, "Go to `cycle N` or `period N` (so many have passed), or to the `start`, whichever way that is.";
    "break" "br" "PLACE [if EXPR]" Completion::Names, Console::add_break, "Stop where a bundle is about to issue: `label`, `label+2`, `file.s:12`, `:12`, `bundle 3`; or at `cycle N`, `period N`.";
    "watch" "w" "EXPR [== EXPR | > EXPR | nan | subnormal]" Completion::Names, Console::add_watch, "Stop when a value changes, or becomes equal, above, a NaN, a subnormal number.";
    "delete" "d" "[N]" Completion::None, Console::delete, "Remove a breakpoint or watchpoint, or all.";
    "stops" "" "" Completion::None, |c, _| Ok(c.stops()), "List breakpoints and watchpoints.";
    "print" "p" "EXPR, …" Completion::Names, Console::print, "Print values: as float, hexadecimal float, integer, bits. `x:int` reads x as an integer.";
    "info" "i" "NAME" Completion::Names, Console::info, "What a name stands for: its registers, the bundles that write and read them, and which is the current line's (`>`).";
    "accuracy" "a" "[NAME]" Completion::Names, |c, a| accuracy::accuracy(&mut c.session, a), "The error of a register, or of the outputs, against binary64 from reset to here, and the lines that it comes from.";
    "set" "" "PLACE = EXPR" Completion::Names, Console::set, "Set a register, port or data word (`table[3]`). What was run beyond this position is forgotten.";
    "ulp" "" "EXPR, EXPR" Completion::Names, Console::ulp, "The distance of two values in units in the last place of the second.";
    "check" "" "EXPR" Completion::Names, Console::check, "Fail if an expression is zero: a script then ends with exit status 1.";
    "registers" "r" "[PATTERN]" Completion::Names, |c, a| Ok(c.registers(a)), "Named registers; `*` stands for any characters.";
    "ports" "" "" Completion::None, |c, _| Ok(c.ports()), "Input and output ports.";
    "memory" "m" "EXPR [COUNT]" Completion::Names, Console::memory, "Data words from an address on.";
    "flight" "f" "" Completion::None, |c, _| Ok(c.flight()), "Operations in flight, with the cycles until their results are there.";
    "stalls" "" "" Completion::None, |c, _| Ok(c.stalls()), "Where the cycles since reset went.";
    "list" "l" "[LINE]" Completion::None, Console::list, "Source lines around this position, or a line.";
    "where" "" "" Completion::None, |c, _| Ok(c.place()), "This position; the calls that lead to it.";
    "display" "" "[EXPR]" Completion::Names, Console::display, "Show a value at each stop; without one, show none any more.";
    "echo" "" "TEXT" Completion::None, |_, a| Ok(format!("{a}\n")), "Print a text.";
    "help" "h" "[COMMAND]" Completion::None, |_, a| help(a), "This list, or one command.";
    "quit" "q" "" Completion::None, |c, _| { c.quit = true; Ok(String::new()) }, "Leave.";
}

/// Keys of the full-screen view, each with the command that it stands for. One that ends in a blank is left to be completed.
#[rustfmt::skip]
pub const KEYS: &[(char, &str)] = &[
    ('s', "step"), ('S', "back"), ('n', "step call"), ('N', "back call"), ('l', "step line"), ('L', "back line"),
    ('i', "step cycle"), ('I', "back cycle"), ('p', "step period"), ('P', "back period"), ('o', "step out"),
    ('c', "continue"), ('C', "reverse"), ('b', "break "), ('w', "watch "), ('u', "until "), ('d', "display "),
    ('g', "goto "), ('q', "quit"),
];

/// A command by its name, its short name, or an unmistakable beginning.
fn find(name: &str) -> Result<&'static Command, String> {
    if let Some(command) = COMMANDS.iter().find(|command| command.name == name || command.short == name) {
        return Ok(command);
    }
    let mut meant = COMMANDS.iter().filter(|command| command.name.starts_with(name));
    match (meant.next(), meant.next()) {
        (Some(command), None) => Ok(command),
        (Some(a), Some(b)) => Err(format!("`{name}` may be `{}` or `{}`", a.name, b.name)),
        (None, _) => {
            let near = nearest(name, COMMANDS.iter().map(|command| command.name));
            let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            Err(format!("there is no command `{name}`{near} (`help` lists them)"))
        }
    }
}

fn usage(command: &Command) -> String {
    format!("{} {}", command.name, command.arguments)
}

/// A line for each command that is wanted.
fn usages(wanted: &dyn Fn(&Command) -> bool) -> String {
    let commands = || COMMANDS.iter().filter(|command| wanted(command));
    let width = commands().map(|command| usage(command).len()).filter(|width| *width < 24).max().unwrap_or(0);
    let mut text = String::new();
    for command in commands() {
        let _ = writeln!(text, "{:<2} {:<width$}  {}", command.short, usage(command), command.text);
    }
    text
}

pub(crate) fn help(name: &str) -> Result<String, String> {
    if !name.is_empty() {
        let command = find(name)?;
        let short =
            if command.short.is_empty() { String::new() } else { format!("  (short: {})", command.short) };
        return Ok(format!("{}{short}\n  {}\n", usage(command).trim_end(), command.text));
    }
    let mut text = usages(&|_| true);
    text.push_str("An empty line repeats a step. Expressions are the assembler's, over live values; also `cycle period address depth`.\n");
    Ok(text)
}

/// Every command for the help of the full-screen view: its use, the keys that stand for it, and its text.
pub fn commands() -> impl Iterator<Item = (String, String, &'static str)> {
    COMMANDS.iter().map(|command| {
        let keys = KEYS.iter().filter(|(_, line)| line.split(' ').next() == Some(command.name));
        let keys: Vec<String> = keys.map(|(key, line)| format!("{key} {}", line.trim_end())).collect();
        (format!("{} {}", command.name, command.arguments), keys.join(", "), command.text)
    })
}

/// Names that complete the word that a line ends with, and where that word begins.
pub fn complete(session: &Session, line: &str) -> (usize, Vec<String>) {
    let start =
        line.rfind(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '.')).map_or(0, |at| at + 1);
    let word = &line[start..];
    let matching = |names: &mut dyn Iterator<Item = &str>| {
        names.filter(|name| name.starts_with(word)).map(str::to_owned).collect::<Vec<_>>()
    };
    let Some((command, _)) = line.trim_start().split_once(' ') else {
        return (start, matching(&mut COMMANDS.iter().map(|command| command.name)));
    };
    let found = match find(command).map(|command| command.completion) {
        Ok(Completion::Names) => session.names(word),
        Ok(Completion::Words(words)) => matching(&mut words.iter().copied()),
        _ => Vec::new(),
    };
    (start, found)
}

/// What to step by, and how often.
pub(crate) fn steps(arguments: &str) -> Result<(Unit, u64), String> {
    let (mut unit, mut count) = (Unit::Bundle, 1u64);
    for word in arguments.split_whitespace() {
        unit = match word {
            "cycle" => Unit::Cycle,
            "bundle" => Unit::Bundle,
            "line" => Unit::Line,
            "period" => Unit::Period,
            "call" => Unit::Call,
            "out" => Unit::Out,
            number => {
                count = number.parse().ok().filter(|count| *count > 0).ok_or_else(|| {
                    let near = nearest(number, UNITS.iter().copied());
                    let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
                    format!("`{number}` is neither a count nor one of {}{near}", UNITS.join(" "))
                })?;
                continue;
            }
        };
    }
    Ok((unit, count))
}

/// A line's command and its arguments; `None` for a blank line or a comment.
pub(crate) fn split(line: &str) -> Option<(&str, &str)> {
    let line = line.trim();
    if line.is_empty() || line.starts_with('#') || line.starts_with(';') {
        return None;
    }
    Some(line.split_once(char::is_whitespace).map_or((line, ""), |(name, rest)| (name, rest.trim())))
}

/// The first line of a script that is no command of these, and why.
pub fn first_mistake<C: Commands>(script: &str) -> Option<(usize, String)> {
    script.lines().enumerate().find_map(|(i, line)| Some((i + 1, C::mistake(line)?)))
}

/// Commands that look at a machine and neither move nor change it: of a system, they are about the selected core; and an editor's
/// console, whose editor moves the run, has these only.
const INSPECTION: &[&str] = &[
    "print",
    "info",
    "ulp",
    "check",
    "registers",
    "ports",
    "memory",
    "flight",
    "stalls",
    "list",
    "where",
    "display",
    "echo",
    "help",
];

/// Their names.
pub(crate) fn inspection() -> impl Iterator<Item = &'static str> {
    INSPECTION.iter().copied()
}

/// Refuses a command that does more than look.
pub(crate) fn only_looks(name: &str) -> String {
    format!("`{name}` is not for an editor's console, which only looks (`help` lists what it has)")
}

/// The name of the command that is meant.
pub(crate) fn named(name: &str) -> Result<&'static str, String> {
    find(name).map(|command| command.name)
}

/// What reads lines and answers: the console of a session, or of a system's.
pub trait Commands {
    /// Executes a line; what it has to say, in whole lines.
    ///
    /// # Errors
    /// What is wrong with it. The session is as it was.
    fn execute(&mut self, line: &str) -> Result<String, String>;

    /// Executes a line if it is a command that only looks; `None` if it is no command. Names are not abbreviated but to their short
    /// names, since the line may be something else.
    fn look(&mut self, line: &str) -> Option<Result<String, String>>;

    /// Whether `quit` was said.
    fn quit(&self) -> bool;

    /// Where the session is.
    fn place(&mut self) -> String;

    /// Names that complete the word that a line ends with, and where that word begins.
    fn complete(&self, line: &str) -> (usize, Vec<String>);

    /// Ends the session; what there is to say of what it leaves behind.
    ///
    /// # Errors
    /// Why that is not left as it should be.
    fn leave(&mut self) -> Result<String, String> {
        Ok(String::new())
    }

    /// What [`Control::cycle`](crate::session::Control::cycle) counts.
    fn counts(&self) -> &'static str {
        "cycle"
    }

    /// What is wrong with a line that is no command.
    fn mistake(line: &str) -> Option<String>
    where
        Self: Sized;
}

impl Commands for Console {
    fn execute(&mut self, line: &str) -> Result<String, String> {
        Console::execute(self, line)
    }

    fn look(&mut self, line: &str) -> Option<Result<String, String>> {
        let (name, arguments) = split(line)?;
        let command = COMMANDS.iter().find(|command| command.name == name || command.short == name)?;
        if !INSPECTION.contains(&command.name) {
            return Some(Err(only_looks(command.name)));
        }
        if (command.name, arguments) == ("help", "") {
            return Some(Ok(usages(&|command| INSPECTION.contains(&command.name))));
        }
        Some(self.execute(line))
    }

    fn quit(&self) -> bool {
        self.quit
    }

    fn place(&mut self) -> String {
        Console::place(self)
    }

    fn complete(&self, line: &str) -> (usize, Vec<String>) {
        complete(&self.session, line)
    }

    fn mistake(line: &str) -> Option<String> {
        find(split(line)?.0).err()
    }
}

/// A session with what commands add to it.
pub struct Console {
    /// The session.
    pub session: Session,
    displays: Vec<Live>,
    /// Checks that have failed.
    pub failed: u32,
    /// Whether `quit` was said.
    pub quit: bool,
    /// The last step, which an empty line repeats.
    last: String,
    /// What named registers held before the last command that moved or changed something.
    before: Vec<Option<u32>>,
}

impl Console {
    /// Commands on a session.
    pub fn new(session: Session) -> Console {
        let before = panes::values(&session);
        Console { session, displays: Vec::new(), failed: 0, quit: false, last: String::new(), before }
    }

    /// Executes a line; what it has to say, in whole lines.
    ///
    /// # Errors
    /// What is wrong with it. The session is as it was.
    pub fn execute(&mut self, line: &str) -> Result<String, String> {
        let repeated = self.last.clone();
        let line = if line.trim().is_empty() { &repeated } else { line };
        let Some((name, arguments)) = split(line) else { return Ok(String::new()) };
        let command = find(name)?;
        let moves = ["step", "back", "continue", "reverse"].contains(&command.name);
        self.last = if moves { line.to_owned() } else { String::new() };
        let (cycle, before) = (self.session.cycle(), panes::values(&self.session));
        let result = (command.run)(self, arguments);
        if self.session.cycle() != cycle || panes::values(&self.session) != before {
            self.before = before;
        }
        result
    }

    /// What there is to see at this position.
    pub fn panes(&mut self) -> Panes {
        let displays = self.displayed();
        Panes::new(&mut self.session, &self.before, displays)
    }

    /// The displayed expressions with their values.
    pub fn displayed(&self) -> Vec<(String, String)> {
        self.displays.iter().map(|live| (live.text().to_owned(), self.short(live))).collect()
    }

    fn short(&self, live: &Live) -> String {
        match self.session.place(live) {
            Ok(Some((_, ty, Some(bits)))) => Shown::new(ty, bits).text,
            Ok(Some((.., None))) => "(never written)".to_owned(),
            _ => self.session.evaluate(live).map_or_else(|error| format!("({error})"), number),
        }
    }

    // ---- Positions.

    /// Where the session is.
    pub fn place(&mut self) -> String {
        format!("{}\n{}", panes::head(&mut self.session), self.at_hand())
    }

    /// The source line and the bundle at this position, and the calls that lead to it.
    pub(crate) fn at_hand(&self) -> String {
        let (session, mut text) = (&self.session, String::new());
        if let Some(location) = session.location()
            && let Some(line) = session.source_line(location)
        {
            let _ = writeln!(text, "{:>5}  {}", location.line, line.trim_end());
        }
        for (slot, operation) in panes::bundle(session) {
            if let Some(operation) = operation {
                let _ = writeln!(text, "    {slot:<4} {operation}");
            }
        }
        for call in panes::calls(session) {
            let _ = writeln!(text, "    called from {call}");
        }
        text
    }

    /// Says why it stopped, where, and what is displayed.
    fn arrive(&mut self, why: Why) -> Result<String, String> {
        let mut text = stops::told(why, &self.session);
        text.push_str(&self.place());
        for (name, value) in self.displayed() {
            let _ = writeln!(text, "    {name} = {value}");
        }
        Ok(text)
    }

    fn step(&mut self, arguments: &str, back: bool) -> Result<String, String> {
        let (unit, count) = steps(arguments)?;
        if unit == Unit::Cycle {
            // At once, however many.
            let now = self.session.cycle();
            let at = if back { now.saturating_sub(count) } else { now.saturating_add(count) };
            let why = if back && now == 0 { Why::Start } else { self.session.go_to(at) };
            return self.arrive(why);
        }
        let mut why = Why::Done;
        for _ in 0..count {
            why = if back { self.session.step_back(unit) } else { self.session.step(unit) };
            if why != Why::Done {
                break;
            }
        }
        self.arrive(why)
    }

    fn go(&mut self, arguments: &str) -> Result<String, String> {
        let why = match arguments.split_whitespace().collect::<Vec<_>>()[..] {
            ["start"] => self.session.go_to(0),
            [unit @ ("cycle" | "period"), number] => {
                let number = number.parse().map_err(|_| format!("`{number}` is no number of a {unit}"))?;
                match unit {
                    "cycle" => self.session.go_to(number),
                    _ => self.session.go_to_period(number),
                }
            }
            _ => return Err("goto takes `cycle N`, `period N` or `start`".to_owned()),
        };
        self.arrive(why)
    }

    // ---- The machine.

    fn flight(&self) -> String {
        let mut text = String::new();
        let flying = panes::flight(&self.session);
        let width = flying.iter().map(|row| row.register.len()).max().unwrap_or(0).max(12);
        for Flying { left, register, mnemonic, from } in flying {
            let cycles = if left == 1 { "cycle" } else { "cycles" };
            let _ = writeln!(text, "{left:>3} {cycles:<6}  {register:<width$} {mnemonic} of {from}");
        }
        if text.is_empty() { "nothing is in flight\n".to_owned() } else { text }
    }

    fn stalls(&self) -> String {
        let rows = panes::stalls(&self.session);
        rows.iter().map(|(cycles, what)| format!("{cycles:>10}  {what}\n")).collect()
    }

    fn list(&mut self, arguments: &str) -> Result<String, String> {
        let here = self.session.location();
        let line = match (arguments, here) {
            ("", Some(location)) => location.line,
            ("", None) => return Err("no source line belongs to this position".to_owned()),
            (text, _) => text.parse().map_err(|_| format!("`{text}` is no line number"))?,
        };
        let file = here.map_or(0, |location| location.file);
        let lines = panes::lines(&self.session, file, line.saturating_sub(5)..=line.saturating_add(5));
        let lines = lines.ok_or_else(|| {
            let name = self.session.program().files.get(file as usize).map_or("it", String::as_str);
            format!(
                "the program carries no source of {name}: an image does unless it is assembled with --strip"
            )
        })?;
        let mut text = String::new();
        for line in lines {
            let mark = if line.next { '>' } else { ' ' };
            let _ = writeln!(text, "{mark}{:>5}  {}", line.number, line.text);
        }
        Ok(text)
    }

    fn display(&mut self, arguments: &str) -> Result<String, String> {
        if arguments.is_empty() {
            self.displays.clear();
            return Ok(String::new());
        }
        let live = self.session.parse(arguments)?;
        let text = format!("{} = {}\n", live.text(), self.short(&live));
        self.displays.push(live);
        Ok(text)
    }
}

/// A computed value, and what binary32 makes of it.
fn number(value: Value) -> String {
    let Value::Real(real) = value else { return value.to_string() };
    let near = real as f32;
    if f64::from(near) == real {
        format!("{value}  {}", hex_float(near))
    } else {
        format!("{value}  (binary32: {near:?})")
    }
}
