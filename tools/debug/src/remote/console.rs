//! Commands on a machine that runs elsewhere: its own, which move it a period at a time, and those of a single session that inspect.

use super::{Activity, RemoteError, RemoteSession, RemoteWhy};
use crate::console::{Commands, Completion, Console, inspection, named, only_looks, split, told};
use crate::panes;
use crate::session::{Place, Session, Where};
use std::fmt::Write as _;
use takt_asm::nearest;

type Run = fn(&mut RemoteConsole, &str) -> Result<String, String>;

/// Name, short name, arguments, text, completion, and what it does.
struct Row(&'static str, &'static str, &'static str, &'static str, Completion, Run);

#[rustfmt::skip]
const COMMANDS: &[Row] = &[
    Row("step", "s", "[period] [N]", "Run one period, or N.", Completion::Words(&["period"]), RemoteConsole::step),
    Row("continue", "c", "", "Run, a period at a time, to a stop. If none is set, run freely until Ctrl-C.", Completion::None, |c, _| c.resume()),
    Row("until", "u", "EXPR", "Run, a period at a time, until an expression is not zero.", Completion::Names, RemoteConsole::until),
    Row("goto", "g", "PLACE", "`period N`: run until N periods have passed. `start`: start again, held at the first `wait`.", Completion::Words(&["period", "start"]), RemoteConsole::go_to),
    Row("break", "br", "period N [if EXPR]", "Stop when N periods have passed.", Completion::Names, RemoteConsole::add_break),
    Row("watch", "w", "EXPR [== EXPR | > EXPR | nan | subnormal]", "Stop after the period in which a value changes, or becomes equal, above, a NaN, a subnormal number.", Completion::Names, |c, a| c.view.execute(&format!("watch {a}"))),
    Row("delete", "d", "[N]", "Remove a stop, or all.", Completion::None, |c, a| c.view.execute(&format!("delete {a}"))),
    Row("stops", "", "", "List stops.", Completion::None, |c, _| c.view.execute("stops")),
    Row("set", "", "PORT = EXPR", "Set an input port for the periods to come.", Completion::Names, RemoteConsole::set),
    Row("hold", "", "", "No more ticks: the program waits at the end of its period, and values can be read. Outputs keep what they drive.", Completion::None, |c, _| c.hold()),
    Row("go", "", "", "Let it run.", Completion::None, |c, _| c.go()),
    Row("where", "", "", "Where the program is.", Completion::None, |c, _| Ok(c.place())),
    Row("help", "h", "[COMMAND]", "This list, or one command.", Completion::None, |_, a| help(a)),
    Row("quit", "q", "", "Leave. A program that ran when the session began runs again, unless `hold` or `goto start` was given.", Completion::None, |c, _| { c.quit = true; Ok(String::new()) }),
];

/// A single session's commands that do not exist here, and why.
const REFUSED: &[(&str, &str)] = &[
    ("back", BACK),
    ("reverse", BACK),
    ("flight", "between two periods nothing is in flight"),
    ("stalls", "the circuit does not count stalls; `takt bound` and `takt analyse` show them"),
    (
        "accuracy",
        "it needs every operation from reset on, and the circuit shows only the ends of periods; use `takt debug` without --board",
    ),
];
const BACK: &str =
    "a circuit does not go back; `goto start` starts it again, and `takt debug` without --board goes back";

/// Why what a single session does inside a period is refused.
const INSIDE: &str = "a board stops only between two periods; `takt debug` without --board stops anywhere";

/// The commands of a single session that inspect, and that exist here.
fn of_view() -> impl Iterator<Item = &'static str> {
    let own = |name: &str| COMMANDS.iter().any(|row| row.0 == name);
    let refused = |name: &str| REFUSED.iter().any(|(refused, _)| *refused == name);
    inspection().filter(move |name| !own(name) && !refused(name))
}

