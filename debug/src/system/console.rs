//! Commands on a system's session: those that move all cores, and a single core's for what there is to see of the one selected.

use super::{Step, SystemSession, SystemStop, SystemWhy};
use crate::console::{Commands, Console, INSPECTION, named, told};
use crate::session::{Session, Shown};
use std::fmt::Write as _;
use takt_asm::nearest;
use takt_emu::Status;
use takt_isa::timing::Cause;
use takt_system::{End, LinkEventKind, LinkKind, System};

type Run = fn(&mut SystemConsole, &str) -> Result<String, String>;

/// Name, short name, arguments, text, and what it does.
struct Row(&'static str, &'static str, &'static str, &'static str, Run);

const COMMANDS: &[Row] = &[
    Row("cores", "", "", "Where each core is; the selected one has a `>`.", |c, _| Ok(c.cores())),
    Row(
        "core",
        "",
        "NAME",
        "Select a core: commands that look at something, and `step bundle`, are about it.",
        SystemConsole::select,
    ),
    Row("links", "", "[NAME]", "What is on the links: values that arrived last, sets, entries.", |c, a| {
        c.links(a)
    }),
    Row(
        "step",
        "s",
        "[UNIT] [N]",
        "Step by a cycle of all cores, or a bundle (if nothing is said) or period of the selected one.",
        |c, a| c.step(a, false),
    ),
    Row("back", "b", "[UNIT] [N]", "Step back by the same units.", |c, a| c.step(a, true)),
    Row("continue", "c", "", "Run on to a stop.", |c, _| {
        let why = c.session.resume(&mut sessions(&mut c.views));
        Ok(c.arrive(&why))
    }),
    Row("reverse", "rc", "", "Run back to one.", |c, _| {
        let why = c.session.resume_back(&mut sessions(&mut c.views));
        Ok(c.arrive(&why))
    }),
    Row("until", "u", "EXPR", "Run on until an expression over the selected core is not zero.", |c, a| {
        let live = c.views[c.selected].session.parse(a)?;
        let why = c.session.run_until(&mut sessions(&mut c.views), c.selected, live);
        Ok(c.arrive(&why))
    }),
    Row(
        "goto",
        "g",
        "PLACE",
        "Go to `cycle N`, so many having passed, or to the `start`, whichever way that is.",
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

const EVENTS: [LinkEventKind; 8] = [
    LinkEventKind::Value(0),
    LinkEventKind::Published,
    LinkEventKind::Taken,
    LinkEventKind::Skipped,
    LinkEventKind::Pushed,
    LinkEventKind::Popped,
    LinkEventKind::Overflow,
    LinkEventKind::Underflow,
];

fn help() -> String {
    let mut text = String::new();
    for Row(name, short, arguments, what, _) in COMMANDS {
        let _ = writeln!(text, "{short:<2} {:<20}  {what}", format!("{name} {arguments}"));
    }
    let _ = writeln!(text, "Of the selected core, as with a single one: {}.", INSPECTION.join(", "));
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

/// The cores' own sessions.
fn sessions(views: &mut [Console]) -> Vec<&mut Session> {
    views.iter_mut().map(|view| &mut view.session).collect()
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
        && INSPECTION.contains(&known)
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
    let near = nearest(name, COMMANDS.iter().map(|row| row.0).chain(INSPECTION.iter().copied()));
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
        let system = self.session.system();
        for (core, view) in self.views.iter_mut().enumerate() {
            view.session.look(system.core(core).clone(), system.periods(core).count, false);
        }
    }

    /// Where the session is: the selected core's bundle.
    pub fn place(&mut self) -> String {
        let name = self.system().description().cores[self.selected].name.clone();
        format!("core {name}: {}", self.views[self.selected].place())
    }

    fn arrive(&mut self, why: &SystemWhy) -> String {
        self.look();
        let mut text = match why {
            SystemWhy::Done => String::new(),
            SystemWhy::Core(core, why) => {
                // What is looked at next is where it has stopped.
                self.selected = *core;
                told(why.clone(), &self.views[*core].session)
            }
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

    fn cores(&mut self) -> String {
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

    fn links(&self, wanted: &str) -> Result<String, String> {
        let system = self.system();
        let description = system.description();
        if !wanted.is_empty() {
            self.link(wanted)?;
        }
        let mut text = String::new();
        for (number, link) in description.links.iter().enumerate() {
            if !wanted.is_empty() && link.name != wanted {
                continue;
            }
            let value = |bits: u32, field: usize| Shown::new(link.fields[field].ty, bits).text;
            let values = |bits: &[u32]| {
                let each = bits.iter().enumerate().map(|(field, &bits)| value(bits, field));
                each.collect::<Vec<_>>().join(", ")
            };
            let state = match link.kind {
                LinkKind::Fifo { depth, .. } => {
                    let entries = system.fifo_entries(number);
                    let shown: Vec<String> =
                        entries.iter().map(|entry| format!("({})", values(entry))).collect();
                    let counts = system.fifo_counts(number).unwrap_or_default();
                    format!(
                        "{} of {depth} entries {}; {} refused when full, {} asked for when empty",
                        entries.len(),
                        shown.join(" "),
                        counts.overflows,
                        counts.underflows
                    )
                }
                _ => {
                    // What the receiver has.
                    let seen: Vec<u32> = link
                        .fields
                        .iter()
                        .map(|field| match (link.to, field.input) {
                            (End::Core(core), Some(register)) => {
                                system.core(core).register(register).unwrap_or(0)
                            }
                            _ => {
                                let name = match link.kind {
                                    LinkKind::Wire => field.to.clone(),
                                    _ => format!("{}.{}", link.name, field.to),
                                };
                                system.output(&name).unwrap_or(0)
                            }
                        })
                        .collect();
                    format!("the receiver has {}", values(&seen))
                }
            };
            let _ = writeln!(text, "{}: {state}", link.name);
        }
        Ok(text)
    }

    fn link(&self, name: &str) -> Result<usize, String> {
        let description = self.system().description();
        description.link_named(name).ok_or_else(|| {
            let names: Vec<&str> = description.links.iter().map(|link| link.name.as_str()).collect();
            let near = nearest(name, names.iter().copied());
            let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            format!("there is no link `{name}`{near} (links: {})", names.join(", "))
        })
    }

    fn step(&mut self, arguments: &str, back: bool) -> Result<String, String> {
        let (mut step, mut count) = (Step::Bundle(self.selected), 1u64);
        for word in arguments.split_whitespace() {
            step = match word {
                "cycle" => Step::Cycle,
                "bundle" => Step::Bundle(self.selected),
                "period" => Step::Period(self.selected),
                number => {
                    count = number.parse().ok().filter(|count| *count > 0).ok_or_else(|| {
                        format!("`{number}` is neither a count nor one of cycle bundle period")
                    })?;
                    continue;
                }
            };
        }
        if step == Step::Cycle {
            let now = self.session.cycle();
            let at = if back { now.saturating_sub(count) } else { now.saturating_add(count) };
            let why = if back && now == 0 { SystemWhy::Start } else { self.session.go_to(at) };
            return Ok(self.arrive(&why));
        }
        let mut why = SystemWhy::Done;
        for _ in 0..count {
            why = if back { self.session.step_back(step) } else { self.session.step(step) };
            if why != SystemWhy::Done {
                break;
            }
        }
        Ok(self.arrive(&why))
    }

    fn go(&mut self, arguments: &str) -> Result<String, String> {
        let why = match arguments.split_whitespace().collect::<Vec<_>>()[..] {
            ["start"] => self.session.go_to(0),
            ["cycle", number] => {
                let number = number.parse().map_err(|_| format!("`{number}` is no number of a cycle"))?;
                self.session.go_to(number)
            }
            _ => return Err("goto takes `cycle N` or `start`".to_owned()),
        };
        Ok(self.arrive(&why))
    }

    fn add_break(&mut self, arguments: &str) -> Result<String, String> {
        let stop = match arguments.strip_prefix("link ") {
            Some(rest) => {
                // Names of wires have blanks in them.
                let event = rest.rsplit_once(' ').and_then(|(name, event)| {
                    let kind = EVENTS.into_iter().find(|kind| kind.name() == event)?;
                    Some((name.trim(), kind))
                });
                match event {
                    Some((name, kind)) => SystemStop { link: self.link(name)?, kind: Some(kind) },
                    None => {
                        let link = self.link(rest.trim()).map_err(|error| {
                            let kinds: Vec<&str> = EVENTS.iter().map(|kind| kind.name()).collect();
                            format!("{error}; events: {}", kinds.join(" "))
                        })?;
                        SystemStop { link, kind: None }
                    }
                }
            }
            None => return self.add_stop("break", arguments),
        };
        let text = format!("break {arguments}");
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
        let view = &mut self.views[self.selected];
        let (place, bits, text) = view.setting(arguments)?;
        // Whether there is such a place is known there.
        view.session.set(place, bits)?;
        self.session.set(self.selected, place, bits);
        self.look();
        Ok(text)
    }

    fn delete(&mut self, arguments: &str) -> Result<String, String> {
        let all = self.all_stops();
        let (session, views) = (&mut self.session, &mut self.views);
        let mut remove =
            |id: u32| session.remove_stop(id) || views.iter_mut().any(|view| view.session.remove_stop(id));
        if !arguments.is_empty() {
            let id = arguments.parse().ok().filter(|id| remove(*id));
            let unknown = || format!("there is no stop {arguments} (`stops` lists them)");
            return id.map(|_| String::new()).ok_or_else(unknown);
        }
        let removed = all.into_iter().filter(|(id, _)| remove(*id)).count();
        Ok(format!("{removed} removed\n"))
    }
}

impl Commands for SystemConsole {
    fn execute(&mut self, line: &str) -> Result<String, String> {
        let repeated = self.last.clone();
        let line = if line.trim().is_empty() { &repeated } else { line };
        let Some((name, arguments)) = crate::console::split(line) else { return Ok(String::new()) };
        match find(name)? {
            Meant::Own(run, moves) => {
                self.last = if moves { line.to_owned() } else { String::new() };
                run(self, arguments)
            }
            Meant::Inspection(known) => {
                self.last.clear();
                self.views[self.selected].execute(&format!("{known} {arguments}"))
            }
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
        let names = COMMANDS.iter().map(|row| row.0).chain(INSPECTION.iter().copied());
        (start, names.filter(|name| name.starts_with(&line[start..])).map(str::to_owned).collect())
    }

    fn mistake(line: &str) -> Option<String> {
        find(crate::console::split(line)?.0).err()
    }
}
