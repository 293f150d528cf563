// SPDX-License-Identifier: MIT OR Apache-2.0
//! Macros of one operand: their properties, and the measurement of their errors.

use super::measure::{ErrorStatistics, check_emulator, every, full};
use super::one_use;
use std::sync::OnceLock;
use takt_isa::fp::Flags;
use takt_isa::{MACHINES, Machine, Op, Slot, T1};

/// Macro of one operand.
pub(crate) struct Function {
    pub(crate) name: &'static str,
    /// Correctly rounded result in binary32.
    pub(crate) nearest: fn(f32) -> f32,
    /// Result in binary64, for the measurement of errors.
    pub(crate) exact: fn(f64) -> f64,
    /// Largest error, ulp, over every operand on every machine; 0 for results that are always the nearest.
    pub(crate) error: f64,
    /// The error is established by this test; an instruction's is in the manual.
    pub(crate) own: bool,
    /// Limit of the domain: beyond this magnitude, the result is NaN and invalid.
    pub(crate) limit: f32,
    /// Pole: finite operand with an infinite result that is not an overflow.
    pub(crate) pole: f32,
    /// Treatment of a NaN operand.
    pub(crate) passes: Passes,
}

/// Treatment of a NaN.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Passes {
    /// The result is the canonical NaN; a signaling NaN raises invalid.
    Canonical,
    /// The result is the operand's NaN, without flags.
    Untouched,
    /// The result is the operand's NaN; a signaling NaN raises invalid.
    Noisy,
    /// The result is the canonical NaN and raises invalid.
    Refused,
}

fn whole(name: &'static str, nearest: fn(f32) -> f32, passes: Passes) -> Function {
    Function { name, nearest, exact: |x| x, error: 0.0, own: true, limit: f32::INFINITY, pole: 0.0, passes }
}

fn smooth(name: &'static str, nearest: fn(f32) -> f32, exact: fn(f64) -> f64, error: f64) -> Function {
    Function {
        name,
        nearest,
        exact,
        error,
        own: true,
        limit: f32::INFINITY,
        pole: 0.0,
        passes: Passes::Canonical,
    }
}

/// Limit 2π·64, like the machine's sine.
const TURNS: f32 = f32::from_bits(takt_isa::fp::SIN_LIMIT);

/// Logistic function 1/(1 + e^-x).
fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + core_math::exp(-x))
}

/// A machine has the unit of an instruction.
pub(crate) fn has(machine: &Machine, mnemonic: &str) -> bool {
    Op::from_mnemonic(mnemonic).is_some_and(|op| machine.host(op.row().function).is_some())
}

/// t1 without its sine: a machine on which the library computes every function.
pub(crate) fn bare() -> &'static Machine {
    static BARE: OnceLock<Machine> = OnceLock::new();
    BARE.get_or_init(|| {
        let sine = Op::from_mnemonic("fsin").map(|op| op.row().function);
        let slots = T1.slots.iter().map(|slot| {
            let units = slot
                .units
                .iter()
                .filter(|unit| sine.is_none_or(|sine| !unit.functions.contains(&sine)))
                .copied();
            Slot { units: Vec::leak(units.collect()), ..*slot }
        });
        Machine { name: "bare", slots: Vec::leak(slots.collect()), ..T1 }
    })
}

/// Macros of one operand in place of instructions, on a machine without the units.
pub(crate) fn replacements(machine: &Machine) -> Vec<Function> {
    let of = |mnemonic: &str, function: Function| {
        (!has(machine, mnemonic)).then_some(Function { passes: Passes::Refused, ..function })
    };
    let turned = |function: Function| Function { limit: TURNS, ..function };
    let all = [
        of("fsin", turned(smooth("sin", core_math::sinf, core_math::sin, 0.96583))),
        of("fcos", turned(smooth("cos", core_math::cosf, core_math::cos, 0.93541))),
        of("facos", smooth("acos", core_math::acosf, core_math::acos, 0.69925)),
    ];
    all.into_iter().flatten().collect()
}

