// SPDX-License-Identifier: MIT OR Apache-2.0
//! Operands for the arithmetic tests, and their number.
//!
//! Two environment variables set the effort. `TAKT_TEST_SCALE` multiplies the number of random operands (default 1,
//! which is 10⁶ per operation with debug assertions and 10⁷ without). `TAKT_FULL=1` runs every one of the 2³² operands
//! where a test has a single one; otherwise a stride samples them.

use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng as _, SeedableRng as _};
use std::ops::Range;
use std::thread;

pub(crate) const SIGN: u32 = 0x8000_0000;
pub(crate) const INFINITY: u32 = 0x7f80_0000;

/// Random operands per operation.
pub(crate) fn random_count() -> u64 {
    let base = if cfg!(debug_assertions) { 1_000_000 } else { 10_000_000 };
    let scale = std::env::var("TAKT_TEST_SCALE").map_or(1.0, |text| {
        text.parse::<f64>().unwrap_or_else(|_| panic!("TAKT_TEST_SCALE is {text:?}, not a number"))
    });
    let count = (base as f64 * scale) as u64;
    assert!(count >= 1000, "TAKT_TEST_SCALE leaves {count} operands, which is no test");
    count
}

/// Every operand is tested instead of a sample (`TAKT_FULL=1`).
pub(crate) fn full() -> bool {
    std::env::var("TAKT_FULL").is_ok_and(|text| text == "1")
}

/// Cuts `0..count` into one piece per core, runs `work` on each, and returns all results.
pub(crate) fn parallel<T: Send>(count: u64, work: impl Fn(Range<u64>) -> T + Sync) -> Vec<T> {
    let pieces = thread::available_parallelism().map_or(1, |n| n.get() as u64);
    thread::scope(|scope| {
        let spawn = |piece| {
            let range = count * piece / pieces..count * (piece + 1) / pieces;
            let work = &work;
            scope.spawn(move || work(range))
        };
        let handles: Vec<_> = (0..pieces).map(spawn).collect();
        let join = |handle: thread::ScopedJoinHandle<'_, T>| {
            handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        handles.into_iter().map(join).collect()
    })
}

/// Random numbers from a seed.
pub(crate) struct Random(Pcg64);

impl Random {
    pub(crate) fn new(seed: u64) -> Random {
        Random(Pcg64::seed_from_u64(seed))
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0.next_u64()
    }

    pub(crate) fn bits(&mut self) -> u32 {
        (self.next() >> 32) as u32
    }

    /// Uniform integer in `low..=high`.
    pub(crate) fn between(&mut self, low: i32, high: i32) -> i32 {
        let span = (i64::from(high) - i64::from(low) + 1) as u64;
        (i64::from(low) + (((self.next() >> 32) * span) >> 32) as i64) as i32
    }
}

/// Values at which floating-point units go wrong, of both signs: 128 of them.
pub(crate) fn special_values() -> Vec<u32> {
    let mut values = vec![
        0x0000_0000, // zero
        0x0000_0001, // smallest subnormal
        0x0000_0002,
        0x0000_0003,
        0x0000_0fff,
        0x0010_0000,
        0x0020_0001,
        0x003f_ffff,
        0x0040_0000, // half the smallest normal
        0x0040_0001,
        0x007f_fffe,
        0x007f_ffff, // largest subnormal
        0x0080_0000, // smallest normal
        0x0080_0001,
        0x00ff_ffff,
        0x0100_0000,
        0x0100_0001,
        0x0b80_0000, // 2^-104
        0x1f80_0000, // 2^-64, whose square is subnormal-free, and 2^-65, …
        0x2000_0000, // 2^-63
        0x32ff_ffff,
        0x3300_0000, // 2^-25
        0x3380_0000, // 2^-24, half a unit in the last place of 1
        0x3380_0001,
        0x3400_0000, // 2^-23
        0x3e80_0000, // 0.25
        0x3eff_ffff,
        0x3f00_0000, // 0.5
        0x3f00_0001,
        0x3f2a_aaab, // 2/3
        0x3f7f_fffe,
        0x3f7f_ffff, // just below 1
        0x3f80_0000, // 1
        0x3f80_0001,
        0x3f80_0002,
        0x3fb5_04f3, // √2
        0x3fbf_ffff,
        0x3fc0_0000, // 1.5
        0x3fff_ffff,
        0x4000_0000, // 2
        0x4020_0000, // 2.5
        0x4049_0fdb, // π
        0x4060_0000, // 3.5
        0x4b00_0000, // 2^23
        0x4b00_0001,
        0x4b7f_ffff,
        0x4b80_0000, // 2^24
        0x4eff_ffff, // largest below 2^31
        0x4f00_0000, // 2^31
        0x4f00_0001,
        0x4f80_0000, // 2^32
        0x5f7f_ffff,
        0x5f80_0000, // 2^64, whose square overflows
        0x7e80_0000,
        0x7eff_ffff,
        0x7f00_0000, // 2^127
        0x7f7f_fffe,
        0x7f7f_ffff, // largest finite
        0x7f80_0000, // infinity
        0x7f80_0001, // signaling NaNs
        0x7fa5_5aa5,
        0x7fbf_ffff,
        0x7fc0_0000, // quiet NaNs
        0x7fc0_0001,
        0x7fff_ffff,
    ];
    values.extend_from_within(..);
    let half = values.len() / 2;
    values[half..].iter_mut().for_each(|bits| *bits |= SIGN);
    values
}

