// SPDX-License-Identifier: MIT OR Apache-2.0
//! A plant between the output and the input ports of a program.

use super::file::{self, CODE, Course, Entry, PlantFile, PortOf, UNLIMITED, entry_of, listed};
use super::{Interface, Model, Plant, indexed_parts, is_of};
use std::sync::Arc;
use takt_diagnostics::diag::{Diagnostic, Diagnostics};
use takt_diagnostics::nearest;
use takt_isa::program::Port;
use takt_isa::{Register, Type};

/// Reason why a loop ended.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum LoopError {
    /// The plant failed.
    #[error("period {period}: the plant `{plant}` failed: {text}")]
    Failed {
        /// Period, from 0.
        period: u64,
        /// Name of the plant.
        plant: String,
        /// The reason.
        text: String,
    },
    /// A value is no finite number any more.
    #[error("period {period}: the plant `{plant}` diverged: {signal} is {value}{from}")]
    Diverged {
        /// Period, from 0.
        period: u64,
        /// Name of the plant.
        plant: String,
        /// State or sensor.
        signal: String,
        /// Its value.
        value: f64,
        /// Input that was no finite number either, as a sentence's end; empty if there is none.
        from: String,
    },
}

/// Source of one input of a plant.
#[derive(Clone, Debug)]
pub enum Source {
    /// The program: the input is port · scale + offset.
    Port {
        /// Output port.
        port: Port,
        /// Factor.
        scale: f64,
        /// Summand.
        offset: f64,
    },
    /// The plant's file.
    Course(Course),
}

/// Sensor behind an input port, which is signal · scale + offset.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Index among the plant's sensors.
    pub index: usize,
    /// Input port.
    pub port: Port,
    /// Factor.
    pub scale: f64,
    /// Summand.
    pub offset: f64,
    /// Least and greatest value.
    pub limits: (f64, f64),
}

impl Sensor {
    /// Value of the port, before it is rounded, from the plant's signals.
    pub fn value(&self, signals: &[f64]) -> f64 {
        (signals[self.index] * self.scale + self.offset).clamp(self.limits.0, self.limits.1)
    }
}

/// How a plant is connected to a program.
#[derive(Clone, Debug)]
pub struct Connection {
    /// Sources of the plant's inputs, in their order.
    pub sources: Vec<Source>,
    /// Sensors that drive input ports.
    pub sensors: Vec<Sensor>,
    /// Input ports that the plant's file drives.
    pub courses: Vec<(Port, Course)>,
    /// Input ports that neither the plant nor its file drives: a table must.
    pub rest: Vec<Port>,
}

/// Value of a port's bits.
fn value(ty: Type, bits: u32) -> f64 {
    match ty {
        Type::F => f32::from_bits(bits).into(),
        Type::I => bits.cast_signed().into(),
        Type::B => bits.into(),
    }
}

/// Bits of a port's value: a float is rounded to nearest, an integer is the next lower one, as in a counter or converter, within its range.
pub fn bits(ty: Type, value: f64) -> u32 {
    match ty {
        Type::F => (value as f32).to_bits(),
        // Rust's casts saturate.
        Type::I => (value.floor() as i32).cast_unsigned(),
        Type::B => value.floor() as u32,
    }
}

/// Ports of a program by name, with what has been said about them.
struct Connector<'a> {
    file: &'a PlantFile,
    interface: &'a Interface,
    /// From the file, then from options; an option replaces the file's entry.
    ports: Vec<Entry<PortOf>>,
    mistakes: Vec<Diagnostic>,
}

impl PlantFile {
    /// Connects a plant to the ports of a program: by the file's map, by `options` (signal and port, in place of the file's), or by equal
    /// names.
    ///
    /// # Errors
    /// Names that do not exist, inputs of the plant without a source, ports with two sources.
    pub fn connect(
        &self,
        interface: &Interface,
        inputs: &[Port],
        outputs: &[Port],
        options: &[(String, String)],
    ) -> Result<Connection, Diagnostics> {
        let mut ports = self.ports.clone();
        for (signal, port) in options {
            match ports.iter_mut().find(|entry| entry.name == *signal) {
                Some(entry) => entry.value.port = port.clone(),
                None => {
                    let (name, value) = (signal.clone(), PortOf::named(port));
                    ports.push(Entry { name, place: Default::default(), value });
                }
            }
        }
        let mut connector = Connector { file: self, interface, ports, mistakes: Vec::new() };
        let connection = connector.connect(inputs, outputs);
        match connector.mistakes.is_empty() {
            true => Ok(connection),
            false => Err(file::diagnostics(Arc::clone(&self.sources), connector.mistakes)),
        }
    }
}

