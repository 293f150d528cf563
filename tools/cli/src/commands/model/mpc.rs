// SPDX-License-Identifier: MIT OR Apache-2.0
//! Model-predictive controllers, by `takt model system.json`.

use super::memory_sizes::{Figures, MachineSource, sized};
use super::{Model, decoded, folder_loader, for_robots, no_body};
use crate::terminal::files::{self, Out};
use crate::terminal::output::Failure;
use crate::terminal::progress::DelayedActivity;
use anyhow::{Result, anyhow};
use serde_json::{Value, json};
use std::io::Write;
use takt_front::mpc::{self, Contraction, Controller, Extreme, Hint, Search, Source};
use takt_isa::Machine;

/// Number of periods with which a search starts warm.
const PERIODS: usize = 1;

impl MachineSource for Source {
    fn text(&self) -> &str {
        &self.text
    }

    fn machine(&self) -> &'static Machine {
        self.machine
    }
}

/// Reads the file, if it is a control problem.
pub(super) fn text(arguments: &Model) -> Result<Option<String>> {
    let text = decoded(&arguments.file, mpc::MAX_BYTES)?.text;
    Ok(Some(text).filter(|text| mpc::is_system(text)))
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
    let told = |error: takt_front::Error| anyhow!(error.located_text(&name));
    let file = folder_loader(&arguments.file, mpc::MAX_BYTES);
    let system = mpc::read(text, &stem, &file).map_err(told)?;
    let controller = Controller::new(system).map_err(|error| told(error.located(text)))?;
    let worst = match arguments.worst {
        None => Vec::new(),
        Some(restarts) => {
            let _waiting = DelayedActivity::new(format!("searching the worst states of {name}"));
            let search = Search { restarts, seed: arguments.seed, periods: PERIODS };
            mpc::search(&controller, search).map_err(told)?
        }
    };
    let (contraction, hint) = (mpc::contraction(&controller), mpc::hint(&controller));
    let machine = arguments.machine.machine;
    let (source, figures) = sized(arguments, color, |bundles| mpc::source(&controller, machine, bundles))?;
    if let Some(path) = &arguments.output {
        files::write(path, source.text.as_bytes())?;
    }
    if arguments.json {
        return files::json(
            &result_json(arguments, &controller, &source, &figures, (contraction.as_ref(), hint), &worst),
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
        "{} words of data memory\n{}, {:.0} an iteration; {bundles} bundles",
        source.words,
        cycles.on(source.machine.name),
        cycles.worst as f64 / controller.system.iterations as f64
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
    if let Some(hint) = hint {
        advise(hint, controller.system.rho, out)?;
    }
    if !worst.is_empty() {
        let (restarts, seed) = (arguments.worst.unwrap_or(0), arguments.seed);
        writeln!(
            out,
            "the worst of {restarts} searches from states within x_range, {PERIODS} periods each (seed {seed}):"
        )?;
    }
    for Extreme { name, text, value, state } in &worst {
        let state: Vec<String> = state.iter().map(|x| format!("{x:.4}")).collect();
        writeln!(out, "  {name}: {value:.4e} ({text})\n    from x = {}", state.join(", "))?;
    }
    Ok(())
}

/// Recommends a better penalty, or reports that no penalty suits the weights.
fn advise(hint: Hint, rho: f64, out: &mut Out) -> Result<()> {
    let Hint { rho: better, rate, spread } = hint;
    if better != rho {
        let rate = rate.map_or_else(String::new, |rate| format!(", by {rate:.4}"));
        writeln!(
            out,
            "`rho` {rho} does not suit the weights `R`: iterations hardly move; `rho` {better} would{rate}"
        )?;
    }
    if let Some(spread) = spread {
        writeln!(
            out,
            "the weights of the inputs differ by a factor of {spread:.0e}, which slows every `rho`: state inputs in units in which `R` \
             has similar entries (u = s·v: column times s in `B`, weight times s² in `R`)"
        )?;
    }
    Ok(())
}

fn title(controller: &Controller) -> String {
    let system = &controller.system;
    format!(
        "{}: model-predictive control, {} states, {} inputs, a horizon of {}, {} iterations, rho {}",
        system.name,
        system.states(),
        system.inputs(),
        system.horizon,
        system.iterations,
        system.rho
    )
}

fn result_json(
    arguments: &Model,
    controller: &Controller,
    source: &Source,
    figures: &Figures,
    (contraction, hint): (Option<&Contraction>, Option<Hint>),
    worst: &[Extreme],
) -> Value {
    let ports = |ports: &[(&str, Vec<usize>, &str)]| {
        let port = |(name, dims, text): &(&str, Vec<usize>, &str)| json!({ "name": name, "shape": dims, "text": text });
        ports.iter().map(port).collect::<Vec<_>>()
    };
    let worst: Vec<Value> = worst
        .iter()
        .map(|Extreme { name, text, value, state }| json!({ "name": name, "text": text, "value": value, "state": state }))
        .collect();
    json!({
        "file": files::input_name(&arguments.file),
        "title": title(controller),
        "machine": source.machine.name,
        "words": source.words,
        "cycles": figures.cycles.worst,
        "cycles_waiting": figures.cycles.waiting,
        "iterations": controller.system.iterations,
        "rho": controller.system.rho,
        "better_rho": hint.map(|hint| hint.rho).filter(|rho| *rho != controller.system.rho),
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