/// Pairs of operands after the pattern of Berkeley TestFloat's generator: some uniform, most where rounding, cancellation,
/// subnormal results or overflow are decided.
pub(crate) struct Pairs {
    random: Random,
    specials: Vec<u32>,
}

impl Pairs {
    pub(crate) fn new(seed: u64) -> Pairs {
        Pairs { random: Random::new(seed), specials: special_values() }
    }

    fn pack(&mut self, exponent: i32, fraction: u32) -> u32 {
        self.random.bits() & SIGN | (exponent.clamp(0, 254) as u32) << 23 | fraction & 0x007f_ffff
    }

    /// A fraction of few ones, few zeros, one run, or uniform.
    fn fraction(&mut self) -> u32 {
        let (a, b, c) = (self.random.bits(), self.random.between(0, 23), self.random.between(0, 23));
        match a >> 30 {
            0 => 1 << b >> 1 | 1 << c >> 1,
            1 => !(1 << b | 1 << c),
            2 => u32::MAX << b ^ u32::MAX << c,
            _ => a,
        }
    }

    /// A finite number of any exponent with a structured fraction.
    fn finite(&mut self) -> u32 {
        let (exponent, fraction) = (self.random.between(0, 254), self.fraction());
        self.pack(exponent, fraction)
    }

    /// A special value or one of its neighbours.
    fn special(&mut self) -> u32 {
        let index = self.random.between(0, self.specials.len() as i32 - 1) as usize;
        let offset = if self.random.bits() & 1 == 0 { 0 } else { self.random.between(-3, 3) };
        self.specials[index].wrapping_add_signed(offset)
    }

    /// `a` and a number of exponent `exponent`.
    fn with_exponent(&mut self, a: u32, exponent: i32) -> (u32, u32) {
        let fraction = self.fraction();
        (a, self.pack(exponent, fraction))
    }

    /// An odd significand of exactly `width` bits, as a number of any exponent.
    fn short_odd(&mut self, width: i32) -> u32 {
        let significand = 1 << (width - 1) | self.random.bits() & ((1 << (width - 1)) - 1) | 1;
        let exponent = self.random.between(40, 210);
        self.pack(exponent, significand << (24 - width))
    }

    pub(crate) fn next(&mut self) -> (u32, u32) {
        let kind = self.random.between(0, 15);
        match kind {
            0 | 1 => (self.random.bits(), self.random.bits()),
            2 => (self.special(), self.special()),
            3 => (self.special(), self.finite()),
            4 => (self.finite(), self.special()),
            5 => (self.finite(), self.finite()),
            // Close exponents.
            6 | 7 => {
                let a = self.finite();
                let exponent = exponent(a) + self.random.between(-27, 27);
                self.with_exponent(a, exponent)
            }
            // Cancellation: equal but for the last bits, or for one binade.
            8 => {
                let a = self.finite();
                (a, (a ^ self.random.bits() & SIGN).wrapping_add_signed(self.random.between(-5, 5)))
            }
            9 => {
                let a = self.finite();
                let exponent = exponent(a) + self.random.between(-2, 2);
                self.with_exponent(a, exponent)
            }
            // Halfway between two sums: b is about half a unit in the last place of a.
            10 => {
                let a = self.finite();
                let b = self.pack(exponent(a) - 24, 0);
                (a, b.wrapping_add_signed(self.random.between(-1, 1)))
            }
            // Halfway between two products: odd significands whose product has 25 bits.
            11 => {
                let width = self.random.between(2, 23);
                let other = 25 + (self.random.bits() & 1) as i32 - width;
                (self.short_odd(width), self.short_odd(other.min(24)))
            }
            // Products, quotients and sums about the smallest normal number.
            12 => {
                let a = self.finite();
                let exponent = 128 - exponent(a) + self.random.between(-26, 2);
                self.with_exponent(a, exponent)
            }
            13 => {
                let a = self.finite();
                let exponent = exponent(a) + 126 + self.random.between(-2, 26);
                self.with_exponent(a, exponent)
            }
            14 => {
                let (low, high) = (self.random.between(0, 3), self.random.between(0, 3));
                let fraction = self.fraction();
                let a = self.pack(low, fraction);
                self.with_exponent(a, high)
            }
            // Products, quotients and sums about the largest finite number.
            _ => {
                let a = self.finite();
                let offset = self.random.between(-2, 2);
                let exponent = match self.random.bits() >> 30 {
                    0 | 1 => 127 + 254 - exponent(a) + offset,
                    2 => exponent(a) - 127 + offset,
                    _ => return (a & SIGN | 0x7f00_0000 | a & 0x007f_ffff, self.pack(254, a >> 3)),
                };
                self.with_exponent(a, exponent)
            }
        }
    }
}