impl Connector<'_> {
    /// A mistake at an entry; entries of options have no place.
    fn mistake(&mut self, place: takt_diagnostics::Span, message: String) -> &mut Diagnostic {
        self.mistakes.push(match place == Default::default() {
            true => Diagnostic::placeless(CODE, message),
            false => Diagnostic::error(CODE, place, message),
        });
        let last = self.mistakes.len() - 1;
        &mut self.mistakes[last]
    }

    /// Port of a signal, with its entry: of the map, or of equal name. Reports a mapped one that does not exist.
    fn port_of(&mut self, signal: &str, ports: &[Port], kind: &str) -> Option<(Port, PortOf)> {
        let find = |name: &str| ports.iter().find(|port| port.name == name).cloned();
        let Some(entry) = entry_of(&self.ports, signal).cloned() else {
            return find(signal).map(|port| (port, PortOf::named(signal)));
        };
        // An entry for all copies names an array of ports.
        let index = indexed_parts(signal).filter(|_| entry.name != signal).map_or("", |(_, index)| index);
        let port = &format!("{}{index}", entry.value.port);
        let found = find(port);
        if found.is_none() {
            let near = nearest(port, ports.iter().map(|port| port.name.as_str()));
            let names = listed(ports.iter().map(|port| port.name.as_str()));
            let text = format!("the program has no {kind} port `{port}` for the plant's `{signal}`");
            let mistake = self.mistake(entry.place, text);
            *mistake = mistake.clone().help(format!("{kind} ports: {names}")).did_you_mean(near);
        }
        found.map(|port| (port, entry.value))
    }

    fn connect(&mut self, inputs: &[Port], outputs: &[Port]) -> Connection {
        let Interface { name: plant, inputs: takes, sensors: gives, .. } = self.interface;
        let names = || takes.iter().map(|(name, _)| name.as_str()).chain(gives.iter().map(String::as_str));
        let copies = self.file.copies;
        let is_signal = |name: &str, entry: &str| name == entry || copies > 1 && is_of(name, entry);
        for entry in self.ports.clone() {
            if !names().any(|name| is_signal(name, &entry.name)) {
                let near = nearest(&entry.name, names());
                let text = format!("the plant `{plant}` has no signal `{}`", entry.name);
                let mistake = self.mistake(entry.place, text);
                *mistake = mistake.clone().help(format!("signals: {}", listed(names()))).did_you_mean(near);
            }
        }
        for entry in &self.file.disturbances {
            if !takes.iter().any(|(name, _)| is_signal(name, &entry.name)) {
                let known = || takes.iter().map(|(name, _)| name.as_str());
                let near = nearest(&entry.name, known());
                let text = format!("the plant `{plant}` has no input `{}`", entry.name);
                let mistake = self.mistake(entry.place, text);
                *mistake = mistake.clone().help(format!("inputs: {}", listed(known()))).did_you_mean(near);
            }
        }
        let sources = takes.iter().map(|(signal, is_disturbance)| {
            let course = entry_of(&self.file.disturbances, signal);
            let mapped = entry_of(&self.ports, signal).map(|entry| entry.place);
            if let (Some(course), Some(_)) = (course, mapped) {
                let text = format!("`{signal}` has a port, and a course under [disturbance]: one must go");
                let _ = self.mistake(course.place, text);
            }
            if let Some(course) = course {
                return Source::Course(course.value.clone());
            }
            if let Some((port, PortOf { scale, offset, limits, .. })) = self.port_of(signal, outputs, "output") {
                if limits != UNLIMITED {
                    let text = format!("`limits` is for sensors, and `{signal}` is an input of the plant");
                    let _ = self.mistake(mapped.unwrap_or_default(), text);
                }
                return Source::Port { port, scale, offset };
            }
            if !is_disturbance && mapped.is_none() {
                let text = format!("the plant `{plant}` takes `{signal}`, and the program has no output port of that name");
                let names = listed(outputs.iter().map(|port| port.name.as_str()));
                let help = format!(
                    "name one under [ports], `{signal} = \"…\"`, or with `--connect {signal}=…` (output ports: {names}), or state its value \
                     under [disturbance]"
                );
                let mistake = self.mistake(Default::default(), text);
                *mistake = mistake.clone().help(help);
            }
            Source::Course(Course::default())
        });
        let sources = sources.collect::<Vec<_>>();
        let mut sensors: Vec<Sensor> = Vec::new();
        for (index, signal) in gives.iter().enumerate() {
            let Some((port, PortOf { scale, offset, limits, .. })) = self.port_of(signal, inputs, "input")
            else {
                continue;
            };
            if let Some(other) = sensors.iter().find(|other| other.port.register == port.register) {
                let other = &gives[other.index];
                let place = entry_of(&self.ports, signal).or_else(|| entry_of(&self.ports, other));
                let place = place.map_or(Default::default(), |entry| entry.place);
                let text =
                    format!("the input port `{}` gets `{other}` and `{signal}`: one must go", port.name);
                let _ = self.mistake(place, text);
            }
            sensors.push(Sensor { index, port, scale, offset, limits });
        }
        let mut courses = Vec::new();
        for entry in &self.file.inputs {
            let own = |port: &&Port| {
                entry_of(&self.file.inputs, &port.name).is_some_and(|own| own.name == entry.name)
            };
            let named: Vec<&Port> = inputs.iter().filter(own).collect();
            if named.is_empty() {
                let known = || inputs.iter().map(|port| port.name.as_str());
                let near = nearest(&entry.name, known());
                let text = format!("the program has no input port `{}`", entry.name);
                let mistake = self.mistake(entry.place, text);
                *mistake =
                    mistake.clone().help(format!("input ports: {}", listed(known()))).did_you_mean(near);
                continue;
            }
            for port in named {
                if let Some(sensor) = sensors.iter().find(|sensor| sensor.port.register == port.register) {
                    let signal = &gives[sensor.index];
                    let text = format!(
                        "the input port `{}` gets the plant's `{signal}`, and a course here: one must go",
                        port.name
                    );
                    let _ = self.mistake(entry.place, text);
                }
                courses.push((port.clone(), entry.value.clone()));
            }
        }
        if sensors.is_empty() && self.mistakes.is_empty() {
            let text = format!(
                "the plant `{plant}` gives none of the program's input ports: there is no loop to close"
            );
            let help = format!(
                "name ports under [ports], `SIGNAL = \"PORT\"`, or with --connect (signals: {}; input ports: {})",
                listed(gives.iter().map(String::as_str)),
                listed(inputs.iter().map(|port| port.name.as_str()))
            );
            let mistake = self.mistake(Default::default(), text);
            *mistake = mistake.clone().help(help);
        }
        let is_driven = |port: &Port| {
            sensors.iter().any(|sensor| sensor.port.register == port.register)
                || courses.iter().any(|(known, _)| known.register == port.register)
        };
        let rest = inputs.iter().filter(|port| !is_driven(port)).cloned().collect();
        Connection { sources, sensors, courses, rest }
    }
}

