//! `takt track --system`: the hybrid robot on a system of cores, one of which computes the path's points.

use super::bound::{bounds, way_json, write_ways};
use super::{LoadedSystem, load, record, told};
use crate::files::{self, Out};
use crate::output;
use crate::plot::Plot;
use crate::progress::progress;
use crate::run::PERIOD_LIMIT;
use crate::track::{Track, trajectory};
use anyhow::{Context, Result, anyhow, bail};
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use takt_isa::Register;
use takt_isa::timing::Cycle;
use takt_programs::accuracy::{Accuracy, MaxError};
use takt_programs::hybrid::closed_loop::{ClosedLoop, Inputs, TrackingController, TrackingError};
use takt_programs::hybrid::generation::{Block, FIELDS, blocks};
use takt_programs::hybrid::params::SAMPLE_TIME;
use takt_programs::hybrid::ports::{INPUTS, OUTPUTS, REFERENCE_LEN};
use takt_programs::hybrid::{LoopError, Outputs};
use takt_system::latency::{Latency, latencies};
use takt_system::{Description, HostError, LinkKind, System, SystemFault};

/// The FIFO of motion blocks.
const BLOCKS: &str = "blocks";
/// Encoders, the first inputs.
const AXES: usize = 5;

/// The system as the controller: the reference is its own.
struct OnSystem {
    system: System,
    /// Field names of a motion block, as the system names them.
    fields: [String; FIELDS.len()],
    fifo: usize,
    depth: usize,
    waiting: std::vec::IntoIter<Block>,
    /// Link and field of each output.
    outputs: [(usize, usize); OUTPUTS.len()],
    /// The core that computes the points, and its registers.
    generation: usize,
    point: [Register; REFERENCE_LEN],
    /// The cycle in which the host writes next, and from one to the next.
    next: Cycle,
    tick: Cycle,
}

