// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt model system.json`: model-predictive control.

use super::sized::{Figures, Stated, sized};
use super::{Model, for_robots, no_body};
use crate::files::{self, Out};
use crate::output::{self, Failure};
use crate::progress::Waiting;
use anyhow::{Result, anyhow};
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use takt_isa::Machine;
use takt_model::mpc::{self, Contraction, Controller, Search, Source, Worst};

/// Periods of the warm start of a search.
const PERIODS: usize = 1;

impl Stated for Source {
    fn text(&self) -> &str {
        &self.text
    }

    fn machine(&self) -> &'static Machine {
        self.machine
    }
}

/// The text of the file if it is a control problem.
pub(super) fn text(arguments: &Model) -> Result<Option<String>> {
    let bytes = files::read(&arguments.file, mpc::MAX_BYTES)?;
    Ok(String::from_utf8(bytes).ok().filter(|text| mpc::is_system(text)))
}

pub(super) fn run(arguments: &Model, text: &str, color: bool, out: &mut Out) -> Result<()> {
    for_robots(arguments, "a control problem")?;
    no_body(arguments, "a control problem")?;
    let name = files::input_name(&arguments.file);
    if arguments.range.is_some() {
        let text = format!("--range applies to policies; {name} names ranges of its states as `x_range`");
        return Err(Failure::Usage(text).into());
    }
    let stem =
        arguments.file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let told = |error: takt_model::Error| match error.line {
        Some(line) => anyhow!("{name}:{line}: {error}"),
        None => anyhow!("{name}: {error}"),
    };
    let folder = arguments.file.parent().unwrap_or(Path::new(""));
    let file = |name: &str| -> Result<String, String> {
        let bytes = files::read(&folder.join(name), mpc::MAX_BYTES).map_err(|error| format!("{error:#}"))?;
        String::from_utf8(bytes).map_err(|_| format!("{name} is not UTF-8 text"))
    };
    let system = mpc::read(text, &stem, &file).map_err(told)?;
    let controller = Controller::new(system).map_err(|error| told(error.located(text)))?;
    let worst = match arguments.worst {
        None => Vec::new(),
        Some(restarts) => {
            let _waiting = Waiting::new(format!("searching the worst states of {name}"));
            let search = Search { restarts, seed: arguments.seed, periods: PERIODS };
            mpc::search(&controller, search).map_err(told)?
        }
    };
    let contraction = mpc::contraction(&controller);
    let machine = arguments.machine.machine;
    let (source, figures) = sized(arguments, color, |bundles| mpc::source(&controller, machine, bundles))?;
    if let Some(path) = &arguments.output {
        files::write(path, source.text.as_bytes())?;
    }
    if arguments.json {
        return output::json(
            &result_json(arguments, &controller, &source, &figures, contraction.as_ref(), &worst),
            out,
        );
    }
    if arguments.output.as_deref().is_some_and(files::is_dash) {
        return Ok(());
    }
    writeln!(out, "{}", title(&controller))?;
    for (kind, ports) in [("input", &source.inputs), ("output", &source.outputs)] {
        for (name, dims, about) in ports {
            let dims: Vec<String> = dims.iter().map(usize::to_string).collect();
            let dims = if dims.is_empty() { String::new() } else { format!("[{}]", dims.join(",")) };
            writeln!(out, "  {kind} {name}{dims}: {about}")?;
        }
    }
    let Figures { cycles, bundles } = figures;
    writeln!(
        out,
        "{} words of data memory\n{cycles} cycles on {}, {:.0} an iteration; {bundles} bundles",
        source.words,
        source.machine.name,
        cycles as f64 / controller.system.iterations as f64
    )?;
    if let Some(Contraction { rate, residuals }) = contraction {
        writeln!(out, "each iteration multiplies the distance from the optimum by {rate:.4} at most")?;
        if let Some((primal, dual)) = residuals {
            writeln!(
                out,
                "  from a cold start, within x_range: primal at most {primal:.4e}, dual at most {dual:.4e}"
            )?;
        }
    }
    if !worst.is_empty() {
        let (restarts, seed) = (arguments.worst.unwrap_or(0), arguments.seed);
        writeln!(
            out,
            "the worst of {restarts} searches from states within x_range, {PERIODS} periods each (seed {seed}):"
        )?;
    }
    for Worst { name, text, value, state } in &worst {
        let state: Vec<String> = state.iter().map(|x| format!("{x:.4}")).collect();
        writeln!(out, "  {name}: {value:.4e} ({text})\n    from x = {}", state.join(", "))?;
    }
    Ok(())
}

fn title(controller: &Controller) -> String {
    let system = &controller.system;
    format!(
        "{}: model-predictive control, {} states, {} inputs, a horizon of {}, {} iterations",
        system.name,
        system.states(),
        system.inputs(),
        system.horizon,
        system.iterations
    )
}

fn result_json(
    arguments: &Model,
    controller: &Controller,
    source: &Source,
    figures: &Figures,
    contraction: Option<&Contraction>,
    worst: &[Worst],
) -> Value {
    let ports = |ports: &[(&str, Vec<usize>, &str)]| {
        let port = |(name, dims, text): &(&str, Vec<usize>, &str)| json!({ "name": name, "shape": dims, "text": text });
        ports.iter().map(port).collect::<Vec<_>>()
    };
    let worst: Vec<Value> = worst
        .iter()
        .map(|Worst { name, text, value, state }| json!({ "name": name, "text": text, "value": value, "state": state }))
        .collect();
    json!({
        "file": files::input_name(&arguments.file),
        "title": title(controller),
        "machine": source.machine.name,
        "words": source.words,
        "cycles": figures.cycles,
        "iterations": controller.system.iterations,
        "bundles": figures.bundles,
        "inputs": ports(&source.inputs),
        "outputs": ports(&source.outputs),
        "contraction": contraction.map(|found| {
            let residuals = found.residuals.map(|(primal, dual)| json!({ "primal": primal, "dual": dual }));
            json!({ "rate": found.rate, "residuals": residuals })
        }),
        "worst": worst,
    })
}
