// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sessions on systems of several cores, compared with the forward-only emulator.

use std::collections::BTreeMap;
use takt_debug::console::{Console, Target, commands, first_mistake};
use takt_debug::session::{Options, Session, Unit};
use takt_debug::system::{SystemOptions, SystemSession, SystemStop, SystemStopReason};
use takt_emu::Event;
use takt_emu::testing::Random;
use takt_isa::{F1, MACHINES, Register};
use takt_system::testing::random_description;
use takt_system::{Description, System};

const CYCLES: u64 = 20_000;

fn session(description: &Description) -> SystemSession {
    SystemSession::new(description, SystemOptions::default()).expect("a random system loads")
}

/// Visible state of a system: registers and memory of each core, and entries of each FIFO.
type State = (Vec<Vec<Option<u32>>>, Vec<Vec<u32>>, Vec<Vec<Vec<u32>>>);

fn state(system: &System) -> State {
    let cores = 0..system.description().cores.len();
    let registers =
        cores.clone().map(|core| Register::all().map(|r| system.core(core).register(r)).collect());
    let memories = cores.map(|core| system.core(core).memory().to_vec());
    let fifos = (0..system.description().links.len()).map(|link| system.fifo_entries(link));
    (registers.collect(), memories.collect(), fifos.collect())
}

/// Systems that do not fault within the tested time.
fn systems() -> impl Iterator<Item = (u64, Description)> {
    let all = (0..16).map(|seed| (seed, random_description(seed, MACHINES)));
    let runs = |(_, description): &(u64, Description)| {
        let mut system = System::new(description).expect("it loads");
        system.run_until(CYCLES + 2000).is_ok() && !system.halted() && system.start().is_some()
    };
    all.filter(runs).take(6)
}

#[test]
fn every_position_equals_a_run_from_reset() {
    for (seed, description) in systems() {
        let mut session = session(&description);
        let mut random = Random::new(seed);
        for _ in 0..12 {
            let cycle = u64::from(random.below(CYCLES as u32));
            assert_eq!(session.go_to(cycle), SystemStopReason::Done, "seed {seed}");
            let mut fresh = System::new(&description).expect("it loads");
            fresh.run_until(cycle).expect("no fault");
            assert_eq!(session.cycle(), cycle);
            assert_eq!(state(session.system()), state(&fresh), "seed {seed}: cycle {cycle}");
        }
    }
}

#[test]
fn stops_at_every_event_forward_and_back() {
    let mut kinds = BTreeMap::new();
    for (seed, description) in systems() {
        let mut system = System::new(&description).expect("it loads");
        system.keep_events();
        system.run_until(CYCLES).expect("no fault");
        let events = system.take_events();
        // The rarest kind of event that occurs more than three times.
        let mut counts: BTreeMap<(usize, &str), Vec<u64>> = BTreeMap::new();
        for event in events.iter().filter(|event| event.cycle + 1100 < CYCLES) {
            counts.entry((event.link, event.kind.name())).or_default().push(event.cycle + 1);
        }
        let Some(((link, name), mut cycles)) =
            counts.into_iter().filter(|(_, cycles)| cycles.len() > 3).min_by_key(|(_, cycles)| cycles.len())
        else {
            continue;
        };
        cycles.dedup();
        cycles.truncate(40);
        let kind = events.iter().find(|event| event.kind.name() == name).expect("it was seen").kind;
        *kinds.entry(name).or_insert(0) += 1;
        let mut session = session(&description);
        let id = session.add_stop(SystemStop { link, kind: Some(kind) }, String::new());
        for &cycle in &cycles {
            assert_eq!(session.resume(&mut []), SystemStopReason::Stop(id), "seed {seed}: {name} at {cycle}");
            assert_eq!(session.cycle(), cycle, "seed {seed}: {name} of link {link}");
        }
        for &cycle in cycles.iter().rev().skip(1) {
            assert_eq!(
                session.resume_back(&mut []),
                SystemStopReason::Stop(id),
                "seed {seed}: back to {name} at {cycle}"
            );
            assert_eq!(session.cycle(), cycle, "seed {seed}: back to {name} of link {link}");
        }
        assert_eq!(session.resume_back(&mut []), SystemStopReason::Start);
    }
    assert!(!kinds.is_empty(), "no system has an event that comes often enough");
}

