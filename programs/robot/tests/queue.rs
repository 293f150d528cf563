// SPDX-License-Identifier: MIT OR Apache-2.0
//! Queue of the kinematic core, filled to capacity by the host, on the three cores.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use takt_robot::controller::{Controller, standard};
use takt_robot::host::{Host, HostEvent, Problem};
use takt_robot::level::{NoFiles, Session};
use takt_robot::limits;
use takt_robot::packet::{Cause, Command};
use takt_robot::plant::Plant;

fn controller() -> Controller {
    let description = standard().unwrap_or_else(|error| panic!("{error}"));
    Controller::new(&description, Plant::standard()).expect("a controller")
}

/// Signals beyond the queue's capacity, sent at once: each is set.
#[test]
fn signals_wait_for_room() {
    let mut session = Session::new(controller(), Arc::new(NoFiles), Arc::new(AtomicBool::new(false)))
        .expect("it gets ready");
    let turns = |state: &str| (1..=30).map(|number| format!("signal {number} {state}\n")).collect::<String>();
    let text = turns("on") + "level 1, 2\n" + &turns("off") + "wait done\n";
    let result = session.run("signals", &text);
    let messages = session.take_messages();
    let said: Vec<&str> = messages.iter().map(|message| message.text.as_str()).collect();
    if let Err(error) = result {
        panic!("{}\n{}", error.render(false), said.join("\n"));
    }
    for number in 1..=30 {
        for state in ["on", "off"] {
            let text = format!("output {number} {state}");
            assert_eq!(said.iter().filter(|said| **said == text).count(), 1, "{text}: {said:?}");
        }
    }
    assert_eq!(said.len(), 61, "{said:?}");
}

/// A host that ignores the queue's room: packets beyond it are refused, and a stop, which drops the queue, is answered.
#[test]
fn stop_ends_waiting_statements() {
    let mut host = Host::new(controller());
    host.power_up().expect("it gets ready");
    let sent: Vec<u32> = (0..60)
        .map(|i| host.post(&Command::Output { mask: 1, bits: i & 1 }).expect("the line takes it"))
        .collect();
    for _ in 0..100 {
        host.tick().expect("the cores go on");
    }
    let refused = sent.iter().filter_map(|sequence| host.finished(*sequence).err()).count();
    assert!(refused > 0, "the queue was never full");
    let (stop, _) = host.command(&Command::Stop).expect("the stop is answered");
    assert_eq!(host.finished(stop), Ok(true));
    let within = (limits::STOP_TIME / 1e-4) as u64;
    host.wait_until(within, || "it does not stand".to_owned(), &|| false, |host| Ok(host.stands()))
        .unwrap_or_else(|problem| panic!("{problem}"));
    assert_eq!(host.unanswered(), 0);
    // Operation continues after the stop.
    let news = host.take_news();
    assert!(news.iter().any(
        |(_, news)| matches!(news, HostEvent::Report(report) if report.cause == Some(Cause::QueueFull))
    ));
    let mask = 1 << 3;
    let last = host.post(&Command::Output { mask, bits: mask }).expect("the line takes it");
    let done = |host: &mut Host<Controller>| -> Result<bool, Problem> { host.finished(last) };
    host.wait_until(200, || "it is not set".to_owned(), &|| false, done)
        .unwrap_or_else(|problem| panic!("{problem}"));
    assert_eq!(host.view().outputs & mask, mask);
}
