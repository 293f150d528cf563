// SPDX-License-Identifier: MIT OR Apache-2.0
//! Plants against solutions in closed form; their files and mistakes in them.

use takt_isa::program::Port;
use takt_isa::{Register, Type};
use takt_programs::PLANTS;
use takt_programs::plants::models::MODELS;
use takt_programs::plants::{ClosedLoop, Copies, Interface, Leg, LoopError, Plant, PlantFile, Quantity};

const PERIOD: f64 = 1e-3;

fn plant(text: &str, period: f64) -> Copies {
    let file =
        PlantFile::read("p.toml", text).unwrap_or_else(|mistakes| panic!("{}", mistakes.render(false)));
    file.simulation(period).unwrap().0
}

/// Sensors after a time under constant inputs.
fn after(text: &str, period: f64, seconds: f64, inputs: &[f64]) -> Vec<f64> {
    let mut plant = plant(text, period);
    for _ in 0..(seconds / period).round() as u32 {
        plant.advance(inputs).unwrap();
    }
    plant.sensors()
}

#[track_caller]
fn near(found: f64, expected: f64, relative: f64) {
    assert!((found - expected).abs() <= relative * expected.abs().max(1e-6), "{found}, expected {expected}");
}

#[test]
fn a_motor_reaches_the_speed_of_its_load() {
    let (r, k, b, load) = (1.0, 0.08, 1e-4, 0.4);
    for voltage in [-12.0, 0.0, 24.0] {
        let expected = (k * voltage - r * load) / (k * k + r * b);
        near(after("model = \"dc_motor\"", PERIOD, 4.0, &[voltage, load])[0], expected, 1e-9);
    }
}

#[test]
fn a_motor_follows_its_step_response() {
    // Without friction and load: the response of a linear system with the poles p and q.
    let (r, l, k, j, voltage) = (1.0, 1e-3, 0.08, 7e-4, 10.0);
    let (sum, product): (f64, f64) = (r / l, k * k / (l * j));
    let root = (sum * sum / 4.0 - product).sqrt();
    let (p, q) = (-sum / 2.0 + root, -sum / 2.0 - root);
    for seconds in [0.001, 0.005, 0.1, 0.5] {
        let exponentials = (q * (p * seconds).exp() - p * (q * seconds).exp()) / (p - q);
        let expected = voltage / k * (1.0 + exponentials);
        let text = "model = \"dc_motor\"\n[parameters]\nB = 0";
        near(after(text, PERIOD, seconds, &[voltage, 0.0])[0], expected, 1e-6);
    }
}

#[test]
fn a_mass_swings_as_its_spring_says() {
    let text = "model = \"mass_spring\"\n[parameters]\nm = 2\nk = 50\nd = 1\n[initial]\nx = 0.1";
    let (decay, rate) = (0.25, (25.0_f64 - 0.0625).sqrt());
    for seconds in [0.1, 1.0, 3.0] {
        let (sine, cosine) = (rate * seconds).sin_cos();
        let expected = 0.1 * (-decay * seconds).exp() * (cosine + decay / rate * sine);
        near(after(text, PERIOD, seconds, &[0.0, 0.0])[0], expected, 1e-7);
    }
    // At rest under a force, and under a push of the same size.
    near(after(text, 0.01, 60.0, &[5.0, 0.0])[0], 0.1, 1e-6);
    near(after(text, 0.01, 60.0, &[0.0, 5.0])[0], 0.1, 1e-6);
}

/// A chain between walls swings in each of its modes as that of a string with as many masses; at rest, forces bend it in straight lines.
#[test]
fn a_chain_swings_in_its_modes() {
    let (m, k) = (0.1, 40.0);
    for mode in 1..=6 {
        let angle = f64::from(mode) * std::f64::consts::PI / 7.0;
        let shape: Vec<f64> = (1..=6).map(|mass| 0.01 * (f64::from(mass) * angle).sin()).collect();
        let initial: String = (1..=6).map(|mass| format!("x{mass} = {}\n", shape[mass - 1])).collect();
        let text = format!("model = \"chain\"\n[parameters]\nm = {m}\nk = {k}\nd = 0\n[initial]\n{initial}");
        let rate = (k / m * (2.0 - 2.0 * angle.cos())).sqrt();
        for seconds in [0.1, 1.0] {
            let found = after(&text, PERIOD, seconds, &[0.0; 6]);
            for (found, shape) in found.iter().zip(&shape) {
                let expected = shape * (rate * seconds).cos();
                assert!((found - expected).abs() < 1e-6 * 0.01, "mode {mode}: {found}, not {expected}");
            }
        }
    }
    // Inputs in the order of the model: forces on the masses 1, 3, 4, 6, then 2 and 5.
    for (input, mass) in [1.0, 3.0, 4.0, 6.0, 2.0, 5.0].into_iter().enumerate() {
        let mut inputs = [0.0; 6];
        inputs[input] = 1.0;
        let text = format!("model = \"chain\"\n[parameters]\nm = {m}\nk = {k}\nd = 1");
        let found = after(&text, 0.01, 60.0, &inputs);
        for (at, found) in (1..=6).map(f64::from).zip(found) {
            let line = if at <= mass { at * (7.0 - mass) } else { mass * (7.0 - at) };
            near(found, line / (7.0 * k), 1e-9);
        }
    }
}

