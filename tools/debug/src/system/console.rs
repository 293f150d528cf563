//! Commands on a system's session: those that move all cores, and a single core's for what there is to see of the one selected.

use super::links::{link_named, link_text};
use super::{SystemSession, SystemStop, SystemWhy};
use crate::console::{Commands, Console, inspection, named, only_looks, steps, told};
use crate::session::{Place, Session, Stop, Unit};
use std::fmt::Write as _;
use takt_asm::nearest;
use takt_emu::Status;
use takt_isa::timing::Cause;
use takt_system::{Link, System};

type Run = fn(&mut SystemConsole, &str) -> Result<String, String>;

/// Name, short name, arguments, text, and what it does.
struct Row(&'static str, &'static str, &'static str, &'static str, Run);

const COMMANDS: &[Row] = &[
    Row("cores", "", "", "Where each core is; the selected one has a `>`.", |c, _| Ok(c.cores_text())),
    Row(
        "core",
        "",
        "NAME",
        "Select a core: commands that look at something, and steps, are about it.",
        SystemConsole::select,
    ),
    Row("links", "", "[NAME]", "What is on the links: values that arrived last, sets, entries.", |c, a| {
        c.links_text(a)
    }),
    Row(
        "step",
        "s",
        "[UNIT] [N]",
        "Step by a cycle of all cores, or a bundle (if nothing is said), line, period or call of the selected one (calls passed over); `out` of its subroutine.",
        |c, a| c.step(a, false),
    ),
    Row("back", "b", "[UNIT] [N]", "Step back by the same units.", |c, a| c.step(a, true)),
    Row("continue", "c", "", "Run on to a stop.", |c, _| {
        let why = c.run(SystemSession::resume);
        Ok(c.arrive(&why))
    }),
    Row("reverse", "rc", "", "Run back to one.", |c, _| {
        let why = c.run(SystemSession::resume_back);
        Ok(c.arrive(&why))
    }),
    Row("until", "u", "EXPR", "Run on until an expression over the selected core is not zero.", |c, a| {
        let (core, live) = (c.selected, c.views[c.selected].session.parse(a)?);
        let why = c.run(|session, views| session.run_until(views, core, live));
        Ok(c.arrive(&why))
    }),
    Row(
        "goto",
        "g",
        "PLACE",
        "Go to `cycle N`, or to `period N` of the selected core (so many have passed), or to the `start`, whichever way that is.",
        SystemConsole::go,
    ),
    Row(
        "break",
        "br",
        "PLACE [if EXPR]",
        "Stop at `link NAME [EVENT]`, or, as with a single core, where a bundle of the selected one is about to issue: `label`, `:12`, `bundle 3`; at `cycle N`, or its `period N`.",
        SystemConsole::add_break,
    ),
    Row(
        "watch",
        "w",
        "EXPR [== EXPR | > EXPR | nan | subnormal]",
        "Stop when a value of the selected core changes, or becomes equal, above, a NaN, a subnormal number.",
        |c, a| c.add_stop("watch", a),
    ),
    Row(
        "set",
        "",
        "PLACE = EXPR",
        "Set a register, port or data word of the selected core; links do not notice. What was run beyond this position is forgotten.",
        SystemConsole::set,
    ),
    Row("delete", "d", "[N]", "Remove a stop, or all.", SystemConsole::delete),
    Row("stops", "", "", "List stops.", |c, _| Ok(c.stops())),
    Row("where", "", "", "This position.", |c, _| Ok(c.place())),
    Row("help", "h", "", "This list.", |_, _| Ok(help())),
    Row("quit", "q", "", "Leave.", |c, _| {
        c.quit = true;
        Ok(String::new())
    }),
];

/// A single core's commands that a system's session has too.
fn of_one_core() -> impl Iterator<Item = &'static str> {
    inspection().filter(|name| COMMANDS.iter().all(|row| row.0 != *name))
}

/// Commands of these that neither move nor change anything.
const LOOKS: &[&str] = &["cores", "core", "links", "stops", "where"];

fn help() -> String {
    usages(|_| true)
}

fn looks_help() -> String {
    usages(|name| LOOKS.contains(&name))
}

