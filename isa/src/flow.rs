// SPDX-License-Identifier: MIT OR Apache-2.0
//! Control flow of a bundle: the address at which execution continues. Only this module interprets an [`Effect`] for the order
//! of execution; emulator, blocks and analysis match on [`Flow`].

use crate::encode::Instruction;
use crate::number::{BundleAddress, Register};
use crate::spec::instructions::Effect;

/// The continuation of execution after a bundle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// At the next bundle.
    Next,
    /// At the target, always.
    Jump(BundleAddress),
    /// At the target if all 32 bits of the register are zero (or, if `zero` is false, not all); else at the next bundle.
    Branch {
        /// The register, as the bundle reads it.
        register: Register,
        /// The branch is taken on zero.
        zero: bool,
        /// Bundle of a taken branch.
        target: BundleAddress,
    },
    /// At the target; the address of the next bundle is pushed on the return stack.
    Call(BundleAddress),
    /// At the address popped from the return stack.
    Return,
    /// At the next bundle, the head of a loop: the bundles from there to just before `end` execute as many times as the count
    /// register says.
    Loop {
        /// The register that holds the count, as the bundle reads it.
        count: Register,
        /// The bundle after the loop's last.
        end: BundleAddress,
    },
    /// At the first bundle of the innermost loop if this is its last bundle and iterations are left; else at the next bundle.
    LoopEnd,
    /// At the next bundle; the outputs are published.
    Publish,
    /// At the target, on the tick.
    Wait(BundleAddress),
    /// Nowhere: execution ends here.
    Halt,
}

impl Flow {
    /// The control flow of a bundle's instructions. At most one of them redirects, since a machine has one sequencer
    /// ([`crate::MachineReason::TwoSlots`]).
    pub fn of<'i>(instructions: impl IntoIterator<Item = &'i Instruction>) -> Flow {
        instructions.into_iter().map(Instruction::flow).find(|flow| *flow != Flow::Next).unwrap_or(Flow::Next)
    }

    /// The control flow of the bundle as the last bundle of a loop. A loop may end only where nothing redirects.
    #[must_use]
    pub fn at_loop_end(self) -> Flow {
        if self == Flow::Next { Flow::LoopEnd } else { self }
    }

    /// The target of a jump, a taken branch, a call or a `wait`.
    pub const fn target(self) -> Option<BundleAddress> {
        match self {
            Flow::Jump(target) | Flow::Branch { target, .. } | Flow::Call(target) | Flow::Wait(target) => {
                Some(target)
            }
            Flow::Next | Flow::Return | Flow::Loop { .. } | Flow::LoopEnd | Flow::Publish | Flow::Halt => {
                None
            }
        }
    }
}

impl Instruction {
    /// The control flow of the instruction.
    pub fn flow(&self) -> Flow {
        let target = BundleAddress::new(self.constant);
        let branch = |zero| Flow::Branch { register: self.sources[0], zero, target };
        match self.effect() {
            Effect::Jump => Flow::Jump(target),
            Effect::BranchZero => branch(true),
            Effect::BranchNonzero => branch(false),
            Effect::Call => Flow::Call(target),
            Effect::Return => Flow::Return,
            Effect::Loop => Flow::Loop { count: self.sources[0], end: target },
            Effect::Publish => Flow::Publish,
            Effect::Wait => Flow::Wait(target),
            Effect::Halt => Flow::Halt,
            Effect::Compute
            | Effect::Nothing
            | Effect::Immediate
            | Effect::Load
            | Effect::Store
            | Effect::ReadFlags
            | Effect::ClearFlags => Flow::Next,
        }
    }
}
