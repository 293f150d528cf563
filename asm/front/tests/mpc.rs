// SPDX-License-Identifier: MIT OR Apache-2.0
//! Model-predictive control compared with TinyMPC and OSQP, and messages about refused problems. `mpc.py` writes both.

use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use takt_asm::{MemoryLoader, Options, Search as Libraries};
use takt_emu::{Emulator, Number};
use takt_front::mpc::{
    Controller, Outcome, Reference, References, Search, System, contraction, read, search, source,
};
use takt_front::no_files;
use takt_isa::{Machine, T3, T4};

/// Iterations that suffice to reach the optimum.
const MANY: usize = 3000;

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/mpc").join(name)
}

fn text(name: &str) -> String {
    std::fs::read_to_string(path(&format!("{name}.json"))).expect("the file")
}

fn system(name: &str) -> System {
    read(&text(name), name, &no_files).expect("a control problem")
}

fn vectors(value: &Value) -> Vec<DVector<f64>> {
    value.as_array().expect("rows").iter().map(|row| crate::common::numbers(row).into()).collect()
}

struct Case {
    problem: String,
    x: DVector<f64>,
    reference: Reference,
    tinympc: Option<Vec<DVector<f64>>>,
    osqp: Vec<DVector<f64>>,
}

fn cases() -> Vec<Case> {
    let table: Value = serde_json::from_str(&text("results")).expect("JSON");
    let case = |row: &Value| Case {
        problem: row["problem"].as_str().expect("a name").to_owned(),
        x: crate::common::numbers(&row["x"]).into(),
        reference: Reference { x: vectors(&row["xr"]), u: vectors(&row["ur"]) },
        tinympc: row.get("tinympc").map(vectors),
        osqp: vectors(&row["osqp"]),
    };
    table.as_array().expect("a list").iter().map(case).collect()
}

fn distance(found: &[DVector<f64>], expected: &[DVector<f64>]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found.iter().zip(expected).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max)
}

#[test]
fn iterates_equal_tinympcs() {
    let mut count = 0;
    for Case { problem, x, reference, tinympc, .. } in cases() {
        let Some(expected) = tinympc else { continue };
        let controller = Controller::new(system(&problem)).expect("factors");
        let found = controller.period(&x, &reference, &mut controller.cold());
        // TinyMPC's Riccati recursion ends when the gain changes by 10⁻⁵.
        let error = distance(&found.u, &expected);
        assert!(error < 2e-4, "{problem}: {error:e}");
        count += 1;
    }
    assert_eq!(count, 9);
}

#[test]
fn many_iterations_reach_the_optimum_of_osqp() {
    for Case { problem, x, reference, osqp, .. } in cases() {
        let mut controller = Controller::new(system(&problem)).expect("factors");
        controller.system.iterations = MANY;
        let found = controller.period(&x, &reference, &mut controller.cold());
        let error = distance(&found.u, &osqp);
        assert!(found.primal < 1e-6 && found.dual < 1e-6, "{problem}: {:e}, {:e}", found.primal, found.dual);
        assert!(error < 1e-5, "{problem}: {error:e}");
    }
}

/// A controller running on a machine.
struct RunningController {
    emulator: Emulator,
    references: References,
    inputs: usize,
    /// A and B, if they are inputs.
    matrices: Option<[DMatrix<f64>; 2]>,
    /// Upper bound of a period's cycles.
    bound: u64,
    cycles: Vec<u64>,
}