fn usages(wanted: impl Fn(&str) -> bool) -> String {
    let mut text = String::new();
    for Row(name, short, arguments, what, _) in COMMANDS.iter().filter(|row| wanted(row.0)) {
        let _ = writeln!(text, "{short:<2} {:<20}  {what}", format!("{name} {arguments}"));
    }
    let _ = writeln!(
        text,
        "Of the selected core, as with a single one: {}.",
        of_one_core().collect::<Vec<_>>().join(", ")
    );
    text
}

/// A system's session with what commands add to it.
pub struct SystemConsole {
    /// The session.
    pub session: SystemSession,
    /// What there is to see of each core.
    views: Vec<Console>,
    selected: usize,
    quit: bool,
    /// The last step, which an empty line repeats.
    last: String,
}

/// What a line is.
enum Meant {
    Own(Run, bool),
    Inspection(&'static str),
}

fn find(name: &str) -> Result<Meant, String> {
    let moves = |row: &Row| ["step", "back", "continue", "reverse"].contains(&row.0);
    if let Some(row) = COMMANDS.iter().find(|row| row.0 == name || (row.1 == name && !name.is_empty())) {
        return Ok(Meant::Own(row.4, moves(row)));
    }
    if let Ok(known) = named(name)
        && inspection().any(|name| name == known)
    {
        return Ok(Meant::Inspection(known));
    }
    let mut meant = COMMANDS.iter().filter(|row| row.0.starts_with(name));
    if let (Some(row), None) = (meant.next(), meant.next()) {
        return Ok(Meant::Own(row.4, moves(row)));
    }
    if named(name).is_ok() {
        return Err(format!(
            "`{name}` is for a single core's session; a system's has not got it (`help` lists)"
        ));
    }
    let near = nearest(name, COMMANDS.iter().map(|row| row.0).chain(of_one_core()));
    let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
    Err(format!("there is no command `{name}`{near} (`help` lists them)"))
}

impl SystemConsole {
    /// Commands on a session; `views` has a session for each core, of its program, with its names and sources.
    pub fn new(session: SystemSession, views: Vec<Session>) -> SystemConsole {
        let views = views.into_iter().map(Console::new).collect();
        let mut console = SystemConsole { session, views, selected: 0, quit: false, last: String::new() };
        console.look();
        console
    }

    fn system(&self) -> &System {
        self.session.system()
    }

    /// Shows each core's state in its view.
    fn look(&mut self) {
        let mut views: Vec<&mut Session> = self.views.iter_mut().map(|view| &mut view.session).collect();
        self.session.show(&mut views);
    }

    /// Where the session is: the selected core's bundle.
    pub fn place(&mut self) -> String {
        let name = self.system().description().cores[self.selected].name.clone();
        format!("core {name}: {}", self.views[self.selected].place())
    }

    /// The number of cores.
    pub fn cores(&self) -> usize {
        self.views.len()
    }

    /// What there is to see of a core.
    pub fn core(&self, core: usize) -> Option<&Console> {
        self.views.get(core)
    }

    /// What there is to see of a core, for what needs to change caches. Its session is moved by [`SystemConsole::run`].
    pub fn core_mut(&mut self, core: usize) -> Option<&mut Console> {
        self.views.get_mut(core)
    }

    /// The core that is looked at: the last one that stopped, or was selected.
    pub fn selected(&self) -> usize {
        self.selected
    }

    /// Looks at a core, if there is such a one.
    pub fn select_core(&mut self, core: usize) {
        if core < self.views.len() {
            self.selected = core;
        }
    }

    /// Moves the session, whose cores' own sessions are the second argument, and looks at where it is then.
    pub fn run(
        &mut self,
        moves: impl FnOnce(&mut SystemSession, &mut [&mut Session]) -> SystemWhy,
    ) -> SystemWhy {
        let mut views: Vec<&mut Session> = self.views.iter_mut().map(|view| &mut view.session).collect();
        let why = moves(&mut self.session, &mut views);
        self.session.show(&mut views);
        // What is looked at next is where it has stopped.
        match &why {
            SystemWhy::Core(core, _) => self.selected = *core,
            SystemWhy::Fault(fault) => self.selected = fault.core,
            _ => {}
        }
        why
    }

