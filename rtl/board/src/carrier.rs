// SPDX-License-Identifier: MIT OR Apache-2.0
//! Carriers of a wiring: the common time of half bridges, samples and ticks. Positions count the cycles of a carrier's period from its
//! valley on.

use crate::document::{Document, Located, Table};
use crate::wiring::{MOST_PERIOD, Wiring};

/// Most carriers of a wiring.
pub const CARRIERS: usize = 16;
/// Least cycles of a half period.
const LEAST_HALF: u32 = 8;
/// Cycles of `takt_tick` from the cycle in which it may run to its first tick, without lead.
const RUN: u32 = 2;

/// A triangular carrier (`takt_carrier`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Carrier {
    /// Name of the carrier.
    pub name: String,
    /// Cycles of half a period.
    pub half: u32,
    /// Cycles by which the valleys come after those of a carrier without phase.
    pub behind: u32,
}

impl Carrier {
    /// Cycles of a period.
    pub fn period(&self) -> u32 {
        2 * self.half
    }

    /// Position in the first cycle after the board's reset.
    pub fn start(&self) -> u32 {
        (self.period() - self.behind) % self.period()
    }
}

/// Places of a carrier at which ticks come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TickPlace {
    /// At valleys.
    Valley,
    /// At peaks.
    Peak,
    /// At valleys and at peaks.
    Both,
}

/// Ticks that follow a carrier.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CarrierTick {
    /// Index of the carrier.
    pub carrier: usize,
    /// Place that precedes each tick.
    pub place: TickPlace,
    /// Cycles from a place to its tick.
    pub after: u32,
}

/// A position of a carrier, at which something happens in each period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instant {
    /// Index of the carrier.
    pub carrier: usize,
    /// Position, 0 to the period less 1.
    pub at: u32,
}

impl Wiring {
    /// Positions of a carrier in the cycles of the board's ticks; `None` if no carrier gives the ticks, or this carrier's period does not
    /// fit them.
    pub fn tick_positions(&self, carrier: usize) -> Option<Vec<u32>> {
        let tick = self.tick.as_ref()?;
        let (from, to) = (self.carriers.get(tick.carrier)?, self.carriers.get(carrier)?);
        if !from.period().is_multiple_of(to.period()) {
            return None;
        }
        let places = match tick.place {
            TickPlace::Valley => vec![0],
            TickPlace::Peak => vec![from.half],
            TickPlace::Both => vec![0, from.half],
        };
        let at = |place: u32| {
            let later = u64::from(place) + u64::from(tick.after) + u64::from(from.behind);
            let period = u64::from(to.period());
            ((later + period - u64::from(to.behind) % period) % period) as u32
        };
        Some(places.into_iter().map(at).collect())
    }

    /// Least and greatest cycles from an instant to the first tick at least `least` cycles later.
    pub fn cycles_to_tick(&self, instant: Instant, least: u32) -> (u32, u32) {
        let period = self.carriers[instant.carrier].period();
        let Some(ticks) = self.tick_positions(instant.carrier) else {
            return (least, least + self.period - 1);
        };
        // After the latest instant that is `least` before the tick.
        let to = |tick: u32| {
            let cycles = (tick + period - instant.at) % period;
            let short = least.saturating_sub(cycles).div_ceil(period);
            cycles + short * period
        };
        let all = || ticks.iter().map(|tick| to(*tick));
        (all().min().unwrap_or(least), all().max().unwrap_or(least))
    }

    /// Position of the ticks' carrier in which the board's `takt_tick` may begin to run, and whether half a period later will do as well.
    pub(crate) fn aligned(&self) -> Option<(Instant, bool)> {
        let tick = self.tick.as_ref()?;
        let period = self.carriers[tick.carrier].period();
        let first = *self.tick_positions(tick.carrier)?.first()?;
        let back = (self.lead + RUN) % period;
        Some((
            Instant { carrier: tick.carrier, at: (first + period - back) % period },
            tick.place == TickPlace::Both,
        ))
    }
}

/// Carriers of a file, the ticks that one of them gives, and the cycles from tick to tick.
#[derive(Default)]
pub(crate) struct Carriers {
    pub(crate) all: Vec<Carrier>,
    pub(crate) tick: Option<(CarrierTick, u32)>,
}

/// Reads the table `carrier`.
pub(crate) fn read<'a>(document: &'a Document<'a>, top: &Table<'a>, clock: f64) -> Carriers {
    let mut found = Carriers::default();
    for (name, table) in top.table("carrier").iter().flat_map(Table::tables) {
        if found.all.len() == CARRIERS {
            document.mistake(&name.place, format!("there are more than {CARRIERS} carriers"));
            break;
        }
        if let Some(text) = crate::wiring::unnamed(&name.value, "a carrier") {
            document.mistake(&name.place, text);
        }
        let Some(half) = half(document, &name, &table, clock) else {
            table.reject_unknown_keys(&["tick", "every", "after", "phase"]);
            continue;
        };
        let phase = table.number("phase", 0.0, 1.0).map_or(0.0, |at| at.value);
        let behind = (phase * f64::from(2 * half)).round() as u32 % (2 * half);
        let carrier = Carrier { name: name.value.clone(), half, behind };
        if let Some((tick, place)) = tick(document, &table, found.all.len(), half, clock) {
            match &found.tick {
                Some((other, _)) => {
                    let text = format!("the ticks come from the carrier `{}`", found.all[other.carrier].name);
                    document.mistake(&place, text);
                }
                None => found.tick = Some(tick),
            }
        }
        table.reject_unknown_keys(&["tick", "every", "after"]);
        found.all.push(carrier);
    }
    found
}

