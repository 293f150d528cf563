// SPDX-License-Identifier: MIT OR Apache-2.0
//! Saved states: what follows from them, and bytes that are none.

use crate::common::{instance, model, reference};
use takt_fmu::{Instance, Mistake};

/// Values of all outputs over some periods.
fn rest(instance: &mut Instance) -> Vec<u64> {
    let (model, mut found) = (model(), Vec::new());
    for period in 0..10_u8 {
        instance.set_real(reference(&model, "x"), 1.0 + f64::from(period) / 8.0).unwrap();
        instance.step(instance.time(), 1e-3).unwrap();
        found.push(instance.real(reference(&model, "sum")).unwrap().to_bits());
        found.push(instance.real(reference(&model, "missed")).unwrap().to_bits());
    }
    found
}

fn started() -> Instance {
    let mut instance = instance();
    instance.enter_initialisation(0.0).unwrap();
    instance.exit_initialisation().unwrap();
    instance
}

#[test]
fn a_state_goes_on_as_the_run_did() {
    let model = model();
    let mut one = started();
    one.set_real(reference(&model, "kp"), 3.0).unwrap();
    rest(&mut one);
    let saved = one.save().unwrap();
    let bytes = one.state_to_bytes(&saved).unwrap();
    let expected = rest(&mut one);
    assert_ne!(rest(&mut one), expected);
    one.restore(&saved).unwrap();
    assert_eq!(rest(&mut one), expected);
    let mut other = instance();
    let read = other.state_from_bytes(&bytes).unwrap();
    assert_eq!(other.state_to_bytes(&read).as_ref(), Ok(&bytes));
    other.restore(&read).unwrap();
    assert_eq!(rest(&mut other), expected);
    // A state before the first cycle.
    let fresh = instance().save().unwrap();
    other.restore(&fresh).unwrap();
    other.enter_initialisation(0.0).unwrap();
    other.exit_initialisation().unwrap();
    assert_eq!(rest(&mut other), rest(&mut started()));
}

#[test]
fn damaged_bytes_are_no_state() {
    let one = started();
    let bytes = one.state_to_bytes(&one.save().unwrap()).unwrap();
    assert!(one.state_from_bytes(&bytes).is_ok());
    for end in (0..bytes.len()).step_by(7) {
        assert!(matches!(one.state_from_bytes(&bytes[..end]), Err(Mistake::State(_))), "{end} bytes");
    }
    for place in (0..bytes.len()).step_by(5) {
        let mut tampered = bytes.clone();
        tampered[place] ^= 0x40;
        assert!(one.state_from_bytes(&tampered).is_err(), "byte {place}");
    }
    // With a checksum that fits: an error, or a state that the program refuses or can run, but no panic.
    let body = bytes.len() - 4;
    for place in 24..body.min(400) {
        for bit in [0, 7] {
            let mut tampered = bytes.clone();
            tampered[place] ^= 1 << bit;
            let checksum = crc32fast::hash(&tampered[..body]);
            tampered[body..].copy_from_slice(&checksum.to_le_bytes());
            let mut instance = instance();
            if let Ok(state) = instance.state_from_bytes(&tampered) {
                let _ = instance.restore(&state).and_then(|()| instance.step(instance.time(), 1e-3));
            }
        }
    }
}