    /// Adds a stop of a core's own session; its number, which is that of no other stop of the system.
    pub fn add_core_stop(&mut self, core: usize, stop: Stop) -> Option<u32> {
        let view = &mut self.views.get_mut(core)?.session;
        *view.next_stop() = *self.session.next_stop();
        let id = view.add_stop(stop);
        *self.session.next_stop() = *view.next_stop();
        Some(id)
    }

    /// Removes a stop, of links or of a core; whether there was one.
    pub fn remove_stop(&mut self, id: u32) -> bool {
        self.session.remove_stop(id) || self.views.iter_mut().any(|view| view.session.remove_stop(id))
    }

    /// Sets a register or a data word of a core. What was recorded of the run after this position is forgotten.
    ///
    /// # Errors
    /// If there is no such place.
    pub fn set_place(&mut self, core: usize, place: Place, bits: u32) -> Result<(), String> {
        let view = self.views.get_mut(core).ok_or("there is no such core")?;
        // Whether there is such a place is known there.
        view.session.set(place, bits)?;
        self.session.set(core, place, bits);
        self.look();
        Ok(())
    }

    fn arrive(&mut self, why: &SystemWhy) -> String {
        let mut text = match why {
            SystemWhy::Done => String::new(),
            SystemWhy::Core(core, why) => told(why.clone(), &self.views[*core].session),
            SystemWhy::Stop(id) => {
                let known = self.session.stops().find(|(known, _)| known == id);
                format!("stop {id}: {}\n", known.map_or("", |(_, text)| text))
            }
            SystemWhy::Start => "the beginning of the run\n".to_owned(),
            SystemWhy::Halted => "every core has halted\n".to_owned(),
            SystemWhy::InputsEnd => "the recorded inputs end here\n".to_owned(),
            SystemWhy::Fault(fault) => {
                format!(
                    "core {}:\n{}",
                    fault.name,
                    self.views[fault.core].session.diagnose(&fault.fault).render(false)
                )
            }
            SystemWhy::Limit(cycles) => format!("nothing to stop at in {cycles} cycles\n"),
            SystemWhy::Interrupted => "interrupted\n".to_owned(),
            SystemWhy::Host(error) => format!("{error}\n"),
        };
        text.push_str(&self.place());
        for (name, value) in self.views[self.selected].displayed() {
            let _ = writeln!(text, "    {name} = {value}");
        }
        text
    }

    fn links_text(&self, wanted: &str) -> Result<String, String> {
        let system = self.system();
        let description = system.description();
        let wanted = (!wanted.is_empty()).then(|| link_named(wanted, description)).transpose()?;
        let shown = |(link, _): &(usize, &Link)| wanted.is_none_or(|wanted| wanted == *link);
        let links = description.links.iter().enumerate().filter(shown);
        Ok(links.map(|(link, row)| format!("{}: {}\n", row.name, link_text(system, link))).collect())
    }

    fn cores_text(&mut self) -> String {
        let names: Vec<String> =
            self.system().description().cores.iter().map(|core| core.name.clone()).collect();
        let width = names.iter().map(String::len).max().unwrap_or(0);
        let mut text =
            format!("cycle {}, {} turns of the host\n", self.session.cycle(), self.session.turns());
        for (core, name) in names.iter().enumerate() {
            let mark = if core == self.selected { '>' } else { ' ' };
            let session = &mut self.views[core].session;
            let address = session.emulator().next_address();
            let bundle = session.program().bundle_text(address);
            let state = match session.emulator().status() {
                Status::Halted { .. } => "has halted".to_owned(),
                Status::Faulted(fault) => format!("stopped with a fault: {fault}"),
                Status::Waiting { .. } => format!("waits for its tick, then {bundle}"),
                Status::Running => match session.stall() {
                    None => format!("issues {bundle}"),
                    Some(Cause::Wait) => format!("waits for its tick, then {bundle}"),
                    Some(cause) => format!("{bundle} waits: {}", session.program().cause_text(cause)),
                },
            };
            let _ = writeln!(text, "{mark} {name:<width$}  {state}");
        }
        text
    }

