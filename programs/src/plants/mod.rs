// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plants that close the loop of a controller.
//!
//! - [`models`]: small plants: parameters, and equations in binary64;
//! - [`file`](mod@file): a plant's file in TOML: its model, or an FMU, parameters, ports, disturbances;
//! - [`ClosedLoop`]: a plant between the output and the input ports of a program.
//!
//! In each period, the program reads what the plant's sensors give, and the plant then moves for a period under the values that the program
//! has written (zero-order hold; the program's own cycles are neglected). The small plants are integrated by the classical Runge-Kutta
//! method, in steps much shorter than their fastest motion. Sums, products, square roots, and the sines of the crate libm make the result
//! the same on every host.

pub mod file;
mod inverter;
mod loops;
pub mod models;

pub use file::{Course, PinCourse, PinDriver, PlantFile};
pub use inverter::Leg;
pub use loops::{ClosedLoop, Connection, LoopError, Sensor, Source, bits};
use models::{ORDER, State};

/// Steps of integration in the time constant of the fastest motion: errors below 10⁻⁶ of the values.
const RESOLUTION: f64 = 16.0;
/// Maximum number of steps in a period.
pub const MOST_STEPS: u32 = 100_000;

/// A parameter of a model.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Parameter {
    /// Symbol, as in the equations.
    pub name: &'static str,
    /// Value unless the user gives another.
    pub value: f64,
    /// SI unit; empty for a pure number.
    pub unit: &'static str,
    /// Meaning in words.
    pub text: &'static str,
    /// Least value that makes sense: 0, or the least positive number.
    pub least: f64,
}

impl Parameter {
    /// Checks a value.
    ///
    /// # Errors
    /// If it makes no sense; the message is an expectation: `expected a positive number`.
    pub fn check(&self, value: f64) -> Result<(), &'static str> {
        match () {
            () if value.is_finite() && value >= self.least => Ok(()),
            () if self.least > 0.0 => Err("expected a positive number"),
            () => Err("expected a number, 0 or more"),
        }
    }
}

/// A quantity of a model: a sensor's or a state.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Quantity {
    /// Name in files.
    pub name: &'static str,
    /// SI unit; empty for a pure number.
    pub unit: &'static str,
    /// Meaning in words.
    pub text: &'static str,
}

/// An input of a model.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Input {
    /// Name, unit, meaning.
    pub quantity: Quantity,
    /// The input is 0 unless a file states another value; all others need a port.
    pub is_disturbance: bool,
}

/// A stretch of time in seconds with the inputs of [`Model::derivative`] in it.
type Stretch = (f64, Vec<f64>);
/// Stretches that make up a period, from parameters, inputs and the period in seconds.
type Stretches = fn(&[f64], &[f64], f64) -> Vec<Stretch>;

/// Inputs of [`Model::derivative`] from the states of the legs and the inputs.
type Bridge = fn(&[Leg], &[f64]) -> Vec<f64>;

/// A small plant.
#[derive(Debug)]
pub struct Model {
    /// Name in files.
    pub name: &'static str,
    /// Description in words.
    pub text: &'static str,
    /// Inputs: actuators, which output ports of a program drive, then disturbances.
    pub inputs: &'static [Input],
    /// Sensors, which fill input ports of a program.
    pub sensors: &'static [Quantity],
    /// State variables; at most [`ORDER`].
    pub states: &'static [Quantity],
    /// Parameters in the order in which the equations take them.
    pub parameters: &'static [Parameter],
    /// Time derivative of the state, from parameters, inputs and state.
    derivative: fn(&[f64], &[f64], State) -> State,
    /// Sensor values from parameters and state.
    sense: fn(&[f64], State) -> Vec<f64>,
    /// Bound of the fastest motion in 1/s, from parameters and the period in seconds.
    rate: fn(&[f64], f64) -> f64,
    /// Stretches that make up a period; `None`: one, with the inputs as they are.
    stretches: Option<Stretches>,
    /// Inputs of [`Model::derivative`] while the legs of half bridges are in given states, in place of the duties, which are all inputs but
    /// disturbances; `None` for a plant without switches.
    bridge: Option<Bridge>,
}