#[test]
fn a_shaft_is_driven_by_its_torque() {
    let text = "model = \"inertia\"\n[parameters]\nJ = 2e-5\nB = 1e-4";
    let found = after(text, PERIOD, 0.3, &[3e-3, 1e-3]);
    let (w, tau) = (2e-3 / 1e-4, 0.2_f64);
    let decayed = (-0.3 / tau).exp();
    near(found[1], w * (1.0 - decayed), 1e-8);
    near(found[0], w * (0.3 - tau * (1.0 - decayed)), 1e-8);
}

#[test]
fn a_tank_empties_as_torricelli_says() {
    let text = "model = \"tank\"\n[parameters]\nA = 0.05\na = 1e-4\nheight = 2\n[initial]\nh = 1";
    let fall = 1e-4 / 0.05 * (9.80665_f64 / 2.0).sqrt();
    for seconds in [10.0, 100.0] {
        let root = 1.0 - fall * seconds;
        near(after(text, 0.1, seconds, &[0.0, 0.0])[0], root * root, 1e-7);
    }
    let flow = 1e-4 * (2.0 * 9.80665_f64 * 0.5).sqrt();
    near(after(text, 0.1, 4000.0, &[flow, 0.0])[0], 0.5, 1e-6);
    near(after(text, 0.1, 4000.0, &[2.0 * flow, -flow])[0], 0.5, 1e-6);
    // A pump that is told to suck does nothing; a full tank flows over, and an empty one stays empty.
    let ends = |inputs: &[f64]| after(text, 0.1, 4000.0, inputs)[0];
    assert_eq!((ends(&[-1.0, 0.0]) < 1e-3, ends(&[1.0, 0.0]), ends(&[0.0, -1.0])), (true, 2.0, 0.0));
}

#[test]
fn a_pendulum_keeps_its_energy_and_momentum() {
    let text = "model = \"cart_pendulum\"\n[parameters]\nM = 0.5\nm = 0.2\nl = 0.3\nb = 0\nc = 0\n[initial]\nangle = 2.5\nv = 0.4\nrate = -1";
    let mut plant = plant(text, PERIOD);
    let energy = |s: &[f64]| {
        let [_, v, angle, rate] = *s else { unreachable!() };
        let (horizontal, vertical) = (v + 0.3 * rate * angle.cos(), -0.3 * rate * angle.sin());
        let kinetic = 0.25 * v * v + 0.1 * (horizontal * horizontal + vertical * vertical);
        (kinetic + 0.2 * 9.80665 * 0.3 * angle.cos(), 0.5 * v + 0.2 * horizontal)
    };
    let (whole, momentum) = energy(&plant.sensors());
    let mut turned: f64 = 0.0;
    for _ in 0..5000 {
        plant.advance(&[0.0, 0.0]).unwrap();
        turned = turned.max((plant.sensors()[2] - 2.5).abs());
    }
    let (energy, later) = energy(&plant.sensors());
    near(energy, whole, 1e-6);
    near(later, momentum, 1e-6);
    assert!(turned > 1.0, "it swings");
}

/// A rotor so heavy that its speed stays: 200 rad/s electrical.
const TURNING: &str = "[parameters]\nR = 0.35\nLd = 0.9e-3\nLq = 1.1e-3\npsi = 0.012\np = 4\nJ = 1e6\nB = 0\n[initial]\nw = 50\n";

