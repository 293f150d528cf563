// SPDX-License-Identifier: MIT OR Apache-2.0
//! Nets of a simulated board that the driver watches in every cycle: the reason for which outputs become safe, as text, the board's tick,
//! and the registers that the program reads.

use crate::application::Application;
use crate::host::Status;
use crate::interlock::{Figures, command, trip};
use crate::sinks::sinks;
use crate::top::{AROUND, TOP};
use crate::wiring::Wiring;
use std::fmt::Write as _;

/// Words of a moment, as the driver sends it: the cycle of the run, the core, then the words of [`Watch::header`] without `drive`.
pub(crate) const WORDS: usize = 10;

/// Net around the cores, as a member of Verilator's top.
pub(crate) fn net(name: &str) -> String {
    format!("rootp->{TOP}__DOT__around__DOT__{name}")
}

/// Line of Verilator's configuration that keeps a net.
pub(crate) fn kept(module: &str, net: &str) -> String {
    format!("public_flat_rd -module \"{module}\" -var \"{net}\"\n")
}

/// The cores that are watched.
#[derive(Debug)]
pub(crate) struct Watch {
    /// MHz of the clock.
    clock: f64,
    cores: Vec<Core>,
    /// Trips of the wiring: name and description of each.
    trips: Vec<(String, String)>,
    /// Input ports that registers drive, each with the register's net.
    seen: Vec<(String, String)>,
}

#[derive(Debug)]
struct Core {
    /// Name of the core, written before a reason; empty for a single program.
    name: String,
    /// The output ports at registers of peripherals, in the order in which they are scaled.
    outputs: Vec<String>,
}

impl Watch {
    pub(crate) fn new(wiring: &Wiring, application: &Application<'_>) -> Watch {
        let cores = sinks(application, wiring).into_iter().zip(&application.description().cores);
        let cores = cores.map(|(sinks, core)| Core {
            name: if application.is_program() { String::new() } else { format!("core `{}`: ", core.name) },
            outputs: sinks.into_iter().map(|sink| sink.written.port.clone()).collect(),
        });
        let trips = wiring.trips().enumerate().map(|(i, of)| (of.name.clone(), trip(Some(wiring), i)));
        let reads = wiring.peripherals.iter().flat_map(|peripheral| {
            let registers = peripheral.kind.reads.iter().zip(&peripheral.reads);
            registers.filter_map(move |(register, port)| {
                Some((port.clone()?, format!("r_{}_{}", peripheral.name, register.name)))
            })
        });
        let (cores, trips, seen) = (cores.collect(), trips.collect(), reads.collect());
        Watch { clock: wiring.clock, cores, trips, seen }
    }

    /// Input ports that registers drive, each with the register's net, in the order of the driver's words.
    pub(crate) fn seen(&self) -> &[(String, String)] {
        &self.seen
    }

    /// Nets that Verilator must keep, each with its module.
    fn nets(&self) -> Vec<(&'static str, String)> {
        let mut nets = ["drives", "fault_kind", "fault_address", "period", "run", "enable"]
            .map(|net| (AROUND, net.to_owned()))
            .to_vec();
        for core in 0..self.cores.len() {
            nets.extend(["cause", "misses", "most_cycles"].map(|net| (AROUND, format!("{net}{core}"))));
        }
        let scaling = if self.is_program() { AROUND } else { "takt_output_latch" };
        nets.push((scaling, "which3".to_owned()));
        nets.extend(self.trips.iter().map(|(name, _)| (AROUND, format!("trip_{name}"))));
        nets.push((AROUND, "ticks".to_owned()));
        nets.extend(self.seen.iter().map(|(_, net)| (AROUND, net.clone())));
        nets
    }

    fn is_program(&self) -> bool {
        self.cores.iter().all(|core| core.name.is_empty())
    }

    /// Verilator's configuration, which keeps the nets.
    pub(crate) fn configuration(&self) -> String {
        let kept = self.nets().into_iter().map(|(module, net)| kept(module, &net));
        format!("`verilator_config\n{}", kept.collect::<String>())
    }

    /// C++ header with the driver's access to the nets: for each core, `drive` and the words of a moment; the tick; the registers.
    pub(crate) fn header(&self) -> String {
        let net = |name: &str| format!("top->{}", net(name));
        let mut text = format!(
            "#define CORES {}\nstatic void look(Vtop *top, unsigned core, uint32_t *words) {{\n    switch (core) {{\n",
            self.cores.len()
        );
        for k in 0..self.cores.len() {
            let which =
                if self.is_program() { "which3".to_owned() } else { format!("latch{k}__DOT__which3") };
            let words = [
                format!("bits({}, {k}, 1)", net("drives")),
                net(&format!("cause{k}")),
                net(&format!("misses{k}")),
                net(&format!("most_cycles{k}")),
                format!(
                    "bits({}, {}, 3) << 16 | bits({}, {}, 16)",
                    net("fault_kind"),
                    3 * k,
                    net("fault_address"),
                    16 * k
                ),
                net(&which),
                net("period"),
                format!("{} | {} << 1", net("run"), net("enable")),
                self.trips(&net),
            ];
            let _ = writeln!(text, "    case {k}:");
            for (i, word) in words.iter().enumerate() {
                let _ = writeln!(text, "        words[{i}] = {word};");
            }
            let _ = writeln!(text, "        break;");
        }
        text += "    }\n}\n";
        let _ = writeln!(text, "static bool ticks(Vtop *top) {{ return {}; }}", net("ticks"));
        let _ = writeln!(
            text,
            "#define SEEN {}\nstatic void see(Vtop *top, uint32_t *words) {{\n    (void)top;\n    (void)words;",
            self.seen.len()
        );
        for (i, (_, register)) in self.seen.iter().enumerate() {
            let _ = writeln!(text, "    words[{i}] = {};", net(register));
        }
        text + "}\n"
    }

    /// The trips as bits of a word.
    fn trips(&self, net: &impl Fn(&str) -> String) -> String {
        let bit = |(number, (name, _)): (usize, &(String, String))| {
            format!("uint32_t({}) << {number}", net(&format!("trip_{name}")))
        };
        let bits: Vec<String> = self.trips.iter().enumerate().map(bit).collect();
        if bits.is_empty() { "0".to_owned() } else { bits.join(" | ") }
    }

    /// Time and reasons of a moment, as text; `begun` is the number of cycles before the run.
    pub(crate) fn text(&self, begun: u64, words: &[u32]) -> String {
        let [cycle, core, cause, misses, most_cycles, fault, which, period, control, trips] = *words else {
            return String::new();
        };
        let Some(Core { name, outputs }) = self.cores.get(core as usize) else { return String::new() };
        let time = (begun + u64::from(cycle)) as f64 / self.clock / 1e3;
        if trips != 0 {
            let held = self.trips.iter().enumerate().filter(|(number, _)| trips >> number & 1 == 1);
            let held: Vec<&str> = held.map(|(_, (_, text))| text.as_str()).collect();
            return format!("{time:.3} ms: {}", held.join("; "));
        }
        let nan = outputs.get(which as usize).map(|port| format!("`{port}`")).into_iter().collect();
        let figures = Figures { fault: Some(fault), misses, most_cycles, period, nan };
        let mut reasons: Vec<String> =
            Status(cause << 12).causes().map(|cause| figures.reason(cause)).collect();
        if reasons.is_empty() {
            reasons.push(command(control & 1 != 0, control & 2 != 0).to_owned());
        }
        format!("{time:.3} ms: the outputs become safe: {name}{}", reasons.join("; "))
    }
}
