// SPDX-License-Identifier: MIT OR Apache-2.0
//! Macros of two operands: powers, over random pairs and all pairs of notable operands, and the remainder, which is exact.

use super::batch::{Batch, LANES};
use super::functions::{bare, has};
use super::measure::{ErrorStatistics, check_emulator, full, notable, parallel};
use super::one_use;
use rand_xoshiro::SplitMix64;
use rand_xoshiro::rand_core::{Rng as _, SeedableRng as _};
use takt_isa::fp::{CANONICAL_NAN, Flags};
use takt_isa::{MACHINES, T3};

/// Largest error of `pow`, ulp, over [`FULL_PAIRS`] random pairs and the pairs of notable operands.
pub(crate) const POW_ERROR: f64 = 0.80832;
/// Bound of the error of `atan2` where the machine has no unit for it, ulp: a quotient just above a power of two, whose angle lies below,
/// carries 1 ulp of it; over 3·10⁸ random pairs, 1.50327.
pub(crate) const ANGLE_ERROR: f64 = 1.52;
/// Number of random pairs with `TAKT_FULL=1`.
const FULL_PAIRS: u64 = 100_000_000;
/// Number of random pairs by default.
const PAIRS: u64 = 1_000_000;
/// Pairs per seed, so that the pairs do not depend on the number of cores.
const CHUNK: u64 = 1 << 14;
/// Steps of the remainder with the small domain, and the quotient that they permit, 2^22.
const STEPS: u32 = 2;

fn is_signaling(x: u32) -> bool {
    f32::from_bits(x).is_nan() && x & 0x0040_0000 == 0
}

/// Generator of the pair with this index.
type PairGenerator = fn(u64, &mut SplitMix64) -> [u32; 2];

/// Runs pairs through a program and records each result.
fn measure(
    program: &takt_isa::Program,
    count: u64,
    draw: PairGenerator,
    take: impl Fn(&mut ErrorStatistics, [u32; 2], u32, Flags) + Sync,
) -> ErrorStatistics {
    let batch = Batch::new(program);
    let special: Vec<[u32; 2]> = notable().flat_map(|x| notable().map(move |y| [x, y])).collect();
    let pieces = parallel(count.div_ceil(CHUNK), |range| {
        let (mut batch, mut measured) = (batch.clone(), ErrorStatistics::default());
        let drawn = range.flat_map(|chunk| {
            let mut random = SplitMix64::seed_from_u64(chunk);
            (0..CHUNK).map(move |index| draw(index, &mut random))
        });
        let mut pairs = special.iter().copied().chain(drawn).peekable();
        while let Some(&first) = pairs.peek() {
            let mut columns = [[0; LANES]; 2];
            let [xs, ys] = &mut columns;
            for (x, y) in xs.iter_mut().zip(ys) {
                [*x, *y] = pairs.next().unwrap_or(first);
            }
            let results = *batch.run(&columns);
            for lane in 0..LANES {
                let pair = [columns[0][lane], columns[1][lane]];
                take(&mut measured, pair, results[lane], batch.flags[lane]);
            }
        }
        measured
    });
    pieces.into_iter().fold(ErrorStatistics::default(), ErrorStatistics::join)
}

/// Operands of a power, in turn: random bits; a base of any size and an exponent that leads to a result of any size; a base near 1;
/// integers and halves.
fn draw_power(index: u64, random: &mut SplitMix64) -> [u32; 2] {
    let bits = random.next_u64();
    let (x, y) = (bits as u32, (bits >> 32) as u32);
    let towards = |x: f32| {
        let exponent = (y % 303_000) as f32 / 1000.0 - 151.0;
        [x.to_bits(), (exponent / x.log2()).to_bits()]
    };
    match index % 4 {
        0 => [x, y],
        1 => towards(f32::from_bits(x & 0x7fff_ffff)),
        2 => towards(f32::from_bits(0x3f80_0000_u32.wrapping_add_signed(x.cast_signed() >> (8 + x % 16)))),
        _ => {
            let exponent = y.cast_signed() % 200;
            [x, (exponent as f32 / 2.0).to_bits()]
        }
    }
}

