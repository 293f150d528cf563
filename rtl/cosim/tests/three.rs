// SPDX-License-Identifier: MIT OR Apache-2.0
//! Three-processor controller as a circuit, in lockstep with the emulator, with host and encoders as at the beginning of a motion.
#![allow(clippy::print_stdout)]

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use takt_cosim::system::{SystemLockstep, SystemModel};
use takt_isa::timing::Cycle;
use takt_robot::controller::{Controller, standard};
use takt_robot::level::{NoFiles, Session};
use takt_robot::plant::Plant;
use takt_rtl::{Library, export_system};
use takt_system::HostAction;

/// The controller accepts and answers packets, plans a motion and begins it, and the servo follows. `TAKT_FULL=1` runs a longer part of
/// the demonstration.
#[test]
fn the_controller_is_its_emulator() {
    let description = standard().unwrap_or_else(|error| panic!("{error}"));
    let mut controller = Controller::new(&description, Plant::standard()).expect("a controller");
    controller.keep_host_actions();
    let mut session =
        Session::new(controller, Arc::new(NoFiles), Arc::new(AtomicBool::new(false))).expect("it gets ready");
    let full = std::env::var_os("TAKT_FULL").is_some();
    let text = if full {
        "signal 1 on\nvia move joints(3, 88, 2, 2, -43, 2)\nvia move joints(9, 84, 6, 6, -39, 6)\nwait 0.1\n"
    } else {
        "profile rectangular\nsignal 1 on\nvia move joints(30, 80, 10, 10, -35, 10)\nwait 0.006\n"
    };
    if let Err(mistakes) = session.run("beginning", text) {
        panic!("{}", mistakes.render(false));
    }
    let controller = session.host().robot();
    // A motion has begun, and the servo has followed it.
    let view = session.host().view();
    assert_eq!(view.mode, takt_robot::host::Mode::Moving);
    assert_eq!(view.outputs, 1);
    // The joint moved by more than one count of its encoder.
    let moved = (controller.plant().joints()[0] - takt_robot::plant::HOME[0]).abs();
    assert!(moved > 2.4e-5, "{moved} rad");
    let actions = controller.system().host_actions();
    let end = controller.system().now();
    let words = actions.iter().filter(|(_, action)| matches!(action, HostAction::Push(_))).count();

    let design = export_system(&description, "controller", &Library::builtin())
        .unwrap_or_else(|error| panic!("{error}"));
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let model = SystemModel::build(&design, &folder, false).unwrap_or_else(|error| panic!("{error}"));
    let simulation = model.start(&design.image.text, &[]).unwrap_or_else(|error| panic!("{error}"));
    let mut lockstep = SystemLockstep::new(&description, &design.plan, simulation).expect("it can be loaded");
    let go = |lockstep: &mut SystemLockstep, cycle: Cycle| {
        let running = lockstep.run_until(cycle).unwrap_or_else(|error| panic!("{error}"));
        assert!(running, "{:?}", lockstep.fault());
    };
    for (cycle, action) in actions {
        go(&mut lockstep, *cycle);
        lockstep.act(action).unwrap_or_else(|error| panic!("{error}"));
    }
    go(&mut lockstep, end);
    lockstep.finish().unwrap_or_else(|error| panic!("{error}"));
    println!(
        "{end} cycles, {words} words of packets: {} events and pins, no difference",
        lockstep.compared()
    );
    assert!(lockstep.compared() > end / 10);
    // The output of both runs is equal.
    assert_eq!(lockstep.system().output("r1"), controller.system().output("r1"));
}