impl Connection {
    /// Input ports that sensors of the plant drive.
    pub fn driven(&self) -> impl Iterator<Item = &Port> {
        self.sensors.iter().map(|sensor| &sensor.port)
    }

    /// Input ports that the plant's file drives, unless a table does.
    pub fn optional(&self) -> Vec<Port> {
        self.courses.iter().map(|(port, _)| port.clone()).collect()
    }

    /// # Errors
    /// If input ports are left for which `has_values` is false; in words.
    pub fn complete(&self, has_values: impl Fn(&Port) -> bool) -> Result<(), String> {
        let missing: Vec<&str> =
            self.rest.iter().filter(|port| !has_values(port)).map(|port| port.name.as_str()).collect();
        let (ports, have) = match missing.len() {
            0 => return Ok(()),
            1 => ("port", "has"),
            _ => ("ports", "have"),
        };
        let names = listed(missing);
        Err(format!(
            "the input {ports} {names} {have} no source: state a value or steps under [inputs] in the plant's file, map a signal of the plant \
             under [ports], or give columns with --inputs"
        ))
    }
}

/// A plant connected to a program, in motion.
pub struct ClosedLoop<P> {
    plant: P,
    interface: Interface,
    connection: Connection,
    /// Length of a period, s.
    length: f64,
    period: u64,
    begun: bool,
    /// States at the beginning of the last period.
    states: Vec<f64>,
}

