//! `takt analyse SYSTEM.toml`: where each core's cycles went.

use super::host::Host;
use super::run::{self, drive};
use super::{load, told};
use crate::account::Account;
use crate::files::{self, Out};
use crate::output;
use crate::select::SourceArguments;
use anyhow::Result;
use serde_json::{Map, Value, json};
use std::io::Write;
use std::path::Path;
use takt_debug::trace::{SystemTracer, Timeline};
use takt_isa::timing::Cause;
use takt_system::System;

/// Base ticks without `--inputs`.
const TICKS: u64 = 10;
/// Stalls that are listed of each core, the longest first.
const STALLS: usize = 8;

/// What a system takes of `takt analyse`.
pub(crate) struct Arguments<'a> {
    pub(crate) file: &'a Path,
    pub(crate) source: &'a SourceArguments,
    pub(crate) inputs: Option<&'a Path>,
    pub(crate) periods: Option<u64>,
    pub(crate) html: Option<&'a Path>,
    pub(crate) json: bool,
}

pub(crate) fn run(arguments: &Arguments<'_>, color: bool, out: &mut Out) -> Result<()> {
    let loaded = load(arguments.file, arguments.source, color)?;
    let host = Host::new(&loaded.description);
    let mut system = System::new(&loaded.description)?;
    if arguments.html.is_some() {
        system.keep_host_actions();
    }
    let periods = arguments.periods.or(arguments.inputs.is_none().then_some(TICKS));
    let driven = run::Arguments {
        file: arguments.file,
        source: arguments.source,
        inputs: arguments.inputs,
        outputs: None,
        periods,
        max_cycles: None,
        stats: false,
        json: false,
        trace: None,
    };
    let mut ran = (Vec::new(), 0, 0);
    let result = drive(&driven, &loaded, &host, &mut system, true, None, &mut ran);
    if let Some(fault) = system.fault() {
        return Err(told(fault, &loaded, color));
    }
    result?;
    let (_, ticks, _) = ran;
    let description = &loaded.description;
    if let (Some(path), Some(start)) = (arguments.html, system.start()) {
        let timeline = timeline(&system, ticks)?;
        let page = timeline.html(description, start, &files::input_name(arguments.file));
        files::write(path, page.as_bytes())?;
        if files::is_dash(path) {
            return Ok(());
        }
    }
    let mut cores = Map::new();
    let mut text = Vec::new();
    writeln!(text, "{ticks} base ticks, {} cycles", system.now())?;
    for (number, core) in description.cores.iter().enumerate() {
        let account = Account::of(&system.core(number).statistics());
        let periods = system.periods(number);
        let waiting = account.stall(Cause::Wait.name());
        let share = |cycles: u64| 100.0 * cycles as f64 / account.cycles.max(1) as f64;
        let period = core.period(description.tick);
        writeln!(
            text,
            "\n{}, {}: {} periods of {} to {} cycles, {period} from tick to tick; {:.1} % of its cycles issue, {:.1} % stall, \
             {:.1} % wait for the tick",
            core.name,
            core.program.machine.name,
            periods.count,
            periods.shortest,
            periods.longest,
            share(account.bundles),
            share(account.cycles - account.bundles - waiting),
            share(waiting)
        )?;
        text.write_all(account.stall_table(&core.program, STALLS).as_bytes())?;
        let stalls: Vec<Value> = account
            .longest(STALLS)
            .map(|(address, cause, cycles)| {
                json!({
                    "cycles": cycles,
                    "bundle": core.program.bundle_text(address),
                    "cause": core.program.cause_text(cause),
                })
            })
            .collect();
        let value = json!({
            "machine": core.program.machine.name,
            "periods": { "count": periods.count, "min": periods.shortest, "max": periods.longest },
            "between_ticks": period,
            "snapshots_skipped": periods.skipped,
            "cycles": account.cycles,
            "bundles": account.bundles,
            "stalls": account.stalls_json(),
            "longest": stalls,
        });
        cores.insert(core.name.clone(), value);
    }
    if arguments.json {
        let value = json!({
            "system": files::input_name(arguments.file),
            "ticks": ticks,
            "cycles": system.now(),
            "cores": cores,
        });
        return output::json(&value, out);
    }
    out.write_all(&text)?;
    Ok(())
}

/// What happened from the time at which the host wrote for the last period of the slowest core. The run is done once more, with
/// the same host: it is the same.
fn timeline(ran: &System, ticks: u64) -> Result<Timeline> {
    let description = ran.description();
    let slowest = description.cores.iter().map(|core| core.every).max().unwrap_or(1);
    // Looked at from the cycle before on, so that what the host does then is seen.
    let first = ran.now().saturating_sub(slowest.min(ticks) * description.tick + 1);
    let mut system = System::new(description)?;
    let mut tracer = SystemTracer::timeline(first..ran.now());
    tracer.run_to_start(&mut system, ran.now())?;
    for (cycle, action) in ran.host_actions() {
        tracer.run_until(&mut system, *cycle)?;
        system.act(action)?;
    }
    tracer.run_until(&mut system, ran.now())?;
    Ok(tracer.finish_timeline().unwrap_or_default())
}