impl RunningController {
    fn new(controller: &Controller, machine: &'static Machine) -> RunningController {
        let source = source(controller, machine, 4096).expect("a source");
        let loader = Libraries::new(MemoryLoader::default()).library(takt_programs::LIBRARY);
        let options = Options { machine: source.machine, ..Options::default() };
        let assembled = takt_asm::assemble_bytes("mpc.s", source.text.into_bytes(), &loader, &options);
        let assembled = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false)));
        assert!(assembled.warnings.is_empty(), "{}", assembled.warnings.render(false));
        let bound = takt_analysis::bound(&assembled.program).expect("a bound").worst_period();
        RunningController {
            emulator: Emulator::new(&assembled.program).expect("it fits"),
            references: controller.system.references,
            inputs: controller.system.inputs(),
            matrices: (controller.system.relinearise > 0)
                .then(|| [controller.system.a.clone(), controller.system.b.clone()]),
            bound: bound.expect("a period"),
            cycles: Vec::new(),
        }
    }

    /// Runs a period; returns the first inputs of the plan, and both residuals.
    fn period(&mut self, x: &DVector<f64>, reference: &Reference) -> (DVector<f64>, f64, f64) {
        let mut values: Vec<(String, f64)> = Vec::new();
        let mut array = |name: &str, vector: &DVector<f64>| {
            values.extend(vector.iter().enumerate().map(|(i, x)| (format!("{name}{}]", i + 1), *x)));
        };
        array("x[", x);
        match self.references {
            References::None => {}
            References::Constant => {
                array("xr[", &reference.x[0]);
                array("ur[", &reference.u[0]);
            }
            References::Horizon => {
                for (l, x) in reference.x.iter().enumerate() {
                    array(&format!("xr[{},", l + 1), x);
                }
                for (l, u) in reference.u.iter().enumerate() {
                    array(&format!("ur[{},", l + 1), u);
                }
            }
        }
        for (name, matrix) in ["A", "B"].into_iter().zip(self.matrices.iter().flatten()) {
            let places = (0..matrix.nrows()).flat_map(|i| (0..matrix.ncols()).map(move |j| (i, j)));
            values.extend(places.map(|(i, j)| (format!("{name}[{},{}]", i + 1, j + 1), matrix[(i, j)])));
        }
        let values: Vec<(&str, Number)> =
            values.iter().map(|(port, x)| (port.as_str(), Number::Float(*x as f32))).collect();
        let report = self.emulator.run_period(&values).expect("a period");
        assert!(report.cycles <= self.bound, "{} cycles, the bound is {}", report.cycles, self.bound);
        self.cycles.push(report.cycles);
        let output = |port: &str| match self.emulator.output(port) {
            Ok(Some(Number::Float(value))) => f64::from(value),
            other => panic!("{port}: {other:?}"),
        };
        let u = DVector::from_fn(self.inputs, |j, _| output(&format!("u[{}]", j + 1)));
        (u, output("primal"), output("dual"))
    }
}

#[test]
fn programs_agree_with_the_binary64_model() {
    let cases = cases();
    for (problem, machine, warm_start) in [
        ("quadrotor", &T3, true),
        ("quadrotor", &T4, true),
        ("mass", &T3, true),
        ("mass", &T3, false),
        ("dense", &T3, true),
    ] {
        let mut system = system(problem);
        system.warm_start = warm_start;
        let controller = Controller::new(system).expect("factors");
        let mut running = RunningController::new(&controller, machine);
        let mut warm = controller.cold();
        for Case { x, reference, .. } in cases.iter().filter(|case| case.problem == problem) {
            let Outcome { u, primal, dual, .. } = controller.period(x, reference, &mut warm);
            let found = running.period(x, reference);
            let error = (&found.0 - &u[0]).amax().max((found.1 - primal).abs());
            assert!(error < 2e-5, "{problem} on {}: {error:e}", machine.name);
            assert!((found.2 - dual).abs() < 5e-5, "{problem} on {}: {}, {dual}", machine.name, found.2);
            for (value, (low, high)) in found.0.iter().zip(&controller.system.u_limits) {
                assert!((f64::from(*low as f32)..=f64::from(*high as f32)).contains(value), "{value}");
            }
        }
        // Cycles do not depend on the data: all periods are equally long.
        assert!(running.cycles.iter().all(|cycles| cycles == &running.cycles[1]), "{:?}", running.cycles);
    }
}

/// With matrices as inputs, the program computes the controller of their system once its cost-to-go has converged, and at once if they
/// equal the file's.
#[test]
fn matrices_can_be_inputs() {
    let cases = cases();
    for (problem, machine) in [("mass", &T3), ("mass", &T4), ("dense", &T3)] {
        let mut given = system(problem);
        (given.warm_start, given.relinearise) = (false, 2);
        if given.references == References::Horizon {
            given.references = References::Constant;
        }
        let mut changed = given.clone();
        changed.a *= 0.97;
        changed.b.iter_mut().enumerate().for_each(|(k, entry)| *entry *= 1.1 + 0.05 * (k % 3) as f64);
        let Case { x, reference, .. } = cases.iter().find(|case| case.problem == problem).expect("a case");
        // Constant references equal the first step's.
        let reference = Reference {
            x: vec![reference.x[0].clone(); reference.x.len()],
            u: vec![reference.u[0].clone(); reference.u.len()],
        };
        let mut running = RunningController::new(&Controller::new(given.clone()).expect("factors"), machine);
        for (system, periods) in [(given, 1), (changed, 60)] {
            running.matrices = Some([system.a.clone(), system.b.clone()]);
            let controller = Controller::new(system).expect("factors");
            let Outcome { u, primal, .. } = controller.period(x, &reference, &mut controller.cold());
            let mut errors = Vec::new();
            for _ in 0..periods {
                let found = running.period(x, &reference);
                errors.push((&found.0 - &u[0]).amax().max((found.1 - primal).abs()));
            }
            let last = errors[periods - 1];
            assert!(last < 1e-4, "{problem} on {}: {errors:?}", machine.name);
            // The first error shows that the cost-to-go had to converge.
            assert!(periods == 1 || errors[0] > 10.0 * last, "{errors:?}");
        }
        assert!(running.cycles.iter().all(|cycles| cycles == &running.cycles[1]), "{:?}", running.cycles);
    }
}

