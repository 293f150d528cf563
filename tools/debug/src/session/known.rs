// SPDX-License-Identifier: MIT OR Apache-2.0
//! Looking back from where a search begins, for what each watched value was where it was there last: so a search finds the
//! same wherever it begins. What was found is kept along the run, as checkpoints are.

use super::interest::Interest;
use super::stops::Watcher;
use super::{End, Session, WINDOW, Why};
use takt_isa::timing::Cycle;

/// Positions near the beginning of a search that are looked through first.
const NEAR: Cycle = 1 << 12;

impl Session {
    /// A watcher for this position that knows of each value what it was last, even if it is not there now. The session stays
    /// where it is.
    ///
    /// # Errors
    /// If it was interrupted.
    pub(super) fn watcher(&mut self) -> Result<Watcher, End> {
        self.make_edits();
        if self.known.before(Cycle::MAX).is_some_and(|(_, known)| !known.is_of(self)) {
            self.known.clear();
        }
        let mut watcher = Watcher::new(self);
        if watcher.is_complete() {
            return Ok(watcher);
        }
        let here = self.core.clone();
        let result = self.look_back(&mut watcher);
        self.core = here;
        result.map(|()| watcher)
    }

    /// Completes this position's watcher: from one that is known, from what there is to see near, or from all of the run.
    fn look_back(&mut self, watcher: &mut Watcher) -> Result<(), End> {
        let here = self.cycle();
        let interest = Interest::stops(&self.stops, self.program());
        let base = self.known.before(here).map_or(0, |(cycle, _)| cycle);
        let mut window = WINDOW;
        while here - base > NEAR && window <= NEAR {
            self.move_to(here - window)?;
            let mut near = Watcher::new(self);
            self.watch_until(here, &interest, &mut near)?;
            watcher.complete(&near);
            if watcher.is_complete() {
                return Ok(());
            }
            window *= 8;
        }
        self.move_to(base)?;
        let known = self.known.before(base).map(|(_, known)| known.clone());
        let mut all = known.unwrap_or_else(|| Watcher::new(self));
        let between = |cycle: &Cycle| base < *cycle && *cycle < here;
        for checkpoint in self.checkpoints().into_iter().filter(between) {
            self.watch_until(checkpoint, &interest, &mut all)?;
            self.known.add(checkpoint, all.clone());
        }
        self.watch_until(here, &interest, &mut all)?;
        self.known.add(here, all.clone());
        watcher.complete(&all);
        Ok(())
    }

    /// Goes to a position before this one.
    fn move_to(&mut self, cycle: Cycle) -> Result<(), End> {
        match self.go_to(cycle) {
            Why::Done => Ok(()),
            end => Err(end),
        }
    }

    /// Runs on to a position of the run that is known, and shows a watcher what there is to see on the way.
    fn watch_until(&mut self, until: Cycle, interest: &Interest, watcher: &mut Watcher) -> Result<(), End> {
        let mut visit = |session: &Session, issuing| {
            watcher.visit(session, issuing);
            None
        };
        match self.scan(until, interest, &mut visit) {
            // It has come there.
            Ok(_) | Err(Why::Limit(_)) => Ok(()),
            Err(end) => Err(end),
        }
    }

    /// Keeps a watcher of this position.
    pub(super) fn keep_watcher(&mut self, watcher: Watcher) {
        self.known.add(self.cycle(), watcher);
    }
}