#[test]
fn bundles_and_periods_of_each_core() {
    let (_, description) = systems().next().expect("a system");
    let mut system = System::new(&description).expect("it loads");
    system.keep_core_events();
    system.run_until(CYCLES).expect("no fault");
    let events = system.take_core_events();
    for core in 0..description.cores.len() {
        let mut session = session(&description);
        let own = || events.iter().filter(|(own, _)| *own == core).map(|(_, event)| event);
        let issues = own().filter_map(|event| match event {
            Event::Issue { cycle, .. } => Some(*cycle),
            _ => None,
        });
        let waits = own().filter_map(|event| match event {
            Event::Wait { cycle, .. } => Some(*cycle + 1),
            _ => None,
        });
        for cycle in issues.take(30) {
            assert_eq!(
                (session.step(&mut [], core, Unit::Bundle), session.cycle()),
                (SystemStopReason::Done, cycle)
            );
        }
        session.go_to(0);
        let waits: Vec<u64> = waits.take(5).collect();
        for &cycle in &waits {
            assert_eq!(
                (session.step(&mut [], core, Unit::Period), session.cycle()),
                (SystemStopReason::Done, cycle)
            );
        }
        for &cycle in waits.iter().rev().skip(1) {
            assert_eq!(
                (session.step_back(&mut [], core, Unit::Period), session.cycle()),
                (SystemStopReason::Done, cycle)
            );
        }
    }
}

#[test]
fn reports_mistakes() {
    let (_, description) = systems().next().expect("a system");
    let views = description
        .cores
        .iter()
        .map(|core| Session::new(&core.program, Options::default()).expect("it loads"));
    let mut console = Console::of_system(session(&description), views.collect());
    for (line, text) in [
        ("core none", "there is no core `none` (cores: c0"),
        ("break link none", "there is no link `none`"),
        ("break nowhere", "no label is named `nowhere`"),
        ("watch nothing", "nothing"),
        ("until", "an expression is missing"),
        ("set nothing = 1", "nothing"),
        ("set zero = 1", "`zero` is always zero"),
        ("step 0", "neither a count nor one of"),
        ("goto cycle x", "`x` is not the number of a cycle"),
        ("hold", "it is for a board"),
        ("accuracy nothing", "nothing"),
        ("stepp", "did you mean `step`?"),
        ("delete 7", "there is no stop 7"),
        ("print nothing", "nothing"),
    ] {
        let error = console.execute(line).expect_err(line);
        assert!(error.contains(text), "{line}: {error}");
    }
    assert!(console.execute("cores").expect("a list").contains("> c0"));
    console.execute("goto cycle 500").expect("it is there");
    assert!(console.execute("check cycle == 500").is_ok());
    assert!(console.execute("check cycle == 501").is_err());
    console.execute("core c1").expect("there is one");
    console.execute("back cycle 100").expect("it is there");
    assert!(console.execute("check cycle == 400").is_ok(), "every core is in the same cycle");
}

/// A watchpoint on a register of core 1 stops at each change of its value, forward and back; conditional breakpoints stop where the
/// condition holds.
#[test]
fn watchpoints_and_conditions_see_every_position() {
    const END: u64 = 1500;
    let mut changes = 0;
    for (seed, description) in systems() {
        let names: Vec<String> = description.cores.iter().map(|core| core.name.clone()).collect();
        let views = || {
            let cores = description.cores.iter();
            cores.map(|core| Session::new(&core.program, Options::default()).expect("it loads")).collect()
        };
        let console = || {
            let mut console = Console::of_system(session(&description), views());
            console.set_run_limit(3 * END);
            console.execute(&format!("core {}", names[1])).expect("it is there");
            console
        };
        // Subjects: an output port, an input port, and a register of the machine.
        let program = &description.cores[1].program;
        let ports = program.outputs.iter().take(1).chain(program.inputs.iter().take(2));
        let watched: Vec<String> = ports.map(|port| format!("{}:int", port.name)).collect();
        for what in &watched {
            // Reference: stops found by visiting each position.
            let mut one = console();
            let value = |console: &mut Console| console.execute(&format!("print {what}")).expect("a value");
            let mut before = value(&mut one);
            let mut expected = Vec::new();
            for cycle in 1..END {
                one.execute("step cycle").expect("a cycle");
                let now = value(&mut one);
                let bits = |text: &str| text.split("  (").next().unwrap_or_default().trim().to_owned();
                if bits(&now) != bits(&before) {
                    expected.push(cycle);
                }
                before = now;
            }
            changes += expected.len();
            let mut watching = console();
            watching.execute(&format!("watch {what}")).expect("it can be watched");
            let mut cycles = Vec::new();
            loop {
                let said = watching.execute("continue").expect("it runs");
                let cycle = watching.session().cycle();
                if cycle >= END || !said.contains("stop 1") {
                    break;
                }
                cycles.push(cycle);
            }
            assert_eq!(cycles, expected, "seed {seed}: {what}");
            watching.execute(&format!("goto cycle {END}")).expect("it is there");
            let mut back = Vec::new();
            while watching.execute("reverse").expect("it runs").contains("stop 1") {
                back.push(watching.session().cycle());
            }
            back.reverse();
            assert_eq!(back, expected, "seed {seed}: {what}, back");
        }
        // A condition that selects issues in even cycles.
        let mut stepping = console();
        let mut expected = Vec::new();
        let (mut bundle, mut cycle) = (None, 0);
        while cycle < END {
            stepping.execute("step bundle").expect("a bundle");
            let here = stepping.system().expect("a system").system().core(1).next_address();
            let before = std::mem::replace(&mut cycle, stepping.session().cycle());
            if cycle == before {
                // The core has halted, or waits forever.
                break;
            }
            if *bundle.get_or_insert(here) == here && cycle % 2 == 0 {
                expected.push(cycle);
            }
        }
        expected.retain(|cycle| *cycle < END);
        let mut stopping = console();
        let place = format!("break bundle {} if cycle % 2 == 0", bundle.expect("one has issued").get());
        assert!(stopping.execute(&place).expect("a place").contains("stop 1"));
        for cycle in expected {
            stopping.execute("continue").expect("it runs");
            assert_eq!(stopping.session().cycle(), cycle, "seed {seed}: {place}");
        }
    }
    assert!(changes > 20, "{changes} changes are too few to tell");
}