/// Why the system cannot control the robot any further.
#[derive(Debug, thiserror::Error)]
enum StepError {
    #[error("{0}")]
    Fault(#[from] SystemFault),
    #[error(transparent)]
    Host(#[from] HostError),
    #[error("the FIFO `{BLOCKS}` has overflowed")]
    Overflow,
}

impl OnSystem {
    fn new(description: &Description, path: Vec<Block>) -> Result<OnSystem> {
        let inputs: Vec<String> = description.inputs().into_iter().map(|port| port.name).collect();
        let given = |name: &str| inputs.iter().any(|known| known == name);
        let fields = FIELDS.map(|field| format!("{BLOCKS}.{field}"));
        let encoders = INPUTS[..AXES].iter().map(|port| port.name);
        if let Some(none) = encoders.chain(fields.iter().map(String::as_str)).find(|name| !given(name)) {
            bail!(
                "this system cannot control the hybrid robot: it has no input `{none}` (see programs/hybrid/two.toml)"
            );
        }
        let fifo = description.link_named(BLOCKS).context("its inputs have this link")?;
        let LinkKind::Fifo { depth, .. } = description.links[fifo].kind else {
            bail!("this system cannot control the hybrid robot: `{BLOCKS}` is no FIFO");
        };
        let known = description.outputs();
        let mut outputs = [(0, 0); OUTPUTS.len()];
        for (place, port) in outputs.iter_mut().zip(&OUTPUTS) {
            let found = known.iter().find(|output| output.name == port.name);
            let found = found.with_context(|| {
                format!("this system cannot control the hybrid robot: it has no output `{}`", port.name)
            })?;
            *place = (found.link, found.field);
        }
        let generation = match description.links[fifo].to {
            takt_system::End::Core(core) => core,
            takt_system::End::Host => bail!("`{BLOCKS}` leads from the host to the host"),
        };
        let core = &description.cores[generation];
        let mut point = [Register::ZERO; REFERENCE_LEN];
        for (register, port) in point.iter_mut().zip(&INPUTS[AXES..]) {
            let found = core.program.outputs.iter().find(|output| output.name == port.name);
            let found = found.with_context(|| format!("core {} computes no `{}`", core.name, port.name))?;
            *register = found.register;
        }
        let mut system = System::new(description)?;
        let start = system.run_to_start(PERIOD_LIMIT)?;
        let start = start.context("the cores do not come to their first ticks")?;
        Ok(OnSystem {
            system,
            fields,
            fifo,
            depth: depth as usize,
            waiting: path.into_iter(),
            outputs,
            generation,
            point,
            next: start - description.lead(),
            tick: description.tick,
        })
    }

    /// A base tick: blocks as far as there is room, encoders, and what the system answers until the next one.
    fn tick(&mut self, counts: [i32; AXES]) -> Result<(), StepError> {
        self.system.run_until(self.next)?;
        // One at a time: entries on their way are not seen among those of the FIFO.
        if self.system.fifo_entries(self.fifo).len() < self.depth
            && let Some(block) = self.waiting.next()
        {
            for (name, word) in self.fields.iter().zip(block.to_words()) {
                self.system.set_input(name, word)?;
            }
            if !self.system.push(self.fifo)? {
                return Err(StepError::Overflow);
            }
        }
        for (port, count) in INPUTS.iter().zip(counts) {
            self.system.set_input(port.name, count.cast_unsigned())?;
        }
        self.next += self.tick;
        Ok(self.system.run_until(self.next)?)
    }

    /// The point of this tick; 0 where nothing was computed yet.
    fn point(&self) -> [f32; REFERENCE_LEN] {
        let core = self.system.core(self.generation);
        self.point.map(|register| f32::from_bits(core.output_bits(register).unwrap_or(0)))
    }
}

impl TrackingController for OnSystem {
    type Error = StepError;

    fn step(&mut self, inputs: &Inputs) -> Result<Outputs<f64>, StepError> {
        self.tick(inputs.counts)?;
        let bits = self.outputs.map(|(link, field)| self.system.field_bits(link, field).unwrap_or(0));
        Ok(Outputs::from_array(bits.map(|bits| f64::from(f32::from_bits(bits)))))
    }
}

/// What a drive came to.
struct Ran<'a> {
    arguments: &'a Track,
    file: &'a Path,
    path: String,
    loaded: &'a LoadedSystem,
    system: &'a System,
    periods: u64,
    errors: TrackingError,
    points: Accuracy<REFERENCE_LEN>,
    ways: Vec<Latency>,
}

pub(crate) fn run(arguments: &Track, file: &Path, color: bool, out: &mut Out) -> Result<()> {
    let loaded = load(file, &arguments.source, color)?;
    let description = &loaded.description;
    let (path, trajectory) = trajectory(arguments.gcode.as_deref())?;
    let clocked = arguments.clock * 1e6 * SAMPLE_TIME;
    if description.tick as f64 != clocked.round() {
        bail!(
            "the system's base tick is {} cycles, a sampling period of {SAMPLE_TIME} s has {clocked:.0} at {} MHz",
            description.tick,
            arguments.clock
        );
    }
    let bounds = bounds(description)?;
    let ways = latencies(description, &bounds).map_err(|error| anyhow!("no end-to-end bound: {error}"))?;
    let robot = arguments.robot.robot(&trajectory)?;
    let mut controller = OnSystem::new(description, blocks(&trajectory)?)?;
    if arguments.csv.is_some() {
        controller.system.keep_host_actions();
    }
    let fault = |error: StepError| match error {
        StepError::Fault(fault) => told(&fault, &loaded, color),
        other => other.into(),
    };
    // The first block, which places the robot, takes a tick of its own, in which it stands.
    let counts = robot.plant().counts().context("the robot stands where its encoders reach")?;
    controller.tick(counts).map_err(fault)?;
    let mut closed_loop = ClosedLoop::with(robot, &trajectory, controller);
    let periods = arguments.periods.unwrap_or(u64::MAX).min(trajectory.periods());
    let mut drawing =
        arguments.plot.as_deref().map(Out::create).transpose()?.map(|file| (file, Plot::new(periods)));
    let bar = progress(periods, "periods", arguments.quiet);
    let (mut errors, mut points) = (TrackingError::default(), Accuracy::default());
    for period in 0..periods {
        let record = closed_loop.next().context("the path ended early")?;
        let record = record.map_err(|error| match error {
            LoopError::Controller { source, .. } => fault(source),
            LoopError::NotFinite { period, port } => anyhow!("{path}: period {period}: {port} is not finite"),
            LoopError::Lost { period } => {
                anyhow!("{path}: period {period}: an axis left the range of its encoder")
            }
        })?;
        errors.add(&record);
        points.add(&closed_loop.controller().point(), &record.sample.reference.to_array());
        if let Some((_, plot)) = &mut drawing {
            plot.add(&record);
        }
        if period.is_multiple_of(4096) {
            bar.set_position(period);
        }
    }
    bar.finish_and_clear();
    let name = files::input_name(file);
    if let Some((mut file, plot)) = drawing {
        file.write_all(plot.draw(&format!("{path} with {name}"))?.as_bytes())?;
        file.finish()?;
    }
    let system = &closed_loop.controller().system;
    if let Some(path) = &arguments.csv {
        record::write(system, path)?;
    }
    let ran = Ran { arguments, file, path, loaded: &loaded, system, periods, errors, points, ways };
    if arguments.json {
        output::json(&ran.json(), out)
    } else if [&arguments.plot, &arguments.csv].iter().any(|path| path.as_deref().is_some_and(files::is_dash))
    {
        Ok(())
    } else {
        ran.text(out)
    }
}

/// Kinds of a point's values: name, unit, and where they are among them.
const KINDS: [(&str, &str, std::ops::Range<usize>); 6] = [
    ("position", "m", 0..3),
    ("velocity", "m/s", 3..6),
    ("acceleration", "m/s²", 6..9),
    ("angle", "rad", 9..11),
    ("angular velocity", "rad/s", 11..13),
    ("angular acceleration", "rad/s²", 13..15),
];

impl Ran<'_> {
    /// The largest error of a kind.
    fn worst(&self, kind: &std::ops::Range<usize>) -> &MaxError {
        let errors = &self.points.errors[kind.clone()];
        errors.iter().max_by(|a, b| a.absolute.total_cmp(&b.absolute)).unwrap_or(&errors[0])
    }

