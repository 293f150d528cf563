// SPDX-License-Identifier: MIT OR Apache-2.0
//! Example programs of the playground.

use crate::{CYCLES, PERIODS, SOURCE_BYTES};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::OnceLock;
use takt_isa::{MACHINES, Machine};
use takt_programs::{EXAMPLES, SOURCES, title};

/// Data of an example besides the text of its source.
struct KnownExample {
    name: &'static str,
    /// Heading in the menu of examples; those of a group stand one after another.
    group: &'static str,
    /// Title in the menu of examples, where a sentence would not fit.
    short: &'static str,
    /// Reader that it is for, and a thing to try; `docs/examples.md` has the same words.
    text: &'static str,
    /// Plant that closes the loop: a file of [`takt_programs::PLANTS`], without the extension.
    plant: Option<&'static str>,
    /// Number of periods without a table in which it shows what it does.
    periods: Option<usize>,
    /// Seconds that assembling takes in a browser, for the page to announce until it has measured them.
    seconds: Option<u32>,
    /// Ports that are plotted first, where these are not outputs with their references.
    plotted: Option<&'static [&'static str]>,
    /// Each period solves a problem `A·x = b`.
    solves: Option<Solves>,
}

/// Names of the ports of a program that solves another problem `A·x = b` in each period. No line joins the points of its plots, and its
/// residual is plotted first.
struct Solves {
    matrix: &'static str,
    solution: &'static str,
    right: &'static str,
    /// Output that is 1 where there is no solution.
    singular: &'static str,
}

/// Values of the fields that most examples leave out.
const PLAIN: KnownExample = KnownExample {
    name: "",
    group: "",
    short: "",
    text: "",
    plant: None,
    periods: None,
    seconds: None,
    plotted: None,
    solves: None,
};
const CURRENTS: &[&str] = &["da", "db", "dc", "id", "iq", "id_ref", "iq_ref", "we"];
const CONTROL: KnownExample =
    KnownExample { plant: Some("pmsm"), periods: Some(320), plotted: Some(CURRENTS), ..PLAIN };
const MOTOR: KnownExample = KnownExample { plant: Some("dc_motor"), periods: Some(400), ..PLAIN };