impl Model {
    /// The model of a name.
    pub fn named(name: &str) -> Option<&'static Model> {
        models::MODELS.into_iter().find(|model| model.name == name)
    }

    /// Number of half bridges whose switches the model has; its first inputs are their duties.
    pub fn legs(&self) -> usize {
        let is_duty = |input: &&Input| self.bridge.is_some() && !input.is_disturbance;
        self.inputs.iter().filter(is_duty).count()
    }

    /// Signals of the model.
    pub fn interface(&self) -> Interface {
        let names = |quantities: &[Quantity]| quantities.iter().map(|one| one.name.to_owned()).collect();
        let inputs = self.inputs.iter();
        Interface {
            name: self.name.to_owned(),
            inputs: inputs.map(|one| (one.quantity.name.to_owned(), one.is_disturbance)).collect(),
            sensors: names(self.sensors),
            states: names(self.states),
        }
    }
}

/// Name of a signal of a copy of a plant, from 1 on.
fn indexed(name: &str, copy: u32) -> String {
    format!("{name}[{copy}]")
}

/// Name and index, in brackets, of a signal that belongs to a copy.
fn indexed_parts(name: &str) -> Option<(&str, &str)> {
    name.ends_with(']').then(|| name.find('[').map(|at| name.split_at(at)))?
}

/// The signal has this name, or is that of a copy.
fn is_of(signal: &str, name: &str) -> bool {
    signal == name || indexed_parts(signal).is_some_and(|(of, _)| of == name)
}

/// Names of a plant's signals.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Interface {
    /// Name of the plant in messages.
    pub name: String,
    /// Inputs; true for those that are 0 unless a file states another value.
    pub inputs: Vec<(String, bool)>,
    /// Sensors.
    pub sensors: Vec<String>,
    /// Variables to be recorded in each period.
    pub states: Vec<String>,
}

impl Interface {
    /// Interface of copies of a plant, with signals from `w[1]` on.
    fn of_copies(self, copies: u32) -> Interface {
        let each = |names: &[String]| {
            (1..=copies).flat_map(|copy| names.iter().map(move |name| indexed(name, copy))).collect()
        };
        let inputs = |copy: u32| {
            self.inputs.iter().map(move |(name, is_disturbance)| (indexed(name, copy), *is_disturbance))
        };
        Interface {
            inputs: (1..=copies).flat_map(inputs).collect(),
            sensors: each(&self.sensors),
            states: each(&self.states),
            name: self.name,
        }
    }

    /// Indices of the sensors that a name stands for: the one of this name, or those of all copies.
    pub fn sensors_named(&self, name: &str) -> Vec<usize> {
        let all = self.sensors.iter().enumerate();
        all.filter(|(_, sensor)| is_of(sensor, name)).map(|(index, _)| index).collect()
    }
}

/// A plant in motion.
pub trait Plant: Send {
    /// Moves for a period under constant inputs, in the order of [`Interface::inputs`].
    ///
    /// # Errors
    /// If the plant failed, in words.
    fn advance(&mut self, inputs: &[f64]) -> Result<(), String>;

    /// Values of the sensors, in the order of [`Interface::sensors`].
    fn sensors(&self) -> Vec<f64>;

    /// Values of the states, in the order of [`Interface::states`].
    fn states(&self) -> Vec<f64>;
}

impl<P: Plant + ?Sized> Plant for Box<P> {
    fn advance(&mut self, inputs: &[f64]) -> Result<(), String> {
        (**self).advance(inputs)
    }

    fn sensors(&self) -> Vec<f64> {
        (**self).sensors()
    }

    fn states(&self) -> Vec<f64> {
        (**self).states()
    }
}

/// A small plant in motion.
#[derive(Clone, Debug)]
pub struct Simulation {
    model: &'static Model,
    parameters: Vec<f64>,
    /// Length of a period, s.
    period: f64,
    /// Longest step of integration, s.
    longest: f64,
    state: State,
}

/// Copies of a small plant in motion, one after the other in inputs, sensors and states.
#[derive(Clone, Debug)]
pub struct Copies(Vec<Simulation>);

impl Copies {
    /// Moves for a time in s under switches, as [`Simulation::advance_switched`] does.
    pub fn advance_switched(&mut self, duration: f64, legs: &[Leg], inputs: &[f64]) {
        let copies = self.0.len().max(1);
        let legs = legs.chunks((legs.len() / copies).max(1)).chain(std::iter::repeat(&[][..]));
        let inputs = inputs.chunks((inputs.len() / copies).max(1));
        for ((plant, legs), inputs) in self.0.iter_mut().zip(legs).zip(inputs) {
            plant.advance_switched(duration, legs, inputs);
        }
    }
}

