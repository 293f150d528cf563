// SPDX-License-Identifier: MIT OR Apache-2.0
//! Bounds that ranges, conditions and relations between values make tight: typical controller programs, each compared with its runs.

use crate::accuracy::{HEAD, check, source};
use takt_analysis::accuracy::{Enclosure, Interval, Problem, enclose, ulp};
use takt_asm::{MemoryLoader, Options, Search};
use takt_emu::testing::Random;
use takt_isa::{F3, MACHINES, Machine, Program};

/// Encloses a program and compares its statements with random runs.
fn held(program: &Program) -> Enclosure {
    let enclosure = enclose(program).unwrap();
    for seed in 0..4 {
        check(program, &enclosure, 300, &mut Random::new(seed));
    }
    enclosure
}

/// Range and error bound of an output.
fn output(enclosure: &Enclosure, name: &str) -> (Interval, f64) {
    let output = enclosure.outputs.iter().find(|output| output.name == name).unwrap();
    (output.range.unwrap(), output.error.unwrap_or(f64::INFINITY))
}

/// Period on latched inputs `x` and `z`, on every machine: range and error of `y`, and the hazards.
fn of_period(ranges: &str, period: &str) -> (Interval, f64, Vec<Problem>) {
    let text = format!(".ports latched\n.input x, z\n.output y\n.range {ranges}\n{HEAD}{period} wait p\n");
    let mut widest: Option<(Interval, f64, Vec<Problem>)> = None;
    for machine in [&F3, MACHINES[MACHINES.len() - 1]] {
        let enclosure = held(&source(&text, machine));
        let (range, error) = output(&enclosure, "y");
        let hazards = enclosure.hazards.iter().map(|hazard| hazard.problem).collect();
        if widest.as_ref().is_none_or(|(_, known, _)| error >= *known) {
            widest = Some((range, error, hazards));
        }
    }
    widest.unwrap()
}

/// Current loop of a motor whose bus may be switched off: the divisor is guarded, the duty clamped.
const CURRENT_LOOP: &str = "\
.schedule on
.ports latched
.input  i_ref, i                        ; A
.input  bus                             ; V
.output duty
.state  s                               ; V
.range  i_ref, i = -20, 20
.range  bus = 0, 60
.range  s = -24, 24
.once
        s = 0
        duty = 0.5
        wait    p
.period
p:
.reg    e v
        e = i_ref - i
        v = 2.5*e + s
        duty = min(max(v/max(bus, 1e-6) + 0.5, 0), 1)
        s = min(max(s + 0.004*e, -24), 24)
        wait    p
";

#[test]
fn a_clamped_output_errs_by_no_more_than_its_width() {
    for machine in MACHINES {
        let enclosure = held(&source(CURRENT_LOOP, machine));
        let (range, error) = output(&enclosure, "duty");
        assert_eq!((range.low, range.high), (0.0, 1.0));
        assert!(error <= 1.0, "{error:e}");
        assert!(enclosure.hazards.is_empty() && enclosure.assumed.is_empty(), "{enclosure:?}");
    }
}

#[test]
fn results_of_functions_stay_within_the_ranges_of_the_functions() {
    let pi = f64::from(std::f32::consts::PI);
    for (period, low, high) in [
        (" fsin y, x\n", -1.0, 1.0),
        (" fcos y, x\n", -1.0, 1.0),
        (" fsat y, x, 1.0\n facos y, y\n", 0.0, pi),
        (" fatan2 y, x, z\n", -pi, pi),
        (" fsin y, x\n fabs y, y\n fsqrt y, y\n", 0.0, 1.0),
    ] {
        let (range, error, _) = of_period("x, z = -100, 100", period);
        assert_eq!((range.low, range.high), (low, high), "{period}");
        assert!(error <= high - low + 1e-7, "{period}: {error}");
    }
    // The sine lies in the domain of the arccosine.
    let (.., hazards) = of_period("x, z = -100, 100", " fsin y, x\n facos y, y\n");
    assert_eq!(hazards, []);
}

