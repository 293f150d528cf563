// SPDX-License-Identifier: MIT OR Apache-2.0
//! Previous values of watched expressions: a search looks back to the last position at which each value existed, so that the result does
//! not depend on where the search begins. Known states are recorded along the run, like checkpoints.

use super::search_positions::Interest;
use super::stops::Watcher;
use super::{End, Session, StopReason, WINDOW};
use takt_isa::timing::Cycle;

/// Number of positions before the start of a search to examine first.
const NEAR: Cycle = 1 << 12;

impl Session {
    /// A watcher for this position that has the last value of every watched expression, even of those whose value is currently not in its
    /// register. The session's position does not change.
    ///
    /// # Errors
    /// If the user interrupted the search.
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

    /// Completes a watcher for this position from a recorded one, from nearby positions, or from the whole run.
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

    /// Goes to an earlier position.
    fn move_to(&mut self, cycle: Cycle) -> Result<(), End> {
        match self.go_to(cycle) {
            StopReason::Done => Ok(()),
            end => Err(end),
        }
    }

    /// Runs forward to a known position, and passes each position on the way to the watcher.
    fn watch_until(&mut self, until: Cycle, interest: &Interest, watcher: &mut Watcher) -> Result<(), End> {
        let mut visit = |session: &Session, issuing| {
            watcher.visit(session, issuing);
            None
        };
        match self.scan(until, interest, &mut visit) {
            // The target position is reached.
            Ok(_) | Err(StopReason::Limit(_)) => Ok(()),
            Err(end) => Err(end),
        }
    }

    /// Records a watcher at this position.
    pub(super) fn keep_watcher(&mut self, watcher: Watcher) {
        self.known.add(self.cycle(), watcher);
    }
}
