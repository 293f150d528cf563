// SPDX-License-Identifier: MIT OR Apache-2.0
//! Searches over a system, forward and back: link events, steps of a core, and stops of the cores' sessions.

use super::{LATE, Point, STRETCH, StretchEvents, SystemSession, SystemStop, SystemStopReason};
use crate::session::{Move, Search, Session, StopReason, Unit, WatchExpression};
use std::collections::BTreeMap;
use takt_emu::{Event, Status};
use takt_isa::timing::Cycle;
use takt_system::{InputEvent, LinkEvent};

/// Hit in a core's session: cycle, core, and reason.
type Hit = (Cycle, usize, StopReason);

/// Positions at which to stop, each with the number of the stop if there is one.
type Hits = Vec<(Cycle, Option<u32>)>;

/// Search in the session of each core.
pub(super) type Searches = Vec<Option<Search>>;

impl SystemSession {
    /// Executes one move; steps are counted on this core. `views` has a session for each core.
    pub fn go(&mut self, views: &mut [&mut Session], core: usize, to: &Move) -> SystemStopReason {
        match to {
            Move::Step(unit, _) => self.step(views, core, *unit),
            Move::Back(unit, _) => self.step_back(views, core, *unit),
            Move::Resume => self.resume(views),
            Move::ResumeBack => self.resume_back(views),
            Move::Until(live) => self.run_until(views, core, (**live).clone()),
            Move::Cycle(cycle) => self.go_to(*cycle),
            Move::Period(period) => self.go_to_period(core, *period),
            Move::Start => self.go_to(0),
        }
    }

    /// Steps one core forward, together with all others. `views` has a session for each core; it may be empty for steps by cycle, bundle
    /// or period.
    ///
    /// # Returns
    /// [`SystemStopReason::Done`]; the halt of this core; or the reason why the system stopped earlier.
    pub fn step(&mut self, views: &mut [&mut Session], core: usize, unit: Unit) -> SystemStopReason {
        let why = match unit {
            Unit::Cycle => return self.go_to(self.cycle() + 1),
            _ if self.has_halted(core) => return SystemStopReason::Core(core, StopReason::Halted),
            Unit::Bundle | Unit::Period => self.seek(&mut [], &mut [], |cores, _| ends(unit, core, cores)),
            Unit::Line | Unit::Call | Unit::Out => {
                let mut searches = self.step_searches(views, core, unit);
                // The core may halt before the step ends.
                self.seek(views, &mut searches, |cores, _| ends(unit, core, cores))
            }
        };
        match why {
            SystemStopReason::Core(_, StopReason::Done) => SystemStopReason::Done,
            SystemStopReason::Done if self.has_halted(core) => {
                SystemStopReason::Core(core, StopReason::Halted)
            }
            why => why,
        }
    }

    /// Steps one core back.
    pub fn step_back(&mut self, views: &mut [&mut Session], core: usize, unit: Unit) -> SystemStopReason {
        let why = match (unit, self.cycle()) {
            (_, 0) => return SystemStopReason::Start,
            (Unit::Cycle, now) => return self.go_to(now - 1),
            (Unit::Bundle | Unit::Period, _) => {
                self.seek_back(&mut [], |_, _| Ok(Vec::new()), |cores, _| ends(unit, core, cores))
            }
            (Unit::Line | Unit::Call | Unit::Out, _) => {
                // The call depth at this position counts, not the depth at the start of the search.
                let wanted = self.step_searches(views, core, unit);
                self.seek_back(views, |_, _| Ok(wanted.clone()), |_, _| Hits::new())
            }
        };
        match why {
            SystemStopReason::Core(_, StopReason::Done) => SystemStopReason::Done,
            why => why,
        }
    }

    /// A search for the end of a step, in the session of one core.
    fn step_searches(&self, views: &mut [&mut Session], core: usize, unit: Unit) -> Searches {
        self.show(views);
        let search =
            |(number, view): (usize, &&mut Session)| (number == core).then(|| Search::step(unit, view));
        views.iter().enumerate().map(search).collect()
    }

    fn has_halted(&self, core: usize) -> bool {
        matches!(self.system().core(core).status(), Status::Halted { .. })
    }

    /// Goes forward or back to the position after this number of periods of a core.
    pub fn go_to_period(&mut self, core: usize, period: u64) -> SystemStopReason {
        let ended = |system: &takt_system::System| system.periods(core).count;
        if period == 0 {
            return self.go_to(0);
        }
        while ended(self.system()) < period {
            if self.has_halted(core) {
                return SystemStopReason::Core(core, StopReason::Halted);
            }
            let why = self.go_to(self.cycle() + STRETCH);
            if why != SystemStopReason::Done && ended(self.system()) < period {
                return why;
            }
        }
        if let Some(point) = self.checkpoints.last_while(|point| ended(&point.system) < period) {
            self.point = point.clone();
        }
        while ended(self.system()) < period {
            let why = self.step(&mut [], core, Unit::Period);
            if why != SystemStopReason::Done {
                return why;
            }
        }
        SystemStopReason::Done
    }

