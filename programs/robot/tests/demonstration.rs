// SPDX-License-Identifier: MIT OR Apache-2.0
//! Demonstration program on the three cores and the plant, end to end.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use takt_robot::controller::{Controller, standard};
use takt_robot::geometry::pose_of;
use takt_robot::host::degrees;
use takt_robot::level::{NoFiles, Session};
use takt_robot::plant::Plant;

#[test]
fn the_demonstration_runs() {
    let description = standard().unwrap_or_else(|error| panic!("{error}"));
    let controller = Controller::new(&description, Plant::standard()).expect("a controller");
    let interrupt = Arc::new(AtomicBool::new(false));
    let mut session = Session::new(controller, Arc::new(NoFiles), interrupt).expect("it gets ready");
    let text = include_str!("../../three/demonstration.robot");
    let result = session.run("demonstration.robot", text).and_then(|()| session.finish());
    let messages = session.take_messages();
    let said: Vec<&str> = messages.iter().map(|message| message.text.as_str()).collect();
    let report = said.join("\n");
    if let Err(error) = result {
        panic!("{}\n{report}", error.render(false));
    }
    assert!(!report.contains("not what was expected"), "{report}");
    let counted = |kind: &str| messages.iter().filter(|message| message.kind == kind).count();
    // Nine errors are caught: four refusals, a queue run dry and four faults of the link.
    assert_eq!((counted("caught"), counted("stopped")), (9, 5), "{report}");
    for part in ["profiles", "square", "jogs", "signals", "refusals", "output 1 on", "output 1 off", "end"] {
        assert!(said.contains(&part), "{part} is missing\n{report}");
    }

    let controller = session.host().robot();
    let tracking = controller.tracking();
    // The robot ends at its reference, and the reference at the program's last target.
    let home = [0.0, 90.0, 0.0, 0.0, -45.0, 0.0];
    for ((plant, view), home) in
        degrees(&controller.plant().joints()).iter().zip(degrees(&session.host().view().joints)).zip(home)
    {
        assert!((plant - view).abs() < 5e-3 && (view - home).abs() < 1e-3, "{plant} {view} {home}");
    }
    for joint in 0..6 {
        let largest = tracking.largest[joint].to_degrees();
        assert!(largest > 0.0 && largest < 0.1, "joint {}: {largest}", joint + 1);
    }
    // The periods of kinematic and dynamic core fit their ticks at 10 kHz.
    for (name, periods) in controller.periods() {
        assert!(name == "communication" || periods.longest < description.tick, "{name}: {periods:?}");
    }
    // The square's corners are passed without stopping: the tool keeps moving there.
    let square = |from: &str, to: &str| {
        let time =
            |text: &str| messages.iter().find(|message| message.text == text).map(|message| message.time);
        (time(from).expect("a time"), time(to).expect("a time"))
    };
    let (begin, end) = square("output 1 on", "output 1 off");
    let records: Vec<_> =
        controller.records().iter().filter(|record| record.time > begin && record.time < end).collect();
    let place = |record: &takt_robot::controller::Record| {
        let ([x, y, z, ..], _) = pose_of(&degrees(&record.reference), [0.0; 3]);
        [x, y, z]
    };
    let speeds: Vec<f64> = records
        .windows(11)
        .map(|window| {
            let (a, b) = (place(window[0]), place(window[10]));
            let way: f64 = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
            way / (window[10].time - window[0].time)
        })
        .collect();
    let moving: Vec<f64> = speeds.iter().copied().skip_while(|speed| *speed < 30.0).collect();
    let stop = moving.iter().position(|speed| *speed < 1.0).unwrap_or(moving.len());
    // Eight sides of 60 to 120 mm at 200 mm/s take more than 4 s.
    assert!(stop as f64 * 1e-3 > 4.0, "it stops after {stop} ms: {report}");
}
