//! The numbers that name things of a machine, each of a type of its own: a register, its place in a bank, a slot, a bundle.
//!
//! A [`Register`], [`BankIndex`] or [`SlotIndex`] is in its range from the moment that it is made, so that whoever has one
//! need not check it. [`Register::index`] and its like are the only places where they become indices of arrays.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A type of numbers below `COUNT`, which is a power of two.
macro_rules! below {
    ($(#[$text:meta])* $name:ident($inner:ident) $count:literal) => {
        $(#[$text])*
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
        #[serde(transparent)]
        pub struct $name($inner);

        impl $name {
            /// The count of numbers: 0 to `COUNT` - 1.
            pub const COUNT: usize = $count;

            /// The one of this number; `None` if it is not below [`Self::COUNT`].
            #[inline]
            pub const fn new(number: usize) -> Option<$name> {
                if number < Self::COUNT { Some($name(number as $inner)) } else { None }
            }

            /// The one that the low bits of a word name; those above are lost.
            #[inline]
            #[allow(dead_code, reason = "not every type has a field in the instruction word")]
            pub(crate) const fn from_low_bits(bits: u32) -> $name {
                $name((bits & (Self::COUNT as u32 - 1)) as $inner)
            }

            /// The number.
            #[inline]
            pub const fn get(self) -> $inner {
                self.0
            }

            /// The number as an index into an array of [`Self::COUNT`] or more. (The mask changes nothing: it tells the
            /// compiler the range, which then leaves out the check of the array's bounds.)
            #[inline]
            pub const fn index(self) -> usize {
                self.0 as usize & (Self::COUNT - 1)
            }

            /// Every one, ascending.
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
    /// A register: its address in the register space, over all banks of a machine. Whether a machine has a register there, its
    /// banks say ([`crate::Machine::has_register`]).
    Register(u16) 1024
}

below! {
    /// The place of a register in its bank, from 0: what an instruction word has as its destination.
    BankIndex(u16) 1024
}

below! {
    /// An issue slot, by its place in a bundle, from 0. ([`crate::Machine::slot`] takes one that the machine has.)
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

/// The address of a bundle in the program memory. Every number is one: whether a program has a bundle there,
/// [`crate::Program::words`] says.
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

    /// The number.
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

    /// The bundle before in memory; of the first one itself.
    #[inline]
    pub const fn previous(self) -> BundleAddress {
        BundleAddress(self.0.saturating_sub(1))
    }

    /// The bundle so many further on.
    #[inline]
    pub const fn offset(self, bundles: u32) -> BundleAddress {
        BundleAddress(self.0.saturating_add(bundles))
    }

    /// Bundles from `start` up to this one; 0 if it lies before.
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