    fn missed(&self) -> u64 {
        let cores = (0..self.loaded.description.cores.len()).map(|core| self.system.core(core));
        cores.map(|core| core.statistics().missed).sum()
    }

    fn json(&self) -> Value {
        let cores = self.loaded.description.cores.iter().enumerate().map(|(number, core)| {
            let periods = self.system.periods(number);
            json!({
                "name": core.name, "program": core.path, "machine": core.program.machine.name,
                "periods": periods.count, "shortest": periods.shortest, "longest": periods.longest, "skipped": periods.skipped,
            })
        });
        let points = KINDS.iter().map(|(name, unit, kind)| {
            let error = self.worst(kind);
            json!({ "of": name, "unit": unit, "largest_error": error.absolute, "ulps": error.ulps_of_largest() })
        });
        let ways = self.ways.iter().map(|way| way_json(&self.loaded.description, way));
        json!({
            "system": files::input_name(self.file), "path": self.path, "periods": self.periods, "clock_mhz": self.arguments.clock,
            "tick": self.loaded.description.tick, "cores": cores.collect::<Vec<_>>(), "missed": self.missed(),
            "tracking_error_m": { "cutting": self.errors.cutting, "overall": self.errors.overall },
            "points": points.collect::<Vec<_>>(), "latencies": ways.collect::<Vec<_>>(),
        })
    }

    fn text(&self, out: &mut Out) -> Result<()> {
        let description = &self.loaded.description;
        writeln!(
            out,
            "{} along {}: {} periods of {} cycles, {} deadlines missed",
            files::input_name(self.file),
            self.path,
            self.periods,
            description.tick,
            self.missed()
        )?;
        writeln!(out, "\nlargest tracking error, µm")?;
        writeln!(
            out,
            "  while cutting {:>8.2}\n  overall       {:>8.2}",
            self.errors.cutting * 1e6,
            self.errors.overall * 1e6
        )?;
        writeln!(out, "\ncycles of a period")?;
        for (number, core) in description.cores.iter().enumerate() {
            let periods = self.system.periods(number);
            let (least, most) = (periods.shortest, periods.longest);
            writeln!(out, "  {:<12} {:<4} {least:>5} to {most:>5}", core.name, core.program.machine.name)?;
        }
        writeln!(out, "\nthe path's points against binary64, largest errors (ulp of the largest value)")?;
        for (name, unit, kind) in &KINDS {
            let error = self.worst(kind);
            writeln!(
                out,
                "  {name:<21} {:>8.1e} {unit:<7} {:>4.1} ulp",
                error.absolute,
                error.ulps_of_largest()
            )?;
        }
        write_ways(description, &self.ways, self.arguments.clock, None, out)
    }
}