fn take_power(measured: &mut ErrorStatistics, [x, y]: [u32; 2], result: u32, flags: Flags) {
    let (base, exponent, got) = (f32::from_bits(x), f32::from_bits(y), f32::from_bits(result));
    let nearest = core_math::powf(base, exponent);
    let finite = base.is_finite() && exponent.is_finite();
    let expected = if base.is_nan() || exponent.is_nan() {
        if is_signaling(x) || is_signaling(y) { Flags::INVALID } else { Flags::NONE }
    } else if nearest.is_nan() {
        Flags::INVALID
    } else if nearest.is_infinite() && finite {
        if base == 0.0 { Flags::DIVIDE_BY_ZERO } else { Flags::OVERFLOW }
    } else {
        Flags::NONE
    };
    assert_eq!(flags, expected, "flags of pow of {x:08x}, {y:08x}, which gives {result:08x}");
    measured.operands += 1;
    // The power of 1 to a signaling NaN is left open by IEEE 754.
    let one = y << 1 == 0 || base == 1.0;
    let nearest = if one { 1.0 } else { nearest };
    if nearest.is_nan() {
        assert_eq!(result, CANONICAL_NAN, "pow of {x:08x}, {y:08x}");
    } else if result != nearest.to_bits() {
        let wrong = !got.is_finite() || got == 0.0 && nearest.to_bits() << 1 != 2;
        assert!(!wrong, "pow of {x:08x}, {y:08x} gives {result:08x}, not {:08x}", nearest.to_bits());
        measured.miss([x, y], got, core_math::pow(f64::from(base), f64::from(exponent)));
    }
}

#[test]
fn powers_are_within_the_documented_error() {
    for machine in MACHINES {
        let program = one_use(machine, "pow d, x, y", 2, "clrflags").program;
        check_emulator(&program, 2);
        if full() && machine.name != MACHINES[0].name {
            continue;
        }
        let count = if full() { FULL_PAIRS } else { PAIRS };
        let measured = measure(&program, count, draw_power, take_power);
        assert_eq!(measured.check(&format!("pow on {}", machine.name), POW_ERROR, true), None);
    }
}

/// Operands of an angle, in turn: random bits; any quotient of numbers of like size; quotients near those at which the method changes.
fn draw_angle(index: u64, random: &mut SplitMix64) -> [u32; 2] {
    let bits = random.next_u64();
    let (y, x) = (bits as u32, (bits >> 32) as u32);
    match index % 3 {
        0 => [y, x],
        1 => {
            let exponent = ((x >> 23 & 255) + (y >> 23) % 9).saturating_sub(4).min(254);
            [y & 0x807f_ffff | exponent << 23, x]
        }
        _ => {
            let quotient = [7.0, 11.0, 19.0, 39.0][(y & 3) as usize] / 16.0 * (1.0 + (y >> 8) as f32 * 1e-10);
            [(f32::from_bits(x) * quotient).to_bits(), x ^ y << 31]
        }
    }
}

fn take_angle(measured: &mut ErrorStatistics, [y, x]: [u32; 2], result: u32, flags: Flags) {
    let [a, b, got] = [y, x, result].map(f32::from_bits);
    let nearest = core_math::atan2f(a, b);
    let raised = if nearest.is_nan() { Flags::INVALID } else { Flags::NONE };
    assert_eq!(flags, raised, "flags of the angle of {y:08x}, {x:08x}, which is {result:08x}");
    measured.operands += 1;
    if nearest.is_nan() {
        assert_eq!(result, CANONICAL_NAN, "the angle of {y:08x}, {x:08x}");
    } else if result != nearest.to_bits() {
        assert!(
            got.is_finite() && got.is_sign_negative() == nearest.is_sign_negative() && nearest != 0.0,
            "the angle of {y:08x}, {x:08x} is {result:08x}, not {:08x}",
            nearest.to_bits()
        );
        measured.miss([y, x], got, core_math::atan2(f64::from(a), f64::from(b)));
    }
}

