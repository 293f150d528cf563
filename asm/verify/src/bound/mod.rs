// SPDX-License-Identifier: MIT OR Apache-2.0
//! Check of a certificate of bounds ([`takt_isa::certificate`]). Nothing is searched for: each claimed place is compared with what the check's
//! own rules of issue give from the place before it. `docs/verify.md` has the argument why claims that pass are bounds.

mod flow;
mod path;
mod sections;

use flow::{Flow, LoopCount};
use path::{Cost, State, Touched, Way, line};
use sections::{Key, SectionSpans, claims};
use std::collections::BTreeMap;
use std::fmt;
use takt_isa::Program;
use takt_isa::certificate::{self, Certificate, Claim, Edge, End, Exit, FORMAT, Lemma, Place, Proof};
use takt_isa::certificate::{Step, Target, Turn, fingerprint};

/// Limit on the length of a certificate in bytes.
pub const MAX_BYTES: u64 = 1 << 26;
/// Limit on the bundles that a check executes.
pub const MAX_BUNDLES: u64 = 1 << 27;

/// Reason why a certificate does not prove its claims.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unproved {
    /// Part of the certificate, such as `proof 0, lemma 3, place 7`.
    pub part: String,
    /// Bundle at which the claim fails, with its source line; `None` if the reason is no bundle's.
    pub bundle: Option<String>,
    /// The reason.
    pub what: String,
}

impl fmt::Display for Unproved {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bundle = self.bundle.as_ref().map_or_else(String::new, |bundle| format!("{bundle}: "));
        let part = if self.part.is_empty() { String::new() } else { format!(" ({})", self.part) };
        write!(f, "{bundle}{}{part}", self.what)
    }
}

impl std::error::Error for Unproved {}

/// Result of a successful check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProvedBounds {
    /// Claims, all of which hold.
    pub sections: Vec<Claim>,
    /// Number of lemmas.
    pub lemmas: usize,
    /// Number of places: bundles in one state.
    pub places: usize,
    /// Number of bundles that the check has executed.
    pub bundles: u64,
}

/// Checks that a certificate, as text, proves its claims about a program.
///
/// # Errors
/// The first step that the rules do not give.
pub fn check(program: &Program, text: &[u8]) -> Result<ProvedBounds, Unproved> {
    let refused = |what: String| Unproved { part: String::new(), bundle: None, what };
    if text.len() as u64 > MAX_BYTES {
        return Err(refused(format!("the certificate is longer than {MAX_BYTES} bytes")));
    }
    let read = serde_json::from_slice(text);
    let certificate: Certificate =
        read.map_err(|error| refused(format!("this is no certificate: {error}")))?;
    let Certificate { format, machine, program: of, sections, proofs } = certificate;
    if format != FORMAT {
        return Err(refused(format!("the certificate's format is `{format}`, not `{FORMAT}`")));
    }
    if machine != program.machine.name {
        let name = program.machine.name;
        return Err(refused(format!("the certificate is for machine `{machine}`, the program for `{name}`")));
    }
    if of != fingerprint(program) {
        return Err(refused("the certificate is of another program, or of another machine".to_owned()));
    }
    let flow = Flow::new(program).map_err(|(at, what)| Unproved {
        part: String::new(),
        bundle: Some(place_text(program, at)),
        what,
    })?;
    let mut checker =
        Checker { flow: &flow, part: String::new(), states: Vec::new(), proved: Vec::new(), bundles: 0 };
    let mut spans = Vec::new();
    for (number, proof) in proofs.iter().enumerate() {
        let proved = checker.proof(number, proof).map_err(|failure| failure.of(&checker))?;
        spans.push(proved);
    }
    checker.part = "sections".to_owned();
    claims(program, &sections, &spans).map_err(|failure| failure.of(&checker))?;
    let lemmas = proofs.iter().flat_map(|proof| &proof.lemmas);
    let places = lemmas.clone().map(|lemma| match lemma {
        Lemma::Code { places, .. } => places.len(),
        Lemma::Loop { turns, .. } => turns.iter().map(Vec::len).sum(),
    });
    Ok(ProvedBounds {
        lemmas: lemmas.clone().count(),
        places: places.sum(),
        bundles: checker.bundles,
        sections,
    })
}

