// SPDX-License-Identifier: MIT OR Apache-2.0
//! Marks: events between two cuts that leave no value. Emulator and bounds rely on them in an image: heads of bounded loops, starts of
//! counted loops, labels.

use crate::code::{Code, refuse};
use crate::fields::Bound;
use crate::labels::Labels;
use crate::term::{Term, Terms};
use crate::{Difference, run::Side};
use foldhash::{HashMap, HashSet};
use takt_isa::program::Location;

/// Marks since the last cut.
#[derive(Clone, Debug, Default)]
pub(crate) struct Marks {
    /// Labels passed: the first and the last at a bundle, and the number of effects before.
    labels: Vec<((u32, u32), u32)>,
    /// Heads of bounded loops without a hardware counter, once per iteration.
    turns: Vec<u32>,
    /// Starts of counted loops: count, first bundle and source line.
    starts: Vec<(Term, u32, Option<Location>)>,
    /// Number of effects: writes to ports, stores, calls and returns.
    pub(crate) done: u32,
}

impl Marks {
    /// Records the marks of a bundle on arrival.
    pub(crate) fn arrive(&mut self, code: &Code, at: u32) {
        if !code.marked.get(at as usize).copied().unwrap_or(false) {
            return;
        }
        if let Some(&labels) = code.labels.get(&at) {
            self.labels.push((labels, self.done));
        }
        if code.bounds.contains_key(&at) && !code.is_counted(at) {
            self.turns.push(at);
        }
    }

    /// Records the start of a counted loop.
    pub(crate) fn begin(&mut self, count: Term, head: u32, location: Option<Location>) {
        self.starts.push((count, head, location));
    }
}

/// Loops whose bounds have been compared.
#[derive(Debug, Default)]
pub(crate) struct ComparedLoops {
    source: HashSet<u32>,
    image: HashSet<u32>,
    /// Bounds of source loops with two copies in the image, by first bundle: of the pipelined copy, and of the copy as written.
    ways: HashMap<u32, [Option<Bound>; 2]>,
    /// A bound is wrong; splitting cases cannot mend that.
    pub(crate) is_mistaken: bool,
}

fn differ(place: Option<Location>, what: &str, source: Option<Bound>, image: Option<Bound>) -> Difference {
    let text = |bound: Option<Bound>| bound.map(Bound::text);
    Difference { place, what: what.to_owned(), source: text(source), image: text(image) }
}

impl ComparedLoops {
    /// Compares the bounds of the loops that both programs have passed since the last cut.
    pub(crate) fn compare_bounds(
        &mut self,
        terms: &Terms,
        source: &Side<'_>,
        image: &Side<'_>,
    ) -> Result<(), Difference> {
        self.compare_turns(source, image)?;
        self.compare_starts(terms, source, image)
    }

    /// Compares the iterations of loops without a hardware counter, with their bounds. Adjacent heads of the source whose code vanished in
    /// between merge into one loop with both bounds; their labels are then at one bundle.
    fn compare_turns(&mut self, source: &Side<'_>, image: &Side<'_>) -> Result<(), Difference> {
        let mut said = source.marks.turns.iter().peekable();
        let bound = |side: &Side<'_>, head: u32| side.code.bounds.get(&head).copied();
        for &head in &image.marks.turns {
            let done = bound(image, head);
            let (mut merged, mut said_at): (Option<Bound>, Option<u32>) = (None, None);
            let is_there = |from: u32| {
                let within = |of: &(u32, u32)| {
                    image.code.labels.get(&head).is_some_and(|all| all.0 <= of.0 && of.1 <= all.1)
                };
                source.code.labels.get(&from).is_none_or(within)
            };
            while merged.is_none() || merged != done {
                let may_merge = |from: u32| said_at.is_none_or(|before| is_there(before) && is_there(from));
                let Some(&from) = said.next_if(|&&from| may_merge(from)) else { break };
                let from_bound = bound(source, from);
                merged = merged.zip(from_bound).map(|(one, other)| one.merged(other)).or(from_bound);
                self.source.insert(from);
                said_at = Some(from);
            }
            let is_alike =
                said_at.is_some_and(|from| source.code.is_led_to(from) == image.code.is_led_to(head));
            if merged != done || !is_alike {
                let place = image.code.location(head);
                return Err(differ(place, "a loop has another bound in the image", merged, done));
            }
            self.image.insert(head);
        }
        match said.next() {
            Some(&head) => {
                let place = source.code.location(head);
                Err(differ(place, "a loop has no bound in the image", bound(source, head), None))
            }
            None => Ok(()),
        }
    }

    /// Compares the starts of counted loops: count and bound. The count and bound of a pipelined loop are less by the iterations that its
    /// prologue begins; the image also has the loop as written, for smaller counts.
    fn compare_starts(
        &mut self,
        terms: &Terms,
        source: &Side<'_>,
        image: &Side<'_>,
    ) -> Result<(), Difference> {
        let (said, done) = (&source.marks.starts, &image.marks.starts);
        for (&(count, from, place), &(other, head, _)) in said.iter().zip(done) {
            let (known, found) =
                (source.code.bounds.get(&from).copied(), image.code.bounds.get(&head).copied());
            self.source.insert(from);
            self.image.insert(head);
            let constant = terms.constant_value(count);
            let fewer =
                constant.zip(terms.constant_value(other)).and_then(|(count, other)| less(count, other));
            let less = match (known, found) {
                (Some(Bound { most, total: None }), Some(Bound { most: other, total: None })) => {
                    less(most, other)
                }
                _ => None,
            };
            let is_within = constant.zip(found).is_some_and(|(count, bound)| count <= bound.most);
            match () {
                () if count == other && known == found => {}
                () if fewer.is_some() && known.is_none() && found.is_none() => {}
                () if fewer.is_some() && fewer == less => self.ways.entry(from).or_default()[0] = found,
                () if count == other && less.is_some() && is_within => {
                    self.ways.entry(from).or_default()[1] = found;
                }
                () if count == other || fewer.is_some() => {
                    self.is_mistaken = true;
                    return Err(differ(place, "a counted loop has another bound in the image", known, found));
                }
                () => return Err(differ(place, "a counted loop has another count in the image", None, None)),
            }
        }
        if said.len() != done.len() {
            let place = said.first().or(done.first()).and_then(|start| start.2);
            return Err(differ(
                place,
                "the image does not begin as many counted loops as the source",
                None,
                None,
            ));
        }
        Ok(())
    }