    fn select(&mut self, name: &str) -> Result<String, String> {
        let description = self.system().description();
        let Some(core) = description.core_named(name) else {
            let names: Vec<&str> = description.cores.iter().map(|core| core.name.as_str()).collect();
            return Err(format!("there is no core `{name}` (cores: {})", names.join(" ")));
        };
        self.selected = core;
        Ok(self.place())
    }

    /// Carries a command out whose arguments are about the selected core, or name another one's values as `core.name`. What it
    /// says is then preceded by the core's name, and the selected one stays selected unless the session moves.
    fn of_a_core(
        &mut self,
        arguments: &str,
        run: impl Fn(&mut SystemConsole, &str) -> Result<String, String>,
    ) -> Result<String, String> {
        let names = self.system().description().cores.iter().map(|core| core.name.as_str());
        let (cores, own) = core_names(arguments, &names.collect::<Vec<_>>());
        let error = match run(self, arguments) {
            // A name of the selected core's own program comes first.
            Err(error) if !cores.is_empty() => error,
            result => return result,
        };
        let [core] = cores[..] else {
            return Err(format!(
                "{error} (one command is about one core: each core's names in one of its own)"
            ));
        };
        let (selected, cycle) = (self.selected, self.session.cycle());
        self.selected = core;
        let result = run(self, &own);
        if result.is_err() || self.session.cycle() == cycle {
            self.selected = selected;
        }
        let name = &self.system().description().cores[core].name;
        result.map(|said| format!("core {name}: {said}")).map_err(|error| format!("core {name}: {error}"))
    }

    fn step(&mut self, arguments: &str, back: bool) -> Result<String, String> {
        let (unit, count) = steps(arguments)?;
        if unit == Unit::Cycle {
            // At once, however many.
            let now = self.session.cycle();
            let at = if back { now.saturating_sub(count) } else { now.saturating_add(count) };
            let why = self.run(|session, _| match (back, now) {
                (true, 0) => SystemWhy::Start,
                _ => session.go_to(at),
            });
            return Ok(self.arrive(&why));
        }
        let core = self.selected;
        let mut why = SystemWhy::Done;
        for _ in 0..count {
            why = self.run(|session, views| match back {
                true => session.step_back(views, core, unit),
                false => session.step(views, core, unit),
            });
            if why != SystemWhy::Done {
                break;
            }
        }
        Ok(self.arrive(&why))
    }

    fn go(&mut self, arguments: &str) -> Result<String, String> {
        let core = self.selected;
        let why = match arguments.split_whitespace().collect::<Vec<_>>()[..] {
            ["start"] => self.run(|session, _| session.go_to(0)),
            [unit @ ("cycle" | "period"), number] => {
                let number = number.parse().map_err(|_| format!("`{number}` is no number of a {unit}"))?;
                self.run(|session, _| match unit {
                    "cycle" => session.go_to(number),
                    _ => session.go_to_period(core, number),
                })
            }
            _ => return Err("goto takes `cycle N`, `period N` or `start`".to_owned()),
        };
        Ok(self.arrive(&why))
    }

    fn add_break(&mut self, arguments: &str) -> Result<String, String> {
        let Some(link) = SystemStop::parse(arguments, self.system().description()) else {
            return self.add_stop("break", arguments);
        };
        let (stop, text) = (link?, format!("break {arguments}"));
        let id = self.session.add_stop(stop, text.clone());
        Ok(format!("stop {id}: {text}\n"))
    }

    /// Adds a stop of the selected core's own session.
    fn add_stop(&mut self, command: &str, arguments: &str) -> Result<String, String> {
        let view = &mut self.views[self.selected];
        *view.session.next_stop() = *self.session.next_stop();
        let said = view.execute(&format!("{command} {arguments}"))?;
        *self.session.next_stop() = *view.session.next_stop();
        Ok(said)
    }

    /// Each with its number and text, and that of the core's name, in the order of their numbers.
    fn all_stops(&self) -> Vec<(u32, String)> {
        let mut stops: Vec<(u32, String)> =
            self.session.stops().map(|(id, text)| (id, text.to_owned())).collect();
        for (view, core) in self.views.iter().zip(&self.system().description().cores) {
            let own = view.session.stops().iter();
            stops.extend(own.map(|(id, stop)| (*id, format!("{} of core {}", stop.text(), core.name))));
        }
        stops.sort();
        stops
    }

