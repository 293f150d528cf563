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
/// Number of periods after which an example without inputs shows an effect.
const PERIODS_OF: [(&str, usize); 2] = [("blink.s", 2000), ("pendulum.s", 6000)];
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
/// Tables of inputs that do not have their example's name; without a table, the plant's file has the inputs that the plant leaves.
const INPUTS_OF: [(&str, Option<&str>); 3] =
    [("foc_early.s", Some("foc.csv")), ("gains.s", Some("pi.csv")), ("pendulum.s", None)];
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
    let plant = |name: &str| {
        PLANT_OF.iter().find(|(known, _)| *known == name).map(|(_, plant)| json!({ "name": plant }))
    };
    let example = |name: &str| {
        let source = text(name)?;
        let table = INPUTS_OF.iter().find(|(known, _)| *known == name).map(|(_, table)| *table);
        let inputs = table.unwrap_or(Some(&name.replace(".s", ".csv"))).and_then(text);
        let periods = PERIODS_OF.iter().find(|(known, _)| *known == name).map(|(_, periods)| periods);
        Some(
            json!({ "name": name, "title": title(source), "source": source, "inputs": inputs, "periods": periods, "seconds": seconds(name), "plant": plant(name), "track": false }),
        )
    };
    let mut examples: Vec<Value> = FIRST.into_iter().chain(rest).filter_map(example).collect();
    if let Some((path, source)) = SOURCES.iter().find(|(path, _)| *path == TRACKING) {
        let tracking = json!({ "name": file_name(path), "title": title(source), "source": source, "inputs": takt_programs::TRACKING_INPUTS, "seconds": seconds(file_name(path)), "track": true });
        examples.insert(2.min(examples.len()), tracking);
    }
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "machines": MACHINES.iter().map(|machine| json!({ "name": machine.name, "text": machine.text })).collect::<Vec<_>>(),
        "examples": examples,
        "limits": { "cycles": CYCLES, "periods": PERIODS, "source_bytes": SOURCE_BYTES },
    })
}
