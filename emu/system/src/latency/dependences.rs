// SPDX-License-Identifier: MIT OR Apache-2.0
//! Dependences through a core: the number of periods from each field of an incoming link to each field of an outgoing one.

use std::collections::{BTreeMap, BTreeSet};
use takt_analysis::dependence::{Dependence, Dependents, OutputEvent, Periods};
use takt_isa::Register;
use takt_isa::system::{Description, End, Link, LinkKind};

/// Dependences from one link to another: for each field of the first, the periods to each field of the second; `None` where the second
/// field does not depend on the first.
type Fields = Vec<Vec<Option<Periods>>>;

/// Dependences within every core of a system, by pairs of incoming and outgoing links.
#[derive(Clone, Debug)]
pub(super) struct LinkDependences {
    between: BTreeMap<(usize, usize), Fields>,
}

/// Periods of state on a path from a field of its first link to a field of its last.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct States {
    /// Least number of periods in each core on the path.
    pub(super) least: Vec<u32>,
    /// Greatest number of periods in each core, if certain for every core.
    pub(super) most: Option<Vec<u32>>,
    /// States carry the value on to later periods.
    pub(super) lasting: bool,
}

/// Dependence along a path: field of the first link, field of the last, and the states between.
pub(super) type FieldDependence = (usize, usize, States);

impl LinkDependences {
    /// Analyses the cores that wait for ticks.
    pub(super) fn new(description: &Description, waits: impl Fn(usize) -> bool) -> LinkDependences {
        let mut between = BTreeMap::new();
        for number in (0..description.cores.len()).filter(|&core| waits(core)) {
            let links = |end: fn(&Link) -> End| {
                let links = description.links.iter().enumerate();
                links.filter(move |(_, link)| end(link) == End::Core(number)).collect::<Vec<_>>()
            };
            let (inward, outward) = (links(|link| link.to), links(|link| link.from));
            let fields = |link: &Link| {
                let fields: Vec<_> = link.fields.iter().filter_map(|field| field.output).collect();
                fields
            };
            let by = outward.iter().filter_map(|(_, link)| match sent(description, link) {
                OutputEvent::By(by) => Some(fields(link).into_iter().map(move |field| (field, by))),
                OutputEvent::Written | OutputEvent::AtWait => None,
            });
            let by: BTreeSet<(Register, Register)> = by.flatten().collect();
            // A program that cannot be followed has no bounds either, so the error is reported there.
            let dependence = Dependence::new(&description.cores[number].program, &by);
            let dependence = dependence.unwrap_or_else(|_| Dependence::unknown());
            let mut dependents: BTreeMap<Register, Dependents<'_>> = BTreeMap::new();
            for &(from, link) in &inward {
                let arriving = arriving(link);
                for &port in arriving.iter().flatten() {
                    dependents.entry(port).or_insert_with(|| dependence.on(port));
                }
                for &(to, next) in &outward {
                    let sent = sent(description, next);
                    let periods = |ports: &Vec<Register>, output: Option<Register>| {
                        let each = ports.iter().filter_map(|port| dependents[port].output(output?, sent));
                        each.reduce(Periods::sooner)
                    };
                    let row = |ports: &Vec<Register>| {
                        next.fields.iter().map(|field| periods(ports, field.output)).collect()
                    };
                    between.insert((from, to), arriving.iter().map(row).collect());
                }
            }
        }
        LinkDependences { between }
    }

    /// Dependences from fields of a path's first link to fields of its last, with the periods of state between.
    pub(super) fn along_path(&self, description: &Description, way: &[usize]) -> Vec<FieldDependence> {
        let Some(&first) = way.first() else { return Vec::new() };
        let mut found = Vec::new();
        for input in 0..description.links[first].fields.len() {
            let mut reached: BTreeMap<usize, States> = BTreeMap::from([(
                input,
                States { least: Vec::new(), most: Some(Vec::new()), lasting: false },
            )]);
            for pair in way.windows(2) {
                let Some(fields) = self.between.get(&(pair[0], pair[1])) else { return Vec::new() };
                let mut next: BTreeMap<usize, States> = BTreeMap::new();
                for (field, before) in &reached {
                    for (to, periods) in fields[*field].iter().enumerate() {
                        let Some(periods) = periods else { continue };
                        let states = before.with(*periods);
                        let states = match next.remove(&to) {
                            Some(other) => other.or(states),
                            None => states,
                        };
                        next.insert(to, states);
                    }
                }
                reached = next;
            }
            found.extend(reached.into_iter().map(|(output, states)| (input, output, states)));
        }
        found
    }
}

impl States {
    /// Extends the path by one core.
    fn with(&self, periods: Periods) -> States {
        let more = |before: &Vec<u32>, more| before.iter().copied().chain([more]).collect();
        States {
            least: more(&self.least, periods.least),
            most: self.most.as_ref().zip(periods.most).map(|(before, most)| more(before, most)),
            lasting: self.lasting || periods.lasting,
        }
    }

    /// Merges two dependences over the same links: the smaller least number for each core, and the greatest numbers with the smaller sum.
    fn or(self, other: States) -> States {
        let sum = |most: &Vec<u32>| most.iter().map(|&periods| u64::from(periods)).sum::<u64>();
        States {
            least: self.least.iter().zip(&other.least).map(|(one, other)| *one.min(other)).collect(),
            most: [self.most, other.most].into_iter().flatten().min_by_key(sum),
            lasting: self.lasting || other.lasting,
        }
    }
}

/// Event that puts a core's writes onto a link.
fn sent(description: &Description, link: &Link) -> OutputEvent {
    match link.kind {
        LinkKind::Snapshot { strobe: Some(by) } | LinkKind::Fifo { push: Some(by), .. } => {
            OutputEvent::By(by)
        }
        _ if is_published(description, link) => OutputEvent::AtWait,
        _ => OutputEvent::Written,
    }
}

/// Input ports that change when a field arrives, for each field of a link to a core: the field's own port and a FIFO's status ports.
fn arriving(link: &Link) -> Vec<Vec<Register>> {
    let status: Vec<Register> = match &link.kind {
        LinkKind::Fifo { receiver, .. } => receiver.iter().map(|(_, register)| *register).collect(),
        LinkKind::Wire | LinkKind::Snapshot { .. } => Vec::new(),
    };
    let fields = link.fields.iter().filter_map(|field| field.input);
    fields.map(|field| [field].into_iter().chain(status.iter().copied()).collect()).collect()
}

/// The link carries values that its sender publishes, by a `publish` or by a `wait`.
pub(super) fn is_published(description: &Description, link: &Link) -> bool {
    match link.kind {
        LinkKind::Snapshot { strobe } => strobe.is_none(),
        LinkKind::Wire => description.core(link.from).is_some_and(|core| core.program.latched),
        LinkKind::Fifo { .. } => false,
    }
}
