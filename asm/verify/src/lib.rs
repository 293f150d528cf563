// SPDX-License-Identifier: MIT OR Apache-2.0
//! A checker that an image does what its source says (translation validation), for every path and every input.
//!
//! It executes the plain program of the source ([`takt_asm::plain`]) and the image's words, both symbolically, and compares what
//! can be seen: what is written to ports, data memory, flags, states, and where each goes. `docs/verify.md` says what it takes on
//! trust.

mod clock;
mod code;
mod memory;
mod relate;
mod run;
mod term;

pub use relate::MAX_VISITS;
pub use run::MAX_STEPS;
pub use term::MAX_TERMS;

use takt_asm::Contraction;
use takt_asm::plain::{Plain, PlainKind};
use takt_asm::select::Selection;
use takt_isa::Program;
use takt_isa::program::{Location, SectionCycles};

/// A change by the assembler that the source does not say. None is taken on trust: each is accepted only where the source permits it and
/// it changes no bit that is said.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Hint {
    /// A product is fused into a sum: each by its bundle in the plain program, and its number there.
    Fused {
        /// The product.
        product: (u32, u32),
        /// The sum.
        sum: (u32, u32),
    },
    /// A short branch, by its bundle in the plain program, is a selection.
    Selected(u32),
}

/// The hints of an assembled program: its fused sums and its selections.
pub fn hints(contractions: &[Contraction], selections: &[Selection]) -> Vec<Hint> {
    let fused = contractions.iter().map(|fused| Hint::Fused { product: fused.at[0], sum: fused.at[1] });
    fused.chain(selections.iter().map(|selection| Hint::Selected(selection.at))).collect()
}

/// The first difference, or the reason why none can be excluded.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Difference {
    /// The source line.
    pub place: Option<Location>,
    /// The difference, in words.
    pub what: String,
    /// The source's term there, in words.
    pub source: Option<String>,
    /// The image's term there.
    pub image: Option<String>,
}

/// The time of a section that takes the same on every path, by the check's own statement of the rules of issue.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SectionTime {
    /// The image's bundle that it begins with.
    pub start: u32,
    /// Cycles from the reset or the tick to cycle 0: the time to fetch that bundle after a reset.
    pub before: u64,
    /// The image's bundle that ends it: a `wait` or `halt`.
    pub wait: u32,
    /// The source line of that.
    pub location: Option<Location>,
    /// The cycle in which it issues; the section's first bundle can issue in cycle 1.
    pub cycles: u64,
    /// The cycle in which each output is last written: by the number of its declaration.
    pub outputs: Vec<(usize, u64)>,
}

/// The result of a check that succeeds.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Established {
    /// Places at which the relation between source and image was found.
    pub cuts: usize,
    /// Times that one of them was visited.
    pub visits: usize,
    /// Bundles executed, of both programs.
    pub steps: u64,
    /// Terms made.
    pub terms: usize,
    /// Sums that are fused with a product, by source line: a rounding less than written.
    pub fused: Vec<Option<Location>>,
    /// Sections that take the same time on every path.
    pub times: Vec<SectionTime>,
    /// Deadlines that hold in such sections.
    pub deadlines: usize,
}

impl Established {
    /// Compares claims about the cycles of sections with the times found here. Returns the number of sections compared.
    ///
    /// # Errors
    /// The first claim that does not hold.
    pub fn compare(&self, claims: &[SectionCycles]) -> Result<usize, Difference> {
        let mut compared = 0;
        for claim in claims {
            let of_claim =
                |time: &&SectionTime| time.start == claim.address.get() && claim.once == (time.before > 0);
            for time in self.times.iter().filter(of_claim) {
                let cycles = time.before + time.cycles;
                if cycles < claim.cycles.best || cycles > claim.cycles.worst {
                    return Err(Difference {
                        place: time.location,
                        what: format!("section `{}` takes another time than is claimed", claim.name),
                        source: Some(format!("{} to {} cycles", claim.cycles.best, claim.cycles.worst)),
                        image: Some(format!("{cycles} cycles")),
                    });
                }
                compared += 1;
            }
        }
        Ok(compared)
    }
}

/// Checks that an image does what the source says.
///
/// # Errors
/// The first difference, or the reason why none can be excluded.
pub fn verify(program: &Program, plain: &Plain, hints: &[Hint]) -> Result<Established, Difference> {
    let source = code::of_source(plain, hints)?;
    let image = code::of_image(program, plain)?;
    let selected = hints.iter().filter_map(|hint| match hint {
        Hint::Selected(bundle) => Some(*bundle),
        Hint::Fused { .. } => None,
    });
    let found = relate::Relation::new(plain, &source, &image, selected.collect()).follow()?;
    let sums = found.fused.iter().filter_map(|number| {
        let &Hint::Fused { sum: (bundle, at), .. } = hints.get(*number)? else { return None };
        Some(plain.bundles[bundle as usize].operations[at as usize].location)
    });
    let period = program.sections.iter().find(|section| section.name == "period");
    let outputs: Vec<(usize, &str)> = code::named(plain, PlainKind::Output).collect();
    let mut deadlines = 0;
    for time in found.times.values() {
        let in_period = period.is_some_and(|section| section.start.get() <= time.wait);
        for &(register, cycle, of_period) in &plain.deadlines {
            let port = outputs.iter().position(|(id, _)| *id == register as usize);
            let written = port.and_then(|port| time.outputs.iter().find(|output| output.0 == port));
            let Some((port, written)) = written.filter(|_| of_period == in_period) else { continue };
            if *written > u64::from(cycle) {
                let what = format!(
                    "output `{}` is written in cycle {written}, after its deadline {cycle}",
                    outputs[*port].1
                );
                return Err(Difference { place: time.location, what, source: None, image: None });
            }
            deadlines += 1;
        }
    }
    Ok(Established {
        cuts: found.cuts,
        visits: found.visits,
        steps: found.steps,
        terms: found.terms,
        fused: sums.collect(),
        times: found.times.into_values().collect(),
        deadlines,
    })
}
