// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sections of a program: the states in which each begins, the cycles that follow from its lemma, and the claims about them.

use super::path::Cost;
use super::{Checker, Failure, at, text};
use crate::clock::InFlight;
use std::collections::BTreeMap;
use takt_isa::certificate::{Claim, Cycles, End, Proof, Times};
use takt_isa::{BundleAddress, Program};

/// Section: whether it starts at reset, and its first bundle.
pub(super) type Key = (bool, u32);
/// Proved cycles of a section, as best and worst case.
type Span = (i128, i128);

/// Proved cycles, by the moment of the tick.
#[derive(Clone, Copy, Default)]
struct Spans {
    refilled: Option<Span>,
    in_time: Option<Span>,
    missed: Option<Span>,
}

fn either(a: Option<Span>, b: Option<Span>) -> Option<Span> {
    match (a, b) {
        (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
        (a, b) => a.or(b),
    }
}

/// Both bounds hold: the larger best case and the smaller worst one do.
fn both(a: Option<Span>, b: Option<Span>) -> Option<Span> {
    match (a, b) {
        (Some(a), Some(b)) => Some((a.0.max(b.0), a.1.min(b.1))),
        (a, b) => a.or(b),
    }
}

impl Spans {
    fn with(self, other: Spans, of: fn(Option<Span>, Option<Span>) -> Option<Span>) -> Spans {
        Spans {
            refilled: of(self.refilled, other.refilled),
            in_time: of(self.in_time, other.in_time),
            missed: of(self.missed, other.missed),
        }
    }

    fn is_empty(&self) -> bool {
        self.refilled.is_none()
    }
}

/// Proved cycles of a section: to its end, to a `publish`, and to a `wait` before which none has issued.
#[derive(Clone, Copy, Default)]
pub(super) struct SectionSpans {
    end: Spans,
    publish: Spans,
    unpublished: Spans,
}

impl SectionSpans {
    /// Cycles to the publication of the outputs, if a `publish` may come.
    fn published(&self) -> Spans {
        match self.publish.is_empty() {
            true => Spans::default(),
            false => self.publish.with(self.unpublished, either),
        }
    }
}

impl Checker<'_> {
    /// Checks that every section is proved in every state in which a `wait` can lead to it; returns the cycles of each.
    pub(super) fn entries(
        &self,
        proof: &Proof,
        prices: &BTreeMap<u32, u64>,
    ) -> Result<BTreeMap<Key, SectionSpans>, Failure> {
        let refill = i128::from(self.flow.program.machine.refill);
        // Entries, each with whether it is one that comes as soon as it can.
        let mut entered: BTreeMap<(u32, InFlight), bool> = BTreeMap::new();
        let mut waits: Vec<(u32, u32, InFlight)> = Vec::new();
        let mut sections: BTreeMap<Key, SectionSpans> = BTreeMap::new();
        let mut is_reset = false;
        for entry in &proof.entries {
            let address = entry.address;
            let state = at(address, self.state(entry.state))?;
            let begins = match entry.once {
                true => {
                    let is_loaded =
                        |(register, value): (&usize, &u32)| self.flow.initial.get(register) == Some(value);
                    address == 0 && state.time.is_empty() && state.known.iter().all(is_loaded)
                }
                false => state.known.is_empty(),
            };
            if !begins || state.count.is_some() || state.published {
                return Err((address, "no section begins in such a state".to_owned()).into());
            }
            if entry.once {
                is_reset = true;
            } else {
                *entered.entry((address, state.time.clone())).or_default() |= entry.soonest;
            }
            let lemma = at(address, self.before(entry.lemma))?;
            if lemma.is_loop || lemma.start != address {
                return Err((address, "the lemma is not that of this section".to_owned()).into());
            }
            let enters = |head: &u32| *head == lemma.start || lemma.touched.heads.contains(head);
            let paid = prices.iter().filter(|(head, _)| enters(head)).map(|(head, price)| {
                let total = self.flow.loops.get(head).and_then(|count| count.total).unwrap_or(0);
                i128::from(*price) * i128::from(total)
            });
            let paid: i128 = paid.sum();
            for way in at(address, self.after(lemma, state, lemma.exits.len()))? {
                // The cycle of the last issue counts, too.
                let span = (way.cycles.best + 1, (way.cycles.worst + paid).max(0) + 1);
                let after = |more: i128| Some((span.0 + more, span.1 + more));
                let mut spans =
                    Spans { refilled: after(if entry.once { refill } else { 0 }), ..Spans::default() };
                if !entry.once {
                    spans.in_time = spans.refilled;
                    if entry.soonest {
                        // The earliest tick comes a cycle after the `wait`: one cycle of the refill has passed.
                        spans.in_time = either(spans.in_time, after((refill - 1).max(0)));
                        spans.missed = after(refill);
                    }
                }
                let section = sections.entry((!entry.once, address)).or_default();
                match way.end {
                    End::Go { .. } | End::Return { .. } => {
                        let what = format!("the section is left by a way {}", text(way.end));
                        return Err((address, what).into());
                    }
                    End::Publish { .. } => {
                        section.publish = section.publish.with(spans, either);
                        continue;
                    }
                    End::Halt { .. } => {}
                    End::Wait { at: wait, target } => {
                        let Some(after) = way.state else {
                            return Err((wait, "the exit at a `wait` has no state".to_owned()).into());
                        };
                        if !after.published {
                            section.unpublished = section.unpublished.with(spans, either);
                        }
                        waits.push((wait, target, after.time));
                    }
                }
                section.end = section.end.with(spans, either);
            }
        }
        if !is_reset {
            return Err("the section that runs once has no entry".into());
        }
        for (wait, target, mut time) in waits {
            if entered.get(&(target, time.clone())) != Some(&true) {
                let what = format!("the period that begins at bundle {target} has no entry for this `wait`");
                return Err((wait, what).into());
            }
            while !time.is_empty() {
                time = time.a_cycle_later();
                if !entered.contains_key(&(target, time.clone())) {
                    let what = format!(
                        "the period at bundle {target} has no entry for every tick after this `wait`"
                    );
                    return Err((wait, what).into());
                }
            }
        }
        Ok(sections)
    }
}