#[test]
fn a_limit_that_the_run_never_reaches_keeps_the_value() {
    // The product is at most 1 in the run, but may exceed 1 in exact arithmetic.
    let limited = " fmul y, x, 0.1\n fmin z2, y, 1.0\n fsub y, z2, y\n";
    let (range, error, _) = of_period("x = 0, 10", &format!(".reg z2\n{limited}"));
    assert!(range.magnitude() < 1e-6 && error < 4.0 * ulp(1.0), "{range:?} {error:e}");
}

/// Ranges at the end of a period of the states that are not proved to keep their declared ranges.
fn left(enclosure: &Enclosure) -> Vec<(f64, f64)> {
    let ends =
        |found: Option<Interval>| found.map_or((f64::NEG_INFINITY, f64::INFINITY), |at| (at.low, at.high));
    enclosure.later().map(|state| ends(state.found)).collect()
}

/// Encloses a program on two machines, with its branches unchanged and with branches converted to selections by the scheduler.
fn both_ways(text: &str, mut test: impl FnMut(&Enclosure, &str)) {
    for schedule in ["", ".schedule on\n"] {
        for machine in [&F3, MACHINES[MACHINES.len() - 1]] {
            let text = format!("{schedule}{text}");
            test(&held(&source(&text, machine)), &format!("{} {schedule:?}", machine.name));
        }
    }
}

#[test]
fn counters_stay_in_their_ranges() {
    // A counter modulo 20: by a selection, by a branch, and by a comparison with its last value.
    for next in [
        "        c = c == 19 ? 0 : c + 1\n",
        "        c = c >= 19 ? 0 : c + 1\n",
        "        c = c < 19 ? c + 1 : 0\n",
        "        ieq     f, c, 19\n        bz      f, more\n        li      c, -1\nmore:\n        iadd    c, c, 1\n",
        "        iadd    c, c, 1\n        ilt     f, c, 20\n        bnz     f, more\n        li      c, 0\nmore:\n",
    ] {
        let text = format!(
            ".output y\n.state c:int\n.reg f:int\n.range c = 0, 19\n.once\n mov c, 0\n wait p\n.period\np:\n{next} itof y, c\n wait p\n"
        );
        both_ways(&text, |enclosure, about| {
            assert_eq!(left(enclosure), [], "{about}:\n{next}");
            let (range, _) = output(enclosure, "y");
            assert_eq!((range.low, range.high), (0.0, 19.0), "{about}:\n{next}");
        });
    }
}

#[test]
fn angles_wrap_into_a_turn() {
    let text = "\
.ports latched
.input  w                               ; rad/s
.output y
.state  a                               ; rad
.range  w = -1000, 1000
.range  a = -3.1416, 3.1416
.once
        a = 0
        wait    p
.period
p:
        a = a + 0.001*w
        a = a > 3.1415926 ? a - 6.2831853 : a
        a = a < -3.1415926 ? a + 6.2831853 : a
        y = a
        wait    p
";
    both_ways(text, |enclosure, about| {
        assert_eq!(left(enclosure), [], "{about}");
        let (range, error) = output(enclosure, "y");
        assert!(range.magnitude() < 3.14160 && error < 1e-6, "{about}: {range:?} {error:e}");
    });
}