/// Cycles of half a period, from `half`, or from `frequency` in kHz.
fn half<'a>(
    document: &'a Document<'a>,
    name: &Located<String>,
    table: &Table<'a>,
    clock: f64,
) -> Option<u32> {
    let half = table.integer("half", LEAST_HALF, u16::MAX.into());
    let frequency = table.number("frequency", 1e-3, 1e6);
    match (half, frequency) {
        (Some(half), None) => Some(half.value),
        (None, Some(at)) => {
            let half = (clock * 1e3 / at.value / 2.0).round();
            if !(f64::from(LEAST_HALF)..=f64::from(u16::MAX)).contains(&half) {
                let text = format!(
                    "{} kHz are {half} cycles of {clock} MHz for half a period; expected {LEAST_HALF} to {}",
                    at.value,
                    u16::MAX
                );
                document.mistake(&at.place, text);
                return None;
            }
            Some(half as u32)
        }
        (Some(_), Some(at)) => {
            document.mistake(&at.place, "`half` already determines the period: leave out one of the two");
            None
        }
        (None, None) => {
            if table.place_of("half").or(table.place_of("frequency")).is_none() {
                let text = format!(
                    "`{}` has neither `half`, half a period in cycles, nor `frequency` in kHz",
                    name.value
                );
                document.mistake(&name.place, text);
            }
            None
        }
    }
}

type Ticks = ((CarrierTick, u32), std::ops::Range<usize>);

/// Ticks that a carrier gives, with the cycles from one to the next and the key's place.
fn tick<'a>(
    document: &'a Document<'a>,
    table: &Table<'a>,
    carrier: usize,
    half: u32,
    clock: f64,
) -> Option<Ticks> {
    let given = table.string("tick");
    let every = table.integer("every", 1, 65535);
    let after = table.number("after", 0.0, f64::from(MOST_PERIOD));
    let Some(given) = given else {
        for (key, place) in [("every", every.map(|at| at.place)), ("after", after.map(|at| at.place))] {
            if let Some(place) = place {
                document.mistake(&place, format!("`{key}` applies to ticks, but this carrier has no `tick`"));
            }
        }
        return None;
    };
    let place = match given.value.as_str() {
        "valley" => TickPlace::Valley,
        "peak" => TickPlace::Peak,
        "both" => TickPlace::Both,
        other => {
            let text = format!("`tick` must be \"valley\", \"peak\" or \"both\", not \"{other}\"");
            document.mistake(&given.place, text);
            return None;
        }
    };
    if let Some(every) = every.as_ref().filter(|every| every.value > 1 && place == TickPlace::Both) {
        let text =
            format!("with `tick = \"both\"` each place has a tick: `every` must be 1, not {}", every.value);
        document.mistake(&every.place, text);
        return None;
    }
    let span = if place == TickPlace::Both { half } else { 2 * half };
    let period = span.saturating_mul(every.map_or(1, |every| every.value));
    if !(64..=MOST_PERIOD).contains(&period) {
        let text = format!("ticks come every {period} cycles; expected 64 to {MOST_PERIOD}");
        document.mistake(&given.place, text);
        return None;
    }
    let cycles = after.as_ref().map_or(0.0, |after| (after.value * clock).round());
    if let Some(after) = after.filter(|_| cycles >= f64::from(span)) {
        let text =
            format!("`after` is {cycles} cycles; it must be less than {span}, the cycles between two places");
        document.mistake(&after.place, text);
        return None;
    }
    Some(((CarrierTick { carrier, place, after: cycles as u32 }, period), given.place))
}

/// Reads `carrier.place`, moved by `shift` cycles.
pub(crate) fn instant(
    document: &Document<'_>,
    carriers: &[Carrier],
    at: &Located<String>,
    shift: f64,
) -> Option<Instant> {
    let (name, place) = at.value.split_once('.').unwrap_or((&at.value, ""));
    let carrier = find(document, carriers, name, at)?;
    let Carrier { half, .. } = carriers[carrier];
    let place = match place {
        "valley" => 0,
        "peak" => half,
        _ => {
            let text = format!(
                "`{}` is not a place of a carrier; there are `{name}.valley` and `{name}.peak`",
                at.value
            );
            document.mistake(&at.place, text);
            return None;
        }
    };
    let at = (f64::from(place) + shift).rem_euclid(f64::from(2 * half));
    Some(Instant { carrier, at: at as u32 % (2 * half) })
}

/// Finds a carrier by name.
pub(crate) fn find(
    document: &Document<'_>,
    carriers: &[Carrier],
    name: &str,
    at: &Located<String>,
) -> Option<usize> {
    let found = carriers.iter().position(|carrier| carrier.name == name);
    if found.is_none() {
        let names: Vec<&str> = carriers.iter().map(|carrier| carrier.name.as_str()).collect();
        let there = match names[..] {
            [] => "the wiring has none: `[carrier.main]` with `half` makes one".to_owned(),
            _ => format!("there are {}", names.join(", ")),
        };
        document.mistake(&at.place, format!("`{name}` is not a carrier; {there}"));
    }
    found
}