/// Examples in the order of the menu; the page opens on the first, which is the README's.
#[rustfmt::skip]
const KNOWN: [KnownExample; 12] = [
    KnownExample { name: "gains.s", group: "Motors", short: "motor speed, equations",
        text: "For makers of speed controllers. Try ki at 20: the speed overshoots. With \"set from period\" 200 first, only from there on.", ..MOTOR },
    KnownExample { name: "pi.s", group: "Motors", short: "motor speed, PI",
        text: "For those whose gains are fixed. Try KP at 0.3, and the speed overshoots; at 1.6, it arrives too late.", ..MOTOR },
    KnownExample { name: "foc.s", group: "Motors", short: "motor current",
        text: "For makers of motor drives. Try wc at 1500, and the currents follow more slowly.", ..CONTROL },
    KnownExample { name: "foc_early.s", group: "Motors", short: "motor current, early",
        text: "For drives whose duties must be out early. Try the tab Code: what stands below its red line, where the duties are out, is for the next period.", ..CONTROL },
    KnownExample { name: "tracking.s", group: "Robots and machines", short: "five-axis robot",
        text: "For makers of robots. Try the tab Robot, where it follows its path, and the tab Pipeline, with each cycle of a period.", seconds: Some(3), ..PLAIN },
    KnownExample { name: "pendulum.s", group: "Robots and machines", short: "pendulum on a cart",
        text: "For makers of machines that balance. Try KA at 15, and the pendulum swings ever further.", plant: Some("cart_pendulum"), periods: Some(6000), plotted: Some(&["force", "angle", "x", "x_ref"]), ..PLAIN },
    KnownExample { name: "statespace.s", group: "Robots and machines", short: "six masses in a chain",
        text: "For controllers of many states. Try the plant's k at 20, springs softer than it was designed for: the masses swing ever further.", plant: Some("chain"), periods: Some(300), seconds: Some(2), plotted: Some(&["y[1]", "y[2]", "y[3]", "u[1]", "u[2]", "u[3]", "u[4]"]), ..PLAIN },
    KnownExample { name: "biquads.s", group: "Signals", short: "low-pass filter",
        text: "For those who filter a measurement. Try FC at 100, and the curve is smoother and later.", plotted: Some(&["x", "y"]), ..PLAIN },
    KnownExample { name: "kalman.s", group: "Signals", short: "Kalman filter",
        text: "For those who estimate a speed from positions. Try P0 at 0, and the filter takes longer to find it.", ..PLAIN },
    KnownExample { name: "table.s", group: "Signals", short: "thermistor, table",
        text: "For those who read a sensor that is not linear. Try B at 3000, and the same voltage is further from 25 °C.", ..PLAIN },
    KnownExample { name: "blink.s", group: "First steps, and mathematics", short: "blinking lamp",
        text: "For a first look. Try SECONDS at 0.1, and the lamp blinks five times as fast.", periods: Some(2000), ..PLAIN },
    KnownExample { name: "lu.s", group: "First steps, and mathematics", short: "linear equations",
        text: "For those who solve equations in each period. Try the tab Pipeline, and Fit: one staircase, whatever the matrix.", solves: Some(Solves { matrix: "A", solution: "x", right: "b", singular: "singular" }), ..PLAIN },
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

impl KnownExample {
    /// Description for the page; `None` if no source has the name.
    fn describe(&self) -> Option<Value> {
        let text = |name: &str| EXAMPLES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text);
        let is_track = self.name == file_name(TRACKING);
        let (source, table) = if is_track {
            let tracking = SOURCES.iter().find(|(path, _)| *path == TRACKING);
            (tracking.map(|(_, text)| *text), Some(takt_programs::TRACKING_INPUTS))
        } else {
            (text(self.name), text(&self.name.replace(".s", ".csv")))
        };
        let source = source?;
        // The file of a plant has the inputs that the plant leaves; a recorded table would have columns that nobody reads.
        let inputs = table.filter(|_| self.plant.is_none());
        let solves =
            self.solves.as_ref().map(|ports| [ports.matrix, ports.solution, ports.right, ports.singular]);
        Some(json!({
            "name": self.name, "title": title(source), "group": self.group, "short": self.short, "text": self.text, "source": source, "inputs": inputs,
            "periods": self.periods, "seconds": self.seconds, "plotted": self.plotted, "track": is_track,
            "plant": self.plant.map(|plant| json!({ "name": plant })),
            "points": solves.is_some(), "residual": solves,
        }))
    }
}

/// Data that the page needs at its start.
pub(crate) fn about() -> Value {
    let machine = |machine: &&Machine| json!({ "name": machine.name, "text": machine.text });
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "machines": MACHINES.iter().map(machine).collect::<Vec<_>>(),
        "examples": KNOWN.iter().filter_map(KnownExample::describe).collect::<Vec<_>>(),
        "limits": { "cycles": CYCLES, "periods": PERIODS, "source_bytes": SOURCE_BYTES },
    })
}

#[cfg(test)]
mod tests {
    use super::{EXAMPLES, KNOWN, KnownExample, TRACKING, file_name};
    use std::collections::BTreeSet;

    #[test]
    fn every_example_is_in_the_menu() {
        let menu: BTreeSet<&str> = KNOWN.iter().map(|known| known.name).collect();
        let shipped = EXAMPLES.iter().map(|(name, _)| *name).filter(|name| name.ends_with(".s"));
        assert_eq!(menu, shipped.chain([file_name(TRACKING)]).collect());
        assert!(KNOWN.iter().all(|known| known.describe().is_some()));
    }

    #[test]
    fn the_document_has_the_same_words() {
        let document = include_str!("../../../docs/examples.md");
        for KnownExample { name, text, .. } in &KNOWN {
            let row = document.lines().find(|line| line.starts_with(&format!("| `{name}` | ")));
            assert!(!text.is_empty() && row.is_some_and(|row| row.contains(text)), "{name}: {row:?}");
        }
    }
}