#[test]
fn dead_zones_and_guards_decide_what_is_computed() {
    // A dead zone: the sign gives the side, the magnitude the amount.
    let dead = ".reg m\n m = max(abs(x) - 0.5, 0)\n y = x < 0 ? -m : m\n";
    let (range, error, hazards) = of_period("x = -2, 2", dead);
    assert!(range.magnitude() <= 1.5 && error < 1e-6 && hazards.is_empty(), "{range:?} {error:e}");
    let zone = ".reg m:bits\n flt m, x, -0.5\n bnz m, low\n flt m, 0.5, x\n bnz m, high\n mov y, 0.0\n jmp out\nlow: fadd y, x, 0.5\n jmp out\nhigh: fsub y, x, 0.5\nout:\n";
    let (range, error, _) = of_period("x = -2, 2", zone);
    assert!(range.magnitude() <= 1.5 && error < 2.0 * ulp(1.5), "{range:?} {error:e}");
    // Revolutions per minute of the time between two pulses, which is zero at standstill.
    let guard = ".reg c:int\n mov y, 0.0\n flt c, x, 0.001\n bnz c, out\n fdiv y, 60.0, x\nout:\n";
    let (range, error, hazards) = of_period("x = 0, 10", guard);
    assert!(
        range.low == 0.0 && range.high <= 60_000.0 * 1.0001 && hazards.is_empty(),
        "{range:?} {hazards:?}"
    );
    assert!(error < 4.0 * ulp(6e4), "{error:e}");
    // A selection computes the quotient in any case, which raises the flag; the output is bounded.
    let chosen = " y = x < 0.001 ? 0 : 60/x\n";
    let (range, _, hazards) = of_period("x = 0, 10", chosen);
    assert!(range.low == 0.0 && range.high <= 60_000.0 * 1.0001, "{range:?}");
    assert_eq!(hazards, [Problem::DivisionByZero]);
    let guarded = " y = 60/max(x, 0.001)\n";
    let (range, _, hazards) = of_period("x = 0, 10", guarded);
    assert!(range.high <= 60_000.0 * 1.0001 && hazards.is_empty(), "{range:?}");
    // The root of a value that a comparison proves positive.
    let root = ".reg c:int f\n fmul f, x, x\n fsub f, 1.0, f\n mov y, 0.0\n flt c, f, 0.0\n bnz c, out\n fsqrt y, f\nout:\n";
    let (range, _, hazards) = of_period("x = -2, 2", root);
    assert!(range.low == 0.0 && range.high <= 1.0 && hazards.is_empty(), "{range:?} {hazards:?}");
}

#[test]
fn hysteresis_and_saturating_integrators_keep_their_ranges() {
    let text = "\
.ports latched
.input  t                               ; degrees
.output heat
.state  on:int
.state  s
.range  t = -40, 120
.range  on = 0, 1
.range  s = -10, 10
.once
        on = 0
        s = 0
        wait    p
.period
p:
        on = t < 20 ? 1 : t > 22 ? 0 : on
        s = sat(s + 0.01*(21 - t), 10)
        heat = on != 0 ? s : 0
        wait    p
";
    both_ways(&text.replace("on != 0 ? s : 0", "on ? s : 0"), |enclosure, about| {
        assert_eq!(left(enclosure), [], "{about}");
        assert_eq!(output(enclosure, "heat").0.magnitude(), 10.0, "{about}");
    });
}

/// PI controller whose integrator follows the saturated output: the error is limited by the output that is not saturated.
#[test]
fn a_limit_bounds_what_it_is_a_sum_of() {
    let text = "\
.ports latched
.input  e
.output u
.state  s
.range  e = -50, 50
.range  s = -48, 48
.once
        s = 0
        wait    p
.period
p:
.reg    v
        v = 0.8*e + s
        u = sat(v, 24)
        s = s + 0.012*e + 0.02*(u - v)
        wait    p
";
    both_ways(text, |enclosure, about| {
        // Within the limit, e is (v - s)/0.8, so s shrinks; beyond, it is fed back.
        assert_eq!(left(enclosure), [], "{about}");
    });
}

