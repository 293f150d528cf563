// SPDX-License-Identifier: MIT OR Apache-2.0
//! Code generation from a [`Graph`].
//!
//! The code is branch-free up to its end: an address outside of the memory is replaced by 0 and sets an error mark. At the end, if no
//! mark is set, the registers that the block also reads are written. Otherwise these are unchanged, the call reports failure, and the
//! memory words that it has overwritten can be restored from the scratch words.

use super::emit::{Emit, VECTOR, Width};
use super::graph::{Graph, Id, Node};
use super::host::Host;
use super::native::{NativeBlock, signature, target};
use crate::machine::Word;
use cranelift::codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift::codegen::ir::{Function, SigRef, StackSlot, UserFuncName};
use cranelift::prelude::{
    AbiParam, FunctionBuilder, FunctionBuilderContext, InstBuilder, MemFlagsData, Signature, StackSlotData,
    StackSlotKind, Value, types,
};
use takt_isa::{Op, ROWS, compute, compute_lanes, fp};

/// Layout of the scratch words, which hold the results other than registers and memory: the flags, values of watched ports, data words of
/// late loads, and for each store its address and the word it replaced (the undo log).
#[derive(Clone, Copy, Debug)]
pub(super) struct Scratch {
    pub(super) watched: usize,
    pub(super) late: usize,
    pub(super) stored: usize,
    pub(super) end: usize,
}

impl Scratch {
    pub(super) fn new(graph: &Graph, late: usize) -> Scratch {
        let stores = graph.nodes.iter().filter(|node| matches!(node, Node::Store { .. })).count();
        let watched = 1;
        let late_start = watched + graph.watches.len();
        let stored = late_start + late;
        Scratch { watched, late: late_start, stored, end: stored + 2 * stores }
    }
}

/// Computes an operation for which the host has no instruction: its value in the low word, its flags above.
extern "C" fn call(op: u32, a: u32, b: u32, c: u32) -> u64 {
    let value = compute::<fp::Host>(ROWS[op as usize].op, a, b, c);
    u64::from(value.flags.bits()) << 32 | u64::from(value.bits)
}

/// Operands of an operation, each in all lanes of a vector; the result replaces the first.
type Operands = [[u32; VECTOR]; 3];

/// Computes an operation without a host instruction in all lanes of a vector. The upper word of the result is nonzero if the operation
/// raises a flag.
extern "C" fn call_lanes(op: u32, operands: &mut Operands) -> u64 {
    let [a, b, c] = *operands;
    let raised =
        compute_lanes::<fp::ScreenedFloat, VECTOR>(ROWS[op as usize].op, [&a, &b, &c], &mut operands[0]);
    u64::from(raised) << 32
}

/// Representations of a value that have been needed so far.
#[derive(Clone, Copy, Default)]
struct Forms {
    float: Option<Value>,
    integer: Option<Value>,
    /// Boolean: the value is not zero.
    truth: Option<Value>,
    /// Register that holds the value up to the end of the block, if any.
    home: Option<Word>,
    /// The value has had a binary32 representation, perhaps dropped since.
    is_float: bool,
    /// Node of the value's last use.
    used: Id,
}

/// Number of nodes without a use after which a value is loaded again from its register. The host has few registers: the compiler would
/// otherwise spill the value to memory, only to load it from there.
const NEAR: usize = 8;

impl Forms {
    /// Representations of a value before its first use.
    fn of(node: Node) -> Forms {
        let home = if let Node::Entry(word) = node { Some(word) } else { None };
        Forms { home, ..Forms::default() }
    }

    fn is_float(&self) -> bool {
        self.is_float || self.float.is_some()
    }
}

/// Number of sums that collect the checks for infinities and NaNs: several, so that the additions do not depend on each other.
const SUMS: usize = 4;

struct Lowering<'a, 'f> {
    emit: Emit<'f>,
    nodes: &'a [Node],
    forms: Vec<Forms>,
    /// Index of the node under translation.
    now: Id,
    depth: u32,
    scratch: Scratch,
    registers: Value,
    memory: Value,
    words: Value,
    call: SigRef,
    /// Stack slot for a call's [`Operands`], made at the first call.
    operands: Option<StackSlot>,
    fused: bool,
    sums: [Option<Value>; SUMS],
    looked: usize,
    /// Condition that leaves the block to the interpreter, in any lane; it includes the condition on addresses, which all lanes share.
    wrong: Option<Value>,
    wrong_address: Option<Value>,
    /// Flags of calls, in their upper words.
    raised: Option<Value>,
    stores: usize,
    watches: usize,
}