impl<P: Plant> ClosedLoop<P> {
    /// A loop whose periods have the given length in s.
    pub fn new(plant: P, interface: Interface, connection: Connection, length: f64) -> ClosedLoop<P> {
        ClosedLoop { plant, interface, connection, length, period: 0, begun: false, states: Vec::new() }
    }

    /// Length of a period, s.
    pub fn period(&self) -> f64 {
        self.length
    }

    /// Signals of the plant.
    pub fn interface(&self) -> &Interface {
        &self.interface
    }

    /// Connection to the program.
    pub fn connection(&self) -> &Connection {
        &self.connection
    }

    /// Names of the states as columns of a table: `dc_motor.w`.
    pub fn state_names(&self) -> impl Iterator<Item = String> {
        self.interface.states.iter().map(|state| format!("{}.{state}", self.interface.name))
    }

    /// Units of the states, in the order of [`Interface::states`]; `None` for an FMU's.
    pub fn state_units(&self) -> Vec<Option<String>> {
        let model = Model::named(&self.interface.name);
        let unit =
            |state: &String| Some(model?.states.iter().find(|one| is_of(state, one.name))?.unit.to_owned());
        self.interface.states.iter().map(unit).collect()
    }

    /// The plant.
    pub fn plant(&self) -> &P {
        &self.plant
    }

    /// States at the beginning of the last period, in the order of [`Interface::states`]; empty before the first.
    pub fn states(&self) -> &[f64] {
        &self.states
    }

    /// Begins a period: moves the plant under the outputs of the one before, unless it is the first, and sets the inputs in a row of a table
    /// as [`ClosedLoop::set_inputs`] does. So only a period that is run needs the plant's motion in the one before.
    ///
    /// # Errors
    /// If the plant fails, or is not finite any more.
    pub fn begin(
        &mut self,
        row: &mut Vec<(Register, u32)>,
        output: impl Fn(Register) -> Option<u32>,
    ) -> Result<(), LoopError> {
        if self.begun {
            self.advance(output)?;
        }
        self.begun = true;
        self.set_inputs(row);
        self.states = self.plant.states();
        Ok(())
    }

    /// Sets the inputs of the next period in a row of a table: those of the plant in place of the row's own, those of the file where the
    /// row has none.
    pub fn set_inputs(&self, row: &mut Vec<(Register, u32)>) {
        let signals = self.plant.sensors();
        for sensor in &self.connection.sensors {
            let Sensor { port, .. } = sensor;
            row.retain(|(known, _)| *known != port.register);
            row.push((port.register, bits(port.ty, sensor.value(&signals))));
        }
        for (port, course) in &self.connection.courses {
            if row.iter().all(|(known, _)| *known != port.register) {
                row.push((port.register, bits(port.ty, course.at(self.period, self.length))));
            }
        }
    }

    /// Moves the plant for a period under the program's outputs; `output` gives the bits of a port, `None` if it was never written, which
    /// acts as 0.
    ///
    /// # Errors
    /// If the plant fails, or is not finite any more.
    pub fn advance(&mut self, output: impl Fn(Register) -> Option<u32>) -> Result<(), LoopError> {
        let ClosedLoop { plant, interface, connection, length, period, .. } = self;
        let inputs = connection.sources.iter().map(|source| match source {
            Source::Port { port, scale, offset } => {
                value(port.ty, output(port.register).unwrap_or_default()) * scale + offset
            }
            Source::Course(course) => course.at(*period, *length),
        });
        let inputs: Vec<f64> = inputs.collect();
        let name = &interface.name;
        plant.advance(&inputs).map_err(|text| LoopError::Failed {
            period: *period,
            plant: name.clone(),
            text,
        })?;
        let (states, sensors) = (plant.states(), plant.sensors());
        let named = interface.states.iter().zip(&states).chain(interface.sensors.iter().zip(&sensors));
        if let Some((signal, value)) = named.into_iter().find(|(_, value)| !value.is_finite()) {
            let input = interface.inputs.iter().zip(&inputs).find(|(_, input)| !input.is_finite());
            let from =
                input.map_or(String::new(), |((name, _), input)| format!("; its input {name} was {input}"));
            let (period, plant, signal) = (*period, name.clone(), signal.clone());
            return Err(LoopError::Diverged { period, plant, signal, value: *value, from });
        }
        *period += 1;
        Ok(())
    }
}