#[test]
fn a_short_circuited_motor_has_the_currents_of_its_impedance() {
    let (r, ld, lq, psi, we) = (0.35, 0.9e-3, 1.1e-3, 0.012, 200.0);
    let whole = r * r + we * we * ld * lq;
    let (id, iq) = (-we * we * lq * psi / whole, -we * r * psi / whole);
    for (model, period) in [("pmsm", 50e-6), ("pmsm_switched", 50e-6), ("pmsm", 1e-3)] {
        let text = format!("model = \"{model}\"\n{TURNING}");
        let mut plant = plant(&text, period);
        for _ in 0..(0.1 / period) as u32 {
            plant.advance(&[0.0, 0.0, 0.0, 0.0]).unwrap();
        }
        let states = plant.states();
        near(states[0], id, 1e-6);
        near(states[1], iq, 1e-6);
        near(plant.sensors()[8], 1.5 * 4.0 * (psi * iq + (ld - lq) * id * iq), 1e-5);
        let [ia, ib, ic, ..] = plant.sensors()[..] else { unreachable!() };
        assert!((ia + ib + ic).abs() < 1e-12);
    }
}

#[test]
fn switches_and_their_mean_agree_at_the_valley() {
    let of = |model: &str, dead: &str| {
        let text =
            format!("model = \"{model}\"\n{}", TURNING.replace("p = 4", &format!("p = 4\ndead = {dead}")));
        let mut plant = plant(&text, 50e-6);
        let mut duties = [0.6, 0.5, 0.42];
        for _ in 0..400 {
            plant.advance(&[duties[0], duties[1], duties[2], 0.0]).unwrap();
            duties.rotate_left(1);
        }
        (plant.states()[0], plant.states()[1])
    };
    let ((id, iq), (d, q)) = (of("pmsm", "0"), of("pmsm_switched", "0"));
    assert!((id - d).abs() < 0.05 && (iq - q).abs() < 0.05, "{id} {iq}, switched {d} {q}");
    let (lossy, _) = of("pmsm", "2e-6");
    assert!((lossy - id).abs() > 0.1, "dead time takes voltage: {lossy} {id}");
}

#[test]
fn dead_time_takes_voltage_from_each_phase() {
    // At standstill with a current out of phase a and back through the others: each leg loses 4 % of 24 V.
    let voltage = 2.0 / 3.0 * (0.1 - 2.0 * 0.04) * 24.0;
    for model in ["pmsm", "pmsm_switched"] {
        let text = TURNING.replace("w = 50", "w = 0").replace("p = 4", "p = 4\ndead = 2e-6");
        let mut plant = plant(&format!("model = \"{model}\"\n{text}"), 50e-6);
        for _ in 0..4000 {
            plant.advance(&[0.6, 0.5, 0.5, 0.0]).unwrap();
        }
        near(plant.states()[0], voltage / 0.35, if model == "pmsm" { 1e-6 } else { 0.01 });
    }
}

#[test]
fn a_plant_follows_its_switches() {
    let text = format!("model = \"pmsm_switched\"\n{}", TURNING.replace("p = 4", "p = 4\ndead = 1e-6"));
    let (mut whole, mut parts) = (plant(&text, 50e-6), plant(&text, 50e-6));
    let duties = [0.5, 0.3, 0.6];
    for _ in 0..100 {
        whole.advance(&[duties[0], duties[1], duties[2], 0.1]).unwrap();
        // Steps of a tenth of a microsecond, in which no switch changes.
        for step in 0..500 {
            let time = (f64::from(step) + 0.5) * 1e-7;
            let legs = duties.map(|duty| {
                let (rise, fall) = (25e-6 * (1.0 - duty), 25e-6 * (1.0 + duty));
                match time {
                    _ if (rise..rise + 1e-6).contains(&time) || (fall..fall + 1e-6).contains(&time) => {
                        Leg::OFF
                    }
                    _ if (rise..fall).contains(&time) => Leg::HIGH,
                    _ => Leg::LOW,
                }
            });
            parts.advance_switched(1e-7, &legs, &[9.0, 9.0, 9.0, 0.1]);
        }
    }
    for (a, b) in whole.states().into_iter().zip(parts.states()) {
        near(b, a, 1e-6);
    }
}

