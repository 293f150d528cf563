// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `takt board sim --plant`: a plant at the pins of a simulated board. Half bridges drive it switch by switch, and devices at the
//! pins measure it. This command is also the host at the UART, which starts the program and writes the ports that no peripheral drives.

use super::pins::{Pins, Script};
use super::sim::next_commands;
use crate::run::loaded_program::LoadedProgram;
use crate::run::plant;
use crate::run::ports;
use crate::terminal::files::Out;
use crate::terminal::output::{self, Failure};
use crate::terminal::plot::curves::Curves;
use crate::terminal::progress::DelayedProgress;
use anyhow::{Result, anyhow, bail};
use std::io;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};
use takt_asm::nearest;
use takt_board::device::{self, Actuator, BridgeState, Device, NeededPin};
use takt_board::protocol::{self, Line};
use takt_board::simulation::{Edge, Simulation, Stop, Watched};
use takt_board::terminal::Terminal;
use takt_board::top::RESET;
use takt_board::{Application, Host, Wiring};
use takt_diagnostics::diag::Diagnostics;
use takt_isa::Type;
use takt_isa::program::Port;
use takt_programs::plants::{
    self, Course, Interface, Leg, LoopError, PinCourse, PinDriver, Plant, PlantFile, Sensor, Source,
};

/// Most cycles in one go, between changes of pins: of a plant that comparators and switches see, and of others.
const RESOLUTION: [u64; 2] = [50, 1000];
/// Cycles in one go between two looks at the pseudo-terminal.
const SLICE: u64 = 2000;
/// A pin with noise has one level in this many inverted.
const NOISE: u32 = 16;
/// Largest relative difference between the scale of a duty in the plant's file and the wiring's.
const SCALE: f64 = 1e-4;

/// A plant in motion.
enum Motion {
    /// Under switches.
    Switched(plants::Copies),
    /// Under the mean values of a period.
    Averaged(Box<dyn Plant>),
}

impl Motion {
    fn plant(&self) -> &dyn Plant {
        match self {
            Motion::Switched(plant) => plant,
            Motion::Averaged(plant) => plant.as_ref(),
        }
    }
}

/// Source of an input of the plant.
enum Drive {
    /// A half bridge, one leg of the plant's; mirrored if the plant takes the port with a negative scale.
    Leg { actuator: Actuator, is_mirrored: bool },
    /// The mean level of pins: port · scale + offset.
    Mean { actuator: Actuator, scale: f64, offset: f64 },
    /// The plant's file.
    Course(Course),
}

impl Drive {
    fn actuator(&self) -> Option<&Actuator> {
        match self {
            Drive::Leg { actuator, .. } | Drive::Mean { actuator, .. } => Some(actuator),
            Drive::Course(_) => None,
        }
    }
}

/// A sensor, the device behind it, and the device's pins in the circuit.
struct Measurement {
    sensor: Sensor,
    device: Box<dyn Device>,
    needed: Vec<(String, Edge)>,
    driven: Vec<String>,
}

/// An input pin that the plant's file drives.
struct FilePin {
    circuit: String,
    course: PinCourse,
    /// Sensors that a comparator watches.
    signals: Vec<usize>,
}

/// An input port that the host writes.
struct Reference {
    port: Port,
    address: u16,
    course: Course,
}

/// A plant that fits a wiring and a program.
pub(super) struct PlantAtPins<'a> {
    wiring: &'a Wiring,
    interface: Interface,
    motion: Motion,
    drives: Vec<Drive>,
    measurements: Vec<Measurement>,
    pins: Vec<FilePin>,
    references: Vec<Reference>,
}

/// Diagnostics as an error of this command.
fn failure(color: bool) -> impl Fn(Diagnostics) -> anyhow::Error {
    move |mistakes| Failure::Diagnostics(mistakes.render(color)).into()
}