/// Macros of one operand that every machine has.
pub(crate) fn functions(machine: &Machine) -> Vec<Function> {
    let atan = smooth("atan", core_math::atanf, core_math::atan, 0.88751);
    let atan = if has(machine, "fatan2") {
        Function { error: takt_isa::fp::ATAN2_MAX_ULP, own: false, passes: Passes::Refused, ..atan }
    } else {
        atan
    };
    let tan = smooth("tan", core_math::tanf, core_math::tan, 0.89898);
    vec![
        whole("floor", f32::floor, Passes::Untouched),
        whole("ceil", f32::ceil, Passes::Untouched),
        whole("trunc", f32::trunc, Passes::Untouched),
        whole("round", f32::round, Passes::Untouched),
        whole("rint", f32::round_ties_even, Passes::Noisy),
        smooth("exp", core_math::expf, core_math::exp, 0.81123),
        smooth("expm1", core_math::expm1f, core_math::expm1, 1.25283),
        smooth("log", core_math::logf, core_math::log, 0.81752),
        Function { pole: -1.0, ..smooth("log1p", core_math::log1pf, core_math::log1p, 1.4375) },
        Function { limit: TURNS, passes: Passes::Refused, ..tan },
        Function {
            name: "tan_quick",
            error: 2.16531,
            limit: TURNS,
            passes: Passes::Refused,
            ..smooth("", core_math::tanf, core_math::tan, 0.0)
        },
        smooth("asin", core_math::asinf, core_math::asin, 0.72224),
        atan,
        smooth("tanh", core_math::tanhf, core_math::tanh, 0.98208),
        smooth("tanh_quick", core_math::tanhf, core_math::tanh, 5.9925),
        smooth("erf", core_math::erff, core_math::erf, 6.43092),
        smooth("sigmoid", |x| logistic(f64::from(x)) as f32, logistic, 2.40188),
        Function {
            passes: Passes::Noisy,
            ..smooth(
                "elu",
                |x| if x < 0.0 { core_math::expm1f(x) } else { x },
                |x| if x < 0.0 { core_math::expm1(x) } else { x },
                1.06734,
            )
        },
    ]
}

impl Function {
    /// Flags that a use raises.
    fn flags(&self, x: f32, result: f32) -> Flags {
        let signaling = x.is_nan() && x.to_bits() & 0x0040_0000 == 0;
        if x.is_nan() {
            let invalid = match self.passes {
                Passes::Untouched => false,
                Passes::Refused => true,
                Passes::Canonical | Passes::Noisy => signaling,
            };
            return if invalid { Flags::INVALID } else { Flags::NONE };
        }
        match (result.is_nan(), result.is_infinite() && x.is_finite()) {
            (true, _) => Flags::INVALID,
            (_, true) if x == self.pole => Flags::DIVIDE_BY_ZERO,
            (_, true) => Flags::OVERFLOW,
            _ => Flags::NONE,
        }
    }

    /// Checks and records a result.
    pub(crate) fn take(&self, measured: &mut ErrorStatistics, x: u32, result: u32, flags: Flags) {
        let operand = f32::from_bits(x);
        let got = f32::from_bits(result);
        let refused = operand.abs() > self.limit;
        let nearest = if refused { f32::NAN } else { (self.nearest)(operand) };
        let name = self.name;
        assert_eq!(
            flags,
            self.flags(operand, nearest),
            "flags of {name} of {x:08x}, which gives {result:08x}"
        );
        measured.operands += 1;
        if nearest.is_nan() {
            let passes = matches!(self.passes, Passes::Untouched | Passes::Noisy) && operand.is_nan();
            let expected = if passes { x } else { takt_isa::fp::CANONICAL_NAN };
            assert_eq!(result, expected, "{name} of {x:08x}");
        } else if result != nearest.to_bits() {
            assert!(
                got.is_finite() && got != 0.0 && self.error > 0.0,
                "{name} of {x:08x} gives {result:08x}, not {:08x}",
                nearest.to_bits()
            );
            measured.miss([x, 0], got, (self.exact)(f64::from(operand)));
        }
    }
}

fn measure(name: &str) {
    let mut wrong = Vec::new();
    // `tan_quick` uses the sine.
    let all = MACHINES.iter().copied().chain((name != "tan_quick").then(bare));
    let functions = all.flat_map(|machine| {
        let all = functions(machine).into_iter().chain(replacements(machine));
        all.filter(|function| function.name == name).map(move |function| (machine, function))
    });
    let functions: Vec<(&Machine, Function)> = functions.collect();
    let first = functions.first().expect("it is in the list").0.name;
    for (machine, function) in functions {
        let program = one_use(machine, &format!("{name} d, x"), 1, "clrflags").program;
        check_emulator(&program, 1);
        // Macros compute the same operations on every machine, except `atan`, which depends on the machine's units.
        if full() && machine.name != first && name != "atan" {
            continue;
        }
        let measured =
            every(&program, |measured, x, result, flags| function.take(measured, x, result, flags));
        wrong.extend(measured.check(&format!("{name} on {}", machine.name), function.error, function.own));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Separate test for each macro, so that each can run alone.
macro_rules! tests {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            measure(stringify!($name));
        })*

        #[test]
        fn every_function_is_measured() {
            for machine in MACHINES {
                let all = functions(machine).into_iter().chain(replacements(bare()));
                let names: Vec<&str> = all.map(|function| function.name).collect();
                assert_eq!(names, [$(stringify!($name)),*]);
            }
        }
    };
}

tests!(floor ceil trunc round rint exp expm1 log log1p tan tan_quick asin atan tanh tanh_quick erf sigmoid elu sin cos acos);
