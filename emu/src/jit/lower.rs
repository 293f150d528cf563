//! Code for a [`Graph`].
//!
//! It has one way through and decides nothing before its end: an address outside the memory becomes 0 and a mark. At the end
//! either nothing was out of the ordinary, and the registers that the block also reads are written, or the code says so: then
//! these are as they were, and the words of memory that it has overwritten are among the scratch words.

use super::graph::{Graph, Id, Node};
use super::host::Host;
use super::native::{Native, signature, target};
use crate::machine::Word;
use cranelift::codegen::ir::condcodes::{FloatCC, IntCC};
use cranelift::codegen::ir::{Function, SigRef, UserFuncName};
use cranelift::prelude::{
    AbiParam, FunctionBuilder, FunctionBuilderContext, Ieee32, InstBuilder, MemFlagsData, Signature, Value,
    types,
};
use takt_isa::{Op, ROWS, compute, fp};

/// Where a block's code finds and leaves what is neither register nor memory: the flags, values of watched ports, data words
/// of late loads, then for each store its address and the word it replaced.
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

/// What the code calls for an operation that the host has no instruction for: its value, and above that its flags.
extern "C" fn call(op: u32, a: u32, b: u32, c: u32) -> u64 {
    let value = compute::<fp::Host>(ROWS[op as usize].op, a, b, c);
    u64::from(value.flags.bits()) << 32 | u64::from(value.bits)
}

/// A value in the forms in which it was needed so far.
#[derive(Clone, Copy, Default)]
struct Forms {
    float: Option<Value>,
    integer: Option<Value>,
    /// Not zero exactly if the value is not.
    truth: Option<Value>,
}

/// Sums that tell whether one of their terms was no number: several, so that none waits long for the other.
const SUMS: usize = 4;

struct Lowering<'a, 'f> {
    builder: FunctionBuilder<'f>,
    nodes: &'a [Node],
    forms: Vec<Forms>,
    depth: u32,
    scratch: Scratch,
    registers: Value,
    memory: Value,
    words: Value,
    call: SigRef,
    fused: bool,
    sums: [Option<Value>; SUMS],
    looked: usize,
    /// Marks of what went wrong: bytes, not zero if it did.
    wrong: Option<Value>,
    /// Flags of calls, in their upper words.
    raised: Option<Value>,
    stores: usize,
    watches: usize,
}

const TRUSTED: MemFlagsData = MemFlagsData::trusted();

/// The code of a block, for a data memory of `depth` words; `None` if there is none that is worth while.
pub(super) fn lower(graph: &Graph, depth: u32, scratch: Scratch) -> Option<Native> {
    let target = target()?;
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
    called.params.extend([AbiParam::new(types::I32); 4]);
    called.returns.push(AbiParam::new(types::I64));
    let call = builder.import_signature(called);
    let mut lowering = Lowering {
        builder,
        nodes: &graph.nodes,
        forms: vec![Forms::default(); graph.nodes.len()],
        depth,
        scratch,
        registers,
        memory,
        words,
        call,
        fused: target.isa_flags().iter().any(|flag| flag.name == "has_fma" && flag.as_bool() == Some(true)),
        sums: [None; SUMS],
        looked: 0,
        wrong: None,
        raised: None,
        stores: 0,
        watches: 0,
    };
    let (early, last) = graph.places();
    for (id, looked_at) in looked_at.into_iter().enumerate() {
        lowering.node(id)?;
        for &word in &early[id] {
            lowering.write(word, id);
        }
        if looked_at {
            lowering.look_at(id);
        }
    }
    lowering.finish(graph, &last);
    Native::new(function, depth as usize, scratch.end)
}

fn offset(word: Word) -> i32 {
    4 * word.index() as i32
}

impl Lowering<'_, '_> {
    fn float(&mut self, id: Id) -> Value {
        if let Some(value) = self.forms[id].float {
            return value;
        }
        let value = match (self.nodes[id], self.forms[id].integer) {
            (Node::Constant(bits), _) => self.builder.ins().f32const(Ieee32::with_bits(bits)),
            (Node::Entry(word), _) => {
                self.builder.ins().load(types::F32, TRUSTED, self.registers, offset(word))
            }
            _ => {
                let integer = self.integer(id);
                self.builder.ins().bitcast(types::F32, MemFlagsData::new(), integer)
            }
        };
        self.forms[id].float = Some(value);
        value
    }