impl<'a> PlantAtPins<'a> {
    /// Reads a plant's file, and connects it with the pins of a wiring.
    ///
    /// # Errors
    /// If the plant does not fit program and wiring.
    pub(super) fn new(
        path: &Path,
        connect: &[String],
        wiring: &'a Wiring,
        loaded: &LoadedProgram,
        pins: &Pins,
        color: bool,
    ) -> Result<PlantAtPins<'a>> {
        let file = plant::read(path, color)?;
        let options = plant::connections(connect)?;
        let period = f64::from(wiring.period) / (wiring.clock * 1e6);
        let (motion, interface) = if file.is_leg(0) {
            let (plant, interface) = file.simulation(period)?;
            (Motion::Switched(plant), interface)
        } else {
            let (plant, interface) = plant::open(&file, path, period, color)?;
            (Motion::Averaged(plant), interface)
        };
        let program = &loaded.program;
        let connection = file.connect(&interface, &program.inputs, &program.outputs, &options);
        let connection = connection.map_err(failure(color))?;
        connection
            .complete(|port| device::reader(wiring, &port.name).is_some())
            .map_err(|text| Failure::Usage(text.replace(", or give columns with --inputs", "")))?;
        let drives = connection.sources.iter().zip(&interface.inputs).enumerate();
        let drives = drives
            .map(|(i, (source, (signal, _)))| drive(&file, signal, source, wiring, file.is_leg(i)))
            .collect::<Result<Vec<Drive>, Diagnostics>>()
            .map_err(failure(color))?;
        let signals = motion.plant().sensors();
        let mut measurements: Vec<Measurement> = Vec::new();
        for sensor in &connection.sensors {
            let signal = &interface.sensors[sensor.index];
            let measurement = measurement(&file, signal, sensor, wiring, &signals).map_err(failure(color))?;
            let shares =
                |other: &&Measurement| other.driven.iter().any(|pin| measurement.driven.contains(pin));
            if let Some(other) = measurements.iter().find(shares) {
                let other = &interface.sensors[other.sensor.index];
                let text = format!("`{other}` and `{signal}` feed the same pins: one must go");
                return Err(failure(color)(file.mistake_of(signal, text)));
            }
            measurements.push(measurement);
        }
        let pins = file_pins(&file, &interface, pins).map_err(failure(color))?;
        let application = Application::from(program);
        let is_of_host = |port: &Port| device::reader(wiring, &port.name).is_none();
        let references = connection.courses.iter().filter(|(port, _)| is_of_host(port));
        let references = references.map(|(port, course)| {
            let address = application.find(&port.name).ok().and_then(|place| place.set);
            let address = address.ok_or_else(|| anyhow!("the host cannot write the port `{}`", port.name))?;
            Ok(Reference { port: port.clone(), address, course: course.clone() })
        });
        let mut references = references.collect::<Result<Vec<Reference>>>()?;
        references.sort_by_key(|reference| reference.address);
        if let Some(reference) = references.first().filter(|_| !wiring.uart) {
            bail!(
                "the host would write the port `{}`, and the wiring leaves out its UART (`uart = false`): leave the port out of [inputs]",
                reference.port.name
            );
        }
        Ok(PlantAtPins { wiring, interface, motion, drives, measurements, pins, references })
    }

    /// Input pins in the circuit that the plant and its file drive.
    pub(super) fn driven(&self) -> Vec<String> {
        let of_devices = self.measurements.iter().flat_map(|one| one.driven.iter());
        of_devices.chain(self.pins.iter().map(|pin| &pin.circuit)).cloned().collect()
    }
}

/// Finds the drive of an input of the plant.
fn drive(
    file: &PlantFile,
    signal: &str,
    source: &Source,
    wiring: &Wiring,
    is_leg: bool,
) -> Result<Drive, Diagnostics> {
    let mistake = |text: String| Err(file.mistake_of(signal, text));
    let (port, scale, offset) = match source {
        Source::Course(_) if is_leg => {
            return mistake(format!(
                "`{signal}` is a half bridge at pins: name the output port of its duty under [ports]"
            ));
        }
        Source::Course(course) => return Ok(Drive::Course(course.clone())),
        Source::Port { port, scale, offset } => (&port.name, *scale, *offset),
    };
    let actuator = match Actuator::of(wiring, port) {
        Some(Ok(actuator)) => actuator,
        Some(Err(text)) => return mistake(format!("`{signal}`: {text}")),
        None => {
            return mistake(format!(
                "`{signal}` takes the output port `{port}`, which no peripheral of the wiring has"
            ));
        }
    };
    if !is_leg {
        return Ok(Drive::Mean { actuator, scale, offset });
    }
    let Some((unit, zero)) = actuator.duty() else {
        return mistake(format!(
            "`{signal}` is the duty of a half bridge, and `{}`, behind the port `{port}`, is none",
            actuator.peripheral
        ));
    };
    let is_mirrored = scale < 0.0;
    let (wanted, base) = if is_mirrored { (-unit, 1.0 - zero) } else { (unit, zero) };
    if (scale / wanted - 1.0).abs() > SCALE || (offset - base).abs() > SCALE {
        return mistake(format!(
            "`{signal}` is {scale} · `{port}` + {offset}, but at the pins of `{}` the duty is {unit:.7} · `{port}` + {zero}: write \
             `{signal} = {{ port = \"{port}\", scale = {wanted:.7}, offset = {base} }}`",
            actuator.peripheral
        ));
    }
    Ok(Drive::Leg { actuator, is_mirrored })
}

