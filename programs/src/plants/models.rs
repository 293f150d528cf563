// SPDX-License-Identifier: MIT OR Apache-2.0
//! Equations of the small plants, one row of [`MODELS`] each. Sine and cosine are the crate libm's, so that they are the same on every host.

use super::inverter::{self, Leg};
use super::{Input, Model, Parameter, Quantity};

/// Number of state variables of the largest model; smaller ones leave the others at 0.
pub(super) const ORDER: usize = 12;
/// State variables.
pub(super) type State = [f64; ORDER];

/// State with these first variables.
fn state<const N: usize>(variables: [f64; N]) -> State {
    std::array::from_fn(|at| variables.get(at).copied().unwrap_or_default())
}

/// All models.
pub static MODELS: [&Model; 9] = [
    &DC_MOTOR,
    &DC_MOTOR_SWITCHED,
    &PMSM,
    &PMSM_SWITCHED,
    &INERTIA,
    &MASS_SPRING,
    &CHAIN,
    &CART_PENDULUM,
    &TANK,
];

const fn positive(name: &'static str, value: f64, unit: &'static str, text: &'static str) -> Parameter {
    Parameter { name, value, unit, text, least: f64::MIN_POSITIVE }
}

const fn natural(name: &'static str, value: f64, unit: &'static str, text: &'static str) -> Parameter {
    Parameter { name, value, unit, text, least: 0.0 }
}

const fn quantity(name: &'static str, unit: &'static str, text: &'static str) -> Quantity {
    Quantity { name, unit, text }
}

const fn actuator(name: &'static str, unit: &'static str, text: &'static str) -> Input {
    Input { quantity: quantity(name, unit, text), is_disturbance: false }
}

const fn disturbance(name: &'static str, unit: &'static str, text: &'static str) -> Input {
    Input { quantity: quantity(name, unit, text), is_disturbance: true }
}

const SPEED: Quantity = quantity("w", "rad/s", "speed of the shaft");
const ANGLE: Quantity = quantity("angle", "rad", "angle of the shaft, which counts turns");
const LOAD: Input = disturbance("load", "N·m", "torque of the load, against the motor's");
const INERTIA_OF_SHAFT: Parameter = positive("J", 7e-4, "kg·m²", "moment of inertia, with the load's");
const RESISTANCE: Parameter = positive("R", 1.0, "Ω", "resistance of the armature");
const INDUCTANCE: Parameter = positive("L", 1e-3, "H", "inductance of the armature");
const CONSTANT: Parameter =
    positive("K", 0.08, "V·s/rad", "back EMF per speed, and torque per current in N·m/A");
const BRIDGE_VOLTAGE: Parameter = positive("udc", 24.0, "V", "voltage of the bridge");
const DEAD_TIME: Parameter = natural("dead", 0.5e-6, "s", "dead time of the half bridges");
const KNEE: Parameter = positive(
    "knee",
    0.05,
    "A",
    "current below which a leg's capacitance, and no diode, decides its voltage in the dead time",
);
const FRICTION: Parameter = natural("B", 1e-4, "N·m·s/rad", "viscous friction");

static DC_MOTOR_PARAMETERS: [Parameter; 5] = [RESISTANCE, INDUCTANCE, CONSTANT, INERTIA_OF_SHAFT, FRICTION];

/// L·di/dt = u - R·i - K·w, J·dw/dt = K·i - B·w - load.
static DC_MOTOR: Model = Model {
    name: "dc_motor",
    text: "DC motor with a load",
    inputs: &[actuator("u", "V", "voltage of the armature"), LOAD],
    sensors: &[SPEED, quantity("i", "A", "current of the armature"), ANGLE],
    states: &[quantity("i", "A", "current of the armature"), SPEED, ANGLE],
    parameters: &DC_MOTOR_PARAMETERS,
    derivative: |p, input, [current, speed, ..]| {
        let (&[r, l, k, j, b], &[u, load]) = (p, input) else { return [0.0; ORDER] };
        state([(u - r * current - k * speed) / l, (k * current - b * speed - load) / j, speed])
    },
    sense: |_, [current, speed, angle, ..]| vec![speed, current, angle],
    rate: |p, _| {
        let [r, l, k, j, b] = *p else { return 0.0 };
        r / l + b / j + k / (l * j).sqrt()
    },
    stretches: None,
    bridge: None,
};