#[test]
fn a_switched_dc_motor_has_the_speed_of_its_mean_voltage() {
    let (r, k, b, load) = (1.0, 0.08, 1e-4, 0.4);
    for (da, db) in [(0.9, 0.2), (1.0, 0.0), (0.1, 0.6)] {
        let expected = (k * 24.0 * (da - db) - r * load) / (k * k + r * b);
        let text = "model = \"dc_motor_switched\"\n[parameters]\ndead = 0";
        near(after(text, PERIOD / 10.0, 4.0, &[da, db, load])[0], expected, 1e-3);
    }
    // In the dead time a current out of a leg flows through the lower diode, one into it through the upper one.
    let text = "model = \"dc_motor_switched\"\n[parameters]\ndead = 5e-6\nJ = 1e6\n";
    near(after(text, PERIOD / 10.0, 0.05, &[0.8, 0.2, 0.0])[1], 24.0 * (0.6 - 0.1), 1e-2);
    // Without switches a current flows back into the bridge, and ends.
    let mut motor = plant("model = \"dc_motor_switched\"\n[initial]\ni = 5", PERIOD);
    motor.advance_switched(1e-4, &[Leg::OFF; 2], &[0.0; 3]);
    let current = motor.states()[0];
    near(current, (5.0 + 24.0) * (-0.1_f64).exp() - 24.0, 1e-3);
    motor.advance_switched(1e-2, &[Leg::OFF; 2], &[0.0; 3]);
    assert!(motor.states()[0].abs() < 0.01, "{:?}", motor.states());
}

#[test]
fn sensors_saturate_at_their_limits() {
    let text = "model = \"dc_motor\"\n[ports]\nw = { port = \"n\", scale = 10, offset = 5, limits = [-3, 4] }\n[inputs]\nw_ref = 0\nw = 0";
    let closed = connect(text, &[]).unwrap();
    let mut row = vec![];
    closed.set_inputs(&mut row);
    assert_eq!(row.iter().find(|(register, _)| register.index() == 770).map(|(_, bits)| *bits), Some(4));
    let wrong = text.replace("w = { port = \"n\"", "u = { port = \"count\"");
    assert!(connect(&wrong, &[]).is_err_and(|error| error.contains("`limits` is for sensors")));
}

fn port(name: &str, register: usize, ty: Type) -> Port {
    Port { name: name.to_owned(), register: Register::new(register).unwrap(), ty }
}

fn mistakes(text: &str) -> String {
    PlantFile::read("p.toml", text).err().map_or(String::new(), |mistakes| mistakes.render(false))
}

#[test]
fn units_are_read_and_checked() {
    let value = |text: &str| {
        let file = PlantFile::read("p.toml", &format!("model = \"pmsm\"\n[parameters]\n{text}"));
        let file = file.map_err(|mistakes| mistakes.render(false))?;
        let name = text.split(' ').next().unwrap_or_default();
        file.settings().into_iter().find(|one| one.name == name).map(|one| one.value).ok_or_else(String::new)
    };
    for (text, expected) in [
        ("Ld = 0.9e-3", 0.9e-3),
        ("Ld = \"0.9 mH\"", 0.9e-3),
        ("Ld = \"900µH\"", 900e-6),
        ("Ld = \"9e2 uH\"", 9e-4),
        ("Ld = \"0.0009 H\"", 0.9e-3),
        ("R = \"350 mohm\"", 0.35),
        ("psi = \"12 mV*s\"", 12e-3),
        ("J = \"2e-5 kg·m^2\"", 2e-5),
        ("dead = \"500 ns\"", 500e-9),
        ("p = 3", 3.0),
    ] {
        assert_eq!(value(text), Ok(expected), "{text}");
    }
    for text in [
        "Ld = \"0.9 mF\"",
        "Ld = \"0.9\"",
        "Ld = \"mH\"",
        "J = \"2e-5 g·m²\"",
        "p = \"4 H\"",
        "R = nan",
        "R = true",
        "R = [1]",
    ] {
        assert!(
            value(text)
                .is_err_and(|error| error.contains("p.toml:3:") && error.contains("expected a number")),
            "{text}"
        );
    }
}

