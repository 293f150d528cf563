// SPDX-License-Identifier: MIT OR Apache-2.0
//! Small plants that close the loop of a controller: parameters, and equations in binary64.
//!
//! A plant takes output ports of a program and gives input ports, by their names. In each period, the program reads what the plant gives
//! and the plant then moves for a period under the values that the program has written (zero-order hold; the program's own cycles are
//! neglected). It is integrated by the classical Runge-Kutta method, in steps much shorter than its fastest motion; sums and products
//! alone make the result the same on every host.

/// Steps in the time constant of the fastest motion: errors below 10⁻⁶ of the values.
const RESOLUTION: f64 = 4.0;
/// Maximum number of steps in a period.
const MOST_STEPS: f64 = 10_000.0;
/// Largest number of state variables.
const ORDER: usize = 2;

/// A parameter of a plant.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Parameter {
    /// Symbol, as in the equations.
    pub name: &'static str,
    /// Value unless the user gives another.
    pub value: f64,
    /// SI unit.
    pub unit: &'static str,
    /// Meaning in words.
    pub text: &'static str,
    /// Zero and negative values make no sense.
    pub positive: bool,
}

/// Time derivative of a state.
type Derivative = fn(&[f64], f64, [f64; ORDER], &[f64]) -> [f64; ORDER];

/// A plant with its parameters.
#[derive(Debug)]
pub struct Plant {
    /// Name in requests.
    pub name: &'static str,
    /// Description in words.
    pub text: &'static str,
    /// Output ports of a program that act on the plant.
    pub takes: &'static [&'static str],
    /// Input ports of a program that the plant's sensors fill.
    pub gives: &'static [&'static str],
    /// Parameters in the order in which the equations take them.
    pub parameters: &'static [Parameter],
    /// Time derivative of the state, from parameters, the time at which a step of integration begins, state and inputs.
    derivative: Derivative,
    /// Sensor values of a state.
    sensors: fn([f64; ORDER]) -> Vec<f64>,
    /// Bound of the fastest motion, 1/s.
    rate: fn(&[f64]) -> f64,
}

/// All plants.
pub static PLANTS: [&Plant; 1] = [&DC_MOTOR];

const fn parameter(
    name: &'static str,
    value: f64,
    unit: &'static str,
    text: &'static str,
    positive: bool,
) -> Parameter {
    Parameter { name, value, unit, text, positive }
}

/// L·di/dt = u - R·i - K·w, J·dw/dt = K·i - B·w - load.
static DC_MOTOR: Plant = Plant {
    name: "dc_motor",
    text: "DC motor with a load",
    takes: &["u"],
    gives: &["w"],
    parameters: &[
        parameter("R", 1.0, "Ω", "resistance of the armature", true),
        parameter("L", 1e-3, "H", "inductance of the armature", true),
        parameter("K", 0.08, "V·s/rad", "back EMF per speed, and torque per current in N·m/A", true),
        parameter("J", 7e-4, "kg·m²", "moment of inertia, with the load's", true),
        parameter("B", 1e-4, "N·m·s/rad", "viscous friction", false),
        parameter("load", 0.4, "N·m", "torque of the load, which comes after the delay", false),
        parameter("delay", 0.1, "s", "time until the load comes", false),
    ],
    derivative: |parameters, time, [current, speed], inputs| {
        let [r, l, k, j, b, load, delay] = *parameters else { return [0.0; ORDER] };
        let load = if time >= delay { load } else { 0.0 };
        let voltage = inputs.first().copied().unwrap_or_default();
        [(voltage - r * current - k * speed) / l, (k * current - b * speed - load) / j]
    },
    sensors: |[_, speed]| vec![speed],
    rate: |parameters| {
        let [r, l, k, j, b, ..] = *parameters else { return 0.0 };
        r / l + b.abs() / j + k / (l * j).sqrt()
    },
};

impl Plant {
    /// The plant of a name.
    ///
    /// # Errors
    /// If there is none; the message lists the names.
    pub fn named(name: &str) -> Result<&'static Plant, String> {
        let all = || PLANTS.map(|plant| plant.name).join(", ");
        let found = PLANTS.into_iter().find(|plant| plant.name == name);
        found.ok_or_else(|| format!("there is no plant `{name}` (plants: {})", all()))
    }
}

/// A plant in motion.
#[derive(Clone, Debug)]
pub struct Simulation {
    plant: &'static Plant,
    parameters: Vec<f64>,
    /// Length of a period in seconds, and the number of steps in which it is integrated.
    period: f64,
    steps: u32,
    periods: u64,
    state: [f64; ORDER],
}

impl Simulation {
    /// The plant at rest. `given` replaces values of parameters, by name; `period` is in seconds.
    ///
    /// # Errors
    /// If a parameter does not exist or has a value that makes no sense, or if the plant is too fast for the period.
    pub fn new<'n>(
        plant: &'static Plant,
        given: impl IntoIterator<Item = (&'n str, f64)>,
        period: f64,
    ) -> Result<Simulation, String> {
        let mut parameters: Vec<f64> = plant.parameters.iter().map(|parameter| parameter.value).collect();
        for (name, value) in given {
            let index = plant.parameters.iter().position(|parameter| parameter.name == name);
            let index =
                index.ok_or_else(|| format!("the plant `{}` has no parameter `{name}`", plant.name))?;
            if !value.is_finite() || plant.parameters[index].positive && value <= 0.0 {
                let wanted = if plant.parameters[index].positive { "a positive number" } else { "a number" };
                return Err(format!(
                    "the parameter `{name}` of `{}` is {value}; expected {wanted}",
                    plant.name
                ));
            }
            parameters[index] = value;
        }
        let steps = (period * (plant.rate)(&parameters) * RESOLUTION).ceil().max(1.0);
        if !(period > 0.0 && steps <= MOST_STEPS) {
            return Err(format!(
                "the plant `{}` moves too fast for a period of {period} s: expected at most {MOST_STEPS} steps of integration in \
                 a period, these parameters ask for {steps}",
                plant.name
            ));
        }
        Ok(Simulation { plant, parameters, period, steps: steps as u32, periods: 0, state: [0.0; ORDER] })
    }

    /// Sensor values, in the order of [`Plant::gives`].
    pub fn sensors(&self) -> Vec<f64> {
        (self.plant.sensors)(self.state)
    }

    /// Moves the plant for a period under constant inputs, in the order of [`Plant::takes`].
    pub fn advance(&mut self, inputs: &[f64]) {
        let step = self.period / f64::from(self.steps);
        let begin = self.periods as f64 * self.period;
        for i in 0..self.steps {
            let time = begin + f64::from(i) * step;
            let slope = |by: f64, slope: [f64; ORDER]| {
                let state = std::array::from_fn(|at| self.state[at] + by * slope[at]);
                (self.plant.derivative)(&self.parameters, time, state, inputs)
            };
            let first = slope(0.0, [0.0; ORDER]);
            let second = slope(step / 2.0, first);
            let third = slope(step / 2.0, second);
            let fourth = slope(step, third);
            self.state = std::array::from_fn(|at| {
                self.state[at] + step / 6.0 * (first[at] + 2.0 * (second[at] + third[at]) + fourth[at])
            });
        }
        self.periods += 1;
    }
}
