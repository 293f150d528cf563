// SPDX-License-Identifier: MIT OR Apache-2.0
//! `.contract on`: a product and its only user, a sum, become one operation with one rounding.
//!
//! The choice depends on the source and the machine's latencies, never on the schedule, so that a program computes the same bits
//! however it is scheduled. The product's operation is removed; the fused one replaces the sum.

mod choose;

use crate::banks;
use crate::ir::matching;
use crate::ir::{Constant, Ir, Operation, RegisterId, RegisterKind, runs};
use foldhash::{HashMap, HashSet};
use smallvec::SmallVec;
use takt_isa::program::Location;
use takt_isa::{Fusion, Slots, fusions};

/// A product that was fused into a sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Contraction {
    /// The instruction that does both.
    pub mnemonic: &'static str,
    /// The product's source line.
    pub product: Option<Location>,
    /// The sum's source line.
    pub sum: Option<Location>,
    /// Product and sum in the plain program ([`crate::plain`]): bundle, and index in it.
    pub at: [(u32, u32); 2],
}

/// Result of fusing a program's products.
#[derive(Debug, Default)]
pub(crate) struct ContractionResult {
    /// Fused products, in the order of the sums.
    pub(crate) contractions: Vec<Contraction>,
    /// Registers that only removed products used: not reported as unused.
    pub(crate) gone: HashSet<RegisterId>,
}

/// Position of an operation: its bundle, and its index there.
type OperationPosition = (usize, usize);

/// By sum: the products that it could be fused with, in source order.
type FusionCandidates = HashMap<OperationPosition, SmallVec<[(OperationPosition, Fusion); 2]>>;

/// The state of a register within a straight run.
#[derive(Clone, Default)]
struct RegisterState {
    /// Number of writes so far.
    version: u32,
    /// Index of the product that the register holds.
    product: Option<usize>,
}

/// A product of a run.
struct Product {
    at: OperationPosition,
    dest: RegisterId,
    /// Versions of the sources when the product reads them, and of its result.
    versions: [u32; 2],
    version: u32,
    /// Readers, each with the index of the source; a second reader rules out fusing.
    readers: SmallVec<[(OperationPosition, usize); 2]>,
    /// The product is the register's last value in the run.
    last: bool,
    /// A source is overwritten before the product is read.
    stale: bool,
}

/// Fuses products into sums in bundles that `is_on` allows, if the machine has an operation for it.
pub(crate) fn contract(ir: &mut Ir, is_on: impl Fn(usize) -> bool) -> ContractionResult {
    let mut contracted = ContractionResult::default();
    let hosted = |fusion: &&Fusion| ir.machine.host(fusion.fused.row().function).is_some();
    let known: Vec<&Fusion> = fusions().iter().filter(hosted).collect();
    if known.is_empty() || !(0..ir.bundles.len()).any(&is_on) {
        return contracted;
    }
    // Bundles with fixed addresses, or raw words that may read any register, rule out any removal.
    if runs::jumps_to_numbers(ir) || ir.is_opaque() {
        return contracted;
    }
    let exposed = exposed(ir);
    let mut current = vec![RegisterState::default(); ir.registers.len()];
    for run in runs::runs(ir) {
        current.fill(RegisterState::default());
        let products = products(ir, &known, run, &mut current);
        let fits = |product: &Product| {
            let [(reader, source)] = product.readers[..] else { return None };
            let sum = at(ir, reader);
            let fusion = known.iter().find(|fusion| {
                (fusion.product, fusion.sum, fusion.source) == (at(ir, product.at).op, sum.op, source)
            })?;
            let wanted = is_on(product.at.0) && is_on(reader.0);
            let free = !(product.stale || product.last && exposed[product.dest.index()]);
            (wanted && free && has_place(ir, reader, fusion)).then_some((reader, **fusion))
        };
        let mut wishes = FusionCandidates::default();
        for product in &products {
            if let Some((sum, fusion)) = fits(product) {
                wishes.entry(sum).or_default().push((product.at, fusion));
            }
        }
        for (sum, product, fusion) in choose::choose(ir, run, &wishes) {
            contracted.gone.extend(at(ir, product).dest);
            contracted.contractions.push(fuse(ir, product, sum, fusion));
        }
    }
    for operation in ir.operations() {
        for register in operation.reads().iter().chain(&operation.dest) {
            contracted.gone.remove(register);
        }
    }
    contracted
}

fn at(ir: &Ir, (bundle, number): OperationPosition) -> &Operation {
    &ir.bundles[bundle].operations[number]
}

