//! `takt run SYSTEM.toml`: a base tick for each row of inputs.

use super::host::Host;
use super::{LoadedSystem, load, told};
use crate::account::Account;
use crate::files::{self, Out};
use crate::output;
use crate::ports;
use crate::progress::{self, Late};
use crate::run::PERIOD_LIMIT;
use crate::select::SourceArguments;
use crate::trace::TraceArguments;
use anyhow::{Result, bail};
use serde_json::{Map, Value, json};
use std::io::Write;
use std::path::Path;
use takt_debug::trace::SystemTracer;
use takt_isa::timing::Cycle;
use takt_system::System;

/// What a run of a system takes of `takt run`.
pub(crate) struct Arguments<'a> {
    pub(crate) file: &'a Path,
    pub(crate) source: &'a SourceArguments,
    pub(crate) inputs: Option<&'a Path>,
    pub(crate) outputs: Option<&'a Path>,
    pub(crate) periods: Option<u64>,
    pub(crate) max_cycles: Option<u64>,
    pub(crate) stats: bool,
    pub(crate) json: bool,
    pub(crate) trace: Option<&'a TraceArguments>,
}

/// What a run came to.
struct Ran<'a> {
    arguments: &'a Arguments<'a>,
    loaded: &'a LoadedSystem,
    system: &'a System,
    host: &'a Host,
    /// Base ticks, or none if it ran until all cores had halted.
    ticks: Option<u64>,
    last: Vec<Option<u32>>,
    refused: u64,
}

pub(crate) fn run(arguments: &Arguments<'_>, color: bool, out: &mut Out) -> Result<()> {
    let loaded = load(arguments.file, arguments.source, color)?;
    let description = &loaded.description;
    let host = Host::new(description);
    let mut system = System::new(description)?;
    let mut ran = (Vec::new(), 0, 0);
    let has_ticks = arguments.inputs.is_some() || arguments.periods.is_some();
    let mut file = arguments.trace.map(TraceArguments::create).transpose()?.flatten();
    let mut tracer = match (arguments.trace, &mut file) {
        (Some(trace), Some(file)) => Some(trace.of_system(&system, file)?),
        _ => None,
    };
    let result = drive(arguments, &loaded, &host, &mut system, has_ticks, tracer.as_mut(), &mut ran);
    if let (Some(trace), Some(tracer)) = (arguments.trace, tracer) {
        trace.finish_system(tracer, color)?;
    }
    file.map_or(Ok(()), Out::finish)?;
    if let Some(fault) = system.fault() {
        return Err(told(fault, &loaded, color));
    }
    result?;
    let (last, ticks, refused) = ran;
    let ticks = has_ticks.then_some(ticks);
    let ran = Ran { arguments, loaded: &loaded, system: &system, host: &host, ticks, last, refused };
    if arguments.json {
        output::json(&ran.json(), out)?;
    } else if !arguments.outputs.is_some_and(files::is_dash) {
        ran.text(out)?;
    } else if arguments.stats {
        let mut text = Vec::new();
        ran.text(&mut text)?;
        output::message(&String::from_utf8_lossy(&text));
    }
    Ok(())
}

pub(super) fn drive(
    arguments: &Arguments<'_>,
    loaded: &LoadedSystem,
    host: &Host,
    system: &mut System,
    has_ticks: bool,
    mut tracer: Option<&mut SystemTracer<'_>>,
    (last, ticks, refused): &mut (Vec<Option<u32>>, u64, u64),
) -> Result<()> {
    let description = &loaded.description;
    let columns = host.columns(description);
    let limit = arguments.max_cycles.unwrap_or(PERIOD_LIMIT);
    let stop = |system: &System| {
        let flag = "`--max-cycles` sets the limit";
        anyhow::anyhow!("the system has run for {} cycles without ending ({flag})", system.now())
    };
    let titles = || host.outputs.iter().map(|output| output.name.clone());
    let open = || ports::Inputs::open(arguments.inputs, &columns);
    let (mut inputs, mut outputs) = ports::open_both(arguments.inputs, open, arguments.outputs, titles())?;
    let live = arguments.inputs.is_some_and(files::is_live);
    let start = match &mut tracer {
        Some(tracer) => tracer.run_to_start(system, limit)?,
        None => system.run_to_start(limit)?,
    };
    let mut run = |system: &mut System, cycle: Cycle| match &mut tracer {
        Some(tracer) => tracer.run_until(system, cycle),
        None => system.run_until(cycle),
    };
    if !has_ticks {
        if start.is_some() && !system.halted() {
            bail!("the system goes on from tick to tick: give it base ticks with --inputs or --periods");
        }
        *last = host.read(system)?;
        return if system.halted() { Ok(()) } else { Err(stop(system)) };
    }
    let Some(start) = start else {
        if system.halted() {
            bail!("every core has halted before the first tick: there are no periods to run");
        }
        return Err(stop(system));
    };
    // The host writes so early that the periods which begin at the tick read it.
    let mut next: Cycle = start - description.lead();
    let all = arguments.periods.or_else(|| progress::rows(arguments.inputs)).filter(|_| !live);
    let shows_rows = arguments.outputs.is_some_and(files::is_dash);
    let mut bar = Late::new(all.filter(|_| !shows_rows), "base ticks");
    let mut tick = |ticks: &mut u64| -> Result<bool> {
        let Some(row) = inputs.next()? else { return Ok(false) };
        run(system, next)?;
        *refused += host.write(system, row)?;
        next += description.tick;
        if arguments.max_cycles.is_some_and(|most| next > most) {
            return Err(stop(system));
        }
        run(system, next)?;
        *ticks += 1;
        bar.add(1);
        *last = host.read(system)?;
        if let Some(outputs) = &mut outputs {
            let values = host.outputs.iter().zip(&*last);
            let values = values
                .map(|(output, bits)| bits.map_or(String::new(), |bits| ports::format(output.ty, bits)));
            ports::write_row(outputs, values)?;
            if live {
                outputs.flush()?;
            }
        }
        Ok(true)
    };
    let mut result = Ok(true);
    while matches!(result, Ok(true)) && arguments.periods.is_none_or(|most| *ticks < most) {
        result = tick(ticks);
    }
    drop(bar);
    ports::finish(outputs, *ticks, result.map(|_| ()))
}

