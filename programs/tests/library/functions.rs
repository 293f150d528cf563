// SPDX-License-Identifier: MIT OR Apache-2.0
//! The macros of one operand: what is known of each, and its measurement.

use super::measure::{Measured, check_emulator, every, full};
use super::one_use;
use takt_isa::fp::Flags;
use takt_isa::{MACHINES, Machine};

/// A macro of one operand.
pub(crate) struct Function {
    pub(crate) name: &'static str,
    /// The correctly rounded result.
    pub(crate) nearest: fn(f32) -> f32,
    /// The same of a wider operand, to measure by.
    pub(crate) exact: fn(f64) -> f64,
    /// The largest error, ulp, found over every operand, on every machine; 0 where the result is always the nearest.
    pub(crate) error: f64,
    /// True if that figure is this test's own: an instruction's stands in the manual.
    pub(crate) own: bool,
    /// Beyond this magnitude, and of a NaN, the result is NaN and invalid.
    pub(crate) limit: f32,
    /// True if a NaN comes out as it went in, unless `noisy` says that a signaling one raises invalid.
    pub(crate) passes: Passes,
}

/// The treatment of a NaN.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Passes {
    /// The canonical one comes out; invalid of a signaling one.
    Canonical,
    /// It comes out as it is, and raises nothing.
    Untouched,
    /// It comes out as it is; invalid of a signaling one.
    Noisy,
    /// The canonical one comes out, and invalid.
    Refused,
}

fn whole(name: &'static str, nearest: fn(f32) -> f32, passes: Passes) -> Function {
    Function { name, nearest, exact: |x| x, error: 0.0, own: true, limit: f32::INFINITY, passes }
}

fn smooth(name: &'static str, nearest: fn(f32) -> f32, exact: fn(f64) -> f64, error: f64) -> Function {
    Function { name, nearest, exact, error, own: true, limit: f32::INFINITY, passes: Passes::Canonical }
}

/// 2π·64, as for the machine's sine.
const TURNS: f32 = f32::from_bits(takt_isa::fp::SIN_LIMIT);

/// 1/(1 + e^-x).
fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + core_math::exp(-x))
}

/// Every macro of one operand on a machine.
pub(crate) fn functions(machine: &Machine) -> Vec<Function> {
    let has_arctangent =
        takt_isa::Op::from_mnemonic("fatan2").is_some_and(|op| machine.host(op.row().function).is_some());
    let atan = smooth("atan", core_math::atanf, core_math::atan, 0.88751);
    let atan = if has_arctangent {
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
        smooth("log", core_math::logf, core_math::log, 0.81752),
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
    /// The flags that a use raises.
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
            (_, true) if x == 0.0 => Flags::DIVIDE_BY_ZERO,
            (_, true) => Flags::OVERFLOW,
            _ => Flags::NONE,
        }
    }

    /// Takes up a result.
    pub(crate) fn take(&self, measured: &mut Measured, x: u32, result: u32, flags: Flags) {
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
    for machine in MACHINES {
        let function = functions(machine).into_iter().find(|function| function.name == name);
        let function = function.expect("it is in the list");
        let program = one_use(machine, &format!("{name} d, x"), 1, "clrflags").program;
        check_emulator(&program, 1);
        // The same operations compute it on every machine, but for what depends on what the machine has.
        if full() && machine.name != MACHINES[0].name && name != "atan" {
            continue;
        }
        let measured =
            every(&program, |measured, x, result, flags| function.take(measured, x, result, flags));
        wrong.extend(measured.check(&format!("{name} on {}", machine.name), function.error, function.own));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// A test for each, so that one can be run alone.
macro_rules! tests {
    ($($name:ident)*) => {
        $(#[test]
        fn $name() {
            measure(stringify!($name));
        })*

        #[test]
        fn every_function_is_measured() {
            for machine in MACHINES {
                let names: Vec<&str> = functions(machine).iter().map(|function| function.name).collect();
                assert_eq!(names, [$(stringify!($name)),*]);
            }
        }
    };
}

tests!(floor ceil trunc round rint exp log tan tan_quick asin atan tanh tanh_quick sigmoid elu);