    fn integer(&mut self, id: Id) -> Value {
        let forms = self.forms[id];
        if let Some(value) = forms.integer {
            return value;
        }
        let value = match self.nodes[id] {
            Node::Constant(bits) => self.builder.ins().iconst(types::I32, i64::from(bits)),
            Node::Entry(word) => self.builder.ins().load(types::I32, TRUSTED, self.registers, offset(word)),
            _ => match (forms.float, forms.truth) {
                (Some(float), _) => self.builder.ins().bitcast(types::I32, MemFlagsData::new(), float),
                // A comparison's, 0 or 1.
                (_, Some(truth)) => self.builder.ins().uextend(types::I32, truth),
                // It has none: a store.
                _ => self.builder.ins().iconst(types::I32, 0),
            },
        };
        self.forms[id].integer = Some(value);
        value
    }

    fn truth(&mut self, id: Id) -> Value {
        if let Some(value) = self.forms[id].truth {
            return value;
        }
        let integer = self.integer(id);
        let zero = self.builder.ins().iconst(types::I32, 0);
        let value = self.builder.ins().icmp(IntCC::NotEqual, integer, zero);
        self.forms[id].truth = Some(value);
        value
    }

    fn mark(&mut self, wrong: Value) {
        let all = match self.wrong {
            Some(before) => self.builder.ins().bor(before, wrong),
            None => wrong,
        };
        self.wrong = Some(all);
    }

    /// Times zero it is zero, or a NaN that no sum loses.
    fn look_at(&mut self, id: Id) {
        let value = self.float(id);
        let zero = self.builder.ins().f32const(0.0);
        let sum = &mut self.sums[self.looked % SUMS];
        self.looked += 1;
        *sum = Some(match *sum {
            Some(before) if self.fused => self.builder.ins().fma(value, zero, before),
            Some(before) => {
                let term = self.builder.ins().fmul(value, zero);
                self.builder.ins().fadd(before, term)
            }
            None => self.builder.ins().fmul(value, zero),
        });
    }

    /// The address of a data word, and its number. Outside the memory: that of word 0, and a mark.
    fn address(&mut self, base: Id, offset: u32) -> (Value, Value) {
        let number = match self.nodes[base] {
            Node::Constant(base) if offset.wrapping_add(base) < self.depth => {
                self.builder.ins().iconst(types::I32, i64::from(offset.wrapping_add(base)))
            }
            _ => {
                let base = self.integer(base);
                let offset = self.builder.ins().iconst(types::I32, i64::from(offset));
                let sum = self.builder.ins().iadd(base, offset);
                let depth = self.builder.ins().iconst(types::I32, i64::from(self.depth));
                let outside = self.builder.ins().icmp(IntCC::UnsignedGreaterThanOrEqual, sum, depth);
                self.mark(outside);
                let zero = self.builder.ins().iconst(types::I32, 0);
                self.builder.ins().select(outside, zero, sum)
            }
        };
        let wide = self.builder.ins().uextend(types::I64, number);
        let two = self.builder.ins().iconst(types::I64, 2);
        let bytes = self.builder.ins().ishl(wide, two);
        (self.builder.ins().iadd(self.memory, bytes), number)
    }

    /// A value in the form in which it is there, to be stored.
    fn any(&mut self, id: Id) -> Value {
        match self.forms[id].float {
            Some(float) => float,
            None => self.integer(id),
        }
    }

    fn write(&mut self, word: Word, id: Id) {
        let value = self.any(id);
        self.builder.ins().store(TRUSTED, value, self.registers, offset(word));
    }

    fn put(&mut self, value: Value, place: usize) {
        self.builder.ins().store(TRUSTED, value, self.words, 4 * place as i32);
    }

