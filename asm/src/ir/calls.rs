// SPDX-License-Identifier: MIT OR Apache-2.0
//! Call graph: the code that may run during the calls of a stretch of bundles.

use crate::ir::Ir;
use crate::ir::runs::Run;
use std::collections::{HashMap, VecDeque};
use std::ops::Range;
use takt_isa::Effect;

/// The calls of a program whose labels have their positions.
pub(crate) struct Calls<'r> {
    runs: &'r [Run],
    /// Calls in ascending order: the bundle, and the run that it calls.
    calls: Vec<(usize, usize)>,
    /// By run: its successors, apart from subroutines.
    next: Vec<Vec<usize>>,
}

impl<'r> Calls<'r> {
    pub(crate) fn new(ir: &Ir, runs: &'r [Run]) -> Calls<'r> {
        let starts: HashMap<usize, usize> = (0..).zip(runs).map(|(index, run)| (run.start, index)).collect();
        let mut calls = Vec::new();
        let mut next = Vec::with_capacity(runs.len());
        for run in runs {
            let operations = &ir.bundles[run.end - 1].operations;
            let effects = || operations.iter().map(|operation| operation.row().effect);
            let is_call = effects().any(|effect| effect == Effect::Call);
            let falls_through = is_call || effects().all(Effect::falls_through);
            let mut to: Vec<usize> =
                starts.get(&run.end).copied().filter(|_| falls_through).into_iter().collect();
            for operation in operations {
                let target = match operation.target() {
                    Some(Ok(label)) => ir.labels[label.0 as usize].position as usize,
                    Some(Err(number)) => number as usize,
                    None => continue,
                };
                let Some(&target) = starts.get(&target) else { continue };
                match operation.row().effect {
                    Effect::Call => calls.push((run.end - 1, target)),
                    // Execution reaches the end of a loop's body by falling through.
                    Effect::Loop => {}
                    _ => to.push(target),
                }
            }
            next.push(to);
        }
        Calls { runs, calls, next }
    }

    /// The bundles with calls in a stretch of bundles.
    pub(crate) fn within(&self, stretch: &Range<usize>) -> impl Iterator<Item = usize> {
        self.from(stretch).iter().map(|call| call.0)
    }

    fn from(&self, stretch: &Range<usize>) -> &[(usize, usize)] {
        let bundle = |&(at, _): &(usize, usize)| at;
        let first = self.calls.partition_point(|call| bundle(call) < stretch.start);
        let end = self.calls.partition_point(|call| bundle(call) < stretch.end);
        &self.calls[first..end]
    }

    /// The calls of a run: the bundle of each, and the run that it calls.
    pub(crate) fn of(&self, run: usize) -> impl Iterator<Item = (usize, usize)> {
        let Run { start, end, .. } = self.runs[run];
        self.from(&(start..end)).iter().copied()
    }

    /// The successors of a run, apart from subroutines.
    pub(crate) fn after(&self, run: usize) -> impl Iterator<Item = usize> {
        self.next[run].iter().copied()
    }

    /// The bundles that may run from the calls in a stretch of bundles to their returns, as ascending ranges that do not touch.
    pub(crate) fn during(&self, stretch: &Range<usize>) -> Vec<Range<usize>> {
        let reached = self.reached(stretch);
        let mut ranges: Vec<Range<usize>> = Vec::new();
        for (run, _) in self.runs.iter().zip(&reached).filter(|(_, from)| from.is_some()) {
            match ranges.last_mut() {
                Some(last) if last.end == run.start => last.end = run.end,
                _ => ranges.push(run.start..run.end),
            }
        }
        ranges
    }

    /// The chain of calls, given as their bundles, by which execution may pass from one stretch of bundles to another; `None` without
    /// such a chain.
    pub(crate) fn chain(&self, from: &Range<usize>, to: &Range<usize>) -> Option<Vec<usize>> {
        let reached = self.reached(from);
        let is_there = |index: &usize| {
            let run = self.runs[*index];
            reached[*index].is_some() && run.start < to.end && to.start < run.end
        };
        let mut run = (0..self.runs.len()).find(is_there)?;
        let mut chain = Vec::new();
        while let Some((before, call)) = reached[run] {
            chain.extend(call);
            match before {
                Some(before) => run = before,
                None => break,
            }
        }
        chain.reverse();
        Some(chain)
    }

    /// By run that is reachable through the calls in a stretch of bundles: the predecessor on the path, except for the first call, and the
    /// call if the path enters the run by one.
    #[allow(clippy::type_complexity)]
    fn reached(&self, stretch: &Range<usize>) -> Vec<Option<(Option<usize>, Option<usize>)>> {
        let mut reached = vec![None; self.runs.len()];
        let mut left = VecDeque::new();
        let mut come = |left: &mut VecDeque<usize>, to: usize, before, call| {
            if reached[to].is_none() {
                reached[to] = Some((before, call));
                left.push_back(to);
            }
        };
        for &(call, to) in self.from(stretch) {
            come(&mut left, to, None, Some(call));
        }
        while let Some(run) = left.pop_front() {
            for (call, to) in self.of(run) {
                come(&mut left, to, Some(run), Some(call));
            }
            for to in self.after(run) {
                come(&mut left, to, Some(run), None);
            }
        }
        reached
    }
}