#[test]
fn mistakes_in_a_file_are_named_with_their_places() {
    for (text, place, expected) in [
        ("", "", "expected `model = \"…\"` or `fmu"),
        ("model = \"dc_moter\"", "1:9", "did you mean `dc_motor`?"),
        ("model = 1", "1:9", "`model` must be a text in quotes, found integer"),
        ("model = \"tank\"\nfmu = \"a.fmu\"", "2:7", "not both"),
        ("model = \"tank\"\nparameter = 1", "2:1", "did you mean `parameters`?"),
        ("model = \"tank\"\nparameters = 1", "2:14", "must be a table"),
        ("model = \"tank\"\nlimit = 1", "2:9", "an FMU's step"),
        ("fmu = \"a.fmu\"\nlimit = 0", "2:9", "a time up to a day"),
        ("fmu = \"a.fmu\"\n[initial]\nx = 1", "2:", "states of a model"),
        ("model = \"tank\"\nsteps = 0", "2:9", "a whole number from 1 to 100000"),
        ("model = \"tank\"\n[parameters]\nb = 1", "3:1", "known: `A`, `a`, `height`"),
        ("model = \"tank\"\n[parameters]\nA = 0", "3:5", "`A` is 0: expected a positive number"),
        ("model = \"pmsm\"\n[parameters]\ndead = -1", "3:8", "expected a number, 0 or more"),
        ("model = \"tank\"\n[initial]\nx = 1", "3:1", "no state `x`"),
        ("model = \"tank\"\n[inputs]\nx = [[1, 2], [1, 3]]", "3:15", "increase; 1 s does not"),
        ("model = \"tank\"\n[inputs]\nx = [[-1, 2]]", "3:7", "begin with 0 or more"),
        ("model = \"tank\"\n[inputs]\nx = [1, 2]", "3:6", "a list of [time in s, value]"),
        ("model = \"tank\"\n[inputs]\nx = []", "3:5", "found an empty one"),
        ("model = \"tank\"\n[ports]\nh = 1", "3:5", "a port's name in quotes"),
        ("model = \"tank\"\n[ports]\nh = { scale = 1 }", "3:5", "a port's name in quotes"),
        ("model = \"tank\"\n[ports]\nh = { port = \"w\", scal = 1 }", "3:19", "did you mean `scale`?"),
        (
            "model = \"tank\"\n[ports]\nh = { port = \"w\", limits = [2, 1] }",
            "3:28",
            "as in `limits = [0, 4095]`",
        ),
        ("model = \"tank\"\n[pins]\nstop = 2", "3:8", "expected the level of a pin, 0 or 1"),
        ("model = \"tank\"\n[pins]\nstop = [1, 0]", "3:9", "as in [[0.1, 0], [0.2, \"sensor\"]]"),
        ("model = \"tank\"\n[pins]\nstop = [[1, 0], [0, 1]]", "3:18", "increase; 0 s does not"),
        ("model = \"tank\"\n[pins]\nstop = { above = 1 }", "3:8", "the sensors that a comparator watches"),
        ("model = \"tank\"\n[pins]\nstop = { signal = \"h\" }", "3:10", "did you mean `signals`?"),
        ("model = \"tank\"\n[ports", "2:", ""),
        ("model = \"tank\"\nmodel = \"tank\"", "2:1", "duplicate key"),
    ] {
        let told = mistakes(text);
        let place = if place.is_empty() { String::new() } else { format!("p.toml:{place}") };
        assert!(!told.is_empty() && told.contains(&place) && told.contains(expected), "{text}\n{told}");
    }
    let huge = format!("model = \"tank\" # {}", "x".repeat(1 << 20));
    assert!(mistakes(&huge).contains("longer than 1 MiB"));
}

#[test]
fn a_plant_that_is_too_fast_is_refused() {
    let file = |text: &str| PlantFile::read("p.toml", text).unwrap();
    let fast = file("model = \"dc_motor\"\n[parameters]\nL = 1e-12");
    assert!(
        fast.simulation(PERIOD)
            .is_err_and(|error| error.to_string().contains("moves too fast for a period of 0.001 s"))
    );
    let motor = file("model = \"dc_motor\"");
    for period in [0.0, -1.0, f64::NAN, 1e6] {
        assert!(motor.simulation(period).is_err(), "{period}");
    }
}