/// What a line is.
enum Meant {
    Own(&'static Row),
    View(&'static str),
}

fn find(name: &str) -> Result<Meant, String> {
    let is = |row: &&Row| row.0 == name || (row.1 == name && !name.is_empty());
    if let Some(row) = COMMANDS.iter().find(is) {
        return Ok(Meant::Own(row));
    }
    if let Ok(known) = named(name) {
        if let Some((_, why)) = REFUSED.iter().find(|(refused, _)| *refused == known) {
            return Err(format!("`{known}`: {why}"));
        }
        if let Some(known) = of_view().find(|name| *name == known) {
            return Ok(Meant::View(known));
        }
    }
    let mut meant = COMMANDS.iter().filter(|row| row.0.starts_with(name));
    match (meant.next(), meant.next()) {
        (Some(row), None) => Ok(Meant::Own(row)),
        (Some(a), Some(b)) => Err(format!("`{name}` may be `{}` or `{}`", a.0, b.0)),
        (None, _) => {
            let near = nearest(name, COMMANDS.iter().map(|row| row.0).chain(of_view()));
            let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            Err(format!("there is no command `{name}`{near} (`help` lists them)"))
        }
    }
}

fn help(name: &str) -> Result<String, String> {
    let mut text = String::new();
    if !name.is_empty() {
        return match find(name)? {
            Meant::View(known) => crate::console::help(known),
            Meant::Own(Row(name, _, arguments, what, ..)) => {
                Ok(format!("{}\n  {what}\n", format!("{name} {arguments}").trim_end()))
            }
        };
    }
    for Row(name, short, arguments, what, ..) in COMMANDS {
        let _ = writeln!(text, "{short:<2} {:<20}  {what}", format!("{name} {arguments}"));
    }
    let _ = writeln!(
        text,
        "While the program is held, as without --board: {}.",
        of_view().collect::<Vec<_>>().join(", ")
    );
    text.push_str("An empty line repeats a step. Expressions are the assembler's, over live values; also `period address`.\n");
    Ok(text)
}

/// How the machine is left when the session ends.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Leave {
    Running,
    AsItIs,
}

/// A session with what commands add to it.
pub struct RemoteConsole {
    session: RemoteSession,
    /// What there is to see.
    view: Console,
    /// Whether somebody can press Ctrl-C.
    interactive: bool,
    leave: Option<Leave>,
    quit: bool,
    /// The last step, which an empty line repeats.
    last: String,
}

impl RemoteConsole {
    /// Commands on a machine, which is held, or started again if `restart` is set; `view` is a session of its program, with its names
    /// and sources. Returned with them: what to print first.
    ///
    /// # Errors
    /// If the machine does not answer. A program that does not reach its `wait` is no error.
    pub fn new(
        session: RemoteSession,
        view: Session,
        restart: bool,
        interactive: bool,
    ) -> Result<(RemoteConsole, String), String> {
        let runs = session.state().activity == Activity::Runs;
        let leave = Some(if runs && !restart { Leave::Running } else { Leave::AsItIs });
        let view = Console::new(view);
        let mut console =
            RemoteConsole { session, view, interactive, leave, quit: false, last: String::new() };
        let begun = if restart { console.session.restart() } else { console.session.hold() };
        let said = match console.arrive(begun) {
            Ok(said) => said,
            // A difference, or a program that does not wait.
            Err(said)
                if console.session.is_settled() || console.session.state().activity == Activity::InPeriod =>
            {
                format!("{said}\n")
            }
            Err(said) => return Err(said),
        };
        Ok((console, said))
    }

    /// The session.
    pub fn session(&self) -> &RemoteSession {
        &self.session
    }

    fn drive(&self) -> &'static str {
        if self.session.state().drives { "outputs drive" } else { "outputs are safe" }
    }

    /// What to print when a command has moved the machine: a difference is an error, so that a script fails.
    fn arrive(&mut self, moved: Result<RemoteWhy, RemoteError>) -> Result<String, String> {
        let why = match moved {
            Ok(why) => why,
            Err(error) if self.session.state().activity == Activity::InPeriod => {
                return Err(format!("{error}\n{}", self.place().trim_end()));
            }
            Err(error) => return Err(error.to_string()),
        };
        self.session.show(&mut self.view.session);
        let (mut text, different) = match why {
            RemoteWhy::Of(why) => (told(why, &self.view.session), None),
            RemoteWhy::Fault(Some(fault)) => (self.view.session.diagnose(&fault).render(false), None),
            RemoteWhy::Fault(None) => (String::new(), None),
            RemoteWhy::Different(text) => (String::new(), Some(text)),
            RemoteWhy::Limit(periods) => (format!("nothing to stop at in {periods} periods\n"), None),
        };
        text.push_str(&self.place());
        for (name, value) in self.view.displayed() {
            let _ = writeln!(text, "    {name} = {value}");
        }
        match different {
            None => Ok(text),
            Some(different) => Err(format!("{different}\n{}", text.trim_end())),
        }
    }

