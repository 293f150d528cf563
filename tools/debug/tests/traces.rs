// SPDX-License-Identifier: MIT OR Apache-2.0
//! Traces compared with their run, through readers that share no code with the writers.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::io::{self, Cursor, Write};
use std::ops::Range;
use std::rc::Rc;
use takt_asm::{MemoryLoader, Options as AsmOptions, assemble};
use takt_debug::trace::{Format, Options, SignalError, Summary, Tracer};
use takt_emu::testing::{Options as ProgramOptions, Random, input_ports, random_program};
use takt_emu::{Emulator, Event, Retire, Step};
use takt_isa::timing::Cycle;
use takt_isa::{F1, F3, MACHINES, Program, Type};

/// A shared in-memory file; writes fail beyond a size limit in bytes.
#[derive(Clone)]
struct Disk(Rc<RefCell<Vec<u8>>>, usize);

impl Disk {
    fn new() -> Disk {
        Disk(Rc::default(), usize::MAX)
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.0.borrow().len() + bytes.len() > self.1 {
            return Err(io::ErrorKind::StorageFull.into());
        }
        self.0.borrow_mut().extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn tracking(machine: &'static takt_isa::Machine) -> Program {
    let loader = MemoryLoader::new(takt_programs::SOURCES);
    let options = AsmOptions { machine, effort: 0, ..AsmOptions::default() };
    assemble("hybrid/tracking.s", &loader, &options).unwrap().program
}

/// Emulator of a program, with small random inputs.
fn loaded(program: &Program, seed: u64) -> Emulator {
    let mut emulator = Emulator::new(program).unwrap();
    let mut random = Random::new(seed);
    for port in &program.inputs {
        let bits = match port.ty {
            Type::F => (0.5 + random.below(100) as f32 / 200.0).to_bits(),
            _ => random.below(100),
        };
        emulator.set_input_bits(port.register, bits).unwrap();
    }
    for input in input_ports(program.machine) {
        emulator.set_input_bits(input, random.word()).unwrap();
    }
    emulator
}

const PERIODS: u64 = 3;

fn options(format: Format) -> Options {
    Options { format, cycles: 0..Cycle::MAX, signals: Vec::new(), limit: u64::MAX }
}

fn traced(program: &Program, options: Options) -> (Vec<u8>, Summary) {
    let disk = Disk::new();
    let mut emulator = loaded(program, 1);
    let mut tracer = Tracer::new(&emulator, Box::new(disk.clone()), options).unwrap();
    for _ in 0..PERIODS {
        if tracer.run_period(&mut emulator, None).is_err() {
            break;
        }
    }
    let summary = tracer.finish(&emulator).unwrap();
    let bytes = disk.0.borrow().clone();
    (bytes, summary)
}

/// Expected waveform values in each cycle, by signal, computed without the tracer.
fn expected(program: &Program) -> Vec<BTreeMap<String, String>> {
    let mut whole = loaded(program, 1);
    for _ in 0..PERIODS {
        whole.run_period(&[]).unwrap();
    }
    let (end, mut emulator, mut cycles) = (whole.now(), loaded(program, 1), Vec::new());
    // Ticks replay the recorded run.
    while emulator.now() < end {
        if let takt_emu::Status::Waiting { since, .. } = *emulator.status() {
            emulator.tick_at(emulator.now().max(since + u64::from(program.machine.refill)));
        }
        let mut tick = false;
        let step =
            emulator.observed(&mut |event| tick |= matches!(event, Event::Tick { .. })).step_cycle().unwrap();
        let mut signals = BTreeMap::new();
        let mut flag =
            |name: &str, value: bool| signals.insert(format!("takt.{name}"), u8::from(value).to_string());
        flag("tick", tick);
        flag("missed", false);
        flag("issue", matches!(step, Step::Issued { .. }));
        let kind = |wanted: &str| matches!(step, Step::Stalled { cause, .. } if cause.name() == wanted);
        for name in ["branch", "operand", "destination", "unit", "drain", "write port", "wait"] {
            flag(&format!("stall.{}", name.replace(' ', "_")), kind(name));
        }
        for (scope, ports) in
            [("inputs", &program.inputs), ("outputs", &program.outputs), ("registers", &program.registers)]
        {
            for port in ports {
                let value = match (emulator.register(port.register), port.ty) {
                    (bits, Type::F) => format!("{:?}", bits.map_or(f32::NAN, f32::from_bits)),
                    (Some(bits), _) => format!("{bits:032b}"),
                    (None, _) => "x".repeat(32),
                };
                signals.insert(format!("takt.{scope}.{}", port.name), value);
            }
        }
        cycles.push(signals);
    }
    cycles
}

/// Values in each cycle of the range, as read from a waveform by wellen.
fn read_wave(bytes: Vec<u8>, cycles: Range<Cycle>) -> Vec<BTreeMap<String, String>> {
    let mut wave = wellen::simple::read_from_reader(Cursor::new(bytes)).unwrap();
    let vars: Vec<_> = wave
        .hierarchy()
        .all_vars()
        .map(|var| {
            let var = &wave.hierarchy()[var];
            (var.full_name(wave.hierarchy()), var.signal_ref())
        })
        .collect();
    let ids: Vec<_> = vars.iter().map(|(_, id)| *id).collect();
    wave.load_signals(&ids);
    let times = wave.time_table().to_vec();
    assert!(times[0] == cycles.start || times[0] == 0 && times[1] == cycles.start, "{times:?}");
    assert_eq!(times.last(), Some(&cycles.end));
    let mut read = vec![BTreeMap::new(); (cycles.end - cycles.start) as usize];
    for (name, id) in vars {
        let mut changes = wave.get_signal(id).unwrap().iter_changes().peekable();
        let mut now = None;
        for cycle in cycles.clone() {
            while let Some((_, value)) = changes.next_if(|(time, _)| times[*time as usize] <= cycle) {
                now = Some(match value {
                    wellen::SignalValueRef::Real(value) => format!("{:?}", value as f32),
                    value => value.to_bit_string().unwrap(),
                });
            }
            let value = now.clone().unwrap_or_else(|| panic!("{name} has no value in cycle {cycle}"));
            read[(cycle - cycles.start) as usize].insert(name.clone(), value);
        }
    }
    read
}

#[test]
fn waveforms() {
    for machine in [&F3, &F1] {
        let program = tracking(machine);
        let all = expected(&program);
        let end = all.len() as u64;
        for format in [Format::Vcd, Format::Fst] {
            for cycles in [0..end, 77..end - 50, end - 1..end] {
                let (bytes, summary) =
                    traced(&program, Options { cycles: cycles.clone(), ..options(format) });
                assert_eq!(summary, Summary { cycles: cycles.clone(), cut: false });
                let read = read_wave(bytes, cycles.clone());
                for (read, cycle) in read.iter().zip(cycles.clone()) {
                    let mut read = read.clone();
                    assert!(read.remove("takt.bundle").is_some());
                    assert_eq!(read, all[cycle as usize], "{format:?}, cycle {cycle}");
                }
            }
        }
    }
}

#[test]
fn selected_signals() {
    let program = tracking(&F3);
    let signals = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    let options = Options { signals: signals(&["F*", "issue"]), ..options(Format::Vcd) };
    let (bytes, summary) = traced(&program, options.clone());
    let read = read_wave(bytes, summary.cycles);
    let names: Vec<&str> = read[0].keys().map(String::as_str).collect();
    assert_eq!(names, ["takt.issue", "takt.outputs.F1", "takt.outputs.F2", "takt.outputs.F3"]);

    let emulator = loaded(&program, 1);
    let refused = |options| Tracer::new(&emulator, Box::new(Disk::new()), options).map(|_| ()).unwrap_err();
    let error = refused(Options { signals: signals(&["tua4"]), ..options.clone() });
    assert_eq!(error.to_string(), "no signal is named `tua4`; did you mean `tau4`?");
    let error = refused(Options { signals: signals(&["stall.brunch"]), ..options.clone() });
    assert_eq!(error.to_string(), "no signal is named `stall.brunch`; did you mean `stall.branch`?");
    let log = Options { signals: signals(&["F*", "stall.*"]), format: Format::JsonLines, ..options.clone() };
    assert_eq!(refused(log), SignalError::NoRegister("stall.*".to_owned()));
    assert_eq!(refused(Options { format: Format::Kanata, ..options }), SignalError::None);
}

#[test]
fn size_is_bounded() {
    let program = tracking(&F3);
    for (_, format) in Format::ALL {
        let (whole, _) = traced(&program, options(format));
        let limit = whole.len() as u64 / 4;
        let (bytes, summary) = traced(&program, Options { limit, ..options(format) });
        assert!(summary.cut && bytes.len() < whole.len(), "{format:?}: {}", bytes.len());
        if matches!(format, Format::Vcd | Format::Fst) {
            // The truncated trace is a complete file.
            read_wave(bytes, summary.cycles);
        }
    }
}

#[test]
fn a_full_disk() {
    let program = tracking(&F3);
    for (_, format) in Format::ALL {
        let mut emulator = loaded(&program, 1);
        let disk = Disk(Rc::default(), 1000);
        let mut tracer = Tracer::new(&emulator, Box::new(disk), options(format)).unwrap();
        // A failed write does not disturb the run.
        let report = tracer.run_period(&mut emulator, None).unwrap();
        assert_eq!(report, loaded(&program, 1).run_period(&[]).unwrap());
        assert_eq!(tracer.finish(&emulator).unwrap_err().kind(), io::ErrorKind::StorageFull);
    }
}

/// Signals can be selected by every documented form of their names: alone, with the group, with the whole path.
#[test]
fn signals_by_the_names_of_the_document() {
    let text = include_str!("../../../docs/traces.md");
    let table = text.split("## Waveforms").nth(1).unwrap().split("\n## ").next().unwrap();
    let cells = table.lines().filter_map(|line| line.strip_prefix('|')?.split('|').next());
    let names: Vec<&str> = cells.flat_map(|cell| cell.split('`').skip(1).step_by(2)).collect();
    assert!(names.len() >= 8 && names.iter().all(|name| name.starts_with("takt.")), "{names:?}");
    let program = tracking(&F3);
    let selected = |pattern: &str| {
        let signals = vec![pattern.to_owned()];
        let (bytes, _) = traced(&program, Options { signals, ..options(Format::Vcd) });
        read_names(bytes)
    };
    let all = selected("*");
    let mut covered = 0;
    for name in names {
        let head = name.trim_end_matches('*');
        let meant: Vec<&String> = all.iter().filter(|path| path.starts_with(head)).collect();
        assert!(!meant.is_empty(), "{name}");
        covered += meant.len();
        assert!(selected(name).iter().eq(meant.iter().copied()), "{name}");
        assert!(
            selected(&name["takt.".len()..]).iter().eq(meant.iter().copied()),
            "{name} without the top group"
        );
    }
    assert_eq!(covered, all.len(), "every signal is in the document");
    let causes = table.split("charged to: `").nth(1).unwrap().split('`').next().unwrap();
    let stalls: Vec<String> = causes.split(' ').map(|cause| format!("takt.stall.{cause}")).collect();
    assert_eq!(selected("takt.stall.*"), stalls);
    // A pattern for a name does not match the beginnings of group names.
    assert!(!selected("i*").iter().any(|path| path.starts_with("takt.inputs.") && !path.contains(".i")));
    assert_eq!(selected("*.F1"), ["takt.outputs.F1"]);
}

/// Paths of a VCD's signals, in file order.
fn read_names(bytes: Vec<u8>) -> Vec<String> {
    let text = String::from_utf8(bytes).unwrap();
    let mut scopes = Vec::new();
    let mut names = Vec::new();
    for line in text.lines().take_while(|line| !line.starts_with("$enddefinitions")) {
        let words: Vec<&str> = line.split(' ').collect();
        match words[0] {
            "$scope" => scopes.push(words[2]),
            "$upscope" => drop(scopes.pop()),
            "$var" => names.push(format!("{}.{}", scopes.join("."), words[4])),
            _ => {}
        }
    }
    names
}

fn retires(program: &Program) -> Vec<Retire> {
    let (mut emulator, mut retires) = (loaded(program, 1), Vec::new());
    for _ in 0..PERIODS {
        let mut sink = |event: &Event| {
            if let Event::Retire(retire) = event {
                retires.push(*retire);
            }
        };
        if emulator.observed(&mut sink).run_period(&[]).is_err() {
            break;
        }
    }
    retires
}

#[test]
fn retire_log() {
    let program = tracking(&F3);
    let (bytes, _) = traced(&program, options(Format::JsonLines));
    let text = String::from_utf8(bytes).unwrap();
    let lines: Vec<serde_json::Value> =
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let events = |name: &str| lines.iter().filter(|line| line["event"] == name).count() as u64;
    assert_eq!((events("tick"), events("wait")), (PERIODS, PERIODS + 1));
    let logged: Vec<_> = lines.iter().filter(|line| line["event"] == "retire").collect();
    let retires = retires(&program);
    assert_eq!(logged.len(), retires.len());
    for (line, retire) in logged.into_iter().zip(retires) {
        assert_eq!(line["cycle"], retire.cycle);
        assert_eq!(line["issued"], retire.issued);
        assert_eq!(line["bundle"], retire.address.get());
        assert_eq!(line["op"], retire.op.row().mnemonic);
        assert!(line["source"].as_str().unwrap().starts_with("hybrid/tracking.s:"));
        if let Some(register) = retire.register {
            assert_eq!(line["register"], program.register_text(register));
            assert_eq!(line["bits"], format!("0x{:08x}", retire.value));
        }
        if let Some(value) = line["value"].as_f64().filter(|_| retire.op.row().result_type() == Type::F) {
            assert_eq!((value as f32).to_bits(), retire.value);
        }
    }
}

/// An instruction read back from a Kanata log.
#[derive(Default, Debug)]
struct Row {
    text: String,
    /// Stages: name, first cycle, and cycle after the last.
    stages: Vec<(String, u64, Option<u64>)>,
    retired: Option<(u64, bool)>,
    producers: Vec<u64>,
}

/// Strict reader of the log format as specified (shioyadan/Konata, docs/kanata-log-format.md).
fn read_kanata(text: &str) -> BTreeMap<u64, Row> {
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("Kanata\t0004"));
    let mut rows: BTreeMap<u64, Row> = BTreeMap::new();
    let mut cycle: Option<u64> = None;
    for line in lines {
        let fields: Vec<&str> = line.split('\t').collect();
        let number = |i: usize| fields[i].parse::<u64>().unwrap();
        match (fields[0], fields.len()) {
            ("C=", 2) => assert!(cycle.replace(number(1)).is_none()),
            ("C", 2) => {
                assert!(number(1) > 0);
                cycle = Some(cycle.unwrap() + number(1));
            }
            ("I", 4) => {
                assert!(cycle.is_some() && rows.insert(number(1), Row::default()).is_none());
                assert_eq!(number(1) + 1, rows.len() as u64, "ids count up");
            }
            ("L", 4) => {
                let row = rows.get_mut(&number(1)).unwrap();
                if number(2) == 0 {
                    row.text.push_str(fields[3]);
                }
            }
            ("S", 4) => {
                let row = rows.get_mut(&number(1)).unwrap();
                assert!(number(2) == 0 && row.retired.is_none());
                assert!(row.stages.last().is_none_or(|stage| stage.2 == cycle), "{line}");
                row.stages.push((fields[3].to_owned(), cycle.unwrap(), None));
            }
            ("E", 4) => {
                let stage = rows.get_mut(&number(1)).unwrap().stages.last_mut().unwrap();
                assert_eq!((stage.0.as_str(), stage.2), (fields[3], None), "{line}");
                stage.2 = cycle;
            }
            ("R", 4) => {
                let row = rows.get_mut(&number(1)).unwrap();
                assert!(row.retired.replace((cycle.unwrap(), number(3) == 0)).is_none());
            }
            ("W", 4) => {
                assert!(number(2) < number(1) && rows.contains_key(&number(2)), "{line}");
                rows.get_mut(&number(1)).unwrap().producers.push(number(2));
            }
            _ => panic!("no line of a Kanata log: {line}"),
        }
    }
    rows
}

#[test]
fn konata() {
    let (mut waits, mut arrows) = (HashMap::new(), 0);
    let random = (0..30).flat_map(|seed| {
        MACHINES.iter().map(move |machine| random_program(seed, machine, ProgramOptions::TAME))
    });
    for program in [tracking(&F3), tracking(&F1)].into_iter().chain(random) {
        let (bytes, summary) = traced(&program, options(Format::Kanata));
        let rows = read_kanata(&String::from_utf8(bytes).unwrap());
        let stage = |row: &Row, name: &str| {
            row.stages.iter().find(|stage| stage.0 == name).map(|stage| (stage.1, stage.2.unwrap()))
        };
        let mut shown = Vec::new();
        for row in rows.values() {
            let Some((issued, _)) = stage(row, "Is") else { continue };
            if !row.text.ends_with("nop") {
                let done = stage(row, "Wb").map_or(issued, |(writeback, _)| writeback);
                assert_eq!(row.retired, Some((done + 1, true)));
                shown.push((done, issued, row.text.split(' ').next().unwrap().parse::<u32>().unwrap()));
            }
            for (name, from, to) in &row.stages {
                *waits.entry(name.clone()).or_insert(0) += to.unwrap() - from;
            }
            for producer in &row.producers {
                // A consumer issues at or after the producer's writeback.
                assert!(stage(&rows[producer], "Wb").unwrap().0 <= issued);
                arrows += 1;
            }
        }
        // Operations in flight at the end of the trace are logged until they complete.
        shown.retain(|(done, ..)| *done < summary.cycles.end);
        shown.sort_unstable();
        let mut real: Vec<_> = retires(&program)
            .iter()
            .map(|retire| (retire.cycle, retire.issued, retire.address.get()))
            .collect();
        real.retain(|(done, ..)| *done < summary.cycles.end);
        real.sort_unstable();
        assert_eq!(shown, real);
    }
    for stage in ["Fr", "Op", "De", "Un", "Dr", "Wp", "Is", "Ex", "Wb"] {
        assert!(waits[stage] > 0, "{stage}");
    }
    assert!(arrows > 1000);
}
