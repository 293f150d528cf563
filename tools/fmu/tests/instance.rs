// SPDX-License-Identifier: MIT OR Apache-2.0
//! Instances beside the emulator itself.

use crate::common::{SETTINGS, assemble, instance, model, reference};
use std::sync::Arc;
use takt_emu::{Emulator, Number};
use takt_fmu::{Instance, Mistake, Model, Settings};
use takt_isa::Type;

#[test]
fn runs_like_the_emulator() {
    let (model, mut instance) = (model(), instance());
    let at = |name| reference(&model, name);
    let program = assemble(include_str!("../../../programs/examples/pi.s"));
    let pi = Model::new(&program, SETTINGS).unwrap();
    let mut one = Instance::new(Arc::new(pi.clone())).unwrap();
    let mut emulator = Emulator::new(&program).unwrap();
    one.set_real(reference(&pi, "w_ref"), 100.0).unwrap();
    one.enter_initialisation(2.0).unwrap();
    one.exit_initialisation().unwrap();
    for period in 0..300_u16 {
        let w = f32::from(period) * 0.3;
        one.set_real(reference(&pi, "w"), f64::from(w)).unwrap();
        one.step(2.0 + f64::from(period) * 1e-3, 1e-3).unwrap();
        let report =
            emulator.run_period(&[("w_ref", Number::Float(100.0)), ("w", Number::Float(w))]).unwrap();
        let u = emulator.output("u").unwrap().unwrap().bits();
        assert_eq!(one.get(reference(&pi, "u"), &[Type::F]), Ok(u), "period {period}");
        assert_eq!(
            one.get(reference(&pi, "cycles"), &[Type::I]),
            Ok(report.cycles as u32),
            "period {period}"
        );
    }
    // The section that runs once sees inputs and parameters that are set before.
    instance.set(at("bias"), &[Type::I], 7).unwrap();
    instance.set_real(at("x"), 2.0).unwrap();
    instance.enter_initialisation(0.0).unwrap();
    assert_eq!(instance.get(at("error"), &[Type::I]), Ok(0));
    instance.exit_initialisation().unwrap();
    assert_eq!(instance.get(at("error"), &[Type::I]), Ok(7));
    instance.step(0.0, 3e-3).unwrap();
    assert_eq!(instance.real(at("sum")), Ok(2.0 + 3.0 * 4.0));
    assert!((instance.time() - 3e-3).abs() < 1e-12);
    instance.terminate().unwrap();
    assert!(matches!(instance.step(3e-3, 1e-3), Err(Mistake::Phase { .. })));
    instance.reset();
    assert_eq!((instance.time(), instance.get(at("bias"), &[Type::I])), (0.0, Ok(3)));
}

#[test]
fn wrong_values_are_refused_and_change_nothing() {
    let (model, mut instance) = (model(), instance());
    let at = |name| reference(&model, name);
    for (name, value) in
        [("kp", 50.01), ("kp", f64::NAN), ("x", 0.4), ("x", f64::INFINITY), ("x", f64::NAN), ("x", 1e39)]
    {
        let before = instance.real(at(name));
        assert!(matches!(instance.set_real(at(name), value), Err(Mistake::Range { .. })), "{name} {value}");
        assert_eq!(instance.real(at(name)), before);
    }
    assert!(instance.set_real(at("kp"), 50.0).is_ok() && instance.set_real(at("x"), 0.5).is_ok());
    assert!(matches!(instance.set(at("bias"), &[Type::I], 101), Err(Mistake::Range { .. })));
    assert!(instance.set(at("bias"), &[Type::I], (-100_i32).cast_unsigned()).is_ok());
    for (name, ty) in [("sum", Type::F), ("cycles", Type::I), ("missed", Type::F), ("takt.missed", Type::I)] {
        assert!(matches!(instance.set(at(name), &[ty], 0), Err(Mistake::ReadOnly(_))), "{name}");
    }
    for reference in [0, 100, u32::MAX] {
        assert_eq!(instance.get(reference, &[Type::F]), Err(Mistake::Reference(reference)));
    }
    assert_eq!(instance.get(at("kp"), &[Type::I, Type::B]), Err(Mistake::Reference(at("kp"))));
}

#[test]
fn wrong_calls_are_refused() {
    let mut instance = instance();
    assert!(matches!(instance.step(0.0, 1e-3), Err(Mistake::Phase { .. })));
    assert!(matches!(instance.exit_initialisation(), Err(Mistake::Phase { .. })));
    assert!(instance.enter_initialisation(f64::NAN).is_err());
    instance.enter_initialisation(0.0).unwrap();
    assert!(instance.enter_initialisation(0.0).is_err() && instance.terminate().is_err());
    instance.exit_initialisation().unwrap();
    for size in [0.0, -1e-3, 0.5e-3, 1.001e-3, f64::NAN, f64::INFINITY] {
        assert!(matches!(instance.step(0.0, size), Err(Mistake::StepSize { .. })), "{size}");
    }
    for time in [-1e-3, 1e-3, f64::NAN] {
        assert!(matches!(instance.step(time, 1e-3), Err(Mistake::StepTime { .. })), "{time}");
    }
    instance.step(1e-9, 1e-3 + 1e-11).unwrap();
}

#[test]
fn programs_that_stop_are_errors() {
    let halts = assemble(".output a\n.once\n mov a, zero\n halt\n");
    let mut instance = Instance::new(Arc::new(Model::new(&halts, SETTINGS).unwrap())).unwrap();
    instance.enter_initialisation(0.0).unwrap();
    let error = instance.exit_initialisation().unwrap_err().to_string();
    assert!(error.contains("halted"), "{error}");
    assert!(matches!(instance.step(0.0, 1e-3), Err(Mistake::Phase { .. })) && instance.save().is_err());
    instance.reset();
    instance.enter_initialisation(0.0).unwrap();
}

#[test]
fn settings_without_meaning_are_refused() {
    let program = assemble(".output a\n.once\n mov a, zero\n wait p\n.period\np: mov a, zero\n wait p\n");
    for (period, tick) in [(0.0, 1), (-1.0, 1), (f64::INFINITY, 1), (f64::NAN, 1), (1.0, 0)] {
        assert!(Model::new(&program, Settings { period, tick }).is_err(), "{period} {tick}");
    }
    let one = Model::new(&program, SETTINGS).unwrap();
    let other = Model::new(&program, Settings { tick: 1, ..SETTINGS }).unwrap();
    assert!(one.token() != other.token() && one.token() == Model::new(&program, SETTINGS).unwrap().token());
}
