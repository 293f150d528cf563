// SPDX-License-Identifier: MIT OR Apache-2.0
//! Systems: values, states, mistakes. `test_fmu.py` compares with `takt run`.

use crate::common::{BASE_TICK, described, description, reference, system_model};
use std::sync::Arc;
use takt_fmu::{Instance, Mistake, Model, ModelError, Settings};
use takt_isa::Type;

const STEP: f64 = BASE_TICK.period;

fn started() -> (Model, Instance) {
    let model = system_model();
    let mut instance = Instance::new(Arc::new(model.clone())).unwrap();
    instance.enter_initialisation(0.0).unwrap();
    instance.exit_initialisation().unwrap();
    (model, instance)
}

fn step(instance: &mut Instance) -> Vec<String> {
    instance.step(instance.time(), STEP).unwrap()
}

#[test]
fn values_come_in_their_base_ticks() {
    let (model, mut instance) = started();
    let real = |instance: &Instance, name| instance.real(reference(&model, name)).unwrap();
    let integer = |instance: &Instance, name| instance.get(reference(&model, name), &[Type::I]).unwrap();
    assert_eq!(real(&instance, "total"), 1.0, "the section that runs once");
    instance.set_real(reference(&model, "x"), 2.0).unwrap();
    let mut doubles = Vec::new();
    for tick in 1..=6 {
        assert_eq!(step(&mut instance), [""; 0]);
        assert_eq!(real(&instance, "total"), 1.0 + 2.0 * f64::from(tick));
        let popped = integer(&instance, "out.popped");
        doubles.push((popped, real(&instance, "out.double"), integer(&instance, "out.count")));
        assert!(integer(&instance, "sum.cycles") > 5 && integer(&instance, "sum.missed") == 0);
    }
    // In every second base tick, 10 cycles before its end, so that the entry comes within the next.
    assert_eq!(
        doubles,
        [(0, 0.0, 0), (1, 2.0 * 3.0 + 2.0, 5), (0, 0.0, 0), (1, 16.0, 10), (0, 0.0, 0), (1, 24.0, 15)]
    );
    // A parameter, an entry; both FIFO and parameter between two steps. Several base ticks in a step.
    instance.set_real(reference(&model, "sum.gain"), 0.0).unwrap();
    instance.set_real(reference(&model, "in.entry"), 100.0).unwrap();
    instance.set(reference(&model, "in.push"), &[Type::I], 1).unwrap();
    step(&mut instance);
    assert_eq!(real(&instance, "total"), 113.0);
    instance.step(instance.time(), 3.0 * STEP).unwrap();
    assert_eq!(real(&instance, "total"), 413.0);
    assert_eq!(instance.time(), 10.0 * STEP);
    // The parameter is `twice.cycles`.
    assert!(integer(&instance, "takt.twice.cycles") > 5);
}

#[test]
fn ranges_are_what_all_receivers_accept() {
    let (model, mut instance) = started();
    let x = reference(&model, "x");
    for value in [-1.5, 5.5, f64::NAN] {
        assert!(matches!(instance.set_real(x, value), Err(Mistake::Range { .. })), "{value}");
    }
    assert!(instance.set_real(x, -1.0).is_ok() && instance.set_real(x, 5.0).is_ok());
    assert!(matches!(instance.set_real(reference(&model, "sum.gain"), 10.5), Err(Mistake::Range { .. })));
    assert!(matches!(instance.set_real(reference(&model, "total"), 0.0), Err(Mistake::ReadOnly(_))));
    let mut apart = description();
    let program = Arc::make_mut(&mut apart.cores[0].program);
    for range in &mut program.ranges {
        (range.low, range.high) = (6_f32.to_bits(), 8_f32.to_bits());
    }
    assert!(matches!(Model::of_system(&apart, BASE_TICK), Err(ModelError::Ranges(name)) if name == "x"));
    let other = Settings { tick: 999, ..BASE_TICK };
    assert!(matches!(Model::of_system(&description(), other), Err(ModelError::Setting(_))));
}

/// Values of all variables over some base ticks.
fn rest(model: &Model, instance: &mut Instance) -> Vec<Vec<u32>> {
    let all = 1..=model.variables().len() as u32;
    let types = [Type::F, Type::I, Type::B];
    let rows = (0..9_u8).map(|tick| {
        instance.set_real(reference(model, "x"), f64::from(tick) / 4.0).unwrap();
        instance.set_real(reference(model, "in.entry"), f64::from(tick)).unwrap();
        instance.set(reference(model, "in.push"), &[Type::I], u32::from(tick % 3 > 0)).unwrap();
        step(instance);
        all.clone().map(|reference| instance.get(reference, &types).unwrap()).collect()
    });
    rows.collect()
}

