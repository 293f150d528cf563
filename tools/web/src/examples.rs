// SPDX-License-Identifier: MIT OR Apache-2.0
//! Example programs of the playground.

use crate::{CYCLES, PERIODS, SOURCE_BYTES};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::OnceLock;
use takt_isa::MACHINES;
use takt_programs::{EXAMPLES, SOURCES, title};

/// Examples from `programs/examples` that come first in the list, in this order; all others follow.
const FIRST: [&str; 5] = ["pi.s", "gains.s", "pendulum.s", "foc.s", "blink.s"];
/// Titles in the menu of examples, where a sentence would not fit.
const SHORT: [(&str, &str); 12] = [
    ("biquads.s", "low-pass filter"),
    ("blink.s", "blinking lamp"),
    ("foc.s", "motor current"),
    ("foc_early.s", "motor current, early"),
    ("gains.s", "motor speed, equations"),
    ("kalman.s", "Kalman filter"),
    ("lu.s", "linear equations"),
    ("pendulum.s", "pendulum on a cart"),
    ("pi.s", "motor speed, PI"),
    ("statespace.s", "six masses, state space"),
    ("table.s", "thermistor, table"),
    ("tracking.s", "five-axis robot"),
];
/// Examples whose periods are problems of their own: no line joins the points of a plot.
const POINTS: [&str; 1] = ["lu.s"];
/// Examples that solve `A·x = b` in each period, whose residual is plotted first: names of the matrix, the solution, the right-hand side, and
/// of the output that is 1 where there is no solution.
const RESIDUAL_OF: [(&str, [&str; 4]); 1] = [("lu.s", ["A", "x", "b", "singular"])];
/// Number of periods in which an example without a table shows what it does.
const PERIODS_OF: [(&str, usize); 6] = [
    ("blink.s", 2000),
    ("foc.s", 320),
    ("foc_early.s", 320),
    ("gains.s", 400),
    ("pendulum.s", 6000),
    ("pi.s", 400),
];
/// Seconds that assembling takes in a browser, for the page to announce until it has measured them.
const SECONDS_OF: [(&str, u32); 2] = [("tracking.s", 3), ("statespace.s", 2)];
/// Plants that close the loops of examples: files of [`takt_programs::PLANTS`], without the extension.
const PLANT_OF: [(&str, &str); 5] = [
    ("foc.s", "pmsm"),
    ("foc_early.s", "pmsm"),
    ("gains.s", "dc_motor"),
    ("pendulum.s", "cart_pendulum"),
    ("pi.s", "dc_motor"),
];
/// Ports that are plotted first, where these are not outputs with their references.
const PLOTTED: [&str; 8] = ["da", "db", "dc", "id", "iq", "id_ref", "iq_ref", "we"];
const PLOTTED_OF: [(&str, &[&str]); 4] = [
    ("biquads.s", &["x", "y"]),
    ("foc.s", &PLOTTED),
    ("foc_early.s", &PLOTTED),
    ("pendulum.s", &["force", "angle", "x", "x_ref"]),
];
/// Program that controls the robot.
pub(crate) const TRACKING: &str = "hybrid/tracking.s";

/// Sources that a program can include by name: parts of the shipped programs.
pub(crate) fn includable_sources() -> &'static [(&'static str, &'static str)] {
    static BESIDE: OnceLock<Vec<(&str, &str)>> = OnceLock::new();
    BESIDE.get_or_init(|| SOURCES.iter().map(|(path, text)| (file_name(path), *text)).collect())
}

fn file_name(path: &'static str) -> &'static str {
    path.rsplit_once('/').map_or(path, |(_, name)| name)
}

/// Request for the text of a file.
#[derive(Deserialize)]
pub(crate) struct Source {
    name: String,
}

/// Text of a shipped file or of a library file (`<math.s>`).
pub(crate) fn source(wanted: Source) -> Result<Value, String> {
    let Source { name } = wanted;
    let bare = name.trim_start_matches('<').trim_end_matches('>');
    let known = if bare == name { includable_sources() } else { takt_programs::LIBRARY };
    let text = known.iter().find(|(known, _)| *known == bare).map(|(_, text)| Value::from(*text));
    text.ok_or_else(|| format!("there is no file `{name}` to be shown"))
}

/// Data that the page needs at its start.
pub(crate) fn about() -> Value {
    let text = |name: &str| EXAMPLES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text);
    let rest =
        EXAMPLES.iter().map(|(name, _)| *name).filter(|name| name.ends_with(".s") && !FIRST.contains(name));
    let seconds =
        |name: &str| SECONDS_OF.iter().find(|(known, _)| *known == name).map(|(_, seconds)| seconds);
    let plant = |name: &str| PLANT_OF.iter().find(|(known, _)| *known == name).map(|(_, plant)| *plant);
    let short = |name: &str| SHORT.iter().find(|(known, _)| *known == name).map(|(_, title)| *title);
    let residual = |name: &str| RESIDUAL_OF.iter().find(|(known, _)| *known == name).map(|(_, ports)| *ports);
    let plotted = |name: &str| PLOTTED_OF.iter().find(|(known, _)| *known == name).map(|(_, ports)| *ports);
    let example = |name: &str| {
        let source = text(name)?;
        // The file of a plant has the inputs that the plant leaves; a recorded table would have columns that nobody reads.
        let plant = plant(name);
        let inputs = if plant.is_some() { None } else { text(&name.replace(".s", ".csv")) };
        let periods = PERIODS_OF.iter().find(|(known, _)| *known == name).map(|(_, periods)| periods);
        Some(
            json!({ "name": name, "title": title(source), "short": short(name), "source": source, "inputs": inputs, "periods": periods, "seconds": seconds(name), "plant": plant.map(|plant| json!({ "name": plant })), "plotted": plotted(name), "points": POINTS.contains(&name), "residual": residual(name), "track": false }),
        )
    };
    let mut examples: Vec<Value> = FIRST.into_iter().chain(rest).filter_map(example).collect();
    if let Some((path, source)) = SOURCES.iter().find(|(path, _)| *path == TRACKING) {
        let tracking = json!({ "name": file_name(path), "title": title(source), "short": short(file_name(path)), "source": source, "inputs": takt_programs::TRACKING_INPUTS, "seconds": seconds(file_name(path)), "track": true });
        examples.insert(2.min(examples.len()), tracking);
    }
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "machines": MACHINES.iter().map(|machine| json!({ "name": machine.name, "text": machine.text })).collect::<Vec<_>>(),
        "examples": examples,
        "limits": { "cycles": CYCLES, "periods": PERIODS, "source_bytes": SOURCE_BYTES },
    })
}
