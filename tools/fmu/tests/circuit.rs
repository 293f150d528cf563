// SPDX-License-Identifier: MIT OR Apache-2.0
//! Circuits of boards: variables, descriptions without meaning, simulations that end. `test_fmu_circuit.py` runs a board.
#![cfg(unix)]

use crate::common::{SETTINGS, reference};
use std::path::PathBuf;
use std::sync::Arc;
use takt_fmu::circuit::{Circuit, Encoder, HostPort, InputPin, PortType, Requests};
use takt_fmu::{Causality, Instance, Mistake, Model, ModelError, Settings};
use takt_isa::Type;

fn circuit() -> Circuit {
    let input = |name: Option<&str>| InputPin { name: name.map(str::to_owned), level: false };
    let port = |name: &str, ty, address, range| {
        let (name, port) = (name.to_owned(), name.to_owned());
        HostPort { name, port, ty, address, range }
    };
    let range = Some([2_f32.to_bits(), 4_f32.to_bits()]);
    Circuit {
        board: "a board".to_owned(),
        reset: 512,
        inputs: vec![input(Some("button")), input(None), input(None)],
        encoders: vec![Encoder { name: "angle".to_owned(), pins: [1, 2], start: -3 }],
        outputs: vec!["lamp.out".to_owned()],
        cores: vec![String::new()],
        causes: vec!["fault".to_owned()],
        trips: Vec::new(),
        ports: vec![
            port("speed", PortType::Float, 0x1001, range),
            port("mask", PortType::Bits, 0x1002, None),
        ],
        requests: Requests { hold: Vec::new(), start: Vec::new(), ask: Vec::new(), every: 1 },
        files: vec!["image.hex".to_owned()],
    }
}

/// Model with this text as its simulation.
fn model(circuit: &Circuit, simulation: &str) -> Result<Model, ModelError> {
    let files = vec![("image.hex".to_owned(), b"0".to_vec())];
    Model::of_circuit(circuit, simulation.as_bytes().to_vec(), files, SETTINGS)
}

/// Model as the library of an FMU reads it.
fn unpacked(name: &str, simulation: &str) -> (PathBuf, Model) {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("circuit-{name}"));
    model(&circuit(), simulation).unwrap().write(&folder).unwrap();
    let model = Model::read(&folder).unwrap();
    (folder, model)
}

#[test]
fn variables_are_pins_counts_and_ports() {
    let (folder, model) = unpacked("variables", "");
    assert_eq!(model.token(), self::model(&circuit(), "").unwrap().token());
    let shown: Vec<_> =
        model.variables().iter().map(|v| (v.name.as_str(), v.ty, v.causality, v.start)).collect();
    let expected = [
        ("button", Type::B, Causality::Input, 0),
        ("angle", Type::I, Causality::Input, (-3_i32).cast_unsigned()),
        // 0 lies outside of the range.
        ("speed", Type::F, Causality::Input, 2_f32.to_bits()),
        ("mask", Type::B, Causality::Input, 0),
        ("lamp.out", Type::F, Causality::Output, 0),
    ];
    assert_eq!(shown, expected);
    let mut instance = Instance::new(Arc::new(model.clone())).unwrap();
    let (button, mask) = (reference(&model, "button"), reference(&model, "mask"));
    instance.set_boolean(button, true).unwrap();
    instance.set(mask, &[Type::B], 7).unwrap();
    assert!(instance.boolean(button).unwrap() && instance.get(mask, &[Type::B]) == Ok(7));
    // A Boolean is no integer, and the other way round.
    assert_eq!(instance.get(button, &[Type::B]), Err(Mistake::Reference(button)));
    assert_eq!(instance.set_boolean(mask, true), Err(Mistake::Reference(mask)));
    assert!(matches!(instance.set_real(reference(&model, "speed"), 5.0), Err(Mistake::Range { .. })));
    let Err(Mistake::Call(text)) = instance.save() else { panic!("a state") };
    assert!(text.contains("without `--circuit`"), "{text}");
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn descriptions_without_meaning_are_refused() {
    let wrong = |change: &dyn Fn(&mut Circuit)| {
        let mut circuit = circuit();
        change(&mut circuit);
        model(&circuit, "").unwrap_err().to_string()
    };
    let text = wrong(&|circuit| circuit.encoders[0].pins[1] = 3);
    assert_eq!(text, "circuit.json: an encoder is at a pin that the circuit does not have");
    let text = wrong(&|circuit| circuit.ports[1].address = 0x1001);
    assert_eq!(text, "circuit.json: the ports are not in the order of their addresses");
    let text = wrong(&|circuit| circuit.requests.every = 0);
    assert_eq!(text, "circuit.json: the host's requests must be a period apart at least");
    let settings = Settings { tick: 1 << 32, ..SETTINGS };
    let error = Model::of_circuit(&circuit(), Vec::new(), Vec::new(), settings).unwrap_err();
    assert_eq!(error.to_string(), "takt.json: a period of a board has less than 2^32 cycles");
    let (folder, _) = unpacked("damaged", "");
    std::fs::write(folder.join("circuit.json"), "{").unwrap();
    assert!(Model::read(&folder).unwrap_err().to_string().starts_with("circuit.json: EOF"));
    std::fs::remove_file(folder.join("simulation")).unwrap();
    std::fs::write(folder.join("circuit.json"), serde_json::to_vec(&circuit()).unwrap()).unwrap();
    assert!(matches!(Model::read(&folder), Err(ModelError::File { .. })));
    std::fs::remove_dir_all(folder).unwrap();
}

/// Programs in place of the simulation: an error, after which another reset and start is possible.
#[test]
fn simulations_that_end_are_errors() {
    for (name, simulation, says) in [
        ("exit", "#!/bin/sh\nexit 3\n", "the simulation has ended"),
        ("none", "no program", "cannot start"),
        // An answer to the reset, then the end within an answer.
        (
            "part",
            "#!/bin/sh\nprintf '\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\0\\1'\nsleep 0.2\n",
            "the simulation has ended",
        ),
    ] {
        let (folder, model) = unpacked(name, simulation);
        let mut instance = Instance::new(Arc::new(model)).unwrap();
        for _ in 0..2 {
            instance.enter_initialisation(0.0).unwrap();
            let Err(Mistake::Program { reason, .. }) = instance.exit_initialisation() else {
                panic!("{name}")
            };
            assert!(reason.contains(says), "{name}: {reason}");
            assert!(instance.step(0.0, SETTINGS.period).is_err());
            instance.reset();
        }
        std::fs::remove_dir_all(folder).unwrap();
    }
}