/// The same between two half bridges, each of which has its edges.
static DC_MOTOR_SWITCHED: Model = Model {
    name: "dc_motor_switched",
    text: "DC motor between two half bridges, switch by switch",
    inputs: &[actuator("da", "", PHASES), actuator("db", "", PHASES), LOAD],
    parameters: &[
        RESISTANCE,
        INDUCTANCE,
        CONSTANT,
        INERTIA_OF_SHAFT,
        FRICTION,
        BRIDGE_VOLTAGE,
        DEAD_TIME,
        KNEE,
    ],
    derivative: |p, input, [current, speed, ..]| {
        let (&[r, l, k, j, b, udc, _, knee], &[a_level, a_loss, b_level, b_loss, load]) = (p, input) else {
            return [0.0; ORDER];
        };
        let [a, behind] = [(a_level, a_loss, current), (b_level, b_loss, -current)]
            .map(|(level, loss, current)| Leg { level, loss }.voltage(current, knee));
        let u = (a - behind) * udc;
        state([(u - r * current - k * speed) / l, (k * current - b * speed - load) / j, speed])
    },
    rate: |p, _| {
        let [r, l, k, j, b, udc, _, knee] = *p else { return 0.0 };
        r / l + b / j + k / (l * j).sqrt() + udc / (knee * l)
    },
    stretches: Some(|p, input, period| {
        let edges = inverter::switched::<2>(duties(input), p[6], period);
        edges.into_iter().map(|(duration, state)| (duration, legs(&state, input))).collect()
    }),
    bridge: Some(legs),
    ..DC_MOTOR
};

const PHASES: &str = "duty of the half bridge, 0 to 1";
const CURRENT: &str = "current into the phase";
static PMSM_INPUTS: [Input; 4] =
    [actuator("da", "", PHASES), actuator("db", "", PHASES), actuator("dc", "", PHASES), LOAD];
static PMSM_SENSORS: [Quantity; 9] = [
    quantity("ia", "A", CURRENT),
    quantity("ib", "A", CURRENT),
    quantity("ic", "A", CURRENT),
    quantity("theta", "rad", "electrical angle, from -π to π"),
    quantity("we", "rad/s", "electrical speed"),
    quantity("udc", "V", "voltage of the bridge"),
    SPEED,
    ANGLE,
    quantity("torque", "N·m", "torque of the motor"),
];
static PMSM_STATES: [Quantity; 4] = [
    quantity("id", "A", "current along the magnets"),
    quantity("iq", "A", "current across them"),
    SPEED,
    ANGLE,
];
static PMSM_PARAMETERS: [Parameter; 10] = [
    positive("R", 0.35, "Ω", "resistance of a phase"),
    positive("Ld", 0.9e-3, "H", "inductance along the magnets"),
    positive("Lq", 1.1e-3, "H", "inductance across them"),
    positive("psi", 0.012, "V·s", "flux of the magnets in a phase"),
    positive("p", 4.0, "", "pairs of poles"),
    positive("J", 2e-5, "kg·m²", "moment of inertia, with the load's"),
    natural("B", 1e-5, "N·m·s/rad", "viscous friction"),
    BRIDGE_VOLTAGE,
    DEAD_TIME,
    KNEE,
];

/// Permanent-magnet synchronous machine in the rotor's axes, amplitudes invariant, behind an inverter: the mean voltages of a period.
static PMSM: Model = Model {
    name: "pmsm",
    text: "synchronous motor with an inverter, averaged over each period",
    inputs: &PMSM_INPUTS,
    sensors: &PMSM_SENSORS,
    states: &PMSM_STATES,
    parameters: &PMSM_PARAMETERS,
    derivative: pmsm,
    sense: pmsm_sensors,
    rate: |p, period| pmsm_rate(p, p[DEAD] / period),
    stretches: Some(|p, input, period| {
        vec![(period, legs(&inverter::averaged(duties(input), p[DEAD] / period), input))]
    }),
    bridge: None,
};