#[test]
fn components_of_a_norm_are_at_most_one() {
    // The norm is guarded, the components are not: without the relation, a quotient would be up to 2·10⁶.
    for (period, most) in [
        (".reg n\n n = max(sqrt(x*x + z*z), 1e-6)\n y = x/n\n", 1e-6),
        (".reg n\n n = sqrt(max(z*z + x*x, 1e-12))\n y = -x/n\n", 1e-6),
        (".reg n\n n = 1/sqrt(x*x + z*z + 1e-12)\n y = x*n\n", 1e-6),
    ] {
        let (range, error, hazards) = of_period("x, z = -2, 2", period);
        assert_eq!(hazards, [], "{period}");
        assert!(range.magnitude() <= 1.0 && error < most, "{period}: {range:?} {error:e}");
    }
    // The quotient lies in the domain of the arccosine.
    let (.., hazards) =
        of_period("x, z = -2, 2", ".reg n\n n = max(sqrt(x*x + z*z), 1e-6)\n n = x/n\n facos y, n\n");
    assert_eq!(hazards, []);
    // With a fused sum, which one machine has.
    let fused = " fmul n, z, z\n fma n, x, x, n\n fmax n, n, 1e-12\n fsqrt n, n\n fdiv y, x, n\n wait p\n";
    let text = format!(".ports latched\n.input x, z\n.output y\n.reg n\n.range x, z = -2, 2\n{HEAD}{fused}");
    let (range, error) = output(&held(&source(&text, MACHINES[MACHINES.len() - 1])), "y");
    assert!(range.magnitude() <= 1.0 && error < 1e-6, "{range:?} {error:e}");
    // A voltage beyond the bridge's limit is scaled down to it.
    let scaled = ".reg m v s\n m = x*x + z*z\n v = 24.0\n s = v/sqrt(max(m, v*v))\n y = s*x\n";
    let (range, error, hazards) = of_period("x, z = -100, 100", scaled);
    assert!(range.magnitude() <= 100.0 && error < 1e-4 && hazards.is_empty(), "{range:?} {error:e}");
    // A term that may be negative leaves no relation.
    let (range, ..) = of_period("x = 1, 2\n.range z = -0.9, 2", ".reg n\n n = sqrt(x*x + z)\n y = x/n\n");
    assert!(range.high > 1.5, "{range:?}");
}

/// Coordinates after a rotation, and after another one: no longer than the vector, which no interval says.
#[test]
fn rotations_keep_the_norm() {
    let first = ".reg c s u v\n c = cos(x)\n s = sin(x)\n u = c*z - 3*s\n v = s*z + 3*c\n";
    let long = 18f64.sqrt();
    for (period, most) in [
        (format!("{first} y = u\n"), long),
        (format!("{first} y = -v\n"), long),
        (format!("{first}.reg g h\n g = cos(z)\n h = sin(z)\n y = v*g - h*u\n"), 2f64.sqrt() * long),
        // Products of their own, in the other order.
        (
            ".reg c s u v\n fcos c, x\n fsin s, x\n fmul u, s, z\n fmul v, 3.0, c\n fsub y, u, v\n"
                .to_owned(),
            long,
        ),
    ] {
        let (range, error, hazards) = of_period("x = -4, 4\n.range z = -3, 3", &period);
        assert!(range.magnitude() <= most * (1.0 + 3e-6) && hazards.is_empty(), "{period}: {range:?}");
        // The turn of the errors, and the roundings.
        assert!(error < 3.5e-6, "{period}: {error:e}");
    }
    // Two sines, a sine and a cosine of different angles, and an angle that changes in between are no rotation.
    for period in [
        ".reg s t\n s = sin(x)\n t = sin(x)\n y = s*z + 3*t\n",
        ".reg s t\n s = sin(x)\n t = cos(z)\n y = s*z + 3*t\n",
        ".reg s t u\n s = sin(x)\n u = x + 1\n t = cos(u)\n y = s*z + 3*t\n",
    ] {
        let (range, ..) = of_period("x = -4, 4\n.range z = -3, 3", period);
        assert!(range.magnitude() > 5.0, "{period}: {range:?}");
    }
}

/// An activation, applied to sums that carry errors and stored: its range is known, and the error grows by its slope, which is at most 1.
#[test]
fn stored_activations_keep_their_range_and_slope() {
    let text = format!(
        ".schedule on\n.ports latched\n.include <math.s>\n.input x\n.output y\n.array v[1]\n.result v\n.reg u w\n.range x = -8, 8\n{HEAD} u = (3*x + 300) - 300\n w = tanh(u)\n v[1] = w\n y = u\n wait p\n"
    );
    let enclosure = held(&with_library(&text, &F3));
    let ((range, error), (_, of_sum)) = (output(&enclosure, "v"), output(&enclosure, "y"));
    assert!(range.magnitude() <= 1.0 && error < 4.0 * of_sum, "{range:?} {error:e} {of_sum:e}");
    // A known sign makes the function's divisor known.
    let text = text.replace("-8, 8", "0.4, 4");
    let enclosure = held(&with_library(&text, &F3));
    assert!(enclosure.hazards.is_empty(), "{enclosure:?}");
}