/// Neither one iteration nor the shortest horizon leaves anything unused: [`RunningController::new`] refuses warnings.
#[test]
fn one_iteration_has_no_warning() {
    for (problem, horizon) in [("mass", 2), ("mass", 3), ("quadrotor", 10)] {
        let mut system = system(problem);
        (system.iterations, system.horizon) = (1, horizon);
        let controller = Controller::new(system).expect("factors");
        let x = DVector::from_element(controller.system.states(), 0.1);
        let Outcome { u, .. } = controller.period(&x, &controller.rest(), &mut controller.cold());
        let found = RunningController::new(&controller, &T3).period(&x, &controller.rest());
        assert!((&found.0 - &u[0]).amax() < 1e-6, "{problem}");
    }
}

/// Matrices in files beside the problem, as MATLAB and NumPy write them.
#[test]
fn matrices_can_be_files() {
    let mut problem: Value = serde_json::from_str(&text("mass")).expect("JSON");
    for key in ["A", "B", "Q"] {
        problem[key] = json!(format!("{key}.csv"));
    }
    let problem = serde_json::to_string_pretty(&problem).expect("JSON");
    let files = |a: &'static str| {
        move |name: &str| match name {
            "A.csv" => Ok(a.to_owned()),
            "B.csv" => Ok("4.983374916805359e-03\n9.950166250831947e-02\n".to_owned()),
            "Q.csv" => Ok("10;2\n".to_owned()),
            _ => Err(format!("cannot open {name}")),
        }
    };
    let comma = "1.0,0.09950166250831947\r\n0,0.9900498337491681\r\n";
    let blanks = "# numpy.savetxt\n1.0 0.09950166250831947\n\n0 0.9900498337491681 % damped\n";
    for a in [comma, blanks] {
        let (read, expected) = (read(&problem, "mass", &files(a)).expect("a problem"), system("mass"));
        // Parsing by serde_json may be off by one ulp.
        assert!((&read.a - &expected.a).amax() < 1e-15 && (&read.b - &expected.b).amax() < 1e-15);
        assert_eq!(read, System { a: read.a.clone(), b: read.b.clone(), ..expected });
    }
    let wrong = |a: &'static str| read(&problem, "mass", &files(a)).expect_err("wrong").to_string();
    assert_eq!(
        wrong("x1,x2\n1,2\n"),
        "`A`: A.csv:1: `x1` is not a finite number; expected rows of numbers, without a header"
    );
    assert_eq!(
        wrong("1,nan\n1,2\n"),
        "`A`: A.csv:1: `nan` is not a finite number; expected rows of numbers, without a header"
    );
    assert_eq!(
        wrong("1,2\n"),
        "`A`: row 1 has 2 numbers, expected 1: A has a row and a column for each state"
    );
    assert_eq!(wrong(""), "`A`: 0 states; expected 1 to 32");
    let other = problem.replace("B.csv", "none.csv");
    assert_eq!(
        read(&other, "mass", &files(comma)).expect_err("no file").to_string(),
        "`B`: cannot open none.csv"
    );
    let error = read(&problem, "mass", &no_files).expect_err("no files").to_string();
    assert!(error.contains("this text comes from memory"), "{error}");
}