/// The same behind the switches of the inverter, each of which has its edges.
static PMSM_SWITCHED: Model = Model {
    name: "pmsm_switched",
    text: "synchronous motor with an inverter, switch by switch",
    rate: |p, _| pmsm_rate(p, 0.5),
    stretches: Some(|p, input, period| {
        let edges = inverter::switched::<3>(duties(input), p[DEAD], period);
        edges.into_iter().map(|(duration, state)| (duration, legs(&state, input))).collect()
    }),
    bridge: Some(legs),
    ..PMSM
};

/// Places of parameters.
const UDC: usize = 7;
const DEAD: usize = 8;

fn duties<const N: usize>(input: &[f64]) -> [f64; N] {
    std::array::from_fn(|phase| input[phase])
}

/// Inputs of the equations of plants behind half bridges: level and loss of each leg, and the load.
fn legs(legs: &[Leg], input: &[f64]) -> Vec<f64> {
    let legs = legs.iter().flat_map(|leg| [leg.level, leg.loss]);
    legs.chain(input.last().copied()).collect()
}

/// Sine and cosine of the electrical angle.
fn electrical(p: &[f64], state: State) -> (f64, f64) {
    libm::sincos(p[4] * state[3])
}

/// Currents of the three phases.
fn phase_currents(p: &[f64], state: State) -> [f64; 3] {
    let (sine, cosine) = electrical(p, state);
    let [id, iq, ..] = state;
    let (alpha, beta) = (id * cosine - iq * sine, id * sine + iq * cosine);
    [alpha, HALF_ROOT * beta - 0.5 * alpha, -HALF_ROOT * beta - 0.5 * alpha]
}

/// √3/2.
const HALF_ROOT: f64 = 0.866_025_403_784_438_6;

fn pmsm_torque(p: &[f64], [id, iq, ..]: State) -> f64 {
    1.5 * p[4] * (p[3] * iq + (p[1] - p[2]) * id * iq)
}

/// Ld·did/dt = ud - R·id + we·Lq·iq, Lq·diq/dt = uq - R·iq - we·(Ld·id + psi), J·dw/dt = torque - B·w - load.
fn pmsm(p: &[f64], input: &[f64], at: State) -> State {
    let [r, ld, lq, psi, pairs, j, b, udc, _, knee] = *p else { return [0.0; ORDER] };
    let (sine, cosine) = electrical(p, at);
    let currents = phase_currents(p, at);
    let voltage = |phase: usize| {
        let leg = Leg { level: input[2 * phase], loss: input[2 * phase + 1] };
        leg.voltage(currents[phase], knee) * udc
    };
    let [a, b_phase, c] = [voltage(0), voltage(1), voltage(2)];
    // The star point floats: what the legs have in common drives no current.
    let alpha = (2.0 * a - b_phase - c) / 3.0;
    let beta = (b_phase - c) / (2.0 * HALF_ROOT);
    let (ud, uq) = (alpha * cosine + beta * sine, beta * cosine - alpha * sine);
    let [id, iq, speed, ..] = at;
    let we = pairs * speed;
    let load = input[6];
    state([
        (ud - r * id + we * lq * iq) / ld,
        (uq - r * iq - we * (ld * id + psi)) / lq,
        (pmsm_torque(p, at) - b * speed - load) / j,
        speed,
    ])
}

fn pmsm_sensors(p: &[f64], state: State) -> Vec<f64> {
    let [ia, ib, ic] = phase_currents(p, state);
    let turn = 2.0 * std::f64::consts::PI;
    let angle = p[4] * state[3];
    let wrapped = angle - turn * (angle / turn).round();
    vec![ia, ib, ic, wrapped, p[4] * state[2], p[UDC], state[2], state[3], pmsm_torque(p, state)]
}

/// Windings, electrical speed at which the magnets alone give the bridge's voltage, shaft, and the knee of the dead time.
fn pmsm_rate(p: &[f64], loss: f64) -> f64 {
    let [r, ld, lq, psi, pairs, j, b, udc, _, knee] = *p else { return 0.0 };
    let least = ld.min(lq);
    r / least + udc / psi + b / j + 1.5 * pairs * psi / (least * j).sqrt() + loss * udc / (knee * least)
}