/// An edit is visible whenever the session returns to it, but not before its position.
#[test]
fn edits_persist() {
    let (_, description) = systems().next().expect("a system");
    let views = description.cores.iter();
    let views = views.map(|core| Session::new(&core.program, Options::default()).expect("it loads"));
    let mut console = Console::of_system(session(&description), views.collect());
    let port = description.cores[0].program.inputs[0].name.clone();
    let mut run = |line: &str| console.execute(line).unwrap_or_else(|error| panic!("{line}: {error}"));
    run("goto cycle 700");
    run(&format!("set {port}:int = 12345"));
    run(&format!("check {port}:int == 12345"));
    run("back cycle 600");
    run(&format!("check {port}:int != 12345"));
    run(&format!("until {port}:int == 12345"));
    run("check cycle == 700");
    run("break cycle 690");
    run("reverse");
    run("check cycle == 690");
    assert!(run("stops").contains("break cycle 690 of core c0"));
    run("delete 1");
    assert_eq!(run("stops"), "");
}

/// A program that makes calls and halts, and an endless program.
fn calling() -> (Description, [takt_asm::AssembledProgram; 2]) {
    const CALLING: &str = ".reg n:int m:int
        li      n, 3
turn:   call    twice
        isub    n, n, 1
        bnz     n, turn
        halt
twice:  li      m, 2
inner:  call    once
        isub    m, m, 1
        bnz     m, inner
        ret
once:   iadd    n, n, 0
        ret
";
    const FOREVER: &str = ".reg n:int\n li n, 0\nagain: iadd n, n, 1\n jmp again\n";
    let assembled = |name: &str, text: &str| {
        let options = takt_asm::Options { machine: &F1, ..takt_asm::Options::default() };
        let files = takt_asm::MemoryLoader::new(&[(name, text)]);
        takt_asm::assemble(name, &files, &options).expect("it assembles")
    };
    let programs = [assembled("calling.s", CALLING), assembled("forever.s", FOREVER)];
    let text = "tick = 1000
[[core]]
name = \"calling\"
program = \"calling.s\"
machine = \"f1\"
[[core]]
name = \"forever\"
program = \"forever.s\"
machine = \"f1\"
";
    let program = |request: &takt_system::Request<'_>| -> Result<_, takt_system::ProgramError<()>> {
        Ok(programs[usize::from(request.path == "forever.s")].program.clone())
    };
    let Ok(description) = takt_system::read("system.toml", text, program) else { panic!("it is one") };
    (description, programs)
}