/// Finds the device behind a sensor.
fn measurement(
    file: &PlantFile,
    signal: &str,
    sensor: &Sensor,
    wiring: &Wiring,
    signals: &[f64],
) -> Result<Measurement, Diagnostics> {
    let port = &sensor.port.name;
    let mistake = |text: String| file.mistake_of(signal, text);
    let Some((peripheral, register)) = device::reader(wiring, port) else {
        return Err(mistake(format!(
            "`{signal}` gives the input port `{port}`, which is no register of a peripheral: at the pins it cannot come"
        )));
    };
    if let Some((least, most)) = device::range(peripheral) {
        let (low, high) = sensor.limits;
        if low.is_finite() && low < least || high.is_finite() && high > most {
            return Err(mistake(format!(
                "the limits of `{signal}`, {low} to {high}, are beyond the register `{register}` of `{}`, {least} to {most}",
                peripheral.name
            )));
        }
    }
    let device = device::of(peripheral, register, sensor.value(signals));
    let device = device.map_err(|text| mistake(format!("`{signal}` at port `{port}`: {text}")))?;
    let pins = device.pins();
    let circuit = |pin: &str| format!("{}_{pin}", peripheral.name);
    Ok(Measurement {
        sensor: sensor.clone(),
        device,
        needed: pins.needed.iter().map(|(pin, edge)| (circuit(pin), *edge)).collect(),
        driven: pins.driven.iter().map(|pin| circuit(pin)).collect(),
    })
}

/// Input pins under `[pins]`.
fn file_pins(file: &PlantFile, interface: &Interface, pins: &Pins) -> Result<Vec<FilePin>, Diagnostics> {
    let mut found = Vec::new();
    for (name, place, course) in file.pins() {
        let circuit = pins.circuit(name).map_err(|text| file.mistake(place, text))?.to_owned();
        let mut signals = Vec::new();
        if let PinCourse::Comparator { signals: names, .. } = course {
            for name in names {
                let all = || interface.sensors.iter().map(String::as_str);
                let named = interface.sensors_named(name);
                if named.is_empty() {
                    let near = nearest(name, all());
                    let near = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
                    let text = format!("the plant `{}` has no sensor `{name}`{near}", interface.name);
                    return Err(file.mistake(place, text));
                }
                signals.extend(named);
            }
        }
        found.push(FilePin { circuit, course: course.clone(), signals });
    }
    Ok(found)
}

/// An input pin in the simulation.
struct InputPin {
    input: usize,
    course: Option<PinCourse>,
    signals: Vec<usize>,
    has_device: bool,
    /// Level of the source, and whether noise inverts it.
    level: bool,
    is_flipped: bool,
}

/// A device in the simulation: its needed pins by their places among the watched ones, its driven ones among [`AtPins::pins`].
struct DeviceAt {
    sensor: Sensor,
    device: Box<dyn Device>,
    needed: Vec<usize>,
    driven: Vec<usize>,
    /// The device gives levels by itself, and not at any call.
    is_serial: bool,
}

/// Rows of a run.
pub(super) struct Rows {
    pub(super) outputs: Option<Out>,
    pub(super) curves: Option<Curves>,
    pub(super) most: Option<u64>,
    written: u64,
}

/// A simulated board with a plant at its pins.
pub(super) struct AtPins {
    sim: Simulation,
    /// Cycles of a period, and in a second.
    period: u64,
    clock: f64,
    interface: Interface,
    references: Vec<Reference>,
    motion: Motion,
    /// For each input of the plant its source, and the numbers of the output pins.
    drives: Vec<(Drive, Vec<usize>)>,
    devices: Vec<DeviceAt>,
    pins: Vec<InputPin>,
    watched: Watched,
    resolution: u64,
    /// Cycles after the beginning at which something of the file changes.
    changes: Vec<u64>,
    /// Levels of the output pins in the next cycle.
    levels: Vec<bool>,
    /// Cycles of this period in which each output pin was 1.
    high: Vec<u64>,
    seed: u32,
    /// The next tick is the plant's time 0.
    is_armed: bool,
    /// First cycle of the plant's time, and the last tick's.
    begun: Option<u64>,
    tick: u64,
    /// Values of a period that has not ended: ports, states.
    open: Option<(Vec<String>, Vec<String>)>,
    rows: Rows,
    periods: u64,
    /// Reason why the loop cannot go on.
    failed: Option<anyhow::Error>,
}

