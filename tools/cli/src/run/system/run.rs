// SPDX-License-Identifier: MIT OR Apache-2.0
//! Run of a system, with one base tick per row of inputs.

use super::observers::Observer;
use crate::run::nan::NanWrites;
use crate::run::outcome::{CoreOutcome, Execution, RunOutcome, SystemOutcome};
use crate::run::ports;
use crate::run::table_run::TableApplication;
use crate::run::trace::TraceArguments;
use anyhow::{Result, anyhow, bail};
use takt_analysis::period::PERIOD_LIMIT;
use takt_debug::trace::SystemTracer;
use takt_emu::Row;
use takt_isa::program::Port;
use takt_isa::timing::Cycle;
use takt_system::{Description, Host, System};

pub(crate) struct SystemRun<'a, 't> {
    description: &'a Description,
    host: Host,
    pub(crate) system: System,
    /// Cycle limit of the run; a run that exceeds it fails.
    pub(crate) max_cycles: Option<u64>,
    pub(crate) tracer: Option<SystemTracer<'t>>,
    pub(crate) observer: Observer,
    /// Cycle in which the host writes the next row.
    next: Cycle,
    /// Outputs when the host last read them.
    last: Vec<Option<u32>>,
    /// Number of entries that full FIFOs rejected.
    refused: u64,
}

impl<'a, 't> SystemRun<'a, 't> {
    pub(crate) fn new(description: &'a Description) -> Result<SystemRun<'a, 't>> {
        let host = Host::new(description);
        let system = System::new(description)?;
        let (observer, last) = (Observer::default(), vec![None; host.outputs.len()]);
        Ok(SystemRun {
            description,
            host,
            system,
            max_cycles: None,
            tracer: None,
            observer,
            next: 0,
            last,
            refused: 0,
        })
    }

    /// Runs to the first base tick; returns `None` if there is no tick.
    fn start(&mut self) -> Result<Option<Cycle>> {
        let limit = self.max_cycles.unwrap_or(PERIOD_LIMIT);
        let start = match &mut self.tracer {
            Some(tracer) => tracer.run_to_start(&mut self.system, limit),
            None => self.system.run_to_start(limit),
        };
        self.observer.observe(&mut self.system);
        Ok(start?)
    }

    fn run_until(&mut self, cycle: Cycle) -> Result<()> {
        let result = match &mut self.tracer {
            Some(tracer) => tracer.run_until(&mut self.system, cycle),
            None => self.system.run_until(cycle),
        };
        self.observer.observe(&mut self.system);
        Ok(result?)
    }

    fn endless(&self) -> anyhow::Error {
        let now = self.system.now();
        anyhow!("the system has run for {now} cycles without ending (`--max-cycles` sets the limit)")
    }
}

impl TableApplication for SystemRun<'_, '_> {
    const ROWS: &'static str = "base ticks";

    fn inputs(&self) -> Vec<Port> {
        self.host.columns(self.description)
    }

    fn titles(&self) -> Vec<String> {
        self.host.outputs.iter().map(|output| output.name.clone()).collect()
    }

    fn begin(&mut self) -> Result<()> {
        match self.start()? {
            // The host writes early enough for the periods that start at the tick.
            Some(start) => self.next = start - self.description.lead(),
            None if self.system.halted() => {
                bail!("every core has halted before the first tick: there are no periods to run")
            }
            None => return Err(self.endless()),
        }
        Ok(())
    }

    fn row(&mut self, row: &Row) -> Result<bool> {
        self.run_until(self.next)?;
        self.refused += self.host.write(&mut self.system, row)?;
        self.next += self.description.tick;
        if self.max_cycles.is_some_and(|most| self.next > most) {
            return Err(self.endless());
        }
        self.run_until(self.next)?;
        self.last = self.host.read(&mut self.system)?;
        Ok(true)
    }

    fn values(&self) -> Vec<String> {
        let values = self.host.outputs.iter().zip(&self.last);
        values
            .map(|(output, bits)| bits.map_or(String::new(), |bits| ports::format(output.ty, bits)))
            .collect()
    }
}

impl<'a> Execution<'a> for SystemRun<'a, '_> {
    fn run_to_halt(&mut self) -> Result<()> {
        let start = self.start()?;
        if start.is_some() && !self.system.halted() {
            bail!("the system runs from tick to tick: give it base ticks with --inputs or --periods");
        }
        self.last = self.host.read(&mut self.system)?;
        if self.system.halted() { Ok(()) } else { Err(self.endless()) }
    }

    fn end(mut self, trace: &TraceArguments, color: bool) -> Result<RunOutcome<'a>> {
        if let Some(tracer) = self.tracer.take() {
            trace.finish(tracer.finish(), self.system.now(), color)?;
        }
        let SystemRun { description, host, system, refused, .. } = self;
        let denials = self.observer.denials(&system).into_iter();
        let cores = description.cores.iter().enumerate().zip(denials);
        let cores = cores.map(|((number, core), denials)| {
            let (emulator, periods) = (system.core(number), system.periods(number));
            CoreOutcome::new(&core.name, &core.program, emulator, periods, denials)
        });
        let outputs = host.outputs.iter().zip(self.last);
        let outputs = outputs.map(|(output, bits)| (output.name.clone(), bits.map(|bits| (output.ty, bits))));
        let fifos = description.links.iter().enumerate();
        let fifos =
            fifos.filter_map(|(number, link)| Some((link.name.as_str(), system.fifo_counts(number)?)));
        let (first_tick, cycles) = (system.start(), system.now());
        let fifos = fifos.collect();
        Ok(RunOutcome {
            plant: None,
            cores: cores.collect(),
            outputs: outputs.collect(),
            zeros: !host.inputs.is_empty(),
            nans: NanWrites::default(),
            system: Some(SystemOutcome { description, first_tick, cycles, fifos, refused }),
        })
    }
}
