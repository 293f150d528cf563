// SPDX-License-Identifier: MIT OR Apache-2.0
//! Newtypes for the numbers of a machine's registers, bank indices, slots and bundles.
//!
//! A [`Register`], [`BankIndex`] or [`SlotIndex`] is checked against its range when it is made, so that its users need no check.
//! Only [`Register::index`] and similar methods convert them to array indices.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Defines a type of numbers below `COUNT`, which is a power of two.
macro_rules! below {
    ($(#[$text:meta])* $name:ident($inner:ident) $count:literal) => {
        $(#[$text])*
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
        #[serde(transparent)]
        pub struct $name($inner);

        impl $name {
            /// Number of values: 0 to `COUNT` - 1.
            pub const COUNT: usize = $count;

            /// Checks and wraps a number; `None` if it is not below [`Self::COUNT`].
            #[inline]
            pub const fn new(number: usize) -> Option<$name> {
                if number < Self::COUNT { Some($name(number as $inner)) } else { None }
            }

            /// Wraps the low bits of a word; the bits above are dropped.
            #[inline]
            #[allow(dead_code, reason = "not every type has a field in the instruction word")]
            pub(crate) const fn from_low_bits(bits: u32) -> $name {
                $name((bits & (Self::COUNT as u32 - 1)) as $inner)
            }

            /// The wrapped number, below [`Self::COUNT`].
            #[inline]
            pub const fn get(self) -> $inner {
                self.0
            }

            /// The number as an index into an array of [`Self::COUNT`] or more. (The mask changes nothing; it lets the compiler omit
            /// the bounds check.)
            #[inline]
            pub const fn index(self) -> usize {
                self.0 as usize & (Self::COUNT - 1)
            }

            /// Every value, in ascending order.
            pub fn all() -> impl DoubleEndedIterator<Item = $name> + ExactSizeIterator + Clone {
                (0..Self::COUNT).map(|number| $name(number as $inner))
            }
        }

        const _: () = assert!($name::COUNT.is_power_of_two() && $name::COUNT - 1 <= $inner::MAX as usize);

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.fmt(f)
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{}({})", stringify!($name), self.0)
            }
        }
    };
}

below! {
    /// A register, by its address in the register space of all banks. A given machine may have no register there
    /// ([`crate::Machine::has_register`]).
    Register(u16) 1024
}

below! {
    /// The index of a register in its bank, from 0, as in the destination of an instruction word.
    BankIndex(u16) 1024
}

below! {
    /// An issue slot, by its position in a bundle, from 0. ([`crate::Machine::slot`] requires a slot of the machine.)
    SlotIndex(u8) 8
}

impl SlotIndex {
    /// The slot whose word comes first in a bundle; every machine has it.
    pub const FIRST: SlotIndex = SlotIndex(0);
}

impl Register {
    /// The register that always reads as zero.
    pub const ZERO: Register = Register(Register::COUNT as u16 - 1);
}

/// The address of a bundle in the program memory. Every number is valid, although a program may have no bundle there
/// ([`crate::Program::words`]).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct BundleAddress(u32);

impl BundleAddress {
    /// The bundle at which execution begins after reset.
    pub const RESET: BundleAddress = BundleAddress(0);

    /// The bundle of this number, from 0.
    #[inline]
    pub const fn new(number: u32) -> BundleAddress {
        BundleAddress(number)
    }

    /// The number of the bundle, from 0.
    #[inline]
    pub const fn get(self) -> u32 {
        self.0
    }

    /// The number as an index.
    #[inline]
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// The bundle that follows in memory.
    #[inline]
    pub const fn next(self) -> BundleAddress {
        self.offset(1)
    }

    /// The bundle before this one in memory; for the first one, itself.
    #[inline]
    pub const fn previous(self) -> BundleAddress {
        BundleAddress(self.0.saturating_sub(1))
    }

    /// The bundle `bundles` further on.
    #[inline]
    pub const fn offset(self, bundles: u32) -> BundleAddress {
        BundleAddress(self.0.saturating_add(bundles))
    }

    /// The number of bundles from `start` up to this one; 0 if this one is before `start`.
    #[inline]
    pub const fn since(self, start: BundleAddress) -> u32 {
        self.0.saturating_sub(start.0)
    }

    /// The bundles from this one on, up to but without `end`.
    pub fn until(self, end: BundleAddress) -> impl DoubleEndedIterator<Item = BundleAddress> + Clone {
        (self.0..end.0).map(BundleAddress)
    }
}

impl fmt::Display for BundleAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Debug for BundleAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "BundleAddress({})", self.0)
    }
}
