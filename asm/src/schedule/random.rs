// SPDX-License-Identifier: MIT OR Apache-2.0
//! Pseudo-random numbers of the scheduler's searches. Their sequence decides which schedule is found, so it never changes.

/// A generator with a fixed seed (xorshift64*, Vigna 2016).
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new() -> Random {
        Random(0x9e37_79b9_7f4a_7c15)
    }

    /// The next number, less than `below`.
    pub(super) fn next(&mut self, below: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) % below.max(1)
    }
}