/// Compiles a block, for a data memory of `depth` words; `None` if compiling the block would not be worthwhile.
pub(super) fn lower(graph: &Graph, depth: u32, scratch: Scratch, width: Width) -> Option<NativeBlock> {
    let target = target()?;
    let has =
        |name: &str| target.isa_flags().iter().any(|flag| flag.name == name && flag.as_bool() == Some(true));
    if width != Width::One && !has("has_sse41") {
        return None;
    }
    let looked_at = graph.looked_at()?;
    let mut function = Function::with_name_signature(UserFuncName::default(), signature(target));
    let mut context = FunctionBuilderContext::new();
    let mut builder = FunctionBuilder::new(&mut function, &mut context);
    let entry = builder.create_block();
    builder.append_block_params_for_function_params(entry);
    builder.switch_to_block(entry);
    builder.seal_block(entry);
    let &[registers, memory, words] = builder.block_params(entry) else { return None };
    let mut called = Signature::new(target.default_call_conv());
    called.params.push(AbiParam::new(types::I32));
    called.params.extend(match width {
        Width::One => vec![AbiParam::new(types::I32); 3],
        Width::Vector { .. } => vec![AbiParam::new(types::I64)],
    });
    called.returns.push(AbiParam::new(types::I64));
    let call = builder.import_signature(called);
    let mut lowering = Lowering {
        emit: Emit { builder, width },
        nodes: &graph.nodes,
        forms: graph.nodes.iter().map(|&node| Forms::of(node)).collect(),
        now: 0,
        depth,
        scratch,
        registers,
        memory,
        words,
        call,
        operands: None,
        fused: has("has_fma"),
        sums: [None; SUMS],
        looked: 0,
        wrong: None,
        wrong_address: None,
        raised: None,
        stores: 0,
        watches: 0,
    };
    let (early, last) = graph.places();
    for (id, looked_at) in looked_at.into_iter().enumerate() {
        lowering.now = id;
        lowering.node(id)?;
        for &word in &early[id] {
            lowering.write(word, id);
            lowering.forms[id].home = Some(word);
        }
        if looked_at {
            lowering.look_at(id);
        }
    }
    lowering.finish(graph, &last);
    NativeBlock::new(function, width, depth as usize, scratch.end)
}

impl Lowering<'_, '_> {
    /// Drops the representations of a value in a register that was not used in the last [`NEAR`] nodes.
    fn refresh(&mut self, id: Id) {
        let forms = &mut self.forms[id];
        if forms.home.is_some() && self.now - forms.used > NEAR {
            *forms = Forms { home: forms.home, is_float: forms.is_float(), ..Forms::default() };
        }
        forms.used = self.now;
    }

    fn float(&mut self, id: Id) -> Value {
        self.refresh(id);
        let forms = self.forms[id];
        if let Some(value) = forms.float {
            return value;
        }
        let value = match (self.nodes[id], forms.home) {
            (Node::Constant(bits), _) => self.emit.float_constant(f32::from_bits(bits)),
            (_, Some(word)) => self.emit.load_float(self.registers, word.index()),
            _ => {
                let integer = self.integer(id);
                self.emit.as_float(integer)
            }
        };
        self.forms[id].float = Some(value);
        value
    }

    fn integer(&mut self, id: Id) -> Value {
        self.refresh(id);
        let forms = self.forms[id];
        if let Some(value) = forms.integer {
            return value;
        }
        let value = match self.nodes[id] {
            Node::Constant(bits) => self.emit.constant(bits),
            _ => match (forms.float, forms.truth, forms.home) {
                (Some(float), ..) => self.emit.as_integer(float),
                (_, Some(truth), _) => self.emit.truth_as_integer(truth),
                (.., Some(word)) => self.emit.load(self.registers, word.index()),
                // Stores have no value.
                _ => self.emit.constant(0),
            },
        };
        self.forms[id].integer = Some(value);
        value
    }

    fn truth(&mut self, id: Id) -> Value {
        self.refresh(id);
        if let Some(value) = self.forms[id].truth {
            return value;
        }
        let integer = self.integer(id);
        let value = self.emit.is_not_zero(integer);
        self.forms[id].truth = Some(value);
        value
    }

    /// Disjunction of two marks; the first may be missing.
    fn either(&mut self, mark: Option<Value>, wrong: Value) -> Option<Value> {
        Some(match mark {
            Some(before) => self.emit.builder.ins().bor(before, wrong),
            None => wrong,
        })
    }