    /// Checks that values can be read; the error says why not.
    fn needs_values(&self) -> Result<(), String> {
        match &self.session.state().activity {
            Activity::Runs => Err("the program runs: `hold` first".to_owned()),
            Activity::InPeriod => {
                Err("the program is in a period: `hold` waits for its end, `goto start` starts it again"
                    .to_owned())
            }
            _ if !self.session.is_settled() => {
                Err("what the program does is not known: `hold` asks again".to_owned())
            }
            _ => Ok(()),
        }
    }

    /// Checks that a period can be run; the error says why not.
    fn needs_held(&self) -> Result<(), String> {
        self.needs_values()?;
        let state = match self.session.state().activity {
            Activity::Stopped => "is stopped",
            Activity::Halted => "has halted",
            Activity::Faulted(..) => "has stopped with a fault",
            _ => return Ok(()),
        };
        Err(format!("the program {state}: `goto start` starts it again"))
    }

    fn advance(&mut self, count: Option<u64>, goal: Option<super::Goal>) -> Result<String, String> {
        let moved = self.session.advance(&mut self.view.session, count, goal);
        self.arrive(moved)
    }

    fn step(&mut self, arguments: &str) -> Result<String, String> {
        let mut count = 1;
        for word in arguments.split_whitespace() {
            match word {
                "period" => {}
                "cycle" | "bundle" | "line" | "call" | "out" => {
                    return Err(format!("`step {word}`: {INSIDE}"));
                }
                number => {
                    count = number.parse().ok().filter(|count| *count > 0).ok_or_else(|| {
                        format!("`{number}` is no number of periods; step takes `period` and how many")
                    })?;
                }
            }
        }
        self.needs_held()?;
        self.advance(Some(count), None)
    }

    fn resume(&mut self) -> Result<String, String> {
        self.needs_held()?;
        if let Some(goal) = self.session.goal(&self.view.session, None) {
            return self.advance(None, Some(goal));
        }
        if !self.interactive {
            return Err(
                "there is nothing to stop at: `break period N`, `watch EXPR` or `until EXPR`; `go` lets it run"
                    .to_owned(),
            );
        }
        let moved = self.session.run_freely();
        self.arrive(moved)
    }

    fn until(&mut self, arguments: &str) -> Result<String, String> {
        let live = self.view.session.parse(arguments)?;
        self.needs_held()?;
        let goal = self.session.goal(&self.view.session, Some(live));
        self.advance(None, goal)
    }

    fn go_to(&mut self, arguments: &str) -> Result<String, String> {
        match arguments.split_whitespace().collect::<Vec<_>>()[..] {
            ["start"] => {
                self.leave = Some(Leave::AsItIs);
                let moved = self.session.restart();
                self.arrive(moved)
            }
            ["period", number] => {
                let number: u64 =
                    number.parse().map_err(|_| format!("`{number}` is no number of a period"))?;
                self.needs_held()?;
                match number.checked_sub(self.session.state().periods) {
                    Some(count) => self.advance(Some(count), None),
                    None => Err(format!("`goto period {number}`: {BACK}")),
                }
            }
            ["cycle", _] => Err(format!("`goto cycle`: {INSIDE}")),
            _ => Err("goto takes `period N` or `start`".to_owned()),
        }
    }

    fn add_break(&mut self, arguments: &str) -> Result<String, String> {
        let place = arguments.split_once(" if ").map_or(arguments, |(place, _)| place);
        match Where::parse(place, self.session.program())? {
            Where::Period(_) => self.view.execute(&format!("break {arguments}")),
            _ => Err(format!("`break {place}`: {INSIDE}")),
        }
    }

    fn set(&mut self, arguments: &str) -> Result<String, String> {
        self.needs_values()?;
        let (place, bits, text) = self.view.setting(arguments)?;
        let inputs = &self.session.program().inputs;
        let port = inputs.iter().map(|port| port.register).find(|port| place == Place::Register(*port));
        let port = port.ok_or(
            "only input ports can be set on a board: the host cannot write other registers or data words",
        )?;
        self.session.set_input(port, bits).map_err(|error| error.to_string())?;
        self.session.show(&mut self.view.session);
        Ok(text)
    }

    fn hold(&mut self) -> Result<String, String> {
        self.leave = Some(Leave::AsItIs);
        if self.needs_values().is_ok() {
            return Ok(self.place());
        }
        let moved = self.session.hold();
        self.arrive(moved)
    }

    fn go(&mut self) -> Result<String, String> {
        if self.session.state().activity != Activity::Runs {
            self.needs_held().or_else(|why| match self.session.state().activity {
                Activity::InPeriod => Ok(()),
                _ => Err(why),
            })?;
        }
        self.session.go().map_err(|error| error.to_string())?;
        self.leave = Some(Leave::Running);
        Ok(self.place())
    }