#[test]
fn settings_replace_numbers_of_a_file() {
    let text = "model = \"dc_motor\"\n[disturbance]\nload = [[0.1, 0.4], [0.2, 0]]";
    let mut file = PlantFile::read("p.toml", text).unwrap();
    let find = |file: &PlantFile, name: &str| {
        file.settings().into_iter().find(|one| one.name == name).map(|one| one.value)
    };
    assert_eq!(
        (find(&file, "load"), find(&file, "load.at"), find(&file, "R")),
        (Some(0.4), Some(0.1), Some(1.0))
    );
    file.set("load", 3.0).unwrap();
    file.set("load.at", 0.15).unwrap();
    file.set("R", 2.0).unwrap();
    assert_eq!(
        (find(&file, "load"), find(&file, "load.at"), find(&file, "R")),
        (Some(3.0), Some(0.15), Some(2.0))
    );
    // A push remains as long as it was.
    let moved = "model = \"dc_motor\"\n[parameters]\nR = 2\n[disturbance]\nload = [[0.15, 3], [0.25, 0]]";
    let moved = PlantFile::read("p.toml", moved).unwrap();
    let run = |file: &PlantFile| {
        let (plant, interface) = file.simulation(PERIOD).unwrap();
        let connection =
            file.connect(&interface, &[port("w", 768, Type::F)], &[port("u", 0, Type::F)], &[]).unwrap();
        let mut closed = ClosedLoop::new(plant, interface, connection, PERIOD);
        for _ in 0..400 {
            closed.advance(|_| Some(10.0_f32.to_bits())).unwrap();
        }
        closed.plant().sensors()
    };
    assert_eq!(run(&file), run(&moved));
    for (name, value, expected) in [
        ("J", 0.0, "parameter `J` of `dc_motor` is 0; expected a positive number"),
        ("load", f64::NAN, "expected a number"),
        ("load.at", -0.05, "a time from 0 s on"),
        ("mass", 1.0, "no parameter `mass`"),
        ("u", 1.0, "no parameter `u`"),
    ] {
        assert!(file.set(name, value).is_err_and(|error| error.contains(expected)), "{name}");
    }
}

/// Connects a file's plant with ports.
fn connect(text: &str, options: &[(&str, &str)]) -> Result<ClosedLoop<Copies>, String> {
    let file = PlantFile::read("p.toml", text).map_err(|mistakes| mistakes.render(false))?;
    let (plant, interface) = file.simulation(PERIOD).map_err(|error| error.to_string())?;
    let inputs = [port("w_ref", 768, Type::F), port("w", 769, Type::F), port("n", 770, Type::I)];
    let outputs = [port("u", 0, Type::F), port("count", 1, Type::I)];
    let options: Vec<_> = options.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect();
    let connection = file.connect(&interface, &inputs, &outputs, &options);
    let connection = connection.map_err(|mistakes| mistakes.render(false))?;
    connection.complete(|_| false)?;
    Ok(ClosedLoop::new(plant, interface, connection, PERIOD))
}

const MOTOR: &str = "model = \"dc_motor\"\n[inputs]\nw_ref = [[0, 7], [0.002, 8]]\nn = 5\n";

#[test]
fn ports_are_matched_by_names_maps_and_options() {
    let mut closed = connect(MOTOR, &[]).unwrap();
    let value = |row: &[(Register, u32)], register| {
        row.iter().find(|(r, _)| r.index() == register).map(|(_, bits)| *bits)
    };
    let mut row = vec![(Register::new(769).unwrap(), 1)];
    closed.set_inputs(&mut row);
    assert_eq!(
        (value(&row, 768), value(&row, 769), value(&row, 770)),
        (Some(7.0_f32.to_bits()), Some(0), Some(5))
    );
    // Steps act from the period on that begins at their time; a table's column comes before the file's course.
    for period in 1..=3 {
        closed.advance(|register| (register.index() == 0).then(|| 24.0_f32.to_bits())).unwrap();
        let mut row = vec![(Register::new(770).unwrap(), 9)];
        closed.set_inputs(&mut row);
        let expected = if period >= 2 { 8.0_f32 } else { 7.0 };
        assert_eq!((value(&row, 768), value(&row, 770)), (Some(expected.to_bits()), Some(9)), "{period}");
    }
    let speed = closed.plant().sensors()[0];
    assert!(speed > 1.0);
    // An integer port has the next lower integer, within its range; an integer output is a number.
    let text = "model = \"dc_motor\"\n[ports]\nu = { port = \"count\", scale = 0.5, offset = 1 }\nw = { port = \"n\", scale = 10, offset = 0.9 }\n[inputs]\nw_ref = 0\nw = 0";
    let mut closed = connect(text, &[]).unwrap();
    let mut row = vec![];
    closed.set_inputs(&mut row);
    assert_eq!(value(&row, 770), Some(0));
    for _ in 0..1000 {
        closed.advance(|register| (register.index() == 1).then_some((-26_i32).cast_unsigned())).unwrap();
    }
    row.clear();
    closed.set_inputs(&mut row);
    let expected = (closed.plant().sensors()[0] * 10.0 + 0.9).floor() as i32;
    assert!(expected < -1000 && value(&row, 770) == Some(expected.cast_unsigned()), "{expected}");
    // An option replaces the file's port, and keeps its scale.
    assert!(connect(&text.replace("\nw = 0", ""), &[("w", "w"), ("angle", "n")]).is_ok());
}