impl Ran<'_> {
    /// The FIFOs, each with what has happened to it.
    fn fifos(&self) -> impl Iterator<Item = (&str, takt_system::FifoCounts)> {
        let links = self.loaded.description.links.iter().enumerate();
        links.filter_map(|(number, link)| Some((link.name.as_str(), self.system.fifo_counts(number)?)))
    }

    fn json(&self) -> Value {
        let Ran { arguments, loaded, system, host, ticks, last, refused } = self;
        let cores = loaded.description.cores.iter().enumerate().map(|(number, core)| {
            let statistics = system.core(number).statistics();
            let (account, periods) = (Account::of(&statistics), system.periods(number));
            let value = json!({
                "program": core.path,
                "machine": core.program.machine.name,
                "periods": periods.count,
                "cycles": { "min": periods.shortest, "max": periods.longest, "total": account.cycles },
                "deadlines_missed": statistics.missed + statistics.lost,
                "snapshots_skipped": periods.skipped,
                "nan_writes": statistics.nan_writes,
                "flags": system.core(number).flags().to_string(),
                "bundles": account.bundles,
                "operations": account.operations,
                "stalls": account.stalls_json(),
            });
            (core.name.clone(), value)
        });
        let outputs = host.outputs.iter().zip(last);
        let outputs = outputs.map(|(output, bits)| {
            (output.name.clone(), json!(bits.map(|bits| ports::json(output.ty, bits))))
        });
        let fifos = self.fifos().map(|(name, counts)| {
            let value = json!({
                "pushed": counts.pushed,
                "popped": counts.popped,
                "overflows": counts.overflows,
                "underflows": counts.underflows,
                "most": counts.most,
            });
            (name.to_owned(), value)
        });
        json!({
            "system": files::input_name(arguments.file),
            "ticks": ticks,
            "first_tick": system.start(),
            "cycles": system.now(),
            "cores": cores.collect::<Map<_, _>>(),
            "fifos": fifos.collect::<Map<_, _>>(),
            "refused": refused,
            "outputs": outputs.collect::<Map<_, _>>(),
        })
    }

    fn text(&self, out: &mut impl Write) -> Result<()> {
        let Ran { arguments, loaded, system, host, ticks, last, .. } = self;
        let description = &loaded.description;
        match ticks {
            None => writeln!(out, "every core has halted")?,
            Some(1) => writeln!(out, "1 base tick of {} cycles", description.tick)?,
            Some(ticks) => writeln!(out, "{ticks} base ticks of {} cycles", description.tick)?,
        }
        let width = description.cores.iter().map(|core| core.name.len()).max().unwrap_or(0);
        for (number, core) in description.cores.iter().enumerate() {
            let (periods, statistics) = (system.periods(number), system.core(number).statistics());
            let machine = core.program.machine.name;
            write!(out, "  {:<width$}  {machine}: {} periods", core.name, periods.count)?;
            if periods.count > 0 {
                write!(out, ", {}", periods.shortest)?;
                if periods.shortest != periods.longest {
                    write!(out, " to {}", periods.longest)?;
                }
                write!(out, " cycles each")?;
            }
            write!(out, ", {} deadlines missed", statistics.missed + statistics.lost)?;
            if periods.skipped > 0 {
                write!(out, ", snapshots skipped at {} ticks", periods.skipped)?;
            }
            if statistics.nan_writes > 0 {
                write!(out, ", NaN written to output ports {} times", statistics.nan_writes)?;
            }
            writeln!(out, ", exception flags: {}", system.core(number).flags())?;
        }
        for (name, counts) in self.fifos() {
            let takt_system::FifoCounts { pushed, popped, overflows, underflows, most } = counts;
            writeln!(
                out,
                "  {name}: {pushed} entries in, {popped} out, {most} at most; {overflows} refused when full, {underflows} \
                 asked for when empty"
            )?;
        }
        if arguments.inputs.is_none() && !host.inputs.is_empty() {
            writeln!(out, "  without --inputs the system's inputs are 0")?;
        }
        if arguments.outputs.is_none() {
            for (output, bits) in host.outputs.iter().zip(last) {
                let value = bits.map(|bits| ports::format(output.ty, bits));
                writeln!(out, "  {} = {}", output.name, value.as_deref().unwrap_or("(nothing)"))?;
            }
        }
        if arguments.stats {
            for (number, core) in description.cores.iter().enumerate() {
                let account = Account::of(&system.core(number).statistics());
                writeln!(out, "\n{}: cycles, waiting for the tick left out:", core.name)?;
                out.write_all(account.stall_table(&core.program, 5).as_bytes())?;
            }
        }
        Ok(())
    }
}
