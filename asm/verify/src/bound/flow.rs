// SPDX-License-Identifier: MIT OR Apache-2.0
//! Facts of a program that bounds rest on: decoded bundles, constants, and loops with their least and most iterations.

use crate::code::{Operation, of_bundle};
use std::collections::BTreeMap;
use takt_isa::{Effect, Program, Register};

/// Iterations of a loop, each time it is entered.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoopCount {
    pub(super) least: u32,
    pub(super) most: u32,
    /// Most iterations in a section, if the source promises a total.
    pub(super) total: Option<u32>,
    /// Last bundle, of a loop that the sequencer counts.
    pub(super) last: Option<u32>,
}

/// Program with its loops.
pub(super) struct Flow<'p> {
    pub(super) program: &'p Program,
    bundles: Vec<Result<Vec<Operation>, String>>,
    /// Registers with a constant value: those that the loader sets and no bundle writes.
    pub(super) constants: BTreeMap<usize, u32>,
    /// Values at reset.
    pub(super) initial: BTreeMap<usize, u32>,
    /// Loops with a bound, by first bundle.
    pub(super) loops: BTreeMap<u32, LoopCount>,
    /// First bundle of the counted loop that a bundle ends.
    pub(super) closes: BTreeMap<u32, u32>,
}

/// Operation that decides where execution goes after a bundle.
pub(super) fn redirecting(bundle: &[Operation]) -> Option<(Effect, &Operation)> {
    let effect = |operation: &Operation| operation.op.row().effect;
    bundle.iter().map(|operation| (effect(operation), operation)).find(|(effect, _)| effect.redirects())
}

impl<'p> Flow<'p> {
    /// Flow of a program; an error is the bundle, and the reason why its loops cannot be judged.
    pub(super) fn new(program: &'p Program) -> Result<Flow<'p>, (u32, String)> {
        let bundles: Vec<_> = program.addresses().map(|address| of_bundle(program, address)).collect();
        let constants = program.constants.iter().filter(|(register, _)| !program.machine.is_input(*register));
        let mut initial: BTreeMap<usize, u32> =
            constants.map(|(register, value)| (register.index(), *value)).collect();
        initial.insert(Register::ZERO.index(), 0);
        let mut constants = initial.clone();
        for dest in bundles.iter().flatten().flatten().filter_map(|operation| operation.dest) {
            constants.remove(&dest);
        }
        constants.insert(Register::ZERO.index(), 0);
        let (loops, closes) = (BTreeMap::new(), BTreeMap::new());
        let mut flow = Flow { program, bundles, constants, initial, loops, closes };
        for bound in &program.loop_bounds {
            let most = bound.most.min(bound.total.unwrap_or(u32::MAX));
            let count = LoopCount { least: 1, most, total: bound.total, last: None };
            flow.loops.insert(bound.address.get(), count);
        }
        flow.count()?;
        flow.judge()?;
        Ok(flow)
    }

    /// Operations of a bundle.
    pub(super) fn bundle(&self, at: u32) -> Result<&[Operation], String> {
        match self.bundles.get(at as usize) {
            Some(Ok(bundle)) => Ok(bundle),
            Some(Err(reason)) => Err(format!("the bundle cannot run: {reason}")),
            None => Err("execution continues past the end of the program".to_owned()),
        }
    }

    fn decoded(&self) -> impl Iterator<Item = (u32, &[Operation])> {
        (0..).zip(&self.bundles).filter_map(|(at, bundle)| Some((at, bundle.as_deref().ok()?)))
    }

    /// Adds the loops that the sequencer counts.
    fn count(&mut self) -> Result<(), (u32, String)> {
        let mut found = Vec::new();
        for (at, bundle) in self.decoded() {
            let Some((Effect::Loop, operation)) = redirecting(bundle) else { continue };
            found.push((at, operation.sources[0], operation.constant));
        }
        for (at, register, end) in found {
            let (head, last) = (at.saturating_add(1), end.saturating_sub(1));
            let is_plain = self.bundle(last).is_ok_and(|bundle| redirecting(bundle).is_none());
            if last < head || !is_plain || self.closes.insert(last, head).is_some() {
                return Err((
                    at,
                    "the body of this counted loop does not end in a bundle of its own".to_owned(),
                ));
            }
            let promised = self.loops.get(&head);
            let total = promised.and_then(|of| of.total);
            let (least, most) = match (self.constants.get(&register), promised) {
                (Some(count), _) => (*count, *count),
                (None, Some(of)) => (of.least, of.most),
                (None, None) => continue,
            };
            self.loops.insert(head, LoopCount { least, most, total, last: Some(last) });
        }
        Ok(())
    }

    /// Checks that control enters the body of each counted loop only by its `loop`, and leaves it, or begins it again, only by its last
    /// bundle. Then the loop on top of the sequencer's stack at that bundle is always this one.
    fn judge(&self) -> Result<(), (u32, String)> {
        // Number of the innermost body around each bundle, its first bundle; 0 is around all.
        let mut innermost = vec![0; self.bundles.len()];
        let mut around: Vec<(u32, u32)> = Vec::new();
        let bodies: BTreeMap<u32, u32> = self.closes.iter().map(|(last, head)| (*head, *last)).collect();
        for (at, inside) in (0..).zip(&mut innermost) {
            while around.last().is_some_and(|(_, last)| *last < at) {
                around.pop();
            }
            if let Some(last) = bodies.get(&at) {
                if around.last().is_some_and(|(_, outer)| outer <= last) {
                    return Err((at, "counted loops overlap here".to_owned()));
                }
                around.push((at, *last));
            }
            *inside = around.last().map_or(0, |(head, _)| *head);
        }
        let inside = |at: u32| innermost.get(at as usize).copied().unwrap_or(0);
        for (at, bundle) in self.decoded() {
            let Some((effect, operation)) = redirecting(bundle) else { continue };
            let (here, target) = (inside(at), operation.constant);
            let keeps = match effect {
                Effect::Jump | Effect::BranchZero | Effect::BranchNonzero => {
                    inside(target) == here && !bodies.contains_key(&target)
                }
                Effect::Call => inside(target) == 0,
                Effect::Wait => here == 0 && inside(target) == 0,
                Effect::Return | Effect::Halt => here == 0,
                _ => true,
            };
            if !keeps {
                let what = "control enters or leaves a counted loop here other than by its `loop` and its last bundle";
                return Err((at, what.to_owned()));
            }
        }
        Ok(())
    }

    /// The bundle calls a subroutine.
    pub(super) fn is_call(&self, at: u32) -> bool {
        self.bundle(at).is_ok_and(|bundle| matches!(redirecting(bundle), Some((Effect::Call, _))))
    }
}
