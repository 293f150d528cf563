// SPDX-License-Identifier: MIT OR Apache-2.0
//! Translation validation: checks that an image does what its source says, for every path and every input.
//!
//! The checker executes the plain program of the source ([`takt_asm::plain`]) and the image's words, both symbolically, and compares the
//! observable effects: writes to ports, data memory, flags and states, and decisions. `docs/verify.md` lists the trusted parts.

pub mod bound;
mod clock;
mod code;
mod fields;
mod labels;
mod liveness;
mod marks;
mod memory;
mod relation;
mod run;
mod term;

pub use term::MAX_STEPS;

use takt_asm::Contraction;
use takt_asm::plain::{PlainKind, PlainProgram};
use takt_isa::Program;
use takt_isa::program::{Location, SectionCycles};

/// First difference found, or the reason why the check cannot exclude a difference.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Difference {
    /// Line of the source.
    pub place: Option<Location>,
    /// Description of the difference.
    pub what: String,
    /// The source's term there, as text.
    pub source: Option<String>,
    /// The image's term there, as text.
    pub image: Option<String>,
}

/// Time of a section that takes equally long on every path, by the check's own statement of the rules of issue.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SectionTime {
    /// First bundle of the section in the image.
    pub start: u32,
    /// Cycles from the reset or the tick to cycle 0: the time to fetch that bundle after a reset.
    pub before: u64,
    /// Last bundle in the image: a `wait` or `halt`.
    pub wait: u32,
    /// Source line of the last bundle.
    pub location: Option<Location>,
    /// Cycle of the last bundle's issue; the first bundle can issue in cycle 1.
    pub cycles: u64,
    /// Cycle of the last write to each output, by number of its declaration.
    pub outputs: Vec<(usize, u64)>,
}

/// Result of a successful check.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct EquivalenceReport {
    /// Cuts: pairs of positions at which the relation between source and image is known.
    pub cuts: usize,
    /// Steps that the check took, of [`MAX_STEPS`].
    pub steps: u64,
    /// Source lines of sums that are fused with a product, and so round once less than written.
    pub fused: Vec<Option<Location>>,
    /// Sections that take equally long on every path.
    pub times: Vec<SectionTime>,
    /// Number of deadlines that hold in such sections.
    pub deadlines: usize,
    /// Source lines that fault, or leave the array of an element, on a path that the check cannot exclude; the image's behaviour from there on
    /// is not compared.
    pub faults: Vec<Location>,
}

impl EquivalenceReport {
    /// Compares claims about the cycles of sections with the times found. Returns the number of sections compared.
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

/// Checks that an image does what its source says. `contractions` lists the fused products; the list is a hint, and each entry is accepted
/// only where the source permits it and the image does it.
///
/// # Errors
/// The first difference found, or the reason why the check cannot exclude a difference.
pub fn verify(
    program: &Program,
    plain: &PlainProgram,
    contractions: &[Contraction],
) -> Result<EquivalenceReport, Difference> {
    let layout = fields::compare(program, plain)?;
    let source = code::of_source(plain, &layout, contractions)?;
    let image = code::of_image(program, &layout)?;
    let found = relation::Relation::new(plain, &source, &image, &layout).follow()?;
    let sums = found.fused.iter().filter_map(|number| {
        let [_, (bundle, at)] = contractions.get(*number)?.at;
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
    Ok(EquivalenceReport {
        cuts: found.cuts,
        steps: found.steps,
        fused: sums.collect(),
        times: found.times.into_values().collect(),
        deadlines,
        faults: found.faults.into_iter().map(|(file, line)| Location { file, line }).collect(),
    })
}