/// Copies of a plant belong to the elements of arrays of ports; an entry for one copy comes before the one for all.
#[test]
fn copies_belong_to_arrays_of_ports() {
    let text = "model = \"dc_motor\"\ncopies = 2\n[ports]\nu = { port = \"u\", scale = 2 }\n[disturbance]\nload = 0.1\n\"load[2]\" = 0\n[inputs]\n\
                ref = 7\n\"ref[2]\" = 8";
    let file = PlantFile::read("p.toml", text).unwrap();
    let (plant, interface) = file.simulation(PERIOD).unwrap();
    assert_eq!(interface.inputs[2..], [("u[2]".to_owned(), false), ("load[2]".to_owned(), true)]);
    assert_eq!(interface.sensors_named("w"), [0, 3]);
    assert_eq!((file.is_leg(0), interface.states[3].as_str()), (false, "i[2]"));
    let array = |name: &str, first: usize| {
        [1_usize, 2].map(|i| port(&format!("{name}[{i}]"), first + i - 1, Type::F))
    };
    let inputs = [array("w", 768), array("ref", 770)].concat();
    let connection = file.connect(&interface, &inputs, &array("u", 0), &[]).unwrap();
    let mut closed = ClosedLoop::new(plant, interface.clone(), connection, PERIOD);
    for _ in 0..4000 {
        closed.advance(|register| Some((6.0 + register.index() as f32).to_bits())).unwrap();
    }
    let mut row = Vec::new();
    closed.set_inputs(&mut row);
    let (r, k, b) = (1.0, 0.08, 1e-4);
    for (at, (voltage, load)) in [(12.0, 0.1), (14.0, 0.0)].into_iter().enumerate() {
        near(closed.plant().sensors()[3 * at], (k * voltage - r * load) / (k * k + r * b), 1e-9);
    }
    let values: Vec<(usize, f32)> = row.iter().map(|(r, bits)| (r.index(), f32::from_bits(*bits))).collect();
    assert_eq!(values[2..], [(770, 7.0), (771, 8.0)]);
    for (text, expected) in [
        (text.replace("copies = 2", "copies = 17"), "`copies` must be a whole number from 1 to 16"),
        (text.replace("model = \"dc_motor\"", "fmu = \"a.fmu\""), "an FMU is one plant"),
        (text.replace("load[2]", "load[3]"), "no input `load[3]`"),
        (text.replace("copies = 2\n", ""), "no input `load[2]`"),
        (text.replace("port = \"u\"", "port = \"v\""), "no output port `v[1]` for the plant's `u[1]`"),
    ] {
        let message = PlantFile::read("p.toml", &text)
            .and_then(|file| {
                file.connect(&file.interface().unwrap(), &inputs, &array("u", 0), &[]).map(|_| ())
            })
            .unwrap_err();
        assert!(message.render(false).contains(expected), "{}", message.render(false));
    }
}

#[test]
fn ports_that_do_not_fit_are_named() {
    for (text, options, expected) in [
        ("model = \"dc_motor\"\n[inputs]\nn = 0", &[][..], "the input port `w_ref` has no source"),
        ("model = \"dc_motor\"", &[], "the input ports `w_ref`, `n` have no source"),
        ("model = \"dc_motor\"\n[ports]\nw = \"speed\"", &[], "p.toml:3:1"),
        ("model = \"dc_motor\"\n[ports]\nw = \"w_rf\"", &[], "did you mean `w_ref`?"),
        ("model = \"dc_motor\"\n[ports]\nu = \"w\"", &[], "no output port `w` for the plant's `u`"),
        ("model = \"dc_motor\"\n[ports]\nspeed = \"w\"", &[], "no signal `speed`"),
        ("model = \"dc_motor\"\n[ports]\nangle = \"w\"", &[], "gets `w` and `angle`"),
        ("model = \"dc_motor\"\n[inputs]\nw = 1", &[], "p.toml:3:1"),
        ("model = \"dc_motor\"\n[inputs]\nspeed = 1", &[], "no input port `speed`"),
        ("model = \"dc_motor\"\n[disturbance]\ntorque = 1", &[], "no input `torque`"),
        ("model = \"dc_motor\"\n[ports]\nload = \"u\"\n[disturbance]\nload = 1", &[], "one must go"),
        ("model = \"mass_spring\"", &[], "takes `force`, and the program has no output port of that name"),
        ("model = \"mass_spring\"\n[ports]\nforce = \"u\"", &[], "gives none of the program's input ports"),
        ("model = \"dc_motor\"", &[("w", "speed")], "no input port `speed`"),
        ("model = \"dc_motor\"", &[("speed", "w")], "no signal `speed`"),
    ] {
        let error = connect(text, options).err().unwrap_or_default();
        assert!(error.contains(expected), "{text}\n{error}");
    }
}