/// Iterations obey the proven rate and the bound on residuals, and the bound is within a factor of ten of the residuals found.
#[test]
fn iterations_contract_at_the_proved_rate() {
    let mut system = system("mass");
    system.x_limits.fill((f64::NEG_INFINITY, f64::INFINITY));
    system.references = References::None;
    for (horizon, rho) in [(8, 1.0), (4, 5.0), (8, 30.0)] {
        let mut nearest: f64 = 0.0;
        for iterations in [1, 2, 3, 5, 8, 12, 20, 30] {
            (system.horizon, system.rho, system.iterations) = (horizon, rho, iterations);
            let controller = Controller::new(system.clone()).expect("factors");
            let found = contraction(&controller).expect("inputs only have limits");
            let (primal, dual) = found.residuals.expect("a range");
            assert!(found.rate < 1.0 && (dual - rho * primal).abs() < 1e-12);
            let worst = search(&controller, Search { restarts: 20, seed: 1, periods: 1 }).expect("a range");
            let [of_primal, of_dual] = [worst[0].value / primal, worst[1].value / dual];
            assert!(of_primal <= 1.0 && of_dual <= 1.0, "{iterations}: {worst:?} {found:?}");
            nearest = nearest.max(of_primal).max(of_dual);
        }
        assert!(nearest > 0.1, "{nearest}");
    }
    // A limit on a state, or a long plan, leaves no rate.
    let limited = Controller::new(self::system("mass")).expect("factors");
    assert_eq!(contraction(&limited), None);
    assert_eq!(contraction(&Controller::new(self::system("quadrotor")).expect("factors")), None);
}

#[test]
fn an_iteration_of_a_dense_system_keeps_its_deadline() {
    let mut system = system("quadrotor");
    // No entry is zero or one.
    for matrix in [&mut system.a, &mut system.b] {
        for (k, entry) in matrix.iter_mut().enumerate() {
            *entry += 1e-4 * (1.0 + (k % 7) as f64);
        }
    }
    let controller = Controller::new(system).expect("factors");
    for (machine, most) in [(&T3, 5600), (&T4, 2900)] {
        let bound = RunningController::new(&controller, machine).bound;
        assert!(bound <= 10 * most, "{}: {bound}", machine.name);
    }
}

#[test]
fn search_agrees_with_a_grid() {
    let mut controller = Controller::new(system("mass")).expect("factors");
    controller.system.iterations = 3;
    let worst = search(&controller, Search { restarts: 30, seed: 1, periods: 1 }).expect("there is a range");
    assert_eq!(worst.iter().map(|worst| worst.name).collect::<Vec<_>>(), ["primal", "dual", "violation"]);
    let range = controller.system.x_range.clone().expect("a range");
    let place = |i: usize, k: usize| range[i].0 + (range[i].1 - range[i].0) * k as f64 / 20.0;
    let [mut primal, mut dual]: [f64; 2] = [0.0; 2];
    for (i, j) in (0..21).flat_map(|i| (0..21).map(move |j| (i, j))) {
        let x = DVector::from_vec(vec![place(0, i), place(1, j)]);
        let outcome = controller.period(&x, &controller.rest(), &mut controller.cold());
        (primal, dual) = (primal.max(outcome.primal), dual.max(outcome.dual));
    }
    assert!(primal > 0.01 && worst[0].value >= 0.999 * primal, "{} {primal}", worst[0].value);
    assert!(dual > 0.01 && worst[1].value >= 0.999 * dual, "{} {dual}", worst[1].value);
    // The reported state gives the value.
    let x = DVector::from_column_slice(&worst[0].state);
    let again = controller.period(&x, &controller.rest(), &mut controller.cold());
    assert_eq!(again.primal, worst[0].value);
}