    /// Runs forward to a stop: at a link event, or in a core's session. `views` has a session for each core, or is empty.
    pub fn resume(&mut self, views: &mut [&mut Session]) -> SystemStopReason {
        let stops = self.stops.clone();
        let mut searches = match self.stop_searches(views) {
            Ok(searches) => searches,
            Err(end) => return end,
        };
        let why = self.seek(views, &mut searches, |_, links| stopped(&stops, links));
        self.arrived(views, why)
    }

    /// Runs back to a stop.
    pub fn resume_back(&mut self, views: &mut [&mut Session]) -> SystemStopReason {
        let stops = self.stops.clone();
        let why = self.seek_back(views, SystemSession::stop_searches, |_, links| stopped(&stops, links));
        self.arrived(views, why)
    }

    /// Makes the line of the breakpoint that stopped a core's session the current line.
    fn arrived(&self, views: &mut [&mut Session], why: SystemStopReason) -> SystemStopReason {
        if let SystemStopReason::Core(core, found) = &why
            && let Some(view) = views.get_mut(*core)
        {
            self.show_core(*core, view, false);
            view.stopped(found.clone());
        }
        why
    }

    /// Runs forward to the next position at which an expression on a core is nonzero.
    pub fn run_until(
        &mut self,
        views: &mut [&mut Session],
        core: usize,
        live: WatchExpression,
    ) -> SystemStopReason {
        let Some(view) = views.get_mut(core) else { return SystemStopReason::Done };
        // An expression that holds now may still hold in the next cycle, as in a session of one core.
        if view.holds(&live) {
            let why = self.go_to(self.cycle() + 1);
            if why != SystemStopReason::Done {
                return why;
            }
            self.show_core(core, view, false);
            if view.holds(&live) {
                return SystemStopReason::Core(core, StopReason::Holds);
            }
        }
        let mut searches: Searches = views.iter().map(|_| None).collect();
        searches[core] = Some(Search::value(live, views[core]));
        self.seek(views, &mut searches, |_, _| Hits::new())
    }

    /// Searches for the stops of all cores' sessions from this position on, with the last value of every watched expression, even of
    /// those whose value is currently not in its register. The session's position does not change.
    ///
    /// # Errors
    /// If the user interrupted the search.
    fn stop_searches(&mut self, views: &mut [&mut Session]) -> Result<Searches, SystemStopReason> {
        self.show(views);
        let mut searches: Searches = views.iter().map(|view| Search::stops(view)).collect();
        if searches.iter().flatten().all(Search::is_complete) {
            return Ok(searches);
        }
        let here = self.point.clone();
        let result = self.look_back(views, &mut searches);
        self.point = here;
        self.show(views);
        result.map(|()| searches)
    }

    /// Completes the searches at this position, from the positions since the last checkpoint, or from all of the run that is unknown.
    fn look_back(
        &mut self,
        views: &mut [&mut Session],
        searches: &mut [Option<Search>],
    ) -> Result<(), SystemStopReason> {
        let is_of = |known: &Searches, views: &[&mut Session]| {
            known.iter().zip(views).all(|(search, view)| match search {
                Some(search) => search.is_of(view),
                None => view.stops().is_empty(),
            })
        };
        if self.known.before(Cycle::MAX).is_some_and(|(_, known)| !is_of(known, views)) {
            self.known.clear();
        }
        let here = self.cycle();
        let base = self.known.before(here).map_or(0, |(cycle, _)| cycle);
        let mut checkpoints: Vec<Cycle> = self.checkpoints.cycles().filter(|cycle| *cycle < here).collect();
        let fresh = |views: &[&mut Session]| views.iter().map(|view| Search::stops(view)).collect();
        if let Some(&near) = checkpoints.last().filter(|near| **near > base) {
            self.move_to(near)?;
            self.show(views);
            let mut found: Searches = fresh(views);
            self.watch_until(here, views, &mut found)?;
            complete(searches, &found);
            if searches.iter().flatten().all(Search::is_complete) {
                return Ok(());
            }
        }
        self.move_to(base)?;
        self.show(views);
        let known = self.known.before(base).map(|(_, known)| known.clone());
        let mut all = known.unwrap_or_else(|| fresh(views));
        checkpoints.retain(|cycle| base < *cycle);
        for cycle in checkpoints {
            self.watch_until(cycle, views, &mut all)?;
            self.known.add(cycle, all.clone());
        }
        self.watch_until(here, views, &mut all)?;
        self.known.add(here, all.clone());
        complete(searches, &all);
        Ok(())
    }

