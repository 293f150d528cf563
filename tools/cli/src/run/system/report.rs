// SPDX-License-Identifier: MIT OR Apache-2.0
//! Results of `takt track --system`, as text and as JSON.

use crate::commands::bound::paths::{way_json, write_ways};
use crate::commands::friction::Friction;
use crate::run::deny::Denials;
use crate::terminal::files::Out;
use anyhow::Result;
use serde_json::{Value, json};
use std::io::Write;
use takt_programs::accuracy::{Accuracy, MaxError};
use takt_programs::hybrid::closed_loop::TrackingError;
use takt_programs::hybrid::ports::REFERENCE_LEN;
use takt_system::System;
use takt_system::latency::Latency;

/// Results of a drive along a path.
pub(crate) struct SystemTracking<'a> {
    pub(crate) name: String,
    pub(crate) path: &'a str,
    /// Clock in MHz, for conversion to time.
    pub(crate) clock: f64,
    pub(crate) system: &'a System,
    pub(crate) periods: u64,
    pub(crate) errors: TrackingError,
    pub(crate) points: Accuracy<REFERENCE_LEN>,
    pub(crate) ways: Vec<Latency>,
    pub(crate) friction: Option<Friction>,
    /// Denied events that occurred, for each core.
    pub(crate) denials: &'a [Denials],
}

/// Kinds of values in a point: name, unit, and range of indices.
const KINDS: [(&str, &str, std::ops::Range<usize>); 6] = [
    ("position", "m", 0..3),
    ("velocity", "m/s", 3..6),
    ("acceleration", "m/s²", 6..9),
    ("angle", "rad", 9..11),
    ("angular velocity", "rad/s", 11..13),
    ("angular acceleration", "rad/s²", 13..15),
];

impl SystemTracking<'_> {
    /// Largest error among the values of a kind.
    fn worst(&self, kind: &std::ops::Range<usize>) -> &MaxError {
        let errors = &self.points.errors[kind.clone()];
        errors.iter().max_by(|a, b| a.absolute.total_cmp(&b.absolute)).unwrap_or(&errors[0])
    }

    fn missed(&self) -> u64 {
        let cores = (0..self.system.description().cores.len()).map(|core| self.system.core(core));
        cores.map(|core| core.statistics().missed).sum()
    }

    pub(crate) fn json(&self) -> Value {
        let cores = self.system.description().cores.iter().enumerate().map(|(number, core)| {
            let periods = self.system.periods(number);
            json!({
                "name": core.name, "program": core.path, "machine": core.program.machine.name,
                "periods": periods.count, "shortest": periods.shortest, "longest": periods.longest, "skipped": periods.skipped,
                "denied": self.denials[number].json,
            })
        });
        let points = KINDS.iter().map(|(name, unit, kind)| {
            let error = self.worst(kind);
            json!({ "of": name, "unit": unit, "largest_error": error.absolute, "ulps": error.ulps_of_largest() })
        });
        let ways = self.ways.iter().map(|way| way_json(self.system.description(), way));
        json!({
            "system": self.name, "path": self.path, "periods": self.periods, "clock_mhz": self.clock,
            "tick": self.system.description().tick, "cores": cores.collect::<Vec<_>>(), "missed": self.missed(),
            "tracking_error_m": { "cutting": self.errors.cutting, "overall": self.errors.overall },
            "points": points.collect::<Vec<_>>(), "latencies": ways.collect::<Vec<_>>(),
            "friction": self.friction.as_ref().map(Friction::json),
        })
    }

    pub(crate) fn text(&self, out: &mut Out) -> Result<()> {
        let description = self.system.description();
        writeln!(
            out,
            "{} along {}: {} periods of {} cycles, {} deadlines missed",
            self.name,
            self.path,
            self.periods,
            description.tick,
            self.missed()
        )?;
        writeln!(out, "\nlargest tracking error, µm")?;
        writeln!(
            out,
            "  while cutting {:>8.2}\n  overall       {:>8.2}",
            self.errors.cutting * 1e6,
            self.errors.overall * 1e6
        )?;
        writeln!(out, "\ncycles of a period")?;
        for (number, core) in description.cores.iter().enumerate() {
            let periods = self.system.periods(number);
            let (least, most) = (periods.shortest, periods.longest);
            writeln!(out, "  {:<12} {:<4} {least:>5} to {most:>5}", core.name, core.program.machine.name)?;
        }
        writeln!(out, "\nthe path's points against binary64, largest errors (ulp of the largest value)")?;
        for (name, unit, kind) in &KINDS {
            let error = self.worst(kind);
            writeln!(
                out,
                "  {name:<21} {:>8.1e} {unit:<7} {:>4.1} ulp",
                error.absolute,
                error.ulps_of_largest()
            )?;
        }
        write_ways(description, &self.ways, self.clock, None, out)?;
        if let Some(friction) = &self.friction {
            let mut text = String::new();
            friction.text(&self.name, &mut text);
            out.write_all(text.as_bytes())?;
        }
        Ok(())
    }
}
