// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt analyse SYSTEM.toml`: cycle account of each core.

use super::run::SystemRun;
use crate::run::account::Account;
use crate::run::table_run::Tables;
use crate::terminal::files;
use anyhow::Result;
use serde_json::{Map, Value, json};
use std::io::Write;
use std::path::Path;
use takt_debug::trace::{SystemTracer, Timeline};
use takt_isa::timing::Cause;
use takt_system::{Description, System};

/// Default number of base ticks, without `--inputs`.
const TICKS: u64 = 10;
/// Number of stalls listed for each core, longest first.
const STALLS: usize = 8;

/// Runs a system; returns the outcome as JSON and as text. `html` receives a page with a timeline.
pub(crate) fn analyse(
    description: &Description,
    tables: Tables<'_>,
    html: Option<&Path>,
    name: &str,
) -> Result<(Value, Vec<u8>)> {
    let mut run = SystemRun::new(description)?;
    if html.is_some() {
        run.system.keep_host_actions();
    }
    let most = tables.most.or(tables.inputs.is_none().then_some(TICKS));
    let ticks = Tables { most, ..tables }.drive(&mut run)?;
    let system = run.system;
    if let (Some(path), Some(start)) = (html, system.start()) {
        let page = timeline(&system, ticks)?.html(description, start, name);
        files::write(path, page.as_bytes())?;
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
    let value = json!({ "system": name, "ticks": ticks, "cycles": system.now(), "cores": cores });
    Ok((value, text))
}

/// Timeline that starts with the host's write for the last period of the slowest core. The run is repeated with the same host, and
/// proceeds identically.
fn timeline(ran: &System, ticks: u64) -> Result<Timeline> {
    let description = ran.description();
    let slowest = description.cores.iter().map(|core| core.every).max().unwrap_or(1);
    // Begin one cycle earlier, to include the writes of the host.
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
