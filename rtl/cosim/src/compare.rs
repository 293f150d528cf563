// SPDX-License-Identifier: MIT OR Apache-2.0
//! Comparison of the events of emulator and circuit.

use crate::event::{CircuitEvent, instruction, show};
use takt_isa::Program;
use takt_isa::timing::Cycle;

/// First difference between emulator and circuit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// Cycle of the event.
    pub cycle: Cycle,
    /// Core, link or pin of a system; empty for a single core.
    pub place: String,
    /// Instruction and its place in the source, if the event has one.
    pub instruction: String,
    /// The emulator's event, as text.
    pub emulator: String,
    /// The circuit's event, as text.
    pub circuit: String,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "cycle {}", self.cycle)?;
        if !self.place.is_empty() {
            write!(f, ", {}", self.place)?;
        }
        if !self.instruction.is_empty() {
            write!(f, " at {}", self.instruction)?;
        }
        write!(f, "\n  emulator: {}\n  circuit:  {}", self.emulator, self.circuit)
    }
}

impl std::error::Error for Difference {}

/// Events of emulator and circuit that wait for comparison.
pub(crate) struct Comparison<E> {
    /// Events of the emulator.
    pub(crate) expected: Vec<E>,
    /// Events of the circuit.
    pub(crate) found: Vec<E>,
    /// Number of equal events.
    pub(crate) compared: u64,
}

impl<E> Default for Comparison<E> {
    fn default() -> Comparison<E> {
        Comparison { expected: Vec::new(), found: Vec::new(), compared: 0 }
    }
}

/// A pair of different events at one place, or an event that the other side lacks.
pub(crate) struct EventMismatch<E> {
    pub(crate) emulator: Option<E>,
    pub(crate) circuit: Option<E>,
}

impl<E: PartialEq + Copy> Comparison<E> {
    /// Compares the events whose counterparts are `known`, in the order of `key`. Different events of one `place` are reported as a pair;
    /// otherwise the other side lacks the earlier event.
    pub(crate) fn check<K: Ord, P: Ord>(
        &mut self,
        known: impl Fn(&E) -> bool,
        key: impl Fn(&E) -> K,
        place: impl Fn(&E) -> P,
    ) -> Result<(), EventMismatch<E>> {
        let take = |events: &mut Vec<E>| {
            let (mut taken, left): (Vec<_>, Vec<_>) = events.drain(..).partition(|event| known(event));
            *events = left;
            taken.sort_by_key(|event| key(event));
            taken
        };
        let (expected, found) = (take(&mut self.expected), take(&mut self.found));
        let same = expected.iter().zip(&found).take_while(|(a, b)| a == b).count();
        self.compared += same as u64;
        match (expected.get(same).copied(), found.get(same).copied()) {
            (None, None) => Ok(()),
            (Some(a), Some(b)) if place(&a) < place(&b) => {
                Err(EventMismatch { emulator: Some(a), circuit: None })
            }
            (Some(a), Some(b)) if place(&a) > place(&b) => {
                Err(EventMismatch { emulator: None, circuit: Some(b) })
            }
            (emulator, circuit) => Err(EventMismatch { emulator, circuit }),
        }
    }
}

impl<E> EventMismatch<E> {
    /// Texts of both sides.
    pub(crate) fn sides(&self, text: impl Fn(&E) -> String) -> [String; 2] {
        [&self.emulator, &self.circuit].map(|event| event.as_ref().map_or("nothing".to_owned(), &text))
    }

    /// Event that locates the difference.
    pub(crate) fn first(&self) -> Option<&E> {
        self.emulator.as_ref().or(self.circuit.as_ref())
    }
}

/// Core of a circuit: its name, empty for a single core, and its program.
pub(crate) type Core<'a> = (&'a str, &'a Program);

impl Comparison<CircuitEvent> {
    /// Compares the events whose counterparts are `known`, in order; the difference names cores and links.
    pub(crate) fn check_events(
        &mut self,
        known: impl Fn(&CircuitEvent) -> bool,
        cores: &[Core<'_>],
        link: impl Fn(usize) -> String,
    ) -> Result<(), Box<Difference>> {
        let Err(unequal) = self.check(known, CircuitEvent::key, CircuitEvent::place) else { return Ok(()) };
        let [emulator, circuit] = unequal.sides(|event| match event {
            CircuitEvent::Core { core, event } => show(cores[*core].1, event),
            CircuitEvent::Link(event) => event.kind.text(),
        });
        let first = unequal.first();
        let (place, instruction) = match first {
            Some(CircuitEvent::Core { core, event }) => {
                let (name, program) = cores[*core];
                let place = if name.is_empty() { String::new() } else { format!("core {name}") };
                (place, instruction(program, event))
            }
            Some(CircuitEvent::Link(event)) => (format!("link {}", link(event.link)), String::new()),
            None => Default::default(),
        };
        let cycle = first.map_or(0, CircuitEvent::cycle);
        Err(Box::new(Difference { cycle, place, instruction, emulator, circuit }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One difference of each kind: in a value, and an event that one side lacks.
    #[test]
    fn the_first_difference_is_found() {
        let check = |expected: &[(u64, char)], found: &[(u64, char)]| {
            let mut comparison =
                Comparison { expected: expected.to_vec(), found: found.to_vec(), ..Comparison::default() };
            let unequal = comparison.check(|event| event.0 < 9, |event| *event, |event| event.0).err();
            (comparison.compared, unequal.map(|unequal| unequal.sides(|event| event.1.to_string())))
        };
        let sides = |a: &str, b: &str| Some([a.to_owned(), b.to_owned()]);
        assert_eq!(check(&[(2, 'b'), (1, 'a')], &[(1, 'a'), (2, 'b'), (9, 'x')]), (2, None));
        assert_eq!(check(&[(1, 'a'), (2, 'b')], &[(1, 'a'), (2, 'c')]), (1, sides("b", "c")));
        assert_eq!(check(&[(1, 'a'), (3, 'b')], &[(2, 'c'), (3, 'b')]), (0, sides("a", "nothing")));
        assert_eq!(check(&[(3, 'b')], &[(2, 'c'), (3, 'b')]), (0, sides("nothing", "c")));
        assert_eq!(check(&[(1, 'a'), (2, 'b')], &[(1, 'a')]), (1, sides("b", "nothing")));
    }
}