impl AtPins {
    fn new(plant: PlantAtPins<'_>, sim: Simulation, rows: Rows) -> Result<AtPins> {
        let PlantAtPins { wiring, interface, motion, drives, measurements, pins: file_pins, references } =
            plant;
        let output = |name: &String| {
            let at = sim.outputs().iter().position(|output| output == name);
            at.ok_or_else(|| anyhow!("the circuit has no output pin `{name}`"))
        };
        let input =
            |name: &str| sim.input(name).ok_or_else(|| anyhow!("the circuit has no input pin `{name}`"));
        let mut watched = Watched { pins: Vec::new(), tick: true };
        let mut at = Vec::new();
        for drive in drives {
            let pins = drive.actuator().map_or(&[][..], |actuator| &actuator.pins);
            let pins = pins.iter().map(output).collect::<Result<Vec<usize>>>()?;
            // Means need the counts only.
            if matches!(drive, Drive::Leg { .. }) {
                watched.pins.extend(pins.iter().map(|pin| (*pin, Edge::Both)));
            }
            at.push((drive, pins));
        }
        watched.pins.sort_by_key(|(pin, _)| *pin);
        watched.pins.dedup();
        let mut pins: Vec<InputPin> = Vec::new();
        for FilePin { circuit, course, signals } in file_pins {
            pins.push(InputPin {
                input: input(&circuit)?,
                course: Some(course),
                signals,
                has_device: false,
                level: false,
                is_flipped: false,
            });
        }
        let mut devices = Vec::new();
        let mut sees = pins.iter().any(|pin| !pin.signals.is_empty());
        for Measurement { sensor, device, needed, driven } in measurements {
            let mut places = Vec::new();
            for (name, edge) in &needed {
                places.push(watched.pins.len());
                watched.pins.push((output(name)?, *edge));
            }
            let mut own = Vec::new();
            for name in &driven {
                let number = input(name)?;
                let place = pins.iter().position(|pin| pin.input == number).unwrap_or(pins.len());
                if place == pins.len() {
                    let (course, signals, level, is_flipped) = (None, Vec::new(), false, false);
                    let has_device = true;
                    pins.push(InputPin { input: number, course, signals, has_device, level, is_flipped });
                }
                pins[place].has_device = true;
                own.push(place);
            }
            sees |= driven.len() == 1 && needed.is_empty();
            let is_serial = !needed.is_empty();
            devices.push(DeviceAt { sensor, device, needed: places, driven: own, is_serial });
        }
        let clock = wiring.clock * 1e6;
        let courses = at.iter().filter_map(|(drive, _)| match drive {
            Drive::Course(course) => Some(course.times().collect::<Vec<f64>>()),
            _ => None,
        });
        let steps = pins.iter().filter_map(|pin| {
            let mut times = Vec::new();
            let mut next = pin.course.as_ref()?.at(f64::NEG_INFINITY).1;
            while let Some(time) = next {
                times.push(time);
                next = pin.course.as_ref()?.at(time).1;
            }
            Some(times)
        });
        let mut changes: Vec<u64> =
            courses.chain(steps).flatten().map(|time| (time * clock - 1e-6).ceil() as u64).collect();
        changes.sort_unstable();
        changes.dedup();
        let levels: Vec<bool> = sim.output_levels().map(|(level, _)| level).collect();
        Ok(AtPins {
            period: wiring.period.into(),
            clock,
            interface,
            references,
            motion,
            drives: at,
            devices,
            pins,
            watched,
            resolution: RESOLUTION[usize::from(!sees)],
            changes,
            high: vec![0; levels.len()],
            levels,
            sim,
            seed: 0x9e37_79b9,
            is_armed: false,
            begun: None,
            tick: 0,
            open: None,
            rows,
            periods: 0,
            failed: None,
        })
    }

    /// Time of the plant in cycles.
    fn elapsed(&self) -> u64 {
        self.begun.map_or(0, |begun| self.sim.cycles - begun)
    }

    /// Time of the plant in s, for steps of the file, which rounding must not put off.
    fn time(&self) -> f64 {
        (self.elapsed() as f64 + 1e-3) / self.clock
    }

    fn is_flip(&mut self) -> bool {
        self.seed ^= self.seed << 13;
        self.seed ^= self.seed >> 17;
        self.seed ^= self.seed << 5;
        self.seed.is_multiple_of(NOISE)
    }