/// By register: a run reads it before writing it, so a value may be read outside its own run.
fn exposed(ir: &Ir) -> Vec<bool> {
    let mut exposed = vec![false; ir.registers.len()];
    let mut written = vec![usize::MAX; ir.registers.len()];
    for (number, run) in runs::runs(ir).into_iter().enumerate() {
        for bundle in &ir.bundles[run.start..run.end] {
            // All operations of a bundle read before any writes.
            for register in bundle.operations.iter().flat_map(Operation::reads) {
                exposed[register.index()] |= written[register.index()] != number;
            }
            for register in bundle.operations.iter().filter_map(|operation| operation.dest) {
                written[register.index()] = number;
            }
        }
    }
    exposed
}

/// Products of a run that may be removed, with their readers.
fn products(ir: &Ir, known: &[&Fusion], run: runs::Run, current: &mut [RegisterState]) -> Vec<Product> {
    let mut products: Vec<Product> = Vec::new();
    for bundle in run.start..run.end {
        let operations = || (0..).zip(&ir.bundles[bundle].operations);
        for (number, operation) in operations() {
            for (source, register) in operation.reads().iter().enumerate() {
                let Some(index) = current[register.index()].product else { continue };
                let factors = at(ir, products[index].at).reads();
                let product = &mut products[index];
                product.readers.push(((bundle, number), source));
                // If the product overwrites one of its own factors, removing the product restores that factor's value.
                let as_it_was = |(factor, version): (&RegisterId, &u32)| {
                    let now = current[factor.index()].version;
                    now == *version || (*factor == product.dest && now == product.version)
                };
                product.stale |= !factors.iter().zip(&product.versions).all(as_it_was);
            }
        }
        let mut written: SmallVec<[(RegisterId, Option<usize>); 4]> = SmallVec::new();
        for (number, operation) in operations() {
            let Some(dest) = operation.dest else { continue };
            let register = ir.register(dest);
            let free = register.kind == RegisterKind::Plain
                && register.pinned.is_none()
                && register.preset.is_none();
            let is_product = free && known.iter().any(|fusion| fusion.product == operation.op);
            let product = is_product.then_some(products.len());
            if is_product {
                let version = |index: usize| current[operation.sources[index].index()].version;
                products.push(Product {
                    at: (bundle, number),
                    dest,
                    versions: [version(0), version(1)],
                    version: current[dest.index()].version + 1,
                    readers: SmallVec::new(),
                    last: true,
                    stale: false,
                });
            }
            written.push((dest, product));
        }
        for (dest, product) in written {
            let register = &mut current[dest.index()];
            if let Some(old) = register.product {
                products[old].last = false;
            }
            *register = RegisterState { version: register.version + 1, product };
        }
    }
    products
}

/// The fused operation can replace the sum: a slot that writes the sum's register is free in that bundle.
fn has_place(ir: &Ir, (bundle, number): OperationPosition, fusion: &Fusion) -> bool {
    let operations = &ir.bundles[bundle].operations;
    let dest = operations[number].dest;
    let others =
        || operations.iter().enumerate().filter(|(other, _)| *other != number).map(|(_, other)| other);
    let mut slots: Vec<Slots> =
        others().filter(|other| other.slot.is_some()).map(|other| other.slots).collect();
    slots.push(dest.map_or_else(Slots::default, |dest| banks::able(ir, dest, fusion.fused)));
    // A branch that reads a result of its own bundle cannot wait for a copy.
    let branches =
        others().any(|other| other.redirects() && dest.is_some_and(|dest| other.reads().contains(&dest)));
    // An operation stays on the slot that the source names.
    let named =
        dest.is_some_and(|dest| operations[number].slots != banks::able(ir, dest, operations[number].op));
    !branches && !named && matching::is_possible(&slots)
}

/// Puts the fused operation in the sum's place, and makes the product idle.
fn fuse(ir: &mut Ir, product: OperationPosition, sum: OperationPosition, fusion: Fusion) -> Contraction {
    let first = *at(ir, product);
    let second = *at(ir, sum);
    let slots = second.dest.map_or_else(Slots::default, |dest| banks::able(ir, dest, fusion.fused));
    let [a, b, _] = first.sources;
    let sources = [a, b, second.sources[1 - fusion.source]];
    // The fused operation has no operands of its own in the syntax tree: messages point at the sum.
    let written = (u32::MAX, 0);
    ir.has_choices |= slots.len() > 1;
    ir.bundles[sum.0].operations[sum.1] = Operation {
        op: fusion.fused,
        slots,
        slot: slots.first(),
        sources,
        constant: Constant::None,
        made: true,
        written,
        ..second
    };
    // The bundle keeps an idle operation for now, since indices of operations still count it.
    ir.bundles[product.0].operations[product.1] = Operation { made: true, ..first.idle() };
    Contraction {
        mnemonic: fusion.fused.row().mnemonic,
        product: ir.location(&first),
        sum: ir.location(&second),
        at: [product, sum].map(|(bundle, number)| (bundle as u32, number as u32)),
    }
}