/// A plant whose value grows by its input.
struct Grows(f64);

impl Plant for Grows {
    fn advance(&mut self, inputs: &[f64]) -> Result<(), String> {
        self.0 += inputs[0];
        if self.0 == 2.0 { Err("two".to_owned()) } else { Ok(()) }
    }

    fn sensors(&self) -> Vec<f64> {
        vec![self.0]
    }

    fn states(&self) -> Vec<f64> {
        Vec::new()
    }
}

#[test]
fn a_loop_that_diverges_or_fails_ends() {
    let interface = || Interface {
        name: "grows".to_owned(),
        inputs: vec![("u".to_owned(), false)],
        sensors: vec!["w".to_owned()],
        states: Vec::new(),
    };
    let file = PlantFile::of_fmu("none.fmu");
    let (inputs, outputs) = ([port("w", 768, Type::F)], [port("u", 0, Type::F)]);
    let closed = || {
        let connection = file.connect(&interface(), &inputs, &outputs, &[]).unwrap();
        ClosedLoop::new(Grows(0.0), interface(), connection, PERIOD)
    };
    let mut nan = closed();
    nan.advance(|_| Some(1.0_f32.to_bits())).unwrap();
    let error = nan.advance(|_| Some(f32::NAN.to_bits())).unwrap_err();
    assert_eq!(error.to_string(), "period 1: the plant `grows` diverged: w is NaN; its input u was NaN");
    let mut fails = closed();
    fails.advance(|_| Some(1.0_f32.to_bits())).unwrap();
    let error = fails.advance(|_| Some(1.0_f32.to_bits())).unwrap_err();
    assert!(matches!(error, LoopError::Failed { period: 1, .. }), "{error}");
}

#[test]
fn shipped_files_are_right() {
    for (name, text) in PLANTS {
        assert!(
            PlantFile::read(name, text).is_ok(),
            "{name}: {}",
            PlantFile::read(name, text).err().map_or(String::new(), |m| m.render(false))
        );
    }
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/plant");
    let entries =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut files: Vec<String> = entries.filter(|name| name.ends_with(".toml")).collect();
    files.sort();
    assert_eq!(files, PLANTS.iter().map(|(name, _)| *name).collect::<Vec<_>>());
}

#[test]
fn models_are_in_the_document() {
    let named = |name: &str, unit: &str| {
        if unit.is_empty() { format!("`{name}`") } else { format!("`{name}` {unit}") }
    };
    let list = |all: Vec<String>| if all.is_empty() { "–".to_owned() } else { all.join(", ") };
    let mut table =
        "| model | takes | disturbances | gives | states | parameters |\n|---|---|---|---|---|---|\n"
            .to_owned();
    for model in MODELS {
        let inputs = |wanted: bool| {
            let inputs = model.inputs.iter().filter(|input| input.is_disturbance == wanted);
            list(inputs.map(|input| named(input.quantity.name, input.quantity.unit)).collect())
        };
        let quantities = |all: &[Quantity]| list(all.iter().map(|one| named(one.name, one.unit)).collect());
        let parameters = model.parameters.iter().map(|one| {
            format!("`{}` {} {}", one.name, format!("{:?}", one.value).trim_end_matches(".0"), one.unit)
                .trim_end()
                .to_owned()
        });
        let (takes, disturbances) = (inputs(false), inputs(true));
        let (gives, states, parameters) =
            (quantities(model.sensors), quantities(model.states), list(parameters.collect()));
        table += &format!(
            "| `{}`: {} | {takes} | {disturbances} | {gives} | {states} | {parameters} |\n",
            model.name, model.text
        );
    }
    crate::common::check_table("docs/plant.md", "models", &table);
}