    fn move_to(&mut self, cycle: Cycle) -> Result<(), SystemStopReason> {
        match self.go_to(cycle) {
            SystemStopReason::Done => Ok(()),
            end => Err(end),
        }
    }

    /// Runs forward to a known position, and passes each position on the way to the searches.
    fn watch_until(
        &mut self,
        until: Cycle,
        views: &mut [&mut Session],
        searches: &mut [Option<Search>],
    ) -> Result<(), SystemStopReason> {
        let origin = self.cycle();
        while self.cycle() < until {
            let (begin, from) = (self.point.clone(), self.cycle().max(origin + 1));
            let mut seen = StretchEvents::default();
            let why = self.advance((self.cycle() + STRETCH).min(until), Some(&mut seen));
            if why != SystemStopReason::Done {
                return Err(why);
            }
            self.walk(begin, (from, self.cycle()), &seen, views, searches, false);
            if self.interrupted() {
                return Err(SystemStopReason::Interrupted);
            }
        }
        Ok(())
    }

    /// Copies each core's state into its session.
    pub(crate) fn show(&self, views: &mut [&mut Session]) {
        for (core, view) in views.iter_mut().enumerate() {
            self.show_core(core, view, false);
        }
    }

    fn show_core(&self, core: usize, view: &mut Session, boundary: bool) {
        let system = self.system();
        view.look(system.core(core).clone(), system.periods(core).count, boundary);
    }

    /// Goes to the first hit after this position.
    fn seek(
        &mut self,
        views: &mut [&mut Session],
        searches: &mut [Option<Search>],
        wanted: impl Fn(&[(usize, Event)], &[LinkEvent]) -> Hits,
    ) -> SystemStopReason {
        let origin = self.cycle();
        let looks = searches.iter().any(Option::is_some);
        loop {
            let begin = looks.then(|| self.point.clone());
            // A stretch ends before the issues at its last position; the next stretch records them.
            let from = self.cycle().max(origin + 1);
            let mut seen = StretchEvents::default();
            let left = self.run_limit.saturating_sub(self.cycle() - origin).max(1);
            let why = self.advance(self.cycle() + STRETCH.min(left), Some(&mut seen));
            let now = self.cycle();
            let hits = wanted(&seen.cores, &self.point.links).into_iter();
            let first = hits.filter(|(cycle, _)| *cycle > origin && *cycle <= now).min();
            if let Some(begin) = begin {
                let end = first.map_or(now, |(cycle, _)| cycle);
                let found = self.walk(begin, (from, end), &seen, views, searches, true).pop();
                if let Some((cycle, core, why)) = found {
                    self.go_to(cycle);
                    return SystemStopReason::Core(core, why);
                }
            }
            if let Some((cycle, id)) = first {
                self.go_to(cycle);
                return id.map_or(SystemStopReason::Done, SystemStopReason::Stop);
            }
            if why != SystemStopReason::Done {
                return why;
            }
            if now - origin >= self.run_limit {
                return SystemStopReason::Limit(now - origin);
            }
            if self.interrupted() {
                return SystemStopReason::Interrupted;
            }
        }
    }

    /// Goes to the last hit before this position: of `wanted`, or of one of the searches that `begin` creates at the start of each
    /// stretch.
    fn seek_back(
        &mut self,
        views: &mut [&mut Session],
        begin: impl Fn(&mut SystemSession, &mut [&mut Session]) -> Result<Searches, SystemStopReason>,
        wanted: impl Fn(&[(usize, Event)], &[LinkEvent]) -> Hits,
    ) -> SystemStopReason {
        // Search for hits before `end`, in stretches that begin at a checkpoint before `before`.
        let (mut end, mut before) = (self.cycle(), self.cycle());
        while before > 0 {
            self.restore(before - 1);
            let start = self.cycle();
            self.show(views);
            let mut searches = match begin(self, views) {
                Ok(searches) => searches,
                Err(end) => return end,
            };
            let looks = searches.iter().any(Option::is_some);
            let mut hits = Hits::new();
            let mut found: Option<Hit> = None;
            // Record `LATE` more cycles, since events are reported with a delay.
            while self.cycle() < end + LATE {
                let from = self.cycle().max(start + 1);
                let begin = (looks && from < end).then(|| self.point.clone());
                let mut seen = StretchEvents::default();
                let why = self.advance((self.cycle() + STRETCH).min(end + LATE), Some(&mut seen));
                hits.extend(wanted(&seen.cores, &self.point.links));
                if let Some(begin) = begin {
                    let last = self.cycle().min(end - 1);
                    found =
                        self.walk(begin, (from, last), &seen, views, &mut searches, false).pop().or(found);
                }
                if why != SystemStopReason::Done {
                    break;
                }
            }
            // Events just before a stretch belong to the previous stretch.
            let last =
                hits.into_iter().filter(|(cycle, _)| *cycle < end && (*cycle > start || start == 0)).max();
            match (last, found) {
                (last, Some((cycle, core, why))) if last.is_none_or(|(other, _)| other < cycle) => {
                    self.go_to(cycle);
                    return SystemStopReason::Core(core, why);
                }
                (Some((cycle, id)), _) => {
                    self.go_to(cycle);
                    return id.map_or(SystemStopReason::Done, SystemStopReason::Stop);
                }
                _ => {}
            }
            (end, before) = (start + 1, start);
            if self.interrupted() {
                return SystemStopReason::Interrupted;
            }
        }
        self.go_to(0);
        SystemStopReason::Start
    }

