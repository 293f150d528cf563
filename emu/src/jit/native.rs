// SPDX-License-Identifier: MIT OR Apache-2.0
//! Executable memory and the call of compiled code: the only module with `unsafe`.
#![expect(unsafe_code, reason = "a call of machine code made at run time has no safe form")]

use super::emit::Width;
use crate::machine::WORDS;
use cranelift::codegen::Context;
use cranelift::codegen::control::ControlPlane;
use cranelift::codegen::ir::Function;
use cranelift::prelude::isa::{OwnedTargetIsa, TargetIsa};
use cranelift::prelude::{AbiParam, Configurable, Signature, settings, types};
use memmap2::{Mmap, MmapMut};
use std::sync::OnceLock;

/// Entry point of a block's code.
type Entry = unsafe extern "C" fn(registers: *mut u32, memory: *mut u32, scratch: *mut u32) -> u32;

/// Compiled block in executable memory.
pub(super) struct NativeBlock {
    code: Mmap,
    width: Width,
    memory: usize,
    scratch: usize,
}

/// Instruction set of the host; `None` if code cannot be made for it.
pub(super) fn target() -> Option<&'static dyn TargetIsa> {
    static TARGET: OnceLock<Option<OwnedTargetIsa>> = OnceLock::new();
    let target = TARGET.get_or_init(|| {
        let mut flags = settings::builder();
        // Cranelift's optimiser would move operations, and so cause spills to memory.
        flags.set("opt_level", "none").ok()?;
        // The verifier checks Cranelift's own output; in release builds it would only cost time.
        flags.set("enable_verifier", if cfg!(debug_assertions) { "true" } else { "false" }).ok()?;
        cranelift::native::builder().ok()?.finish(settings::Flags::new(flags)).ok()
    });
    target.as_deref()
}

/// Signature of a block's code: registers, data memory, scratch words; the result is 0 if the code succeeded.
pub(super) fn signature(target: &dyn TargetIsa) -> Signature {
    let mut signature = Signature::new(target.default_call_conv());
    signature.params.extend([AbiParam::new(types::I64); 3]);
    signature.returns.push(AbiParam::new(types::I32));
    signature
}

impl NativeBlock {
    /// Compiles a function with [`signature`] to machine code. The function must not access more than [`WORDS`] registers, `memory`
    /// words of data memory and `scratch` words, for each run of `width`. `None` if it cannot be compiled, or memory runs out.
    pub(super) fn new(
        function: Function,
        width: Width,
        memory: usize,
        scratch: usize,
    ) -> Option<NativeBlock> {
        let target = target()?;
        let mut context = Context::for_function(function);
        let compiled = context.compile(target, &mut ControlPlane::default()).ok()?;
        // Calls are by address, so no relocations are needed.
        if !compiled.buffer.relocs().is_empty() {
            return None;
        }
        let code = compiled.code_buffer();
        let mut pages = MmapMut::map_anon(code.len()).ok()?;
        pages.copy_from_slice(code);
        Some(NativeBlock { code: pages.make_exec().ok()?, width, memory, scratch })
    }

    /// Runs the block in the lanes of one vector, from `lane` on (scalar code: in lane 0 only). Returns false if a check failed; then, in
    /// these lanes, every register that the block reads before it writes it is unchanged.
    pub(super) fn call(
        &self,
        registers: &mut [u32],
        memory: &mut [u32],
        scratch: &mut [u32],
        lane: usize,
    ) -> bool {
        let NativeBlock { width, memory: depth, scratch: places, .. } = *self;
        let stride = width.stride();
        assert!(lane + width.lanes() <= stride, "the batch has no such lanes");
        assert!(registers.len() >= WORDS * stride, "the block needs more registers");
        assert!(
            memory.len() >= depth * stride && scratch.len() >= places * stride,
            "the block needs more words"
        );
        // SAFETY: the pages hold a whole function of this signature and calling convention, made by Cranelift; they are
        // executable and stay where they are as long as `self` lives. `lower`, which alone makes such functions, addresses
        // the registers by `Word::index`, which is below `WORDS`, the memory by indices compared with `self.memory`, and
        // the scratch words by numbers below `self.scratch`; the word of a number in lane `lane` is `lane` words after
        // `number * stride`, and those of a vector's lanes follow it, fewer than `stride` in all. So all are within the
        // lengths above. The three are borrowed for the time of the call, and nothing of them is kept.
        let status = unsafe {
            let entry = std::mem::transmute::<*const u8, Entry>(self.code.as_ptr());
            entry(
                registers.as_mut_ptr().add(lane),
                memory.as_mut_ptr().wrapping_add(lane),
                scratch.as_mut_ptr().add(lane),
            )
        };
        status == 0
    }
}