    /// Leaves the machine as it was found, or as was asked for since; returns what it then does, in words.
    ///
    /// # Errors
    /// If it does not answer.
    fn release(&mut self) -> Result<String, String> {
        let Some(leave) = self.leave.take() else { return Ok(String::new()) };
        let known = if self.session.is_settled() { Ok(()) } else { self.session.ask() };
        let held = matches!(self.session.state().activity, Activity::Held | Activity::InPeriod);
        let left = match known {
            Ok(()) if leave == Leave::Running && held => self.session.go(),
            known => known,
        };
        left.map_err(|error| error.to_string())?;
        let drive = self.drive();
        Ok(match self.session.state().activity {
            Activity::Runs => format!("the program runs; {drive}\n"),
            Activity::Held | Activity::InPeriod => format!("the program stays held; {drive}\n"),
            Activity::Stopped => format!("the program is stopped; {drive}\n"),
            Activity::Halted => format!("the program has halted; {drive}\n"),
            Activity::Faulted(..) => format!("the program has stopped with a fault; {drive}\n"),
        })
    }
}

/// However the session ends, that alone does not leave the machine held.
impl Drop for RemoteConsole {
    fn drop(&mut self) {
        let _ = self.release();
    }
}

impl Commands for RemoteConsole {
    fn execute(&mut self, line: &str) -> Result<String, String> {
        let repeated = self.last.clone();
        let line = if line.trim().is_empty() { &repeated } else { line };
        let Some((name, arguments)) = split(line) else { return Ok(String::new()) };
        match find(name)? {
            Meant::Own(Row(name, .., run)) => {
                let moves = ["step", "continue"].contains(name);
                self.last = if moves { line.to_owned() } else { String::new() };
                run(self, arguments)
            }
            Meant::View(known) => {
                self.last.clear();
                if !["echo", "list"].contains(&known) {
                    self.needs_values()?;
                }
                self.view.execute(&format!("{known} {arguments}"))
            }
        }
    }

    fn look(&mut self, line: &str) -> Option<Result<String, String>> {
        let (name, _) = split(line)?;
        match find(name).ok()? {
            Meant::Own(Row(name, ..)) => Some(Err(only_looks(name))),
            Meant::View(_) => Some(self.execute(line)),
        }
    }

    fn quit(&self) -> bool {
        self.quit
    }

    /// Where the program is.
    fn place(&mut self) -> String {
        let (state, drive) = (self.session.state().clone(), self.drive());
        let (periods, issued) = (state.periods, self.session.program().bundle_text(state.issued));
        match state.activity {
            Activity::Runs => format!("period {periods}: runs; {drive}\n"),
            Activity::Stopped => format!("stopped, in reset; {drive}\n"),
            Activity::InPeriod => {
                format!("period {periods}: has not come to its `wait`; {issued} issued last; {drive}\n")
            }
            _ if !self.session.is_settled() => {
                format!("period {periods}: not known further; {issued} issued last\n")
            }
            Activity::Faulted(address, reason) => {
                let at = self.session.program().bundle_text(address);
                format!("period {periods}: stopped with a fault, {reason}, in {at}; {drive}\n")
            }
            Activity::Held | Activity::Halted => {
                format!("{}; {drive}\n{}", panes::head(&mut self.view.session), self.view.at_hand())
            }
        }
    }

    fn complete(&self, line: &str) -> (usize, Vec<String>) {
        let start = line.len() - line.trim_start().len();
        let matching = |start: usize, names: &mut dyn Iterator<Item = &'static str>| {
            let found = names.filter(|name| name.starts_with(&line[start..])).map(str::to_owned).collect();
            (start, found)
        };
        let Some((command, _)) = line.trim_start().split_once(' ') else {
            return matching(start, &mut COMMANDS.iter().map(|row| row.0).chain(of_view()));
        };
        let word = line.rfind(' ').map_or(0, |at| at + 1);
        match find(command) {
            Ok(Meant::Own(Row(.., Completion::Words(words), _))) => {
                matching(word, &mut words.iter().copied())
            }
            Ok(Meant::Own(Row(.., Completion::None, _))) | Err(_) => (word, Vec::new()),
            // Names are completed as in a single session.
            Ok(_) => self.view.complete(line),
        }
    }

    fn leave(&mut self) -> Result<String, String> {
        self.release()
    }

    fn counts(&self) -> &'static str {
        "period"
    }

    fn mistake(line: &str) -> Option<String> {
        find(split(line)?.0).err()
    }
}