    /// State of the half bridges, or other outputs, behind each input of the plant.
    fn states(&self) -> Vec<Option<BridgeState>> {
        let state = |(drive, pins): &(Drive, Vec<usize>)| {
            let levels: Vec<bool> = pins.iter().map(|pin| self.levels[*pin]).collect();
            drive.actuator().map(|actuator| actuator.state(&levels))
        };
        self.drives.iter().map(state).collect()
    }

    /// Runs so many cycles, and starts sending these bytes to the board.
    fn advance(&mut self, cycles: u64, mut bytes: &[u8]) -> Result<()> {
        let end = self.sim.cycles + cycles;
        while self.sim.cycles < end {
            let now = self.sim.cycles;
            let mut next = end.min(now + self.resolution);
            next = self.devices.iter().filter_map(|at| at.device.next()).fold(next, u64::min);
            if let Some(begun) = self.begun {
                let change = self.changes.partition_point(|change| begun + change <= now);
                next = self.changes.get(change).map_or(next, |change| next.min(begun + change));
                next = next.min(self.tick + self.period + 1);
            }
            let states = self.states();
            let most = next.saturating_sub(now).clamp(1, 1 << 30) as u32;
            let stop = self.sim.run_watched(most, std::mem::take(&mut bytes), &self.watched)?;
            self.moved(&states, stop.cycles)?;
            for (i, (level, high)) in self.sim.output_levels().enumerate() {
                self.levels[i] = level;
                self.high[i] += u64::from(high);
            }
            let now = self.sim.cycles;
            if stop.tick {
                self.ticked(now)?;
            } else if self.begun.is_some() && now > self.tick + self.period {
                // A program that has stopped has no ticks; its plant goes on.
                self.ticked(self.tick + self.period)?;
            }
            self.act(&stop);
        }
        Ok(())
    }

    /// Moves the plant by cycles in which the outputs had these states.
    fn moved(&mut self, states: &[Option<BridgeState>], cycles: u32) -> Result<()> {
        if self.begun.is_none() {
            return Ok(());
        }
        if let Some(leg) = states.iter().position(|state| *state == Some(BridgeState::Short)) {
            let (signal, _) = &self.interface.inputs[leg];
            bail!(
                "cycle {}: both switches of the half bridge `{signal}` are on, a short circuit",
                self.sim.cycles - u64::from(cycles)
            );
        }
        if let Motion::Switched(plant) = &mut self.motion {
            let time = (self.sim.cycles - self.begun.unwrap_or_default()) as f64 - f64::from(cycles);
            let time = (time + 1e-3) / self.clock;
            let (mut legs, mut inputs) = (Vec::new(), Vec::new());
            for ((drive, _), state) in self.drives.iter().zip(states) {
                match (drive, state) {
                    (Drive::Leg { is_mirrored, .. }, Some(state)) => {
                        legs.push(match state {
                            BridgeState::High if *is_mirrored => Leg::LOW,
                            BridgeState::Low if *is_mirrored => Leg::HIGH,
                            BridgeState::High => Leg::HIGH,
                            BridgeState::Low => Leg::LOW,
                            BridgeState::Off | BridgeState::Short => Leg::OFF,
                        });
                        inputs.push(0.0);
                    }
                    (Drive::Course(course), _) => inputs.push(course.value(time)),
                    _ => inputs.push(0.0),
                }
            }
            plant.advance_switched(f64::from(cycles) / self.clock, &legs, &inputs);
        }
        Ok(())
    }

    /// Ends a period, and begins the next one: at a tick, or at its time without one.
    fn ticked(&mut self, now: u64) -> Result<()> {
        if self.begun.is_none() {
            if !self.is_armed {
                return Ok(());
            }
            self.begun = Some(now);
        } else {
            let cycles = (now - self.tick).max(1);
            if let Motion::Averaged(plant) = &mut self.motion {
                let time = ((self.tick - self.begun.unwrap_or_default()) as f64 + 1e-3) / self.clock;
                let inputs = self.drives.iter().map(|(drive, pins)| match drive {
                    Drive::Mean { actuator, scale, offset } => {
                        let high: Vec<u64> = pins.iter().map(|pin| self.high[*pin]).collect();
                        actuator.port(actuator.mean(&high, cycles)) * scale + offset
                    }
                    Drive::Course(course) => course.value(time),
                    Drive::Leg { .. } => 0.0,
                });
                let inputs: Vec<f64> = inputs.collect();
                let (period, name) = (self.periods, self.interface.name.clone());
                plant.advance(&inputs).map_err(|text| LoopError::Failed { period, plant: name, text })?;
            }
            self.finish_row(cycles as f64)?;
            self.periods += 1;
        }
        self.high.fill(0);
        self.tick = now;
        let (states, signals) = (self.motion.plant().states(), self.motion.plant().sensors());
        let named = self.interface.states.iter().zip(&states);
        let named = named.chain(self.interface.sensors.iter().zip(&signals));
        if let Some((signal, value)) = named.into_iter().find(|(_, value)| !value.is_finite()) {
            let (period, plant) = (self.periods, self.interface.name.clone());
            let (signal, value, from) = (signal.clone(), *value, String::new());
            return Err(LoopError::Diverged { period, plant, signal, value, from }.into());
        }
        let seen = self.sim.seen().map(|(_, bits)| ports::format(Type::I, bits));
        let time = self.time();
        let written = self.references.iter().map(|reference| {
            let port = &reference.port;
            ports::format(port.ty, plants::bits(port.ty, reference.course.value(time)))
        });
        self.open = Some((seen.chain(written).collect(), states.iter().map(f64::to_string).collect()));
        Ok(())
    }