fn place_text(program: &Program, at: u32) -> String {
    let address = takt_isa::BundleAddress::new(at);
    let bundle = match program.nearest_label(address) {
        Some((label, 0)) => format!("bundle {at} ({label})"),
        Some((label, distance)) => format!("bundle {at} ({label} + {distance})"),
        None => format!("bundle {at}"),
    };
    program.bundle_place(address).map_or(bundle.clone(), |place| format!("{place}: {bundle}"))
}

/// Reason of a refusal, with its bundle.
struct Failure {
    at: Option<u32>,
    what: String,
}

impl Failure {
    fn of(self, checker: &Checker<'_>) -> Unproved {
        let bundle = self.at.map(|at| place_text(checker.flow.program, at));
        Unproved { part: checker.part.clone(), bundle, what: self.what }
    }
}

impl From<String> for Failure {
    fn from(what: String) -> Failure {
        Failure { at: None, what }
    }
}

impl From<&str> for Failure {
    fn from(what: &str) -> Failure {
        what.to_owned().into()
    }
}

impl From<(u32, String)> for Failure {
    fn from((at, what): (u32, String)) -> Failure {
        Failure { at: Some(at), what }
    }
}

/// Adds the bundle to a reason.
fn at<T>(bundle: u32, result: Result<T, String>) -> Result<T, Failure> {
    result.map_err(|what| (bundle, what).into())
}

fn same(found: usize, claimed: usize) -> Result<(), String> {
    if found == claimed {
        return Ok(());
    }
    Err(format!("{found} ways lead on from here, and {claimed} are claimed"))
}

/// Lemma that has been proved.
struct Proved<'c> {
    /// First bundle.
    start: u32,
    is_loop: bool,
    state: u32,
    exits: &'c [Exit],
    touched: Touched,
}

struct Checker<'c> {
    flow: &'c Flow<'c>,
    /// Part of the certificate that is being checked.
    part: String,
    states: Vec<State>,
    proved: Vec<Proved<'c>>,
    bundles: u64,
}

impl<'c> Checker<'c> {
    fn state(&self, number: u32) -> Result<&State, String> {
        self.states.get(number as usize).ok_or_else(|| format!("there is no state {number}"))
    }

