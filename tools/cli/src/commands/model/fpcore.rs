// SPDX-License-Identifier: MIT OR Apache-2.0
//! `takt model` of an FPCore file: one core, or the figures of all.

use super::{Model, decoded, for_robots, present};
use crate::terminal::files::{self, Out};
use crate::terminal::options::suggest;
use crate::terminal::output::Failure;
use anyhow::{Result, anyhow};
use serde_json::{Value, json};
use std::io::Write;
use takt_front::DecodedText;
use takt_front::fpcore::{self, Core};
use takt_front::graph::Delays;

pub(super) fn run(arguments: &Model, color: bool, out: &mut Out) -> Result<()> {
    for_robots(arguments, "cores of FPCore")?;
    let name = files::input_name(&arguments.file);
    let DecodedText { text, note } = decoded(&arguments.file, fpcore::MAX_BYTES)?;
    let cores = fpcore::read(&text, arguments.rewrites.rewrites())
        .map_err(|error| anyhow!(error.located_text(&name)))?;
    let count = cores.len();
    let names: Vec<String> = cores.iter().map(|core| core.name.clone()).collect();
    let chosen: Vec<Core> = match &arguments.name {
        None => cores,
        Some(wanted) => cores.into_iter().filter(|core| core.name == *wanted).collect(),
    };
    match (&arguments.name, chosen.len()) {
        (Some(wanted), 0) => {
            let near = suggest(wanted, names.iter().map(String::as_str));
            let text = format!("{name} has no core `{wanted}`{near} (cores: {})", names.join(", "));
            return Err(Failure::Usage(text).into());
        }
        (Some(wanted), 2..) => {
            let lines: Vec<String> = chosen.iter().map(|core| core.line.to_string()).collect();
            return Err(anyhow!(
                "{name} has several cores `{wanted}`, on lines {}: rename one",
                lines.join(", ")
            ));
        }
        (None, 2..) if arguments.output.is_some() => {
            let text = format!("{name} has {count} cores: choose one with --name ({})", names.join(", "));
            return Err(Failure::Usage(text).into());
        }
        _ => {}
    }
    let alone = chosen.len() == 1;
    let mut values: Vec<Value> = Vec::new();
    for (number, core) in chosen.into_iter().enumerate() {
        let told = |error: takt_front::Error| error.located_text(&name);
        let mut function = match core.function {
            Ok(function) => function.optimised(&Delays::of(arguments.machine.machine)),
            Err(error) if alone => return Err(anyhow!(told(error))),
            Err(error) if arguments.json => {
                values.push(json!({ "title": core.name, "error": told(error) }));
                continue;
            }
            Err(error) => {
                let blank = if number > 0 { "\n" } else { "" };
                writeln!(out, "{blank}{}: {}", core.name, told(error))?;
                continue;
            }
        };
        function.notes.extend(note.clone());
        if number > 0 && !arguments.json {
            writeln!(out)?;
        }
        match present(arguments, &function, arguments.output.as_deref(), color, out) {
            Ok(value) => values.extend(value),
            Err(error) if alone => return Err(error),
            Err(error) if arguments.json => {
                values.push(json!({ "title": core.name, "error": format!("{error:#}") }));
            }
            Err(error) => writeln!(out, "no program: {error:#}")?,
        }
    }
    match (arguments.json, alone) {
        (true, true) => files::json(&values.pop().unwrap_or_default(), out),
        (true, false) => files::json(&Value::Array(values), out),
        (false, _) => Ok(()),
    }
}