/// Checks that claims have the sections' names and contain the proved cycles of every section.
pub(super) fn claims(
    program: &Program,
    claims: &[Claim],
    proofs: &[BTreeMap<Key, SectionSpans>],
) -> Result<(), Failure> {
    let mut proved: BTreeMap<Key, (Spans, Spans)> = BTreeMap::new();
    for (key, spans) in proofs.iter().flatten() {
        let (end, published) = proved.entry(*key).or_default();
        (*end, *published) = (end.with(spans.end, both), published.with(spans.published(), both));
    }
    if proofs.is_empty() {
        return Err("there is no proof".into());
    }
    let mut claimed = Vec::new();
    for claim in claims {
        let key = (!claim.once, claim.address);
        let Some((end, published)) = proved.get(&key) else {
            return Err((claim.address, format!("section `{}` is not proved", claim.name)).into());
        };
        let name = program.section_name(claim.once, BundleAddress::new(claim.address));
        if claim.name != name {
            let what = format!("the section `{name}` is claimed to be `{}`", claim.name);
            return Err((claim.address, what).into());
        }
        claimed.push(key);
        at(claim.address, contains(&claim.name, Some(claim.cycles), *end))?;
        at(claim.address, contains(&format!("{}, published", claim.name), claim.published, *published))?;
    }
    match proved.iter().find(|(key, (end, _))| !end.is_empty() && !claimed.contains(key)) {
        Some(((_, address), _)) => Err((*address, "the section has no claim".to_owned()).into()),
        None => Ok(()),
    }
}

fn contains(name: &str, claim: Option<Times>, proved: Spans) -> Result<(), String> {
    let of = |which: fn(Times) -> Option<Cycles>| claim.and_then(which);
    let cases = [
        ("", of(|times| Some(times.refilled)), proved.refilled),
        (", a tick in time", of(|times| times.in_time), proved.in_time),
        (", a missed tick", of(|times| times.missed), proved.missed),
    ];
    for (case, claim, proved) in cases {
        match (claim, proved) {
            (None, None) => {}
            (Some(claim), Some((best, worst))) => {
                let claim = Cost { best: claim.0.into(), worst: claim.1.into() };
                Cost { best, worst }.is_covered_by(claim, &format!("section `{name}`{case}"))?;
            }
            _ => return Err(format!("section `{name}`{case}: claim and proof are not of the same kind")),
        }
    }
    Ok(())
}
