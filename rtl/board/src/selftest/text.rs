// SPDX-License-Identifier: MIT OR Apache-2.0
//! Report of the hardware kit as text.

use super::{Comparison, LoopBack, Report, SelftestError, Wire, wires};
use crate::boards::Board;
use crate::wiring::Wiring;
use textwrap::{Options, WordSplitter};

/// Columns of a report.
const WIDTH: usize = 80;
/// Columns of the name that begins a line.
const NAME: usize = 12;
/// Ratio to the nominal frequency, in millionths beyond 1, at which no UART works: of a simulated board.
const SIMULATED: f64 = 50_000.0;

/// Adds a line, filled to the width.
fn add(text: &mut String, name: &str, line: &str) {
    let (name, blank) = (format!("{name:<NAME$}"), " ".repeat(NAME));
    let options = Options::new(WIDTH)
        .initial_indent(&name)
        .subsequent_indent(&blank)
        .break_words(false)
        .word_splitter(WordSplitter::NoHyphenation);
    *text += &textwrap::fill(line, options);
    text.push('\n');
}

impl Report {
    /// The report for a reader, also of another computer: `version` is that of takt, `baud` the rate at which the board has answered.
    ///
    /// # Errors
    /// If the wiring is not the kit's.
    pub fn text(
        &self,
        board: &Board,
        wiring: &Wiring,
        machine: &str,
        version: &str,
        baud: u32,
    ) -> Result<String, SelftestError> {
        let mut text = String::new();
        add(&mut text, "takt", &format!("{version}, hardware kit"));
        add(&mut text, "board", &format!("{}: {}", board.name, board.text));
        let Report { circuit, operands, .. } = self;
        let clock = wiring.clock;
        add(&mut text, "machine", &format!("{machine} at {clock} MHz, circuit {circuit:#010x}, {baud} baud"));
        add(&mut text, "operands", &format!("{operands} of each instruction, pseudo-random"));
        let mut units: Vec<(&str, Vec<&str>)> = Vec::new();
        for (name, unit, _) in self.digests.iter().filter(|(_, _, digest)| digest.is_same()) {
            match units.iter_mut().find(|(known, _)| known == unit) {
                Some((_, names)) => names.push(name),
                None => units.push((unit, vec![name])),
            }
        }
        for (unit, names) in units {
            add(&mut text, unit, &format!("same: {}", names.join(" ")));
        }
        for (name, unit, digest) in self.digests.iter().filter(|(_, _, digest)| !digest.is_same()) {
            let Comparison { found, expected } = digest;
            add(&mut text, unit, &format!("{name} DIFFERENT: {found:#010x}, expected {expected:#010x}"));
        }
        let Comparison { found, expected } = self.cycles;
        let cycles = match self.cycles.is_same() {
            true => format!("{found} from tick to outputs, as expected"),
            false => format!("DIFFERENT: {found} from tick to outputs, expected {expected}"),
        };
        add(&mut text, "cycles", &format!("{cycles}; {} deadlines missed", self.misses));
        add(&mut text, "line", &format!("{} errors, {} repeated requests", self.errors, self.retries));
        let [pulses, words] = wires(wiring)?;
        for (name, wire, found) in [("pulses", pulses, self.pulses), ("words", words, self.words)] {
            let Wire { text: signal, pins: [from, to], .. } = wire;
            let LoopBack { found: count, expected, .. } = found;
            let result = match (found.is_wired(), found.is_right()) {
                (false, _) => "not wired".to_owned(),
                (true, true) => format!("{count} of {expected}"),
                (true, false) => format!("DIFFERENT: {count} of {expected}"),
            };
            add(&mut text, name, &format!("{result}: {signal} from {from} to {to}"));
        }
        let clock = self.clock;
        let clock = match clock.ppm.abs() > SIMULATED + clock.uncertainty {
            true => format!(
                "{:.3} of the nominal frequency: a simulated board, or a busy computer",
                1.0 + clock.ppm / 1e6
            ),
            false => format!(
                "{:+.0} ppm against this computer's, ± {:.0}, over {:.1} s",
                clock.ppm, clock.uncertainty, clock.seconds
            ),
        };
        add(&mut text, "clock", &clock);
        add(&mut text, "result", if self.is_right() { "right, as far as it was run" } else { "NOT RIGHT" });
        Ok(text)
    }
}