#[test]
fn angles_are_within_the_documented_error() {
    let machines = MACHINES.iter().copied().chain([bare()]).filter(|machine| !has(machine, "fatan2"));
    for (number, machine) in machines.enumerate() {
        let program = one_use(machine, "atan2 d, x, y", 2, "clrflags").program;
        check_emulator(&program, 2);
        if full() && number > 0 {
            continue;
        }
        let measured = measure(&program, if full() { FULL_PAIRS } else { PAIRS }, draw_angle, take_angle);
        assert_eq!(measured.check(&format!("atan2 on {}", machine.name), ANGLE_ERROR, false), None);
    }
}

/// Operands of a remainder, in turn: random bits; quotients up to 2^24; multiples and their neighbours; subnormals.
fn draw_remainder(index: u64, random: &mut SplitMix64) -> [u32; 2] {
    let bits = random.next_u64();
    let (x, y) = (bits as u32, (bits >> 32) as u32);
    match index % 4 {
        0 => [x, y],
        1 => {
            let exponent = ((y >> 23 & 255) + (x >> 23) % 25).min(254);
            [x & 0x807f_ffff | exponent << 23, y]
        }
        2 => {
            let multiple = f32::from_bits(y) * ((x >> 8) as f32);
            [multiple.to_bits().wrapping_add_signed((x & 3).cast_signed() - 1), y]
        }
        _ => [x, y & 0x80ff_ffff],
    }
}

fn take_remainder(measured: &mut ErrorStatistics, [x, y]: [u32; 2], result: u32, flags: Flags, limit: f64) {
    let (a, b) = (f32::from_bits(x), f32::from_bits(y));
    let any_nan = a.is_nan() || b.is_nan();
    // Compare exponents, which are exact, instead of the quotient, which binary64 would round.
    let digits = |v: f64| (v.abs().to_bits() >> 52).cast_signed();
    let far = a.is_finite() && b.is_finite() && b != 0.0 && a != 0.0 && {
        digits(f64::from(a)) - digits(f64::from(b)) > limit as i64
    };
    let exact = if far { f32::NAN } else { a % b };
    measured.operands += 1;
    let expected = if exact.is_nan() { CANONICAL_NAN } else { exact.to_bits() };
    assert_eq!(result, expected, "the remainder of {x:08x} and {y:08x}");
    let invalid = exact.is_nan() && (!any_nan || is_signaling(x) || is_signaling(y));
    let raised = if invalid { Flags::INVALID } else { Flags::NONE };
    assert_eq!(flags, raised, "flags of the remainder of {x:08x} and {y:08x}");
}

#[test]
fn remainders_are_exact() {
    let count = if full() { FULL_PAIRS / 10 } else { PAIRS / 4 };
    for machine in MACHINES {
        let program = one_use(machine, "fmod d, x, y", 2, "clrflags").program;
        check_emulator(&program, 2);
        if full() && machine.name != T3.name {
            continue;
        }
        let measured = measure(&program, count, draw_remainder, |measured, pair, result, flags| {
            take_remainder(measured, pair, result, flags, f64::INFINITY);
        });
        assert_eq!(measured.check(&format!("fmod on {}", machine.name), 0.0, true), None);
        let program = one_use(machine, &format!("fmod_in d, x, y, {STEPS}"), 2, "clrflags").program;
        check_emulator(&program, 2);
        let measured = measure(&program, count, draw_remainder, |measured, pair, result, flags| {
            take_remainder(measured, pair, result, flags, f64::from(11 * STEPS));
        });
        assert_eq!(measured.check(&format!("fmod_in on {}", machine.name), 0.0, true), None);
    }
}
