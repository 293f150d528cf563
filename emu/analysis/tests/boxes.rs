// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bounds from divided ranges, numbers that stand for reals, and certificates.

use takt_analysis::accuracy::{Enclosure, Reals, certify, enclose, enclose_in_boxes, enclose_reals};
use takt_asm::{MemoryLoader, Options, assemble_bytes};
use takt_emu::testing::Random;
use takt_emu::{Emulator, Number};
use takt_isa::{F3, Program};

fn program(period: &str, latched: bool) -> Program {
    let latched = if latched { ".ports latched\n" } else { "" };
    let text = format!(
        "{latched}.input x, z\n.output y\n.range x = 1, 4\n.range z = -2, 2\n.once\n wait p\n.period\np:\n{period}\n wait p\n"
    );
    assembled(&text)
}

fn assembled(text: &str) -> Program {
    let options = Options { machine: &F3, ..Options::default() };
    let assembled = assemble_bytes("test.s", text.into(), &MemoryLoader::new(&[]), &options);
    assembled.unwrap_or_else(|diagnostics| panic!("{}", diagnostics.render(false))).program
}

fn error(enclosure: &Enclosure) -> f64 {
    enclosure.outputs[0].error.expect("a bound")
}

/// Boxes narrow the bounds of nonlinear programs, and no run exceeds what is left.
#[test]
fn no_run_exceeds_the_bounds_of_boxes() {
    type Exact = fn(f64, f64) -> f64;
    let programs: [(&str, Exact, f64); 3] = [
        ("y = (x - z)/(x*x + z*z)", |x, z| (x - z) / (x * x + z * z), 0.7),
        ("y = x*x*x - 12*x*x + 40*x", |x, _| x * x * x - 12.0 * x * x + 40.0 * x, 0.95),
        ("y = (x*z - z*z)*(x + z)", |x, z| (x * z - z * z) * (x + z), 0.95),
    ];
    for (period, exact, gain) in programs {
        let program = program(period, true);
        let (whole, boxes) =
            (enclose(&program).unwrap(), enclose_in_boxes(&program, &Reals::default()).unwrap());
        assert!(
            error(&boxes) < gain * error(&whole),
            "{period}: {} in boxes, {} without",
            error(&boxes),
            error(&whole)
        );
        assert!(boxes.hazards.is_empty(), "{period}: {boxes:?}");
        let mut emulator = Emulator::new(&program).unwrap();
        let mut random = Random::new(54);
        let mut largest = 0.0f64;
        for _ in 0..20_000 {
            let mut draw = |low: f64, high: f64| {
                f64::from(
                    (low + (high - low) * f64::from(random.below(1 << 24)) / f64::from((1 << 24) - 1)) as f32,
                )
            };
            let (x, z) = (draw(1.0, 4.0), draw(-2.0, 2.0));
            emulator.run_period(&[("x", Number::Float(x as f32)), ("z", Number::Float(z as f32))]).unwrap();
            let Ok(Some(Number::Float(y))) = emulator.output("y") else { panic!("no output") };
            assert!(boxes.outputs[0].range.unwrap().contains(f64::from(y)), "{period}: {y} of {x}, {z}");
            largest = largest.max((f64::from(y) - exact(x, z)).abs());
        }
        assert!(largest <= error(&boxes), "{period}: {largest} beyond {}", error(&boxes));
        assert!(error(&boxes) < 6.0 * largest, "{period}: {} for {largest}", error(&boxes));
    }
}

/// A port that two bundles read may have two values, in two boxes.
#[test]
fn only_latched_inputs_are_divided() {
    let text = "y = (x - z)/(x*x + z*z)";
    let open = program(text, false);
    assert_eq!(enclose_in_boxes(&open, &Reals::default()).unwrap(), enclose(&open).unwrap());
}

/// A real number in [1, 4] counts as off by up to half an ulp of 4 when it is rounded to binary32, and 0.1 by 1.5e-9.
#[test]
fn roundings_of_reals_count() {
    let copy = program("y = x", true);
    let real = |inputs: bool, constants: &[f64]| Reals { inputs, constants: constants.to_vec() };
    assert_eq!(error(&enclose(&copy).unwrap()), 0.0);
    let bound = error(&enclose_reals(&copy, &real(true, &[])).unwrap());
    let half = 2f64.powi(-22);
    assert!((half..1.001 * half).contains(&bound), "{bound}");
    let product = program("y = 0.1*x", true);
    let (plain, rounded) = [&[][..], &[0.1]]
        .map(|constants| error(&enclose_reals(&product, &real(false, constants)).unwrap()))
        .into();
    let by = 4.0 * (f64::from(0.1f32) - 0.1);
    assert!((rounded - plain - by).abs() < 1e-12, "{plain} {rounded}");
}