    fn mark(&mut self, wrong: Value) {
        self.wrong = self.either(self.wrong, wrong);
    }

    /// Checks a value: its product with zero is zero, or a NaN if it is infinite or a NaN, which a sum then propagates.
    fn look_at(&mut self, id: Id) {
        let value = self.float(id);
        let zero = self.emit.float_constant(0.0);
        let sum = &mut self.sums[self.looked % SUMS];
        self.looked += 1;
        let builder = &mut self.emit.builder;
        *sum = Some(match *sum {
            Some(before) if self.fused => builder.ins().fma(value, zero, before),
            Some(before) => {
                let term = builder.ins().fmul(value, zero);
                builder.ins().fadd(before, term)
            }
            None => builder.ins().fmul(value, zero),
        });
    }

    /// Address of a data word, and its index in every lane. If it is outside of the memory, or if lanes differ, sets the mark and returns
    /// a valid address.
    fn address(&mut self, base: Id, offset: u32) -> (Value, Value) {
        let number = match self.nodes[base] {
            Node::Constant(base) if offset.wrapping_add(base) < self.depth => {
                self.emit.builder.ins().iconst(types::I32, i64::from(offset.wrapping_add(base)))
            }
            _ => {
                let bases = self.integer(base);
                let base = self.emit.first(bases);
                if self.emit.width != Width::One {
                    let first = self.emit.every(base);
                    let differs = self.emit.builder.ins().icmp(IntCC::NotEqual, bases, first);
                    self.mark(differs);
                }
                let builder = &mut self.emit.builder;
                let offset = builder.ins().iconst(types::I32, i64::from(offset));
                let sum = builder.ins().iadd(base, offset);
                let depth = builder.ins().iconst(types::I32, i64::from(self.depth));
                let outside = builder.ins().icmp(IntCC::UnsignedGreaterThanOrEqual, sum, depth);
                let zero = builder.ins().iconst(types::I32, 0);
                let number = builder.ins().select(outside, zero, sum);
                self.wrong_address = self.either(self.wrong_address, outside);
                number
            }
        };
        (self.emit.address(self.memory, number), self.emit.every(number))
    }

    /// Value in any existing representation, to be stored.
    fn any(&mut self, id: Id) -> Value {
        self.refresh(id);
        let Forms { float, integer, .. } = self.forms[id];
        match float {
            Some(float) => float,
            None if integer.is_none() && self.forms[id].is_float => self.float(id),
            None => self.integer(id),
        }
    }

    fn write(&mut self, word: Word, id: Id) {
        let value = self.any(id);
        self.emit.store(value, self.registers, word.index());
    }

    fn put(&mut self, value: Value, place: usize) {
        self.emit.store(value, self.words, place);
    }

    fn node(&mut self, id: Id) -> Option<()> {
        match self.nodes[id] {
            // Constants are emitted at their uses.
            Node::Entry(_) | Node::Constant(_) => {}
            Node::Flags => {
                self.forms[id].integer = Some(self.emit.load(self.words, 0));
            }
            Node::Host(host, sources) if !self.has(host) => {
                // Find the operation of the host instruction.
                let row = ROWS.iter().find(|row| Host::of(row.op) == Some(host))?;
                self.call(id, row.op, sources);
            }
            Node::Host(host, sources) => self.host(id, host, sources),
            Node::Call(op, sources) => self.call(id, op, sources),
            Node::Load { base, offset, late } => {
                if self.depth == 0 {
                    return None;
                }
                let (address, number) = self.address(base, offset);
                self.forms[id].integer = Some(self.emit.load(address, 0));
                if let Some(late) = late {
                    self.put(number, self.scratch.late + late);
                }
            }
            Node::Store { base, offset, value } => {
                if self.depth == 0 {
                    return None;
                }
                let (address, number) = self.address(base, offset);
                let old = self.emit.load(address, 0);
                let place = self.scratch.stored + 2 * self.stores;
                self.put(number, place);
                self.put(old, place + 1);
                let value = self.any(value);
                self.emit.store(value, address, 0);
                self.stores += 1;
            }
            Node::Watched(value) => {
                let value = self.any(value);
                self.put(value, self.scratch.watched + self.watches);
                self.watches += 1;
            }
        }
        Some(())
    }

    /// The host has an instruction at this width: vectors have no shift by a different count in each lane.
    fn has(&self, host: Host) -> bool {
        match host {
            Host::Fused(..) => self.fused,
            Host::ShiftLeft | Host::ShiftRight | Host::ShiftSigned => self.emit.width == Width::One,
            _ => true,
        }
    }