impl Plant for Copies {
    fn advance(&mut self, inputs: &[f64]) -> Result<(), String> {
        let each = (inputs.len() / self.0.len().max(1)).max(1);
        self.0.iter_mut().zip(inputs.chunks(each)).try_for_each(|(plant, inputs)| plant.advance(inputs))
    }

    fn sensors(&self) -> Vec<f64> {
        self.0.iter().flat_map(Plant::sensors).collect()
    }

    fn states(&self) -> Vec<f64> {
        self.0.iter().flat_map(Plant::states).collect()
    }
}

/// Reason why there is no small plant in motion.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum SimulationError {
    /// The plant is an FMU.
    #[error("the plant is an FMU, which runs in a process of its own")]
    Fmu,
    /// A period is too long for the plant's fastest motion.
    #[error(
        "the plant `{name}` moves too fast for a period of {period} s: its parameters ask for {steps:.0} steps of integration in a \
         period, and at most {MOST_STEPS} are made"
    )]
    TooFast {
        /// Name of the model.
        name: &'static str,
        /// Length of a period, s.
        period: f64,
        /// Number of steps.
        steps: f64,
    },
}

impl Simulation {
    /// A plant with parameters in the order of [`Model::parameters`] and an initial state in the order of [`Model::states`] (missing ones
    /// are 0). `period` is in seconds; it has at least `steps` steps of integration.
    ///
    /// # Errors
    /// If the plant is too fast for the period.
    pub fn new(
        model: &'static Model,
        parameters: Vec<f64>,
        initial: &[f64],
        period: f64,
        steps: u32,
    ) -> Result<Simulation, SimulationError> {
        let asked = period * (model.rate)(&parameters, period) * RESOLUTION;
        let asked = asked.max(f64::from(steps)).max(1.0);
        if !(period > 0.0 && asked <= f64::from(MOST_STEPS)) {
            return Err(SimulationError::TooFast { name: model.name, period, steps: asked });
        }
        let state = std::array::from_fn(|at| initial.get(at).copied().unwrap_or_default());
        // A step that is a rounding error longer is no further step.
        let longest = period / asked.ceil() * (1.0 + 1e-9);
        Ok(Simulation { model, parameters, period, longest, state })
    }

    /// Moves for a time in s under switches in given states, one leg for each of [`Model::legs`], and constant inputs, of which duties have no
    /// effect.
    pub fn advance_switched(&mut self, duration: f64, legs: &[Leg], inputs: &[f64]) {
        match self.model.bridge {
            Some(bridge) => self.integrate(duration, &bridge(legs, inputs)),
            None => self.integrate(duration, inputs),
        }
    }

    /// Moves under constant inputs of the equations.
    fn integrate(&mut self, duration: f64, inputs: &[f64]) {
        let steps = (duration / self.longest).ceil().max(1.0);
        let step = duration / steps;
        // `new` bounds the number.
        for _ in 0..steps as u32 {
            let slope = |by: f64, slope: State| {
                let state = std::array::from_fn(|at| self.state[at] + by * slope[at]);
                (self.model.derivative)(&self.parameters, inputs, state)
            };
            let first = slope(0.0, [0.0; ORDER]);
            let second = slope(step / 2.0, first);
            let third = slope(step / 2.0, second);
            let fourth = slope(step, third);
            self.state = std::array::from_fn(|at| {
                self.state[at] + step / 6.0 * (first[at] + 2.0 * (second[at] + third[at]) + fourth[at])
            });
        }
    }
}

impl Plant for Simulation {
    fn advance(&mut self, inputs: &[f64]) -> Result<(), String> {
        match self.model.stretches {
            None => self.integrate(self.period, inputs),
            Some(stretches) => {
                for (duration, inputs) in stretches(&self.parameters, inputs, self.period) {
                    self.integrate(duration, &inputs);
                }
            }
        }
        Ok(())
    }

    fn sensors(&self) -> Vec<f64> {
        (self.model.sense)(&self.parameters, self.state)
    }

    fn states(&self) -> Vec<f64> {
        self.state[..self.model.states.len()].to_vec()
    }
}