#[test]
fn a_state_goes_on_as_the_run_did() {
    let (model, mut one) = started();
    one.set_real(reference(&model, "sum.gain"), 3.0).unwrap();
    for periods in [1, 3] {
        rest(&model, &mut one);
        (0..periods).for_each(|_| drop(step(&mut one)));
        let saved = one.save().unwrap();
        let bytes = one.state_to_bytes(&saved).unwrap();
        let expected = rest(&model, &mut one);
        assert_ne!(rest(&model, &mut one), expected);
        one.restore(&saved).unwrap();
        assert_eq!(rest(&model, &mut one), expected);
        let (_, mut other) = started();
        let read = other.state_from_bytes(&bytes).unwrap();
        assert_eq!(other.state_to_bytes(&read).as_ref(), Ok(&bytes));
        other.restore(&read).unwrap();
        assert_eq!(rest(&model, &mut other), expected);
        one.restore(&saved).unwrap();
    }
    // Within a period of `twice`, a state can be returned to, but has no bytes.
    step(&mut one);
    let busy = one.save().unwrap();
    let error = one.state_to_bytes(&busy).unwrap_err().to_string();
    assert!(error.contains("core `twice` is within a period"), "{error}");
    let expected = rest(&model, &mut one);
    one.restore(&busy).unwrap();
    assert_eq!(rest(&model, &mut one), expected);
    let fresh = Instance::new(Arc::new(model.clone())).unwrap().save().unwrap();
    one.restore(&fresh).unwrap();
    one.enter_initialisation(0.0).unwrap();
    one.exit_initialisation().unwrap();
    assert_eq!(rest(&model, &mut one), rest(&model, &mut started().1));
}

#[test]
fn damaged_bytes_are_no_state() {
    let (_, one) = started();
    let bytes = one.state_to_bytes(&one.save().unwrap()).unwrap();
    let body = bytes.len() - 4;
    // With a checksum that fits: an error, or a state that can run, but no panic.
    // Most bytes are data memories; ticks and values on their way are at the end.
    for place in (24..body).step_by(499).chain(body - 900..body) {
        let mut tampered = bytes.clone();
        tampered[place] ^= 1;
        assert!(one.state_from_bytes(&tampered).is_err());
        let checksum = crc32fast::hash(&tampered[..body]);
        tampered[body..].copy_from_slice(&checksum.to_le_bytes());
        let (_, mut instance) = started();
        if let Ok(state) = instance.state_from_bytes(&tampered) {
            let _ = instance.restore(&state).and_then(|()| instance.step(instance.time(), STEP));
        }
    }
}

#[test]
fn nans_and_faults_are_told() {
    let (model, mut instance) = started();
    instance.set(reference(&model, "in.push"), &[Type::I], 1).unwrap();
    let infinite = reference(&model, "in.entry");
    instance.set_real(infinite, f64::NAN).unwrap();
    let said = step(&mut instance);
    assert_eq!(said, ["base tick 0: NaN on the output `total` of core sum"]);
    // A core that loads beyond its memory.
    let source = ".param cycles:int = 5\n.input total, x\n.output double\n.output count:int\n.once\n wait p\n.period\np: ld double, t[cycles]\n wait p\n.data\nt: .float 0, 1, 2, 3, 4, 5\n";
    let faulty = Model::of_system(&described(source), BASE_TICK).unwrap();
    let mut instance = Instance::new(Arc::new(faulty.clone())).unwrap();
    instance.enter_initialisation(0.0).unwrap();
    instance.exit_initialisation().unwrap();
    step(&mut instance);
    let state = instance.save().unwrap();
    instance.set(reference(&faulty, "twice.cycles"), &[Type::I], 1 << 20).unwrap();
    let error = instance.step(STEP, 2.0 * STEP).unwrap_err().to_string();
    assert!(error.starts_with("period ") && error.contains("core twice: "), "{error}");
    assert!(instance.step(STEP, STEP).is_err() && instance.save().is_err());
    instance.restore(&state).unwrap();
    instance.step(STEP, STEP).unwrap();
}