#[test]
fn rejects_inconsistent_sizes_by_key() {
    let refused = |change: &dyn Fn(&mut Value)| -> String {
        let mut file: Value = serde_json::from_str(&text("mass")).expect("JSON");
        change(&mut file);
        let text = serde_json::to_string_pretty(&file).expect("JSON");
        let made = read(&text, "mass", &no_files).and_then(Controller::new);
        made.map_err(|error| error.located(&text)).map_or_else(
            |error| format!("{}{error}", if error.line.is_some() { "line: " } else { "" }),
            |_| "accepted".to_owned(),
        )
    };
    assert_eq!(refused(&|_| ()), "accepted");
    for (key, value, expected) in [
        ("A", json!([[1, 0.1]]), "line: `A`: row 1 has 2 numbers, expected 1: A has a row and a column"),
        ("B", json!([[1]]), "line: `B`: 1 rows, expected 2: B has a row for each state,"),
        ("B", json!([]), "line: `B`: 0 inputs; expected 1 to 32"),
        ("Q", json!([1, 2, 3]), "line: `Q`: 3 weights, expected 2"),
        ("Q", json!([1, -2]), "line: `Q`: an eigenvalue of the weights is -2.000e0; all must be 0 or above"),
        ("Q", json!([[1, 2], [0, 1]]), "line: `Q`: the matrix of weights is not symmetric"),
        ("R", json!(0), "line: `R`: an eigenvalue of the weights is 0.000e0; all must be above 0"),
        ("u_min", json!([2]), "line: `u_min`: limit 1 is 2, above that of `u_max`, 1"),
        ("x_max", json!([1]), "line: `x_max`: 1 limits, expected 2"),
        ("x_range", json!([[1, 0], [0, 1]]), "line: `x_range`: state 1: the range from 1 to 0 is empty"),
        ("x_range", json!([[0, 1]]), "line: `x_range`: 1 ranges of 2 states"),
        ("horizon", json!(1), "line: `horizon`: 1 states; expected 2 to 128"),
        ("iterations", json!(0), "line: `iterations`: 0 iterations; expected 1 to 10000"),
        ("rho", json!(0), "line: `rho`: the penalty is 0; it must be above 0"),
        (
            "references",
            json!("all"),
            "line: `references`: `all` is unknown; expected none, constant or horizon",
        ),
        ("format", json!("takt-mpc 2"), "line: `format`: unknown format `takt-mpc 2`; expected `takt-mpc 1`"),
        ("P", json!(1), "line: this is not a control problem: unknown field `P`, expected one of"),
        ("R", json!("x"), "line: `R`: `x` is the name of a file, but this text comes from memory"),
        ("R", json!(true), "line: `R`: a truth value is not a number"),
        ("R", json!("NaN"), "line: `R`: expected a finite number, found NaN"),
        ("Q", json!(["Infinity", 1]), "line: `Q`: expected a finite number, found inf"),
        (
            "Q",
            json!(["1", 1]),
            "line: `Q`: expected a number, found the string \"1\": write it without quotes",
        ),
        ("u_max", json!("-inf"), "line: `u_max`: -inf is not a limit; write `null` for no limit"),
        ("x_min", json!([null, "NaN"]), "line: `x_min`: NaN is not a limit; write `null` for no limit"),
        ("x_range", json!([[0, "inf"], [0, 1]]), "line: `x_range`: expected a finite number, found inf"),
        ("rho", json!("Infinity"), "line: `rho`: expected a finite number, found inf"),
        ("A", json!(1), "line: `A`: expected a matrix: a list of rows, or the name of a file of numbers"),
        (
            "relinearise",
            json!(101),
            "line: `relinearise`: 101 steps of the Riccati recursion in a period; there are up to 100",
        ),
    ] {
        let error = refused(&|file| file[key] = value.clone());
        assert!(error.starts_with(expected), "{key}: {error}");
    }
    let unstable = json!([[1.2, 0.1], [0, 0.5]]);
    let error = refused(&|file| (file["A"], file["Q"]) = (unstable.clone(), json!([0, 1])));
    assert!(
        error.starts_with("line: `Q`: `A` has an unstable mode (eigenvalue of magnitude 1.2000)"),
        "{error}"
    );
    let turning = json!([[1.0, 0.5], [-0.5, 1.0]]);
    let error = refused(&|file| (file["A"], file["Q"]) = (turning.clone(), json!(0)));
    assert!(
        error.starts_with("line: `Q`: `A` has an unstable mode (eigenvalue of magnitude 1.1180)"),
        "{error}"
    );
    let error = refused(&|file| (file["A"], file["B"]) = (unstable.clone(), json!([[0], [0]])));
    assert!(error.ends_with("that no input reaches"), "{error}");
    let many = text("quadrotor").replace("\"horizon\"", "\"relinearise\": 1, \"horizon\"");
    let error = read(&many, "quadrotor", &no_files).expect_err("many states").to_string();
    assert_eq!(error, "`relinearise`: 12 states; matrices can be inputs of up to 8");
    let error = read(&text("mass").replace("\"rho\": 1.0", "\"rho\": 1e999"), "mass", &no_files)
        .expect_err("infinite");
    assert!(error.to_string().contains("number out of range"), "{error}");
}

#[test]
fn more_ports_than_a_machine_has_are_an_error() {
    let mut system = system("quadrotor");
    system.references = References::Horizon;
    let controller = Controller::new(system).expect("factors");
    let error = source(&controller, &T4, 4096).err().expect("168 inputs").to_string();
    assert_eq!(error, "it does not fit: 168 input ports, t4 has 127; references: `constant` takes fewer");
    assert!(source(&controller, &T3, 4096).is_ok());
}