    fn stops(&self) -> String {
        self.all_stops().into_iter().map(|(id, text)| format!("{id:>3}  {text}\n")).collect()
    }

    fn set(&mut self, arguments: &str) -> Result<String, String> {
        let (place, bits, text) = self.views[self.selected].setting(arguments)?;
        self.set_place(self.selected, place, bits)?;
        Ok(text)
    }

    fn delete(&mut self, arguments: &str) -> Result<String, String> {
        let all = self.all_stops();
        if !arguments.is_empty() {
            let id = arguments.parse().ok().filter(|id| self.remove_stop(*id));
            let unknown = || format!("there is no stop {arguments} (`stops` lists them)");
            return id.map(|_| String::new()).ok_or_else(unknown);
        }
        let removed = all.into_iter().filter(|(id, _)| self.remove_stop(*id)).count();
        Ok(format!("{removed} removed\n"))
    }
}

/// The cores whose names are before a dot in a text, each once, and the text without them: `outer.p` is `p` of core `outer`.
fn core_names(text: &str, names: &[&str]) -> (Vec<usize>, String) {
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
    let (mut cores, mut own, mut rest) = (Vec::new(), String::new(), text);
    while !rest.is_empty() {
        let end = rest.find(|c| !is_name(c)).unwrap_or(rest.len());
        let (word, behind) = rest.split_at(end);
        let found = word.split_once('.').and_then(|(core, name)| {
            Some((names.iter().position(|known| *known == core)?, name)).filter(|_| !name.is_empty())
        });
        match found {
            Some((core, name)) => {
                own.push_str(name);
                if !cores.contains(&core) {
                    cores.push(core);
                }
            }
            None => own.push_str(word),
        }
        // What is between two words.
        let next = behind.find(is_name).unwrap_or(behind.len());
        own.push_str(&behind[..next]);
        rest = &behind[next..];
    }
    (cores, own)
}

impl Commands for SystemConsole {
    fn execute(&mut self, line: &str) -> Result<String, String> {
        let repeated = self.last.clone();
        let line = if line.trim().is_empty() { &repeated } else { line };
        let Some((name, arguments)) = crate::console::split(line) else { return Ok(String::new()) };
        match find(name)? {
            Meant::Own(run, moves) => {
                self.last = if moves { line.to_owned() } else { String::new() };
                self.of_a_core(arguments, run)
            }
            Meant::Inspection(known) => {
                self.last.clear();
                self.of_a_core(arguments, |console, arguments| {
                    console.views[console.selected].execute(&format!("{known} {arguments}"))
                })
            }
        }
    }

    fn look(&mut self, line: &str) -> Option<Result<String, String>> {
        let (name, arguments) = crate::console::split(line)?;
        match COMMANDS.iter().find(|row| row.0 == name || (row.1 == name && !name.is_empty())) {
            Some(Row("help", ..)) => Some(Ok(looks_help())),
            Some(row) if LOOKS.contains(&row.0) => Some(row.4(self, arguments)),
            Some(row) => Some(Err(only_looks(row.0))),
            None => Some(self.of_a_core(arguments, |console, arguments| {
                let looked = console.views[console.selected].look(&format!("{name} {arguments}"));
                looked.unwrap_or_else(|| Ok(String::new()))
            })),
        }
    }

    fn quit(&self) -> bool {
        self.quit
    }

    fn place(&mut self) -> String {
        SystemConsole::place(self)
    }

    fn complete(&self, line: &str) -> (usize, Vec<String>) {
        if line.trim_start().contains(' ') {
            return self.views[self.selected].complete(line);
        }
        let start = line.len() - line.trim_start().len();
        let names = COMMANDS.iter().map(|row| row.0).chain(of_one_core());
        (start, names.filter(|name| name.starts_with(&line[start..])).map(str::to_owned).collect())
    }

    fn mistake(line: &str) -> Option<String> {
        find(crate::console::split(line)?.0).err()
    }
}