/// J·dw/dt = torque - B·w - load.
static INERTIA: Model = Model {
    name: "inertia",
    text: "shaft with a load, driven by a torque",
    inputs: &[actuator("torque", "N·m", "torque of the motor"), LOAD],
    sensors: &[ANGLE, SPEED],
    states: &[SPEED, ANGLE],
    parameters: &[positive("J", 2e-5, "kg·m²", "moment of inertia, with the load's"), FRICTION],
    derivative: |p, input, [speed, ..]| {
        let (&[j, b], &[torque, load]) = (p, input) else { return [0.0; ORDER] };
        state([(torque - b * speed - load) / j, speed])
    },
    sense: |_, [speed, angle, ..]| vec![angle, speed],
    rate: |p, _| p[1] / p[0],
    stretches: None,
    bridge: None,
};

static MASS_STATES: [Quantity; 2] = [quantity("x", "m", "position"), quantity("v", "m/s", "velocity")];

/// m·dv/dt = force + push - k·x - d·v.
static MASS_SPRING: Model = Model {
    name: "mass_spring",
    text: "mass on a spring",
    inputs: &[
        actuator("force", "N", "force of the actuator"),
        disturbance("push", "N", "another force on the mass"),
    ],
    sensors: &MASS_STATES,
    states: &MASS_STATES,
    parameters: &[
        positive("m", 1.0, "kg", "mass"),
        natural("k", 100.0, "N/m", "stiffness of the spring"),
        natural("d", 0.5, "N·s/m", "damping"),
    ],
    derivative: |p, input, [x, v, ..]| {
        let (&[m, k, d], &[force, push]) = (p, input) else { return [0.0; ORDER] };
        state([v, (force + push - k * x - d * v) / m])
    },
    sense: |_, [x, v, ..]| vec![x, v],
    rate: |p, _| p[2] / p[0] + (p[1] / p[0]).sqrt(),
    stretches: None,
    bridge: None,
};

/// Number of masses of the chain.
const MASSES: usize = 6;
const POSITION: &str = "position, 0 at rest";
static CHAIN_STATES: [Quantity; 2 * MASSES] = [
    quantity("x1", "m", POSITION),
    quantity("x2", "m", POSITION),
    quantity("x3", "m", POSITION),
    quantity("x4", "m", POSITION),
    quantity("x5", "m", POSITION),
    quantity("x6", "m", POSITION),
    quantity("v1", "m/s", "velocity"),
    quantity("v2", "m/s", "velocity"),
    quantity("v3", "m/s", "velocity"),
    quantity("v4", "m/s", "velocity"),
    quantity("v5", "m/s", "velocity"),
    quantity("v6", "m/s", "velocity"),
];

/// Masses between walls, with springs of one stiffness: m·dv/dt = k·(left + right - 2·x) - d·v + force.
static CHAIN: Model = Model {
    name: "chain",
    text: "six masses in a chain of springs",
    inputs: &[
        actuator("f1", "N", "force on mass 1"),
        actuator("f3", "N", "force on mass 3"),
        actuator("f4", "N", "force on mass 4"),
        actuator("f6", "N", "force on mass 6"),
        disturbance("blow", "N", "force on mass 2"),
        disturbance("push", "N", "force on mass 5"),
    ],
    sensors: CHAIN_STATES.split_at(MASSES).0,
    states: &CHAIN_STATES,
    parameters: &[
        positive("m", 0.1, "kg", "each mass"),
        natural("k", 40.0, "N/m", "stiffness of each spring"),
        natural("d", 0.02, "N·s/m", "damping of each mass"),
    ],
    derivative: |p, input, at| {
        let (&[m, k, d], &[f1, f3, f4, f6, blow, push]) = (p, input) else { return [0.0; ORDER] };
        let force = [f1, blow, f3, f4, push, f6];
        let position = |mass: usize| if mass < MASSES { at[mass] } else { 0.0 };
        std::array::from_fn(|variable| match variable.checked_sub(MASSES) {
            None => at[variable + MASSES],
            Some(mass) => {
                let beside = position(mass.wrapping_sub(1)) + position(mass + 1);
                (k * (beside - 2.0 * at[mass]) - d * at[variable] + force[mass]) / m
            }
        })
    },
    sense: |_, at| at[..MASSES].to_vec(),
    rate: |p, _| p[2] / p[0] + 2.0 * (p[1] / p[0]).sqrt(),
    stretches: None,
    bridge: None,
};