    fn finish_row(&mut self, cycles: f64) -> Result<()> {
        let Some((ports, states)) = self.open.take() else { return Ok(()) };
        if self.is_over() {
            return Ok(());
        }
        let parts = self.high.iter().map(|high| (*high as f64 / cycles).to_string());
        let row: Vec<String> = ports.into_iter().chain(parts).chain(states).collect();
        if let Some(curves) = &mut self.rows.curves {
            curves.add(&row);
        }
        if let Some(outputs) = &mut self.rows.outputs {
            ports::write_row(outputs, row)?;
        }
        self.rows.written += 1;
        Ok(())
    }

    /// Ends a run: completes the table, draws the picture, says what ran. The reason of a failure is kept before `ran`.
    fn finish(&mut self, ran: Result<()>, run: &Run<'_>, begun: Instant) -> Result<()> {
        let (written, cycles) = (self.rows.written, self.sim.cycles);
        let result = self.failed.take().map_or(ran, Err);
        let outputs = self.rows.outputs.take().filter(|_| written > 0 || result.is_ok());
        let finished = outputs.map_or(Ok(()), Out::finish);
        let curves = self.rows.curves.take().filter(|curves| !curves.is_empty());
        if let Some((path, curves)) = run.plot.zip(curves) {
            crate::terminal::files::write(path, curves.draw(&run.title)?.as_bytes())?;
        }
        result.and(finished)?;
        let seconds = begun.elapsed().as_secs_f64();
        output::message(&format!(
            "{written} periods of `{}` at the pins, {cycles} cycles: {:.3} ms of the board, simulated in {seconds:.1} s",
            self.interface.name,
            cycles as f64 / self.clock * 1e3
        ));
        Ok(())
    }

    /// The table has all of its rows.
    fn is_over(&self) -> bool {
        self.rows.most.is_some_and(|most| self.rows.written >= most)
    }

    /// Devices act, and input pins take their levels for the next cycle.
    fn act(&mut self, stop: &Stop) {
        let signals = self.motion.plant().sensors();
        let now = self.sim.cycles;
        for at in 0..self.devices.len() {
            let DeviceAt { sensor, device, needed, driven, is_serial } = &mut self.devices[at];
            let pin = |place: &usize| NeededPin {
                level: self.levels[self.watched.pins[*place].0],
                edge: stop.edges.get(*place).copied().unwrap_or_default(),
            };
            let needed: Vec<NeededPin> = needed.iter().map(pin).collect();
            let gives = device.act(now, &needed, sensor.value(&signals));
            let given: Vec<(usize, bool)> =
                driven.iter().copied().zip(device.levels().iter().copied()).collect();
            // Between frames no edge comes, and noise goes on.
            let anew = gives || !*is_serial || !stop.edges.contains(&true);
            for (place, level) in given {
                let flips = if anew { self.is_flip() } else { self.pins[place].is_flipped };
                (self.pins[place].level, self.pins[place].is_flipped) = (level, flips);
            }
        }
        for at in 0..self.pins.len() {
            if !self.pins[at].has_device {
                self.pins[at].is_flipped = self.is_flip();
            }
        }
        let time = self.time();
        for InputPin { input, course, signals: watched, level, is_flipped, .. } in &mut self.pins {
            let driver = course.as_ref().map_or(PinDriver::Sensor, |course| course.at(time).0);
            if let Some(PinCourse::Comparator { above, .. }) = course {
                *level = watched.iter().any(|signal| signals[*signal].abs() > *above);
            }
            let level = match driver {
                PinDriver::Level(level) => level,
                PinDriver::Sensor => *level,
                PinDriver::Noise => *level != *is_flipped,
            };
            self.sim.set_input(*input, level);
        }
    }
}

