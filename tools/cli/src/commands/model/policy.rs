// SPDX-License-Identifier: MIT OR Apache-2.0
//! Learned policies, by `takt model policy.onnx`.

use super::memory_sizes::{Figures, MachineSource, sized};
use super::{Model, for_robots, no_body};
use crate::terminal::files::{self, Out};
use anyhow::{Result, anyhow};
use serde_json::json;
use std::io::Write;
use std::path::Path;
use takt_front::policy::{self, Network, Source};
use takt_isa::Machine;

impl MachineSource for Source {
    fn text(&self) -> &str {
        &self.text
    }

    fn machine(&self) -> &'static Machine {
        self.machine
    }
}

pub(super) fn run(arguments: &Model, color: bool, out: &mut Out) -> Result<()> {
    for_robots(arguments, "a policy")?;
    no_body(arguments, "a policy")?;
    let name = files::input_name(&arguments.file);
    let bytes = files::read(&arguments.file, policy::MAX_BYTES)?;
    let stem =
        arguments.file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let folder = arguments.file.parent().unwrap_or(Path::new(""));
    let files = |name: &str, offset, length| policy::external_data(folder, name, offset, length);
    let network = policy::read(&bytes, &stem, arguments.result.as_deref(), &files)
        .map_err(|error| anyhow!("{name}: {error}"))?;
    let network = network.merged(arguments.rewrites.exact);
    let machine = arguments.machine.machine;
    let make = |bundles| policy::source(&network, machine, arguments.range, bundles);
    let (source, figures) = sized(arguments, color, make)?;
    if let Some(path) = &arguments.output {
        files::write(path, source.text.as_bytes())?;
    }
    if arguments.json {
        return files::json(&result_json(arguments, &network, &source, &figures), out);
    }
    if arguments.output.as_deref().is_some_and(files::is_dash) {
        return Ok(());
    }
    let Network { name, input, output, notes, .. } = &network;
    let activations = network.activations();
    let activations =
        if activations.is_empty() { String::new() } else { format!(", {}", activations.join(", ")) };
    writeln!(out, "{name}: a policy {}{activations}", network.shape())?;
    for note in notes {
        writeln!(out, "  {note}")?;
    }
    writeln!(out, "  input `{}` in the ports {}[{}]", input.name, source.input, input.length)?;
    writeln!(out, "  output `{}` in the ports {}[{}]", output.name, source.output, output.length)?;
    let Figures { cycles, bundles } = figures;
    let weights = network.weights();
    let each = match weights {
        0 => String::new(),
        _ => format!(", {:.2} a weight", cycles.worst as f64 / weights as f64),
    };
    writeln!(
        out,
        "{weights} weights, {} words of data memory\n{}{each}; {bundles} bundles",
        source.words,
        cycles.on(source.machine.name)
    )?;
    Ok(())
}

fn result_json(
    arguments: &Model,
    network: &Network,
    source: &Source,
    figures: &Figures,
) -> serde_json::Value {
    let ports = |name: &str, text: &str, length: usize| {
        (1..=length)
            .map(|i| json!({ "name": format!("{name}[{i}]"), "text": format!("{text}[{}]", i - 1) }))
            .collect::<Vec<_>>()
    };
    json!({
        "file": files::input_name(&arguments.file),
        "title": format!("{}: a policy {}", network.name, network.shape()),
        "notes": network.notes,
        "machine": source.machine.name,
        "activations": network.activations(),
        "weights": network.weights(),
        "words": source.words,
        "cycles": figures.cycles.worst,
        "cycles_waiting": figures.cycles.waiting,
        "bundles": figures.bundles,
        "inputs": ports(&source.input, &network.input.name, network.input.length),
        "outputs": ports(&source.output, &network.output.name, network.output.length),
    })
}