    /// Repeats a stretch whose events are known, and shows each core to its session at the positions of a range that are relevant to its
    /// search. Returns the first hit or all hits, in order. The session's position does not change.
    fn walk(
        &mut self,
        begin: Point,
        (from, end): (Cycle, Cycle),
        seen: &StretchEvents,
        views: &mut [&mut Session],
        searches: &mut [Option<Search>],
        first: bool,
    ) -> Vec<Hit> {
        let here = std::mem::replace(&mut self.point, begin);
        let mut positions: BTreeMap<Cycle, Vec<usize>> = BTreeMap::new();
        let mut issues = BTreeMap::new();
        let mut boundaries = Vec::new();
        for (core, search) in searches.iter_mut().enumerate() {
            let Some(search) = search else { continue };
            let events: Vec<&Event> =
                seen.cores.iter().filter(|(own, _)| *own == core).map(|(_, event)| event).collect();
            let inputs: Vec<&InputEvent> = seen.inputs.iter().filter(|input| input.core == core).collect();
            for event in &events {
                match event {
                    Event::Issue { cycle, address } => drop(issues.insert((core, *cycle), *address)),
                    Event::Wait { cycle, .. } => boundaries.push((core, cycle + 1)),
                    _ => {}
                }
            }
            let mut own = search.positions(&events, &inputs, from, end);
            let edits = self.edits.iter().filter(|edit| edit.core == core).map(|edit| edit.cycle);
            own.extend(edits.filter(|cycle| (from..=end).contains(cycle)));
            if from == 1 {
                // Input ports get their first values in the first cycle.
                own.insert(1);
            }
            for position in own {
                positions.entry(position).or_default().push(core);
            }
        }
        let mut found = Vec::new();
        'positions: for (cycle, cores) in positions {
            if self.advance(cycle, None) != SystemStopReason::Done || self.cycle() != cycle {
                break;
            }
            for core in cores {
                let (Some(search), Some(view)) = (&mut searches[core], views.get_mut(core)) else { continue };
                self.show_core(core, view, boundaries.contains(&(core, cycle)));
                if let Some(why) = search.visit(view, issues.get(&(core, cycle)).copied()) {
                    found.push((cycle, core, why));
                    if first {
                        break 'positions;
                    }
                }
            }
        }
        self.point = here;
        found
    }
}

/// Copies missing previous values from searches at an earlier position.
fn complete(searches: &mut [Option<Search>], earlier: &[Option<Search>]) {
    for (search, earlier) in searches.iter_mut().zip(earlier) {
        if let (Some(search), Some(earlier)) = (search, earlier) {
            search.complete(earlier);
        }
    }
}

/// Ends of a core's step that depend only on its events: bundles, periods, and `halt`.
fn ends(unit: Unit, core: usize, cores: &[(usize, Event)]) -> Hits {
    let own = cores.iter().filter(|(own, _)| *own == core);
    own.filter_map(|(_, event)| match event {
        Event::Issue { cycle, .. } if unit == Unit::Bundle => Some((*cycle, None)),
        Event::Wait { cycle, .. } if unit == Unit::Period => Some((cycle + 1, None)),
        Event::Halt { cycle, .. } => Some((cycle + 1, None)),
        _ => None,
    })
    .collect()
}

fn stopped(stops: &[(u32, SystemStop, String)], links: &[LinkEvent]) -> Hits {
    let mut hits = Hits::new();
    for (id, stop, _) in stops {
        let same = |event: &&LinkEvent| {
            event.link == stop.link && stop.kind.is_none_or(|kind| kind.name() == event.kind.name())
        };
        hits.extend(links.iter().filter(same).map(|event| (event.cycle + 1, Some(*id))));
    }
    hits
}