#[test]
fn a_quotient_errs_by_a_share_of_itself() {
    // The divisor spans many orders of magnitude, so the bound must be relative.
    let (range, error, _) =
        of_period("x = 0.001, 1000\n.range z = -3, 3", ".reg n\n n = x*x*x\n y = n/(n + 1e-3*x)\n");
    assert!(range.high <= 1.03 && error < 1e-6, "{range:?} {error:e}");
}

#[test]
fn remainders_and_differences_of_squares_stay_small() {
    let wrap = ".reg n\n n = x*0.15915494 + 12582912.0\n n = n - 12582912.0\n y = x - 6.2831853*n\n";
    let (range, error, hazards) = of_period("x = -1000, 1000", wrap);
    assert!(range.magnitude() < 3.15 && error < 1e-3 && hazards.is_empty(), "{range:?} {error:e}");
    let circle = ".reg k\n k = sat(x, 1)\n y = sqrt(1 - k*k)\n";
    let (range, error, hazards) = of_period("x = -3, 3", circle);
    assert!(
        range.low == 0.0 && range.high == 1.0 && error < 1e-3 && hazards.is_empty(),
        "{range:?} {error:e}"
    );
}

/// Assembles a program that includes the library.
fn with_library(text: &str, machine: &'static Machine) -> Program {
    let loader = Search::new(MemoryLoader::default()).library(takt_programs::LIBRARY);
    let options = Options { machine, ..Options::default() };
    let assembled = takt_asm::assemble_bytes("test.s", text.into(), &loader, &options);
    assembled.unwrap_or_else(|diagnostics| panic!("{}\n{text}", diagnostics.render(false))).program
}

#[test]
fn an_arcsine_of_a_clamped_value_is_an_angle() {
    for machine in [&F3, MACHINES[MACHINES.len() - 1]] {
        let text = format!(
            ".schedule on\n.ports latched\n.include <math.s>\n.input s\n.output y\n.reg c\n.range s = -2, 2\n{HEAD} c = min(max(s, -1), 1)\n asin y, c\n wait p\n"
        );
        let (range, error) = output(&held(&with_library(&text, machine)), "y");
        assert!(range.magnitude() < 1.7 && error < 1e-3, "{range:?} {error:e}");
    }
}

#[test]
fn an_attitude_filter_is_bounded() {
    let text = "\
.schedule on
.ports latched
.include <math.s>
.input  gx, gy                          ; rad/s
.input  ax, ay, az                      ; m/s²
.output roll, pitch                     ; rad
.state  r p
.range  gx, gy = -35, 35
.range  ax, ay, az = -160, 160
.range  r = -5, 5
.range  p = -3.5, 3.5
.once
        r = 0
        p = 0
        wait    q
.period
q:
.reg    n
        n = max(sqrt(ay*ay + az*az), 0.01)
        r = 0.98*(r + 0.001*gx) + 0.02*atan2(ay, az)
        p = 0.98*(p + 0.001*gy) + 0.02*atan2(-ax, n)
        roll = r
        pitch = p
        wait    q
";
    for machine in [&F3, MACHINES[MACHINES.len() - 1]] {
        let enclosure = held(&with_library(text, machine));
        for name in ["roll", "pitch"] {
            let (range, error) = output(&enclosure, name);
            assert!(range.magnitude() < 5.0 && error < 1e-3, "{name}: {range:?} {error:e}");
        }
        assert!(enclosure.hazards.is_empty() && left(&enclosure).is_empty(), "{enclosure:?}");
    }
}