impl Line for AtPins {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.go(1, bytes)
    }

    fn receive(&mut self) -> io::Result<Vec<u8>> {
        self.go(SLICE, &[])?;
        Ok(self.sim.take_received())
    }

    fn patience(&self) -> u32 {
        self.sim.patience()
    }

    fn time(&self) -> Duration {
        self.sim.time()
    }
}

impl AtPins {
    /// Advances for a host; the reason of a failure is kept.
    fn go(&mut self, cycles: u64, bytes: &[u8]) -> io::Result<()> {
        self.advance(cycles, bytes).map_err(|error| {
            let text = error.to_string();
            self.failed.get_or_insert(error);
            io::Error::other(text)
        })
    }
}

impl Rows {
    /// Rows of a plant's run for these files, with their titles.
    pub(super) fn new(
        plant: &PlantAtPins<'_>,
        sim: &Simulation,
        pins: &Pins,
        (outputs, draws): (Option<&Path>, bool),
        most: Option<u64>,
    ) -> Result<Rows> {
        let seen = sim.seen().map(|(port, _)| port.to_owned());
        let written = plant.references.iter().map(|reference| reference.port.name.clone());
        let outs = sim.outputs().iter().map(|output| pins.shown(output).to_owned());
        let Interface { name, states, .. } = &plant.interface;
        let states = states.iter().map(|state| format!("{name}.{state}"));
        let titles: Vec<String> = seen.chain(written).chain(outs).chain(states).collect();
        let mut outputs = outputs.map(Out::create).transpose()?;
        if let Some(out) = &mut outputs {
            ports::write_row(out, titles.iter().cloned())?;
        }
        let period = f64::from(plant.wiring.period) / (plant.wiring.clock * 1e6);
        // Pins of a peripheral share a chart.
        let grouped = |title: String| match title.split_once('.') {
            Some((name, pin)) if plant.wiring.peripherals.iter().any(|of| of.name == name) => {
                format!("{name}[{pin}]")
            }
            _ => title,
        };
        let curves = draws.then(|| Curves::new(titles.into_iter().map(grouped).collect(), Some(period)));
        Ok(Rows { outputs, curves, most, written: 0 })
    }
}

/// Limits and companions of a run.
pub(super) struct Run<'a> {
    pub(super) cycles: Option<u64>,
    pub(super) script: Option<Script<'a>>,
    pub(super) plot: Option<&'a Path>,
    /// Title of the picture.
    pub(super) title: String,
    /// The table goes to standard output.
    pub(super) is_quiet: bool,
}

/// Words that the host writes at a time.
type Step = (u64, Vec<(u16, u32)>);

/// Steps of the ports that the host writes, by the period from which on they count.
fn steps(references: &[Reference], period: f64) -> Vec<Step> {
    let mut periods: Vec<u64> = references
        .iter()
        .flat_map(|reference| reference.course.times())
        .map(|time| (time / period - 1e-6).ceil().max(0.0) as u64)
        .filter(|period| *period > 0)
        .collect();
    periods.sort_unstable();
    periods.dedup();
    let settings = |at: u64| {
        let value = |at: u64, reference: &Reference| {
            let value = reference.course.value((at as f64 + 1e-6) * period);
            (reference.address, plants::bits(reference.port.ty, value))
        };
        let changed = references.iter().filter(|one| value(at, one) != value(at - 1, one));
        changed.map(|reference| value(at, reference)).collect()
    };
    periods
        .into_iter()
        .map(|at| (at, settings(at)))
        .filter(|(_, settings): &Step| !settings.is_empty())
        .collect()
}

/// Runs a plant at the pins of a board. `report` reports at the end why outputs are safe.
pub(super) fn run(
    plant: PlantAtPins<'_>,
    sim: Simulation,
    rows: Rows,
    mut run: Run<'_>,
    report: impl FnOnce(&mut Host<AtPins>) -> Result<()>,
    out: &mut Out,
) -> Result<()> {
    let (wiring, begun) = (plant.wiring, Instant::now());
    let mut board = AtPins::new(plant, sim, rows)?;
    // Encoders stand at their places before the reset ends.
    board.act(&Stop { cycles: 0, tick: false, edges: Vec::new() });
    if !wiring.uart {
        // The program starts by itself: its first tick is the plant's time 0.
        board.is_armed = true;
        let ran = drive_alone(&mut board, &mut run, out);
        return board.finish(ran, &run, begun);
    }
    // Before the program is started, whether outputs drive says nothing.
    let tell = board.sim.tell.take();
    board.sim.run(RESET, &[])?;
    let mut host = Host::connect(board, 1)?;
    let ran = drive_board(&mut host, wiring, &mut run, tell, out);
    host.line.finish(ran, &run, begun)?;
    report(&mut host)
}