/// Standard gravity, m/s².
const GRAVITY: f64 = 9.806_65;

static PENDULUM_STATES: [Quantity; 4] = [
    quantity("x", "m", "position of the cart"),
    quantity("v", "m/s", "velocity of the cart"),
    quantity("angle", "rad", "angle of the pendulum; 0 is upright"),
    quantity("rate", "rad/s", "angular velocity of the pendulum"),
];

/// A point mass at the end of a rod on a cart; the angle is 0 upright. With l the rod's length, a the cart's acceleration:
/// l·d²angle/dt² = g·sin - a·cos - c·rate/(m·l), (M + m·sin²)·a = force + push - b·v + m·sin·(l·rate² - g·cos) + c·rate·cos/l.
static CART_PENDULUM: Model = Model {
    name: "cart_pendulum",
    text: "pendulum on a cart",
    inputs: &[
        actuator("force", "N", "force on the cart"),
        disturbance("push", "N", "another force on the cart"),
    ],
    sensors: &PENDULUM_STATES,
    states: &PENDULUM_STATES,
    parameters: &[
        positive("M", 0.5, "kg", "mass of the cart"),
        positive("m", 0.2, "kg", "mass of the pendulum"),
        positive("l", 0.3, "m", "length of the rod"),
        natural("b", 0.1, "N·s/m", "friction of the cart"),
        natural("c", 1e-3, "N·m·s/rad", "friction of the joint"),
    ],
    derivative: |p, input, [_, v, angle, rate, ..]| {
        let (&[cart, mass, length, b, c], &[force, push]) = (p, input) else { return [0.0; ORDER] };
        let (sine, cosine) = libm::sincos(angle);
        let joint = c * rate / length;
        let inner = mass * sine * (length * rate * rate - GRAVITY * cosine);
        let acceleration = (force + push - b * v + inner + joint * cosine) / (cart + mass * sine * sine);
        let turning = (GRAVITY * sine - acceleration * cosine - joint / mass) / length;
        state([v, acceleration, rate, turning])
    },
    sense: |_, [x, v, angle, rate, ..]| vec![x, v, angle, rate],
    rate: |p, _| {
        let [cart, mass, length, b, c] = *p else { return 0.0 };
        b / cart + c / (mass * length * length) + (GRAVITY / length * (cart + mass) / cart).sqrt()
    },
    stretches: None,
    bridge: None,
};

/// A·dh/dt = q + inflow - a·√(2·g·h), within the tank.
static TANK: Model = Model {
    name: "tank",
    text: "tank with an outlet",
    inputs: &[
        actuator("q", "m³/s", "flow of the pump, which gives no negative one"),
        disturbance("inflow", "m³/s", "another flow into the tank; negative is a leak"),
    ],
    sensors: &[quantity("h", "m", "level")],
    states: &[quantity("h", "m", "level")],
    parameters: &[
        positive("A", 0.05, "m²", "area of the tank"),
        positive("a", 1e-4, "m²", "area of the outlet's jet"),
        positive("height", 1.0, "m", "level at which the tank flows over"),
    ],
    derivative: |p, input, [h, ..]| {
        let (&[area, outlet, height], &[q, inflow]) = (p, input) else { return [0.0; ORDER] };
        let flow = q.max(0.0) + inflow - outlet * (2.0 * GRAVITY * h.max(0.0)).sqrt();
        // An empty tank gives nothing, a full one keeps nothing.
        let held = if h <= 0.0 {
            flow.max(0.0)
        } else if h >= height {
            flow.min(0.0)
        } else {
            flow
        };
        state([held / area])
    },
    sense: |p, [h, ..]| vec![h.clamp(0.0, p[2])],
    // The outlet's time constant at a hundredth of the height.
    rate: |p, _| p[1] / p[0] * (GRAVITY / (0.02 * p[2])).sqrt(),
    stretches: None,
    bridge: None,
};