    fn call(&mut self, id: Id, op: Op, sources: [Id; 3]) {
        let sources = sources.map(|source| self.integer(source));
        if self.emit.width != Width::One {
            return self.call_lanes(id, op, sources);
        }
        let function = call as extern "C" fn(u32, u32, u32, u32) -> u64;
        let both = self.call_indirect(op, function as usize, &sources);
        self.forms[id].integer = Some(self.emit.builder.ins().ireduce(types::I32, both));
    }

    fn call_lanes(&mut self, id: Id, op: Op, sources: [Value; 3]) {
        let size = size_of::<Operands>() as u32;
        let builder = &mut self.emit.builder;
        let slot = *self.operands.get_or_insert_with(|| {
            builder.create_sized_stack_slot(StackSlotData::new(StackSlotKind::ExplicitSlot, size, 4))
        });
        let address = builder.ins().stack_addr(types::I64, slot, 0);
        let flags = MemFlagsData::new().with_notrap();
        for (source, offset) in sources.into_iter().zip((0..).step_by(size_of::<Operands>() / 3)) {
            builder.ins().store(flags, source, address, offset);
        }
        let function = call_lanes as extern "C" fn(u32, &mut Operands) -> u64;
        self.call_indirect(op, function as usize, &[address]);
        self.forms[id].integer = Some(self.emit.builder.ins().load(types::I32X4, flags, address, 0));
    }

    /// Calls a function with an operation and further arguments, and keeps the flags that it raises.
    fn call_indirect(&mut self, op: Op, function: usize, arguments: &[Value]) -> Value {
        let builder = &mut self.emit.builder;
        let mut all = vec![builder.ins().iconst(types::I32, op as i64)];
        all.extend(arguments);
        let function = builder.ins().iconst(types::I64, function as i64);
        let inst = builder.ins().call_indirect(self.call, function, &all);
        let result = builder.inst_results(inst)[0];
        self.raised = self.either(self.raised, result);
        result
    }

    fn host(&mut self, id: Id, host: Host, sources: [Id; 3]) {
        match host {
            Host::Copy => self.forms[id] = self.forms[sources[0]],
            Host::Choose => {
                let condition = self.truth(sources[0]);
                let as_float = sources[1..].iter().any(|&source| self.forms[source].is_float());
                if as_float {
                    let (yes, no) = (self.float(sources[1]), self.float(sources[2]));
                    self.forms[id].float = Some(self.emit.choose_float(condition, yes, no));
                } else {
                    let (yes, no) = (self.integer(sources[1]), self.integer(sources[2]));
                    self.forms[id].integer = Some(self.emit.choose(condition, yes, no));
                }
            }
            Host::Sum
            | Host::Difference
            | Host::And
            | Host::Or
            | Host::Xor
            | Host::ShiftLeft
            | Host::ShiftRight
            | Host::ShiftSigned => {
                let (a, b) = (self.integer(sources[0]), self.integer(sources[1]));
                let ins = self.emit.builder.ins();
                // Cranelift's shifts also use the low five bits of the count.
                self.forms[id].integer = Some(match host {
                    Host::Sum => ins.iadd(a, b),
                    Host::Difference => ins.isub(a, b),
                    Host::And => ins.band(a, b),
                    Host::Or => ins.bor(a, b),
                    Host::Xor => ins.bxor(a, b),
                    Host::ShiftLeft => ins.ishl(a, b),
                    Host::ShiftRight => ins.ushr(a, b),
                    _ => ins.sshr(a, b),
                });
            }
            Host::Same | Host::Below | Host::BelowUnsigned => {
                let (a, b) = (self.integer(sources[0]), self.integer(sources[1]));
                let condition = match host {
                    Host::Same => IntCC::Equal,
                    Host::Below => IntCC::SignedLessThan,
                    _ => IntCC::UnsignedLessThan,
                };
                self.forms[id].truth = Some(self.emit.builder.ins().icmp(condition, a, b));
            }
            Host::Equal | Host::Less | Host::LessOrEqual => {
                let (a, b) = (self.float(sources[0]), self.float(sources[1]));
                let condition = match host {
                    Host::Equal => FloatCC::Equal,
                    Host::Less => FloatCC::LessThan,
                    _ => FloatCC::LessThanOrEqual,
                };
                self.forms[id].truth = Some(self.emit.builder.ins().fcmp(condition, a, b));
            }
            Host::FromInteger => {
                let a = self.integer(sources[0]);
                self.forms[id].float = Some(self.emit.signed_as_float(a));
            }
            Host::ToInteger => {
                let a = self.float(sources[0]);
                let (nearest, wrong) = self.emit.nearest(a);
                self.mark(wrong);
                self.forms[id].integer = Some(nearest);
            }
            _ => {
                let value = self.number(host, sources);
                self.forms[id].float = Some(value);
            }
        }
    }