/// Progress of a run, by its periods or by its cycles.
struct Progress {
    bar: DelayedProgress,
    periods: Option<u64>,
    shown: u64,
}

impl Progress {
    fn new(board: &AtPins, run: &Run<'_>) -> Progress {
        let periods = board.rows.most;
        let unit = if periods.is_some() { "periods" } else { "cycles" };
        Progress { bar: DelayedProgress::new(periods.or(run.cycles), unit), periods, shown: 0 }
    }

    fn show(&mut self, board: &AtPins) {
        let done = self.periods.map_or(board.sim.cycles, |_| board.rows.written);
        self.bar.add(done - self.shown);
        self.shown = done;
    }
}

/// Cycles up to the next command of the script; `None` at the end of the run.
fn next_slice(board: &mut AtPins, run: &mut Run<'_>, out: &mut Out) -> Result<Option<u64>> {
    let now = board.sim.cycles;
    if board.is_over() || run.cycles.is_some_and(|most| now >= most) {
        return Ok(None);
    }
    let slice = run.cycles.map_or(SLICE, |most| SLICE.min(most - now));
    let Some(script) = &mut run.script else { return Ok(Some(slice)) };
    if script.act(&mut board.sim, out)? {
        return Ok(None);
    }
    Ok(Some(script.at_most(now, slice as u32).into()))
}

/// Lets a board run to whose program nobody talks.
fn drive_alone(board: &mut AtPins, run: &mut Run<'_>, out: &mut Out) -> Result<()> {
    let mut progress = Progress::new(board, run);
    while let Some(slice) = next_slice(board, run, out)? {
        progress.show(board);
        board.advance(slice, &[])?;
    }
    Ok(())
}

/// Starts the program, and is its host until the run ends.
fn drive_board(
    host: &mut Host<AtPins>,
    wiring: &Wiring,
    run: &mut Run<'_>,
    tell: Option<fn(&str)>,
    out: &mut Out,
) -> Result<()> {
    // Hold the program first, so that its first period reads the first values.
    let control = protocol::RUN | protocol::ENABLE;
    host.set("control", control | protocol::HOLD | protocol::RESTART)?;
    let first = host.line.references.iter();
    let first = first.map(|one| (one.address, plants::bits(one.port.ty, one.course.value(0.0))));
    let first: Vec<(u16, u32)> = first.collect();
    host.set_ports(&first)?;
    let mut terminal = Terminal::new()?;
    let port = format!("{} {}", terminal.path().display(), wiring.baud);
    if run.is_quiet {
        output::message(&port);
    } else {
        writeln!(out, "{port}")?;
        out.flush()?;
    }
    host.line.is_armed = true;
    host.line.sim.tell = tell;
    host.set("control", control)?;
    let period = f64::from(wiring.period) / (wiring.clock * 1e6);
    let mut steps = steps(&host.line.references, period).into_iter().peekable();
    let bit = (wiring.clock * 1e6 / f64::from(wiring.baud)).round() as u64;
    let mut asked = 0;
    if host.line.rows.most.or(run.cycles).is_none() {
        next_commands(None, terminal.path(), wiring.baud);
    }
    let mut progress = Progress::new(&host.line, run);
    loop {
        progress.show(&host.line);
        let Some(mut slice) = next_slice(&mut host.line, run, out)? else { return Ok(()) };
        let now = host.line.sim.cycles;
        if let (Some((at, settings)), Some(begun)) = (steps.peek(), host.line.begun) {
            // The frame ends in the period before.
            let frame: usize = settings
                .chunk_by(|a, b| a.0 + 1 == b.0)
                .map(|part| protocol::write(0, 0, &vec![0; part.len()]).len())
                .sum();
            let early = frame as u64 * 10 * bit + u64::from(wiring.period / 4);
            let due = (begun + at * u64::from(wiring.period)).saturating_sub(early);
            if due <= now {
                host.set_ports(settings)?;
                steps.next();
                continue;
            }
            slice = slice.min(due - now);
        }
        // A board that watches its host hears from it.
        if wiring.host > 0 && now >= asked {
            asked = now + u64::from(wiring.host / 2) * u64::from(wiring.period);
            let _ = host.register("id")?;
            continue;
        }
        let bytes = terminal.receive()?;
        host.line.advance(slice, &bytes)?;
        let received = host.line.sim.take_received();
        if !received.is_empty() {
            terminal.send(&received)?;
        }
    }
}