    /// Lemma before the present one.
    fn before(&self, number: u32) -> Result<&Proved<'c>, String> {
        let missing = || format!("lemma {number} does not stand before this one");
        self.proved.get(number as usize).ok_or_else(missing)
    }

    fn covered(&self, found: &State, claimed: &State) -> Result<(), String> {
        found.is_covered_by(claimed, self.flow.program.machine)
    }

    /// Checks a proof; returns the cycles of each section.
    fn proof(&mut self, number: usize, proof: &'c Proof) -> Result<BTreeMap<Key, SectionSpans>, Failure> {
        (self.states, self.proved) = (Vec::new(), Vec::new());
        for (state, of) in proof.states.iter().zip(0..) {
            self.part = format!("proof {number}, state {of}");
            self.states.push(State::read(state, self.flow.program.machine)?);
        }
        self.part = format!("proof {number}, prices");
        let mut prices: BTreeMap<u32, u64> = BTreeMap::new();
        for &(head, price) in &proof.prices {
            let total = self.flow.loops.get(&head).and_then(|count| count.total);
            total.ok_or((head, "no loop with a promised total begins here".to_owned()))?;
            prices.insert(head, price);
        }
        for (lemma, of) in proof.lemmas.iter().zip(0..) {
            let part = format!("proof {number}, lemma {of}");
            self.part.clone_from(&part);
            let proved = match lemma {
                Lemma::Code { places, exits } => self.code(&part, places, exits)?,
                Lemma::Loop { head, state, turns, steady, exits } => {
                    let count = self.flow.loops.get(head);
                    let count = *count.ok_or((*head, "no loop with a bound begins here".to_owned()))?;
                    let price = prices.get(head).copied().unwrap_or(0);
                    let turns = Turns { head: *head, count, price, turns, steady: *steady, exits };
                    self.turns(&part, *state, turns)?
                }
            };
            self.proved.push(proved);
        }
        self.part = format!("proof {number}, entries");
        self.entries(proof, &prices)
    }

    /// Checks a lemma of code: each place, and each of its edges.
    fn code(&mut self, part: &str, places: &'c [Place], exits: &'c [Exit]) -> Result<Proved<'c>, Failure> {
        let first = places.first().ok_or("the lemma has no place")?;
        at(first.at, Cost::default().is_covered_by(first.cycles.into(), "the first place"))?;
        let mut touched = Touched::default();
        for (number, place) in places.iter().enumerate() {
            self.part = format!("{part}, place {number}");
            if number > 0 && self.flow.loops.contains_key(&place.at) {
                touched.heads.insert(place.at);
            }
            let ways = self.ways(place, &mut touched)?;
            at(place.at, same(ways.len(), place.edges.len()))?;
            for (way, edge) in ways.iter().zip(&place.edges) {
                at(place.at, self.edge(way, edge, (number, place), (places, exits)))?;
            }
        }
        Ok(Proved { start: first.at, is_loop: false, state: first.state, exits, touched })
    }

    /// Ways on from a place.
    fn ways(&mut self, place: &Place, touched: &mut Touched) -> Result<Vec<Way>, Failure> {
        let state = at(place.at, self.state(place.state))?.clone();
        let (last, callee) = match place.step {
            Step::To(last) => (last, None),
            Step::Call(last, callee) => (last, Some(callee)),
            Step::Loop(lemma) => {
                let lemma = at(place.at, self.before(lemma))?;
                if !lemma.is_loop || lemma.start != place.at {
                    return Err(
                        (place.at, "the lemma is not that of a loop which begins here".to_owned()).into()
                    );
                }
                touched.include(&lemma.touched);
                return at(place.at, self.after(lemma, &state, place.edges.len()));
            }
        };
        let ways = line(self.flow, (place.at, last), &state, touched, &mut self.bundles)?;
        if self.bundles > MAX_BUNDLES {
            return Err(
                (place.at, format!("the check has executed {MAX_BUNDLES} bundles and gives up")).into()
            );
        }
        let is_call = self.flow.is_call(last);
        let Some(callee) = callee else {
            let what = "a call has no lemma of its subroutine";
            return if is_call { Err((last, what.to_owned()).into()) } else { Ok(ways) };
        };
        let [Way { end: End::Go { to, .. }, state: Some(state), cycles, .. }] = &ways[..] else {
            return Err((last, "the bundle calls no subroutine".to_owned()).into());
        };
        let callee = at(last, self.before(callee))?;
        if !is_call || callee.is_loop || callee.start != *to {
            return Err(
                (last, "the lemma is not that of the subroutine which is called here".to_owned()).into()
            );
        }
        touched.include(&callee.touched);
        touched.heads.extend(self.flow.loops.contains_key(to).then_some(*to));
        let mut after = at(last, self.after(callee, state, place.edges.len()))?;
        for way in &mut after {
            way.cycles = way.cycles.and(*cycles);
            way.end = match way.end {
                End::Return { .. } => End::Go { to: last.saturating_add(1), back: false },
                End::Publish { .. } | End::Halt { .. } => way.end,
                End::Wait { .. } => return Err((last, "a subroutine waits for the tick".to_owned()).into()),
                End::Go { .. } => {
                    return Err((last, "a subroutine is left other than by a return".to_owned()).into());
                }
            };
        }
        Ok(after)
    }

    /// Ways out of a proved lemma that is entered in a state. Registers that it does not write keep their values.
    fn after(&self, lemma: &Proved<'_>, state: &State, edges: usize) -> Result<Vec<Way>, String> {
        same(lemma.exits.len(), edges)?;
        self.covered(state, self.state(lemma.state)?)?;
        let kept = state.known.iter().filter(|(register, _)| !lemma.touched.registers.contains(register));
        let kept: BTreeMap<usize, u32> = kept.map(|(register, value)| (*register, *value)).collect();
        let way = |exit: &Exit| {
            let mut after = exit.state.map(|number| self.state(number).cloned()).transpose()?;
            if let (Some(after), End::Go { .. } | End::Return { .. }) = (&mut after, exit.end) {
                after.known.extend(&kept);
            }
            Ok(Way { end: exit.end, state: after, cycles: exit.cycles.into(), is_possible: true })
        };
        lemma.exits.iter().map(way).collect()
    }

    /// Checks an edge of a place: to a later place, or to an exit.
    fn edge(
        &self,
        way: &Way,
        edge: &Edge,
        (number, place): (usize, &Place),
        (places, exits): (&[Place], &[Exit]),
    ) -> Result<(), String> {
        if edge.to == Target::None {
            let what = || format!("the way {} has no edge", text(way.end));
            return if way.is_possible { Err(what()) } else { Ok(()) };
        }
        way.cycles.is_covered_by(edge.cycles.into(), &format!("the edge {}", text(way.end)))?;
        let cycles = Cost::from(place.cycles).and(edge.cycles.into());
        match edge.to {
            Target::Place(to) => {
                let target = places.get(to as usize).filter(|_| to as usize > number);
                let target = target.ok_or_else(|| format!("place {to} is no later one of the lemma"))?;
                let End::Go { to, back } = way.end else {
                    return Err(format!("the way {} leads to no other place", text(way.end)));
                };
                if to != target.at {
                    return Err(format!("an edge leads to bundle {to}, and to {} as is claimed", target.at));
                }
                if back && self.flow.loops.get(&to).is_some_and(|count| count.last.is_some()) {
                    return Err(format!(
                        "an iteration of the counted loop at bundle {to} begins outside of it"
                    ));
                }
                if let (Some(found), claimed) = (&way.state, self.state(target.state)?) {
                    self.covered(found, claimed)?;
                }
                cycles.is_covered_by(target.cycles.into(), &format!("the way to bundle {to}"))
            }
            Target::Exit(exit) => self.exit(way, cycles, exits, exit),
            Target::None => Ok(()),
        }
    }

    /// Checks a way out of a lemma.
    fn exit(&self, way: &Way, cycles: Cost, exits: &[Exit], number: u32) -> Result<(), String> {
        let exit = exits.get(number as usize).ok_or_else(|| format!("the lemma has no exit {number}"))?;
        if exit.end != way.end {
            return Err(format!("a way {} is claimed to be one {}", text(way.end), text(exit.end)));
        }
        match (&way.state, exit.state) {
            (Some(found), Some(claimed)) => self.covered(found, self.state(claimed)?)?,
            (None, None) => {}
            _ => return Err(format!("exit {number} has a state, or has none, against its kind")),
        }
        cycles.is_covered_by(exit.cycles.into(), &format!("the way {}", text(exit.end)))
    }

    /// Checks a lemma of a loop: each turn, and the induction over those that are alike.
    fn turns(&mut self, part: &str, state: u32, of: Turns<'c>) -> Result<Proved<'c>, Failure> {
        let Turns { head, count, turns, exits, .. } = of;
        let entry = at(head, self.state(state))?.clone();
        // A count of 0 or beyond the bound is a fault.
        let exact = entry.count.filter(|of| count.last.is_some() && (1..=count.most).contains(of));
        let (least, most) = exact.map_or((count.least, count.most), |of| (of, of));
        let begin = State { count: None, ..entry };
        match turns.first().map(Vec::as_slice) {
            Some([first]) => {
                let claimed = at(head, self.state(first.state))?;
                at(head, self.covered(&begin, claimed))?;
                at(head, Cost::default().is_covered_by(first.cycles.into(), "the first iteration"))?;
            }
            None if most == 0 => {}
            _ => return Err((head, "the first iteration does not begin in one state".to_owned()).into()),
        }
        let mut touched = Touched::default();
        for (turn, number) in turns.iter().zip(1..) {
            self.part = format!("{part}, turn {number}");
            let is_last = number as usize == turns.len();
            let steady = of.steady.filter(|_| is_last);
            if number > most || steady.is_some() && turn.len() != 1 {
                let what = format!("the loop has no such iteration: {most} at most, or no single state");
                return Err((head, what).into());
            }
            for place in turn {
                let range = Range { number, least, most, steady };
                at(head, self.turn(place, &of, range, &mut touched))?;
            }
        }
        touched.heads.insert(head);
        Ok(Proved { start: head, is_loop: true, state, exits, touched })
    }

    /// Checks an iteration from one place.
    fn turn(
        &self,
        place: &Turn,
        of: &Turns<'c>,
        Range { number, least, most, steady }: Range,
        touched: &mut Touched,
    ) -> Result<(), String> {
        let Turns { head, count, price, turns, exits, .. } = *of;
        let lemma = self.before(place.lemma)?;
        if lemma.is_loop || lemma.start != head {
            return Err("the lemma is not that of an iteration".to_owned());
        }
        if lemma.touched.heads.contains(&head) {
            return Err("an iteration comes to the loop's head in a way that restarts the count".to_owned());
        }
        touched.include(&lemma.touched);
        let state = self.state(place.state)?;
        let ways = self.after(lemma, state, place.edges.len())?;
        for (way, target) in ways.iter().zip(&place.edges) {
            let cycles = Cost { worst: way.cycles.worst - i128::from(price), ..way.cycles };
            let so_far = Cost::from(place.cycles).and(cycles);
            if way.end == (End::Go { to: head, back: true }) {
                if number == most {
                    continue;
                }
                let found = way.state.as_ref().ok_or("a way back has no state")?;
                if let Some(steady) = steady {
                    self.covered(found, state)?;
                    cycles.is_covered_by(steady.into(), "a further iteration")?;
                    continue;
                }
                let next = match target {
                    Target::Place(next) => {
                        turns.get(number as usize).and_then(|turn| turn.get(*next as usize))
                    }
                    Target::Exit(_) | Target::None => None,
                };
                let next = next.ok_or_else(|| format!("iteration {} is missing", number + 1))?;
                self.covered(found, self.state(next.state)?)?;
                so_far.is_covered_by(next.cycles.into(), &format!("the way to iteration {}", number + 1))?;
                continue;
            }
            // A counted loop is left by its last bundle alone, once its count is used up.
            let is_counted_exit = match (way.end, count.last) {
                (End::Go { to, .. }, Some(last)) if to == last.saturating_add(1) => true,
                (End::Go { to, .. }, Some(_)) => {
                    return Err(format!("the counted loop is left to bundle {to}, not by its last bundle"));
                }
                _ => false,
            };
            let soonest = if is_counted_exit { least.saturating_sub(number) } else { 0 };
            if steady.is_none() && soonest > 0 {
                continue;
            }
            let more = steady.map_or(Cost::default(), |steady| {
                let Cost { best, worst } = steady.into();
                // Iterations cheaper than their price: the fewest are the worst.
                let costliest = if worst < 0 { soonest } else { most - number };
                Cost { best: best * i128::from(soonest), worst: worst * i128::from(costliest) }
            });
            let Target::Exit(exit) = *target else {
                return Err(format!("the way {} has no exit", text(way.end)));
            };
            self.exit(way, so_far.and(more), exits, exit)?;
        }
        Ok(())
    }
}

/// Claimed lemma of a loop.
struct Turns<'c> {
    head: u32,
    count: LoopCount,
    price: u64,
    turns: &'c [Vec<Turn>],
    steady: Option<certificate::Cost>,
    exits: &'c [Exit],
}

/// Iteration, by its number from 1, within the least and most; with the cycles of those that follow if they are alike.
#[derive(Clone, Copy)]
struct Range {
    number: u32,
    least: u32,
    most: u32,
    steady: Option<certificate::Cost>,
}

/// Kind of a way, for messages.
fn text(end: End) -> String {
    match end {
        End::Go { to, back: false } => format!("to bundle {to}"),
        End::Go { to, back: true } => format!("back to bundle {to}"),
        End::Return { at } => format!("to the return at bundle {at}"),
        End::Wait { at, target } => format!("to the `wait` at bundle {at}, which leads to bundle {target}"),
        End::Publish { at } => format!("to the `publish` at bundle {at}"),
        End::Halt { at } => format!("to the `halt` at bundle {at}"),
    }
}
