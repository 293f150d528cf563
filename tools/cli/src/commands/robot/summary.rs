// SPDX-License-Identifier: MIT OR Apache-2.0
//! Summary of a session: tracking errors of the joints, and cycles of the cores.

use serde_json::{Value, json};
use std::fmt::Write as _;
use takt_asm::diag::Message as Mistake;
use takt_robot::controller::{Controller, Tracking};
use takt_robot::level::Message;
use takt_robot::plant::COUNTS;
use takt_system::CorePeriods;

/// Number of periods of a core, and cycles per period.
struct Core {
    name: String,
    periods: CorePeriods,
    budget: u64,
}

/// Figures of a session.
pub(super) struct Summary {
    time: f64,
    tracking: Tracking,
    cores: Vec<Core>,
    /// Cycles per base tick of 100 µs.
    tick: u64,
}

/// Duration of a base tick in s.
const TICK: f64 = takt_robot::host::TICK;
/// Periods given in the paper, by core.
const PAPER: [(&str, &str); 2] = [("kinematic", "40 ms"), ("dynamic", "15 to 20 ms")];

impl Summary {
    pub(super) fn of(controller: &Controller, time: f64) -> Summary {
        let description = controller.system().description();
        let cores = controller.periods().into_iter().zip(&description.cores);
        let cores = cores.map(|((name, periods), core)| Core {
            name,
            periods,
            budget: core.period(description.tick),
        });
        Summary { time, tracking: *controller.tracking(), cores: cores.collect(), tick: description.tick }
    }

    /// The robot has moved, so the tracking errors are meaningful.
    pub(super) fn moved(&self) -> bool {
        self.tracking.ticks > 0
    }

    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        let moved = self.tracking.ticks as f64 * TICK;
        let _ = writeln!(text, "\n{:.3} s, of which the robot moved {moved:.3} s", self.time);
        let _ = writeln!(
            text,
            "\nTracking error, millidegrees (an encoder's count is {:.2})\n  {:<8}{:>16}{:>12}{:>18}",
            360e3 / COUNTS,
            "joint",
            "largest, moving",
            "rms",
            "largest, standing"
        );
        let rms = self.tracking.rms();
        for joint in 0..rms.len() {
            let [largest, rms, standing] =
                [self.tracking.largest[joint], rms[joint], self.tracking.standing[joint]]
                    .map(|angle| angle.to_degrees() * 1e3);
            let _ = writeln!(text, "  {:<8}{largest:>16.2}{rms:>12.2}{standing:>18.2}", joint + 1);
        }
        let _ = writeln!(
            text,
            "\nCores, cycles of a period\n  {:<16}{:>10}{:>12}{:>10}{:>9}{:>12}   in the paper",
            "core", "shortest", "longest", "budget", "used", "longest, us"
        );
        let cycle = TICK * 1e6 / self.tick as f64;
        for Core { name, periods, budget } in &self.cores {
            let paper = PAPER.iter().find(|(core, _)| core == name).map_or("", |(_, period)| period);
            let used = 100.0 * periods.longest as f64 / *budget as f64;
            let _ = writeln!(
                text,
                "  {name:<16}{:>10}{:>12}{budget:>10}{used:>8.1}%{:>12.2}   {paper}",
                periods.shortest,
                periods.longest,
                periods.longest as f64 * cycle
            );
        }
        text
    }

    pub(super) fn json(&self, messages: &[Message], mistakes: &[Mistake]) -> Value {
        let degrees = |angles: [f64; 6]| angles.map(f64::to_degrees);
        let cores = self.cores.iter().map(|Core { name, periods, budget }| {
            json!({"name": name, "periods": periods.count, "shortest": periods.shortest, "longest": periods.longest, "budget": budget})
        });
        json!({
            "time": self.time,
            "moved": self.tracking.ticks as f64 * TICK,
            "messages": messages,
            "errors": mistakes,
            "tracking": {
                "largest": degrees(self.tracking.largest),
                "rms": degrees(self.tracking.rms()),
                "standing": degrees(self.tracking.standing),
            },
            "cores": cores.collect::<Vec<_>>(),
        })
    }
}