    fn node(&mut self, id: Id) -> Option<()> {
        match self.nodes[id] {
            // Where they are needed.
            Node::Entry(_) | Node::Constant(_) => {}
            Node::Flags => {
                let flags = self.builder.ins().load(types::I32, TRUSTED, self.words, 0);
                self.forms[id].integer = Some(flags);
            }
            Node::Host(Host::Fused(..), sources) if !self.fused => {
                // The operation is found by what it computes, from among those that are told by it.
                let Node::Host(host, _) = self.nodes[id] else { return None };
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
                let word = self.builder.ins().load(types::I32, TRUSTED, address, 0);
                self.forms[id].integer = Some(word);
                if let Some(late) = late {
                    self.put(number, self.scratch.late + late);
                }
            }
            Node::Store { base, offset, value } => {
                if self.depth == 0 {
                    return None;
                }
                let (address, number) = self.address(base, offset);
                let old = self.builder.ins().load(types::I32, TRUSTED, address, 0);
                let place = self.scratch.stored + 2 * self.stores;
                self.put(number, place);
                self.put(old, place + 1);
                let value = self.any(value);
                self.builder.ins().store(TRUSTED, value, address, 0);
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

    fn call(&mut self, id: Id, op: Op, sources: [Id; 3]) {
        let [a, b, c] = sources.map(|source| self.integer(source));
        let op = self.builder.ins().iconst(types::I32, op as i64);
        let function = call as extern "C" fn(u32, u32, u32, u32) -> u64;
        let function = self.builder.ins().iconst(types::I64, function as usize as i64);
        let inst = self.builder.ins().call_indirect(self.call, function, &[op, a, b, c]);
        let both = self.builder.inst_results(inst)[0];
        self.forms[id].integer = Some(self.builder.ins().ireduce(types::I32, both));
        self.raised = Some(match self.raised {
            Some(before) => self.builder.ins().bor(before, both),
            None => both,
        });
    }

    fn host(&mut self, id: Id, host: Host, sources: [Id; 3]) {
        match host {
            Host::Copy => self.forms[id] = self.forms[sources[0]],
            Host::Choose => {
                let condition = self.truth(sources[0]);
                let as_float = sources[1..].iter().any(|&source| self.forms[source].float.is_some());
                if as_float {
                    let (yes, no) = (self.float(sources[1]), self.float(sources[2]));
                    self.forms[id].float = Some(self.builder.ins().select(condition, yes, no));
                } else {
                    let (yes, no) = (self.integer(sources[1]), self.integer(sources[2]));
                    self.forms[id].integer = Some(self.builder.ins().select(condition, yes, no));
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
                let ins = self.builder.ins();
                // Cranelift's shifts are by the low five bits too.
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
                self.forms[id].truth = Some(self.builder.ins().icmp(condition, a, b));
            }
            Host::Equal | Host::Less | Host::LessOrEqual => {
                let (a, b) = (self.float(sources[0]), self.float(sources[1]));
                let condition = match host {
                    Host::Equal => FloatCC::Equal,
                    Host::Less => FloatCC::LessThan,
                    _ => FloatCC::LessThanOrEqual,
                };
                self.forms[id].truth = Some(self.builder.ins().fcmp(condition, a, b));
            }
            Host::FromInteger => {
                let a = self.integer(sources[0]);
                self.forms[id].float = Some(self.builder.ins().fcvt_from_sint(types::F32, a));
            }
            Host::ToInteger => self.nearest_integer(id, sources[0]),
            _ => {
                let value = self.number(host, sources);
                self.forms[id].float = Some(value);
            }
        }
    }

    /// As `takt_isa::fp::Host` has it: a sum that rounds at the units' place, in its low word the integer.
    fn nearest_integer(&mut self, id: Id, source: Id) {
        let a = self.float(source);
        let magnitude = self.builder.ins().fabs(a);
        let limit = self.builder.ins().f32const(2_147_483_648.0);
        let wrong = self.builder.ins().fcmp(FloatCC::UnorderedOrGreaterThanOrEqual, magnitude, limit);
        self.mark(wrong);
        let wide = self.builder.ins().fpromote(types::F64, a);
        let units = self.builder.ins().f64const(6_755_399_441_055_744.0);
        let rounded = self.builder.ins().fadd(wide, units);
        let bits = self.builder.ins().bitcast(types::I64, MemFlagsData::new(), rounded);
        self.forms[id].integer = Some(self.builder.ins().ireduce(types::I32, bits));
    }

    /// Operations on binary32 that give one.
    fn number(&mut self, host: Host, sources: [Id; 3]) -> Value {
        let a = self.float(sources[0]);
        if matches!(host, Host::Magnitude | Host::Negation | Host::Root | Host::Sign) {
            let ins = self.builder.ins();
            return match host {
                Host::Magnitude => ins.fabs(a),
                Host::Negation => ins.fneg(a),
                Host::Root => ins.sqrt(a),
                _ => {
                    let one = self.builder.ins().f32const(1.0);
                    let zero = self.builder.ins().f32const(0.0);
                    let signed = self.builder.ins().fcopysign(one, a);
                    let is_zero = self.builder.ins().fcmp(FloatCC::Equal, a, zero);
                    self.builder.ins().select(is_zero, zero, signed)
                }
            };
        }
        let b = self.float(sources[1]);
        match host {
            Host::Saturation => {
                let limit = self.builder.ins().fabs(b);
                let magnitude = self.builder.ins().fabs(a);
                let outside = self.builder.ins().fcmp(FloatCC::GreaterThan, magnitude, limit);
                let limited = self.builder.ins().fcopysign(limit, a);
                self.builder.ins().select(outside, limited, a)
            }
            Host::Fused(product, addend) => {
                let c = self.float(sources[2]);
                let a = if product { self.builder.ins().fneg(a) } else { a };
                let c = if addend { self.builder.ins().fneg(c) } else { c };
                self.builder.ins().fma(a, b, c)
            }
            Host::Add => self.builder.ins().fadd(a, b),
            Host::Subtract => self.builder.ins().fsub(a, b),
            Host::Multiply => self.builder.ins().fmul(a, b),
            Host::Divide => self.builder.ins().fdiv(a, b),
            Host::Minimum => self.builder.ins().fmin(a, b),
            _ => self.builder.ins().fmax(a, b),
        }
    }

    /// Writes the other registers, unless something was out of the ordinary.
    fn finish(mut self, graph: &Graph, last: &[(Word, Id)]) {
        let sums: Vec<Value> = self.sums.into_iter().flatten().collect();
        if let Some(sum) = sums.into_iter().reduce(|a, b| self.builder.ins().fadd(a, b)) {
            let wrong = self.builder.ins().fcmp(FloatCC::Unordered, sum, sum);
            self.mark(wrong);
        }
        if let Some(raised) = self.raised {
            let upper = self.builder.ins().iconst(types::I64, 32);
            let flags = self.builder.ins().ushr(raised, upper);
            let zero = self.builder.ins().iconst(types::I64, 0);
            let wrong = self.builder.ins().icmp(IntCC::NotEqual, flags, zero);
            self.mark(wrong);
        }
        if let Some(wrong) = self.wrong {
            let (right, left) = (self.builder.create_block(), self.builder.create_block());
            self.builder.set_cold_block(left);
            self.builder.ins().brif(wrong, left, &[], right, &[]);
            self.builder.seal_block(left);
            self.builder.seal_block(right);
            self.builder.switch_to_block(left);
            let one = self.builder.ins().iconst(types::I32, 1);
            self.builder.ins().return_(&[one]);
            self.builder.switch_to_block(right);
        }
        // All are read before one is written: some may be what another register held.
        let values: Vec<(i32, Value)> = last.iter().map(|&(word, id)| (offset(word), self.any(id))).collect();
        for (offset, value) in values {
            self.builder.ins().store(TRUSTED, value, self.registers, offset);
        }
        if let Some(flags) = graph.flags {
            let flags = self.integer(flags);
            self.put(flags, 0);
        }
        let zero = self.builder.ins().iconst(types::I32, 0);
        self.builder.ins().return_(&[zero]);
        self.builder.finalize(target().expect("compiling for it").frontend_config());
    }
}