/// Operands of a fused product and sum: a pair of [`Pairs`], and an addend, most often where cancellation, rounding, or the
/// subnormal remainder of both is decided.
pub(crate) struct Triples {
    pairs: Pairs,
}

impl Triples {
    pub(crate) fn new(seed: u64) -> Triples {
        Triples { pairs: Pairs::new(seed) }
    }

    pub(crate) fn next(&mut self) -> (u32, u32, u32) {
        let (mut a, mut b) = self.pairs.next();
        let pairs = &mut self.pairs;
        let kind = pairs.random.between(0, 15);
        if kind >= 13 {
            // A subnormal factor: its product begins with zeros. Or one factor with few ones, whose product ends with zeros.
            a = if kind == 13 { a & (SIGN | 0x007f_ffff) } else { pairs.finite() & 0xfff0_0000 };
            let exponent = pairs.random.between(if kind == 13 { 100 } else { 60 }, 254);
            b = pairs.with_exponent(a, exponent).1;
        }
        // (1 + i·2⁻²³)(1 - i·2⁻²³) is closer to 1 than binary64 sees beside an addend for which 1 is half a unit of the last
        // place. Half of these products are half the smallest subnormal number.
        let tiny = pairs.random.bits() & 1 == 0;
        if kind == 11 {
            let (i, exponent) =
                (pairs.random.bits() & 7, pairs.random.between(1, if tiny { 102 } else { 254 }));
            a = pairs.pack(exponent, i);
            let other = if tiny { 103 - exponent } else { pairs.random.between(80, 200) };
            b = pairs.pack(other, 0x0080_0000 - 2 * i);
        }
        // A product halfway between two numbers, and one bit, far below, that decides.
        if kind == 15 {
            let width = pairs.random.between(2, 23);
            let exponents = pairs.random.between(121, 181);
            let first = pairs.random.between(1, exponents - 1);
            let at = |number: u32, exponent: i32| number & 0x807f_ffff | (exponent as u32) << 23;
            a = at(pairs.short_odd(width), first);
            b = at(pairs.short_odd(25 - width), exponents - first);
        }
        let product = (f64::from(f32::from_bits(a)) * f64::from(f32::from_bits(b))) as f32;
        let (bits, at) = (product.to_bits(), exponent(product.to_bits()));
        let c = match kind {
            0 => pairs.random.bits(),
            1 | 2 => pairs.special(),
            3 => pairs.finite(),
            // Any distance at which both operands affect the result, and a little more.
            4 | 5 | 13 | 14 => {
                let exponent = at + pairs.random.between(-52, 28);
                pairs.with_exponent(a, exponent).1
            }
            // Cancellation of the product, except for its last places, which binary32 does not hold, or for a difference of one binade.
            6..=8 => (bits ^ SIGN).wrapping_add_signed(pairs.random.between(-3, 3)),
            9 => {
                let exponent = at + pairs.random.between(-2, 2);
                pairs.with_exponent(a, exponent).1
            }
            // The addend is about half a unit of the product's last place, or the product of the addend's.
            10 => pairs.pack(at - 24, 0).wrapping_add_signed(pairs.random.between(-1, 1)),
            11 => {
                let fraction = pairs.fraction();
                pairs.pack(if tiny { 0 } else { at + 24 }, fraction)
            }
            15 => pairs.random.bits() & SIGN | 1 << pairs.random.between(0, 22),
            // Sums about the largest number.
            _ => bits & SIGN | 0x7f00_0000 | pairs.fraction() & 0x00ff_ffff,
        };
        (a, b, c)
    }
}

fn exponent(a: u32) -> i32 {
    (a >> 23 & 0xff) as i32
}