    /// Operations on binary32 with a binary32 result.
    fn number(&mut self, host: Host, sources: [Id; 3]) -> Value {
        let a = self.float(sources[0]);
        if matches!(host, Host::Magnitude | Host::Negation | Host::Root | Host::Sign) {
            let ins = self.emit.builder.ins();
            return match host {
                Host::Magnitude => ins.fabs(a),
                Host::Negation => ins.fneg(a),
                Host::Root => ins.sqrt(a),
                _ => {
                    let one = self.emit.float_constant(1.0);
                    let zero = self.emit.float_constant(0.0);
                    let signed = self.emit.with_sign(one, a);
                    let is_zero = self.emit.builder.ins().fcmp(FloatCC::Equal, a, zero);
                    self.emit.choose_float(is_zero, zero, signed)
                }
            };
        }
        let b = self.float(sources[1]);
        match host {
            Host::Saturation => {
                let limit = self.emit.builder.ins().fabs(b);
                let magnitude = self.emit.builder.ins().fabs(a);
                let outside = self.emit.builder.ins().fcmp(FloatCC::GreaterThan, magnitude, limit);
                let limited = self.emit.with_sign(limit, a);
                self.emit.choose_float(outside, limited, a)
            }
            Host::Fused(product, addend) => {
                let c = self.float(sources[2]);
                let a = if product { self.emit.builder.ins().fneg(a) } else { a };
                let c = if addend { self.emit.builder.ins().fneg(c) } else { c };
                self.emit.builder.ins().fma(a, b, c)
            }
            Host::Add => self.emit.builder.ins().fadd(a, b),
            Host::Subtract => self.emit.builder.ins().fsub(a, b),
            Host::Multiply => self.emit.builder.ins().fmul(a, b),
            Host::Divide => self.emit.builder.ins().fdiv(a, b),
            Host::Minimum => self.emit.builder.ins().fmin(a, b),
            _ => self.emit.builder.ins().fmax(a, b),
        }
    }

    /// Ends the code: writes the registers that the block also reads, unless a mark is set.
    fn finish(mut self, graph: &Graph, last: &[(Word, Id)]) {
        let sums: Vec<Value> = self.sums.into_iter().flatten().collect();
        if let Some(sum) = sums.into_iter().reduce(|a, b| self.emit.builder.ins().fadd(a, b)) {
            let wrong = self.emit.builder.ins().fcmp(FloatCC::Unordered, sum, sum);
            self.mark(wrong);
        }
        let mut wrong = self.wrong_address;
        if let Some(marks) = self.wrong {
            let any = self.emit.any(marks);
            wrong = self.either(wrong, any);
        }
        if let Some(raised) = self.raised {
            let builder = &mut self.emit.builder;
            let upper = builder.ins().iconst(types::I64, 32);
            let flags = builder.ins().ushr(raised, upper);
            let zero = builder.ins().iconst(types::I64, 0);
            let any = builder.ins().icmp(IntCC::NotEqual, flags, zero);
            wrong = self.either(wrong, any);
        }
        if let Some(wrong) = wrong {
            let builder = &mut self.emit.builder;
            let (right, left) = (builder.create_block(), builder.create_block());
            builder.set_cold_block(left);
            builder.ins().brif(wrong, left, &[], right, &[]);
            builder.seal_block(left);
            builder.seal_block(right);
            builder.switch_to_block(left);
            let one = builder.ins().iconst(types::I32, 1);
            builder.ins().return_(&[one]);
            builder.switch_to_block(right);
        }
        // Read all values before writing any, since a word may get the old value of another.
        let values: Vec<(Word, Value)> = last.iter().map(|&(word, id)| (word, self.any(id))).collect();
        for (word, value) in values {
            self.emit.store(value, self.registers, word.index());
        }
        if let Some(flags) = graph.flags {
            let flags = self.integer(flags);
            self.put(flags, 0);
        }
        let zero = self.emit.builder.ins().iconst(types::I32, 0);
        self.emit.builder.ins().return_(&[zero]);
        self.emit.builder.finalize(target().expect("compiling for it").frontend_config());
    }
}