/// A product with a power of two is exact unless it is subnormal, and so is a quotient; a rounding at a power of two counts with the smaller
/// spacing of the numbers below.
#[test]
fn powers_of_two_cost_nothing() {
    let of = |period: &str| error(&enclose(&program(period, true)).unwrap());
    for period in ["y = 2*z", "y = -4*z", "y = 0.5*x", "fdiv y, x, 8.0", "fdiv y, z, 0.25"] {
        assert_eq!(of(period), 0.0, "{period}");
    }
    // Subnormal results; results up to 12; and up to 8 and 16, with half of the spacing below.
    for (period, exponent) in [("y = 0.5*z", -150), ("y = 3*x", -21), ("y = x*z", -22), ("y = x*x", -21)] {
        let most = 2f64.powi(exponent);
        assert!((most..1.001 * most).contains(&of(period)), "{period}: {}", of(period));
    }
    // Gappa proves the same.
    let goals = |period: &str| certify(&program(period, true)).unwrap().unwrap().goals();
    let [(_, doubled)] = &goals("y = 2*z")[..] else { panic!("one operation") };
    assert!(doubled.ends_with("in [0b0, 0b0] }\n"), "{doubled}");
    let [(_, halved)] = &goals("y = 0.5*z")[..] else { panic!("one operation") };
    assert!(halved.contains("in [0b0, 1b-150] }\n$ v"), "{halved}");
    assert!(halved.ends_with(" in (-1b-125, 1b-125);\n"), "{halved}");
}

/// A certificate lists each operation; `cargo evidence check certificates` lets Gappa and the checker examine it.
#[test]
fn certificates_say_what_they_prove() {
    let certificate = certify(&program("y = sqrt(x*x + z*z)", true)).unwrap().unwrap();
    assert_eq!(certificate.goals().len(), 4);
    assert_eq!(certificate.outputs.len(), 1);
    let bound = error(&enclose(&program("y = sqrt(x*x + z*z)", true)).unwrap());
    assert!(certificate.outputs[0].bound >= 0.99 * bound && certificate.outputs[0].bound < 3.0 * bound);
    let (_, goal) = &certificate.goals()[0];
    assert!(goal.contains("r = rnd((v0 * v0));\n{ v0 in ["), "{goal}");
    let open = certify(&program("y = x/z", true)).unwrap().unwrap();
    assert!(open.outputs.is_empty() && open.open[0].reason.contains("the divisor"), "{open:?}");
    let branch = ".reg c\n c = x > 2\n bz c, q\n y = x\n wait p\nq: y = z";
    assert!(
        certify(&program(branch, true))
            .is_ok_and(|found| found.is_err() || found.is_ok_and(|found| !found.steps.is_empty()))
    );
}

/// A filter's states are kept by all periods together; a certificate has their map, and `check.py` proves that it converges.
#[test]
fn certificates_prove_that_states_converge() {
    let filter = |feedback: &str| {
        let text = format!(
            ".schedule on\n.input x\n.output y\n.state a b\n.range x = -1, 1\n.range a, b = -12, 12\n.once\n a = 0\n b = 0\n y = 0\n wait p\n\
             .period\np: y = x + a\n a = b + {feedback}*y\n b = -0.7*y\n wait p\n"
        );
        certify(&assembled(&text)).unwrap().unwrap()
    };
    let kept = filter("1.2");
    assert_eq!(kept.converging.len(), 2, "{:?}", kept.open);
    assert!(kept.converging.iter().all(|state| state.first == [0.0, 0.0]), "{:?}", kept.converging);
    assert!(kept.open.is_empty(), "{:?}", kept.open);
    // With its poles beyond the unit circle, or too near to it for the range, it is not proved.
    for feedback in ["1.8", "1.69"] {
        assert_eq!(filter(feedback).converging, [], "{feedback}");
    }
}