    /// Compares the bounds of loops that no path reached, and of loops with two copies in the image.
    pub(crate) fn finish(&self, source: &Code, image: &Code) -> Result<(), Difference> {
        let most = |of: Option<&Bound>| of.map_or(0, |bound| bound.most);
        for (from, ways) in &self.ways {
            let known = source.bounds.get(from).copied();
            if let [Some(pipelined), Some(short)] = ways
                && pipelined.most + short.most != most(known.as_ref())
            {
                let place = source.location(*from);
                return Err(differ(
                    place,
                    "a counted loop has another bound in the image",
                    known,
                    Some(*short),
                ));
            }
        }
        let mut left = unpassed(image, &self.image);
        // Removes the second copy of a loop if every path took the first. Only a count that the assembler does not know has a bound, so that
        // neither copy stands alone.
        for (from, ways) in self.ways.iter().filter(|(_, ways)| ways.contains(&None)) {
            let known = source.bounds.get(from).copied();
            let taken: u32 = ways.iter().flatten().map(|bound| bound.most).sum();
            let is_other = |&(head, found): &(u32, Bound)| {
                image.is_counted(head)
                    && found.total.is_none()
                    && taken.checked_add(found.most) == Some(most(known.as_ref()))
            };
            if let Some(other) = left.iter().position(is_other) {
                left.remove(other);
            } else {
                let (place, found) = (source.location(*from), ways[0].or(ways[1]));
                return Err(differ(place, "a counted loop has another bound in the image", known, found));
            }
        }
        compare_unpassed(source, &unpassed(source, &self.source), image, &left)
    }
}

/// Bounded loops that no path reached, in ascending order of bundles.
fn unpassed(code: &Code, passed: &HashSet<u32>) -> Vec<(u32, Bound)> {
    let mut left: Vec<(u32, Bound)> = code
        .bounds
        .iter()
        .filter(|(head, _)| !passed.contains(head))
        .map(|(head, bound)| (*head, *bound))
        .collect();
    left.sort_unstable_by_key(|(head, _)| *head);
    left
}

/// Compares the bounds of unreached loops in order; a pipelined loop of the image is followed by its copy as written.
fn compare_unpassed(
    source: &Code,
    said: &[(u32, Bound)],
    image: &Code,
    done: &[(u32, Bound)],
) -> Result<(), Difference> {
    let is_alike = |from: u32, head: u32| {
        source.is_counted(from) == image.is_counted(head) && source.is_led_to(from) == image.is_led_to(head)
    };
    let mut done = done.iter().copied();
    for &(from, known) in said {
        let wrong = |found: Option<Bound>| {
            Err(differ(source.location(from), "a loop has another bound in the image", Some(known), found))
        };
        let Some((head, found)) = done.next() else { return wrong(None) };
        if found == known && is_alike(from, head) {
            continue;
        }
        let is_pipelined = source.is_counted(from) && image.is_counted(head) && found.most < known.most;
        let other = if is_pipelined { done.next() } else { None };
        let is_other = |(head, other): (u32, Bound)| {
            let totals = [known.total, found.total, other.total];
            image.is_counted(head) && found.most + other.most == known.most && totals == [None; 3]
        };
        if !other.is_some_and(is_other) {
            return wrong(Some(found));
        }
    }
    match done.next() {
        Some((head, found)) => {
            let what = "the image has a loop bound that the source does not";
            Err(differ(image.location(head), what, None, Some(found)))
        }
        None => Ok(()),
    }
}

/// Difference of two numbers; `None` unless the second is less.
fn less(number: u32, other: u32) -> Option<u32> {
    number.checked_sub(other).filter(|less| *less > 0)
}

/// Checks that both programs pass the same labels, after equally many effects. Adjacent labels of the source whose code vanished in between
/// share a bundle of the image.
pub(crate) fn compare_labels(labels: &Labels, source: &Side<'_>, image: &Side<'_>) -> Result<(), Difference> {
    let differ = |number: u32| {
        let name = labels.names.get(number as usize).map_or("", String::as_str);
        Difference {
            place: source.location(),
            ..refuse(format!("label `{name}` is in another place in the image"))
        }
    };
    let mut said = source.marks.labels.iter().peekable();
    for &((first, last), done) in &image.marks.labels {
        let within = |of: &(u32, u32)| first <= of.0 && of.1 <= last;
        let Some(&(mut passed, _)) = said.next_if(|(of, before)| within(of) && *before == done) else {
            return Err(differ(first));
        };
        while let Some(&(next, _)) =
            said.next_if(|(of, before)| within(of) && of.0 > passed.1 && *before == done)
        {
            passed = next;
        }
    }
    said.next().map_or(Ok(()), |(of, _)| Err(differ(of.0)))
}