/// Steps of a core in a system equal those of its program alone, forward and back.
#[test]
fn steps_of_a_core_equal_a_single_programs() {
    let (description, programs) = calling();
    let view = |program: &takt_asm::AssembledProgram| Session::new(&program.program, Options::default());
    let [mut calling, mut forever] =
        [&programs[0], &programs[1]].map(|program| view(program).expect("it loads"));
    for unit in [Unit::Bundle, Unit::Line, Unit::Call, Unit::Out] {
        for begin in [0, 15, 29, 47] {
            let mut alone = view(&programs[0]).expect("it loads");
            let mut system = session(&description);
            let mut views = [&mut calling, &mut forever];
            alone.go_to(begin);
            system.go_to(begin);
            let mut steps = 0;
            loop {
                let (expected, why) = (alone.step(unit), system.step(&mut views, 0, unit));
                if expected == takt_debug::session::StopReason::Halted {
                    assert_eq!(why, SystemStopReason::Core(0, expected), "{unit:?} from {begin}");
                    break;
                }
                assert_eq!(why, SystemStopReason::Done, "{unit:?} from {begin}");
                assert_eq!(system.cycle(), alone.cycle(), "{unit:?} from {begin}");
                steps += 1;
            }
            assert!(steps > 2 || unit == Unit::Out, "{unit:?} from {begin}: {steps} steps");
            while alone.cycle() > 0 {
                system.go_to(alone.cycle());
                alone.step_back(unit);
                system.step_back(&mut views, 0, unit);
                assert_eq!(system.cycle(), alone.cycle(), "{unit:?} back from {begin}");
            }
        }
    }
    // The first core has halted; the second runs on, and so does time.
    let mut system = session(&description);
    let mut views = [&mut calling, &mut forever];
    system.go_to(5000);
    assert_eq!(
        system.step(&mut views, 0, Unit::Line),
        SystemStopReason::Core(0, takt_debug::session::StopReason::Halted)
    );
    assert_eq!(system.cycle(), 5000);
    assert_eq!(system.step(&mut views, 1, Unit::Line), SystemStopReason::Done);
}

/// A search proceeds in stretches, and also finds a bundle that is about to issue at the end of a stretch.
#[test]
fn finds_stops_from_every_start() {
    let (description, programs) = calling();
    let mut system = System::new(&description).expect("it loads");
    system.keep_core_events();
    system.run_until(9000).expect("no fault");
    let events = system.take_core_events();
    let issue = |(core, event): (usize, Event)| match event {
        Event::Issue { cycle, address } if core == 1 && cycle > 8300 => Some((cycle, address)),
        _ => None,
    };
    let (cycle, address) = events.into_iter().find_map(issue).expect("one issues");
    for distance in [1, 4095, 4096, 4097, 8192] {
        let views = programs.iter().map(|program| Session::new(&program.program, Options::default()));
        let views = views.map(|view| view.expect("it loads")).collect();
        let mut console = Console::of_system(session(&description), views);
        let mut run = |line: &str| console.execute(line).unwrap_or_else(|error| panic!("{line}: {error}"));
        run("core forever");
        run(&format!("break bundle {} if cycle == {cycle}", address.get()));
        run(&format!("goto cycle {}", cycle - distance));
        assert!(run("continue").contains("stop 1"), "from {distance} cycles before");
        run(&format!("check cycle == {cycle}"));
        run(&format!("goto cycle {}", cycle + distance));
        assert!(run("reverse").contains("stop 1"), "from {distance} cycles behind");
        run(&format!("check cycle == {cycle}"));
    }
}

/// Periods of each core count from reset, in both directions.
#[test]
fn goes_to_a_period_of_a_core() {
    let (_, description) = systems().next().expect("a system");
    let mut session = session(&description);
    for period in [3, 1, 2, 0] {
        assert_eq!(session.go_to_period(0, period), SystemStopReason::Done);
        assert_eq!(session.system().periods(0).count, period);
        let here = session.cycle();
        if period > 0 {
            session.go_to(here - 1);
            assert_eq!(
                session.system().periods(0).count,
                period - 1,
                "it is the first position behind its `wait`"
            );
        }
    }
}

/// The reported error of a core covers its operations since reset, in a system as in a single program.
#[test]
fn accuracy_of_a_core_equals_its_programs() {
    const THIRD: &str = ".reg n:int x y
        li      n, 5
        fdiv    x, 1.0, 3.0
turn:   fmul    y, x, x
        fadd    x, x, y
        isub    n, n, 1
        bnz     n, turn
end:    jmp     end
";
    let machine = MACHINES.iter().find(|machine| machine.name == "t1").expect("there is one");
    let options = takt_asm::Options { machine, ..takt_asm::Options::default() };
    let files = takt_asm::MemoryLoader::new(&[("third.s", THIRD)]);
    let assembled = takt_asm::assemble("third.s", &files, &options).expect("it assembles");
    let core = |name: &str| format!("[[core]]\nname = \"{name}\"\nprogram = \"third.s\"\nmachine = \"t1\"\n");
    let text = format!("tick = 1000\n{}{}", core("a"), core("b"));
    let program = |_: &takt_system::Request<'_>| -> Result<_, takt_system::ProgramError<()>> {
        Ok(assembled.program.clone())
    };
    let Ok(description) = takt_system::read("system.toml", &text, program) else { panic!("it is one") };
    let view = || {
        let options = Options { names: assembled.names.clone(), ..Options::default() };
        Session::new(&assembled.program, options).expect("it loads")
    };
    let mut alone = Console::new(view());
    let mut both = Console::of_system(session(&description), vec![view(), view()]);
    for cycle in [150, 400, 250] {
        let say = |console: &mut Console, line: &str| console.execute(line).expect("a value");
        say(&mut alone, &format!("goto cycle {cycle}"));
        say(&mut both, &format!("goto cycle {cycle}"));
        let expected = say(&mut alone, "accuracy x");
        assert!(expected.contains(" ulp) of "), "{expected}");
        assert_eq!(say(&mut both, "accuracy x"), expected);
        assert_eq!(say(&mut both, "accuracy b.x"), format!("core b: {expected}"));
        assert_eq!(both.session().cycle(), cycle, "it stays where it is");
    }
}

/// Every console command works on a system, or states why it does not.
#[test]
fn each_command_is_available_or_states_the_reason() {
    let names = |target| commands(target).map(|(usage, ..)| usage.split(' ').next().map(str::to_owned));
    let [program, system, board] =
        [Target::Program, Target::System, Target::Board].map(|target| names(target).collect::<Vec<_>>());
    assert!(program.iter().all(|name| system.contains(name)));
    for (target, own) in [(Target::Program, &program), (Target::System, &system), (Target::Board, &board)] {
        for name in program.iter().chain(&system).chain(&board).flatten() {
            let refused = first_mistake(name, target).map(|(_, why)| why);
            match refused {
                None => assert!(own.iter().flatten().any(|known| known == name), "{name}"),
                Some(why) => assert!(why.starts_with(&format!("`{name}`: ")) && why.len() > 40, "{why}"),
            }
        }
    }
}

/// Values of another core are named with that core's name as prefix; the selection does not change.
#[test]
fn names_of_another_core() {
    let (description, programs) = calling();
    let views = programs.iter().map(|assembled| {
        let options = Options { names: assembled.names.clone(), ..Options::default() };
        Session::new(&assembled.program, options).expect("it loads")
    });
    let mut console = Console::of_system(session(&description), views.collect());
    let mut run = |line: &str| console.execute(line);
    run("goto cycle 40").expect("it is there");
    run("core forever").expect("it is there");
    let own = run("print n").expect("a value");
    run("core calling").expect("it is there");
    assert_eq!(run("print forever.n").expect("a value"), format!("core forever: {own}"));
    assert!(run("cores").expect("a list").contains("> calling"));
    assert_ne!(run("print calling.n").expect("a value"), format!("core calling: {own}"));
    assert!(run("watch forever.n > 100").expect("a stop").starts_with("core forever: stop 1; now "));
    assert!(run("stops").expect("a list").contains("watch n > 100 of core forever"));
    assert!(
        run("break forever.again if forever.n == 30")
            .expect("a stop")
            .starts_with("core forever: stop 2 at ")
    );
    assert!(run("cores").expect("a list").contains("> calling"));
    assert!(run("until forever.n == 20").expect("it holds").contains("the expression holds"));
    assert!(run("check forever.n == 20").is_ok());
    assert!(run("continue").expect("it stops").contains("stop 2"));
    assert!(run("continue").expect("it stops").contains("stop 1"));
    // An error in an expression on another core is reported as for the selected core.
    let error = run("print forever.m, calling.n").expect_err("two cores");
    assert!(error.contains("one command is about one core"), "{error}");
    run("core calling").expect("it is there");
    let error = run("print forever.k").expect_err("no such name");
    assert!(error.starts_with("core forever: nothing is named `k`"), "{error}");
    let error = run("print nobody.n").expect_err("no such core");
    assert!(error.contains("nothing is named `nobody.n`"), "{error}");
    assert!(
        console
            .look("print forever.n")
            .expect("it looks")
            .expect("a value")
            .starts_with("core forever: n = ")
    );
}
