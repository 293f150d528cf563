// SPDX-License-Identifier: MIT OR Apache-2.0
//! Sessions on a remote machine: here a second emulator with planted differences.

use std::sync::{Arc, Mutex};
use takt_asm::{MemoryLoader, Options as AsmOptions, assemble};
use takt_debug::console::{Console, Target, first_mistake};
use takt_debug::remote::{Activity, Remote, RemoteError, RemoteSession, State};
use takt_debug::session::{Control, Options, Session};
use takt_emu::{Emulator, PeriodError, Status};
use takt_isa::fp::Flags;
use takt_isa::{BundleAddress, F3, Program, Register};

/// Program that sums its input, keeps the last eight sums in a ring, and stops on command.
const SOURCE: &str = "\
.input  n, mode:int
.output sum, count:int
.reg    at:int x m:int never
.const  gain = 0.5
        fadd    sum, zero, zero
        mov     count, zero
        mov     at, zero
        wait    period
.period
period: fadd    sum, sum, n
        iadd    count, count, 1
        fmul    x, sum, gain
        st      ring[at], x
        iadd    at, at, 1
        iand    at, at, 7
        bnz     mode, other
        wait    period
other:  isub    m, mode, 2
        bz      m, stop
        isub    m, m, 1
        bz      m, wrong
rare:   mov     never, n
        wait    period
stop:   halt
wrong:  li      m, 100000
        ld      x, ring[m]
        wait    period
.data
ring:   .float  0, 0, 0, 0, 0, 0, 0, 0
table:  .float  0.5, 0.25

";

/// Faults planted in the emulated board; none by default.
#[derive(Clone, Copy, Default, Debug)]
struct PlantedFaults {
    /// Bits that are wrong in a register, from a period on.
    register: Option<(u64, Register, u32)>,
    /// Bits that are wrong in a data word, from a period on.
    word: Option<(u64, u32, u32)>,
    /// The board stops answering from this period on.
    gone: Option<u64>,
    /// The program does not reach its `wait` from this period on.
    busy: Option<u64>,
}

/// Circuit of a board, represented by an emulator.
struct Circuit {
    emulator: Emulator,
    program: Program,
    periods: u64,
    runs: bool,
    drives: bool,
    planted: PlantedFaults,
    /// Log of the requests, except reads of values.
    asked: Vec<&'static str>,
    control: Arc<Control>,
}

impl Circuit {
    fn new(program: &Program, planted: PlantedFaults, control: &Arc<Control>) -> Circuit {
        let mut emulator = Emulator::new(program).unwrap();
        for port in &program.inputs {
            emulator.set_input_bits(port.register, 0).unwrap();
        }
        emulator.run_to_wait().unwrap();
        let (program, control) = (program.clone(), Arc::clone(control));
        Circuit {
            emulator,
            program,
            periods: 0,
            runs: true,
            drives: true,
            planted,
            asked: Vec::new(),
            control,
        }
    }

    fn period(&mut self) {
        match self.emulator.run_period(&[]) {
            Ok(_) => self.periods += 1,
            Err(PeriodError::Halted | PeriodError::Fault(_)) => self.drives = false,
            Err(error) => panic!("{error}"),
        }
        self.emulator.run_until(self.emulator.now() + 64).ok();
    }

    fn is(&self, from: Option<u64>) -> bool {
        from.is_some_and(|from| self.periods >= from)
    }
}

/// A board whose circuit is accessible to the test.
#[derive(Clone)]
struct Board(Arc<Mutex<Circuit>>);

impl Board {
    fn circuit<T>(&self, of: impl FnOnce(&mut Circuit) -> T) -> T {
        of(&mut self.0.lock().unwrap())
    }

    fn answer<T>(&self, of: impl FnOnce(&mut Circuit) -> T) -> Result<T, RemoteError> {
        self.circuit(|circuit| match circuit.is(circuit.planted.gone) {
            true => Err(RemoteError::Other("the line is gone".to_owned())),
            false => Ok(of(circuit)),
        })
    }

    fn moved(&self, asked: &'static str, of: impl FnOnce(&mut Circuit)) -> Result<(), RemoteError> {
        self.answer(|circuit| {
            circuit.asked.push(asked);
            of(circuit);
            if circuit.is(circuit.planted.busy) { Err(RemoteError::Busy) } else { Ok(()) }
        })?
    }
}

impl Remote for Board {
    fn state(&mut self) -> Result<State, RemoteError> {
        self.answer(|circuit| {
            let (activity, issued) = match circuit.emulator.status() {
                Status::Waiting { address, .. } if circuit.runs => (Activity::Runs, *address),
                Status::Waiting { address, .. } if circuit.is(circuit.planted.busy) => {
                    (Activity::InPeriod, *address)
                }
                Status::Waiting { address, .. } => (Activity::Held, *address),
                Status::Halted { address, .. } => (Activity::Halted, *address),
                Status::Faulted(fault) => {
                    (Activity::Faulted(fault.address, fault.kind.name().to_owned()), fault.address)
                }
                Status::Running => (Activity::Stopped, BundleAddress::RESET),
            };
            let (periods, drives) = (circuit.periods, circuit.drives);
            State { activity, issued, periods, flags: Flags::NONE, drives }
        })
    }

    fn poll(&mut self) -> Result<State, RemoteError> {
        self.answer(|circuit| {
            (0..3).for_each(|_| circuit.period());
            if circuit.periods > 20 {
                circuit.control.interrupt();
            }
        })?;
        self.state()
    }

    fn hold(&mut self) -> Result<(), RemoteError> {
        self.moved("hold", |circuit| circuit.runs = false)
    }

    fn go(&mut self) -> Result<(), RemoteError> {
        self.answer(|circuit| {
            circuit.asked.push("go");
            circuit.runs = true;
        })
    }

    fn step(&mut self) -> Result<(), RemoteError> {
        self.moved("step", Circuit::period)
    }

    fn restart(&mut self) -> Result<(), RemoteError> {
        self.moved("restart", |circuit| {
            *circuit =
                Circuit { runs: false, ..Circuit::new(&circuit.program, circuit.planted, &circuit.control) };
            circuit.asked.push("restart");
        })
    }

    fn set_input(&mut self, port: Register, bits: u32) -> Result<(), RemoteError> {
        self.answer(|circuit| circuit.emulator.set_input_bits(port, bits).unwrap())
    }

    fn inputs(&mut self) -> Result<Vec<u32>, RemoteError> {
        self.answer(|circuit| {
            let ports = circuit.program.inputs.iter();
            ports.map(|port| circuit.emulator.register(port.register).unwrap()).collect()
        })
    }

    fn outputs(&mut self) -> Result<Vec<u32>, RemoteError> {
        let ports: Vec<Register> =
            self.circuit(|circuit| circuit.program.outputs.iter().map(|port| port.register).collect());
        self.registers(&ports)
    }

    fn registers(&mut self, registers: &[Register]) -> Result<Vec<u32>, RemoteError> {
        assert!(registers.is_sorted());
        self.answer(|circuit| {
            let wrong = |register| match circuit.planted.register {
                Some((from, planted, bits)) if planted == register && circuit.periods >= from => bits,
                _ => 0,
            };
            // Registers that were never written hold arbitrary bits.
            let bits =
                |register| circuit.emulator.register(register).unwrap_or(0xdead_beef) ^ wrong(register);
            registers.iter().map(|register| bits(*register)).collect()
        })
    }

    fn words(&mut self, words: &[u32]) -> Result<Vec<u32>, RemoteError> {
        assert!(words.is_sorted());
        self.answer(|circuit| {
            let wrong = |word| match circuit.planted.word {
                Some((from, planted, bits)) if planted == word && circuit.periods >= from => bits,
                _ => 0,
            };
            words.iter().map(|word| circuit.emulator.memory()[*word as usize] ^ wrong(*word)).collect()
        })
    }
}

fn program() -> Program {
    let options = AsmOptions { machine: &F3, ..AsmOptions::default() };
    assemble("ring.s", &MemoryLoader::new(&[("ring.s", SOURCE)]), &options).unwrap().program
}

/// A console on a board after `periods` periods, its first message, and the board.
fn begin(periods: u64, planted: PlantedFaults, restart: bool, interactive: bool) -> (Console, String, Board) {
    let options = AsmOptions { machine: &F3, ..AsmOptions::default() };
    let assembled = assemble("ring.s", &MemoryLoader::new(&[("ring.s", SOURCE)]), &options).unwrap();
    let debug = assembled.debug_info();
    let (program, control) = (&assembled.program, Arc::new(Control::default()));
    let mut circuit = Circuit::new(program, planted, &control);
    let n = program.inputs[0].register;
    for period in 0..periods {
        circuit.emulator.set_input_bits(n, (period as f32).to_bits()).unwrap();
        circuit.period();
    }
    let board = Board(Arc::new(Mutex::new(circuit)));
    let session = RemoteSession::attach(program, Box::new(board.clone()), control).unwrap();
    let options = Options {
        constants: debug.constants,
        sources: debug.sources,
        names: debug.names,
        ..Options::default()
    };
    let view = Session::new(program, options).unwrap();
    let (console, said) = Console::of_board(session, view, restart, interactive).unwrap();
    (console, said, board)
}

/// Transcript: the commands, each with its answer.
fn talk(console: &mut Console, commands: &[&str]) -> String {
    let mut text = String::new();
    for command in commands {
        text.push_str(&format!("(takt) {command}\n"));
        match console.execute(command) {
            Ok(said) => text.push_str(&said),
            Err(said) => text.push_str(&format!("error: {said}\n")),
        }
    }
    text
}

#[test]
fn console_transcript_of_a_remote_session() {
    let (mut console, mut text, _) = begin(3, PlantedFaults::default(), false, false);
    text += &talk(
        &mut console,
        &[
            "print sum, count, ring[2], never, table[1], gain, period, address",
            "info sum",
            "registers *",
            "ports",
            "memory ring 4",
            "set n = 2.5",
            "step",
            "",
            "display sum * 2",
            "step period 3",
            "check sum == 1",
            "until count == 9",
            "break period 12 if n > 2",
            "watch at == 4",
            "stops",
            "continue",
            "delete 1",
            "continue",
            "goto period 22",
            "list",
            "where",
            "goto start",
            "print sum, n, never, x",
            "set n = 1; 2",
            "go",
            "print sum",
            "hold",
            "hold",
            "echo done",
        ],
    );
    text += &console.leave().unwrap();
    insta::assert_snapshot!("session", text);
}

#[test]
fn refused_commands_state_the_reason() {
    let (mut console, _, board) = begin(2, PlantedFaults::default(), false, false);
    let mut text = String::new();
    for command in [
        "back",
        "b 3",
        "reverse",
        "flight",
        "stalls",
        "accuracy sum",
        "step cycle",
        "step out 2",
        "step 0",
        "step sideways",
        "break :8",
        "break bundle 2",
        "break cycle 7",
        "break nowhere",
        "goto cycle 4",
        "goto period 1",
        "goto there",
        "continue",
        "set sum = 1",
        "set ring[1] = 2",
        "set n",
        "print cycle",
        "print depth + 1",
        "until ring[cycle]",
        "print smu",
        "hodl",
    ] {
        let said = console.execute(command).expect_err(command);
        text.push_str(&format!("(takt) {command}\n{said}\n"));
    }
    text.push_str(&console.execute("help").unwrap());
    text.push_str(&console.execute("help until").unwrap());
    text.push_str(&console.execute("help print").unwrap());
    insta::assert_snapshot!("refused", text);
    assert_eq!(board.circuit(|circuit| circuit.periods), 2, "nothing has moved");
    let mistake = first_mistake("step\nback\n", Target::Board).unwrap();
    assert!(mistake.0 == 2 && mistake.1.contains("does not go back"), "{mistake:?}");
}

#[test]
fn a_script_leaves_the_board_as_it_found_it() {
    let ends = |runs: bool, restart: bool, commands: &[&str]| {
        let (mut console, _, board) = begin(2, PlantedFaults::default(), restart, false);
        if !runs {
            drop(console);
            board.circuit(|circuit| circuit.runs = false);
            let session = RemoteSession::attach(&program(), Box::new(board.clone()), Arc::default()).unwrap();
            let view = Session::new(&program(), Options::default()).unwrap();
            console = Console::of_board(session, view, false, false).unwrap().0;
        }
        talk(&mut console, commands);
        let said = console.leave().unwrap();
        (said, board.circuit(|circuit| circuit.runs))
    };
    let (runs, held) = ("the program runs; outputs drive\n", "the program stays held; outputs drive\n");
    assert_eq!(ends(true, false, &["step 2", "quit"]), (runs.to_owned(), true));
    assert_eq!(ends(false, false, &["step 2"]), (held.to_owned(), false));
    assert_eq!(ends(true, false, &["hold"]), (held.to_owned(), false));
    assert_eq!(ends(true, false, &["goto start", "step"]), (held.to_owned(), false));
    assert_eq!(ends(true, true, &["step"]), (held.to_owned(), false));
    assert_eq!(ends(true, true, &["step", "go"]), (runs.to_owned(), true));
    assert_eq!(ends(false, false, &["go"]), (runs.to_owned(), true));
    // However the console ends, the board is released.
    let (console, _, board) = begin(2, PlantedFaults::default(), false, false);
    assert!(!board.circuit(|circuit| circuit.runs));
    drop(console);
    assert!(board.circuit(|circuit| circuit.runs));
}

#[test]
fn reports_each_difference_once_by_name() {
    let register = |name: &str| {
        let program = program();
        let mut named = program.outputs.iter().chain(&program.registers);
        named.find(|port| port.name == name).unwrap().register
    };
    let one = |planted: PlantedFaults, restart: bool, commands: &[&str]| {
        let (mut console, _, _) = begin(2, planted, restart, false);
        talk(&mut console, commands)
    };
    let planted = |from, name| PlantedFaults {
        register: Some((from, register(name), 0x40_0000)),
        ..PlantedFaults::default()
    };
    for restart in [false, true] {
        let text = one(planted(4, "sum"), restart, &["set n = 1", "step 9", "print sum"]);
        let says = "error: period 4: output port `sum` is ";
        assert!(
            text.contains(says) && text.contains("; inputs: n = 1.0, mode = 0\nperiod 4: waits"),
            "{text}"
        );
        // A difference in a register that affects no output is found when the command ends.
        let text = one(planted(4, "at"), restart, &["step 5", "print at", "step"]);
        let period = if restart { 5 } else { 7 };
        assert!(text.contains(&format!("error: after period {period}: `at` (register ")), "{text}");
        // The console shows the board's value, and the shadow continues from it. In this circuit only the values that are read are wrong,
        // so the two differ again in the next step.
        let at = (if restart { 5 } else { 7 }) | 0x40_0000;
        assert!(text.contains(&format!("at = {at} ")), "{text}");
        let word = PlantedFaults { word: Some((4, 3, 1)), ..PlantedFaults::default() };
        let text = one(word, restart, &["step 8"]);
        let says = match restart {
            true => "after period 8: data word 3 (`ring+3`) is 1e-45 on the board, 0.0 in the emulator",
            false => "after period 10: data word 3 (`ring+3`) is 1.5000001 on the board, 1.5 in the emulator",
        };
        assert!(text.contains(says), "{text}");
    }
    // Constants are compared at the start of the session.
    let (constant, bits) = program().constants[0];
    let (_, said, _) = begin(
        2,
        PlantedFaults { register: Some((0, constant, 1)), ..PlantedFaults::default() },
        false,
        false,
    );
    assert_eq!(bits, 0.5_f32.to_bits());
    let says =
        " is 0.50000006 on the board, 0.5 in the emulator, and the program does not write it\nperiod 2: ";
    assert!(said.starts_with("register ") && said.contains(says), "{said}");
    let (_, said, _) = begin(2, PlantedFaults::default(), false, false);
    assert!(said.starts_with("period 2: waits for the tick, since bundle "), "{said}");
    // Without a difference none is reported, not even for registers that were never written.
    for restart in [false, true] {
        let text = one(
            PlantedFaults::default(),
            restart,
            &["set n = 0.1", "step 20", "set mode = 1", "step", "set mode = 0", "step 5"],
        );
        assert!(!text.contains("error"), "{text}");
    }
}

#[test]
fn a_program_that_stops() {
    let (mut console, _, board) = begin(2, PlantedFaults::default(), false, false);
    let text =
        talk(&mut console, &["set mode = 2", "step 4", "print count", "step", "go", "goto start", "step"]);
    assert!(text.contains("the program has halted\nperiod 2: halted at bundle "), "{text}");
    assert!(text.contains("outputs are safe") && text.contains("count = 3 "), "{text}");
    assert!(text.contains("error: the program has halted: `goto start` starts it again"), "{text}");
    assert!(
        text.ends_with(&console.execute("where").unwrap()) && text.contains("\nperiod 1: waits"),
        "{text}"
    );
    assert_eq!(board.circuit(|circuit| circuit.asked.clone()), ["restart", "step"]);

    let (mut console, _, _) = begin(2, PlantedFaults::default(), false, false);
    let text = talk(&mut console, &["set mode = 3", "step 4", "step", "print m"]);
    let says = "reads data word 100000, but the data memory has words 0 to 1023";
    assert!(text.contains(says) && text.contains("ld      x, ring[m]"), "{text}");
    assert!(text.contains("period 2: stopped with a fault, data address, in bundle "), "{text}");
    assert!(
        text.contains("error: the program has stopped with a fault: `goto start`")
            && text.contains("m = 100000 "),
        "{text}"
    );
    assert_eq!(console.leave().unwrap(), "the program has stopped with a fault; outputs are safe\n");
}

#[test]
fn reports_a_board_that_does_not_answer() {
    let busy = |from| PlantedFaults { busy: Some(from), ..PlantedFaults::default() };
    let (mut console, said, board) = begin(2, busy(2), false, false);
    assert!(
        said.starts_with("the program does not come to its `wait`") && said.contains(" issued last; "),
        "{said}"
    );
    let text = talk(&mut console, &["print sum", "step", "where"]);
    assert!(text.contains("error: the program is in a period: `hold` waits for its end"), "{text}");
    assert_eq!(console.leave().unwrap(), "the program runs; outputs drive\n");
    assert!(board.circuit(|circuit| circuit.runs));
    let (mut console, _, _) = begin(2, busy(4), false, false);
    let text = talk(&mut console, &["step 5", "hold", "registers"]);
    assert!(
        text.contains("error: the program does not come")
            && text.contains("period 4: has not come to its `wait`"),
        "{text}"
    );

    let gone = PlantedFaults { gone: Some(4), ..PlantedFaults::default() };
    let (mut console, _, _) = begin(2, gone, false, false);
    let text =
        talk(&mut console, &["step 5", "print sum", "step", "hold", "where", "stops", "set n = 1", "go"]);
    assert!(text.contains("(takt) step 5\nerror: the line is gone\n"), "{text}");
    assert!(text.contains("error: the program's state is unknown: `hold` asks again"), "{text}");
    assert_eq!(console.leave().unwrap_err(), "the line is gone");
}

#[test]
fn runs_freely_until_interrupted() {
    let (mut console, _, board) = begin(2, PlantedFaults::default(), false, true);
    let text = talk(&mut console, &["set n = 0.5", "continue"]);
    let periods = board.circuit(|circuit| circuit.periods);
    assert!(text.contains(&format!("interrupted\nperiod {periods}: waits")) && periods > 20, "{text}");
    assert!(!board.circuit(|circuit| circuit.runs));
    // An interrupt also ends an endless search.
    board.circuit(|circuit| circuit.control.interrupt());
    assert!(console.execute("until sum < 0").unwrap().starts_with("interrupted\n"));
    let text = talk(&mut console, &["set mode = 2", "continue"]);
    assert!(text.contains("the program has halted\n"), "{text}");
    assert_eq!(console.leave().unwrap(), "the program has halted; outputs are safe\n");
}

#[test]
fn completions() {
    let (console, _, _) = begin(1, PlantedFaults::default(), false, false);
    let complete = |line: &str| {
        let (at, found) = console.complete(line);
        format!("{}|{}", &line[..at], found.join(" "))
    };
    assert_eq!(complete("st"), "|step stops");
    assert_eq!(complete("step p"), "step |period");
    assert_eq!(complete("goto "), "goto |period start");
    assert_eq!(complete("until cou"), "until |count");
    assert_eq!(complete("print 1 + su"), "print 1 + |sum");
    assert_eq!(complete("set n"), "set |n never");
    assert_eq!(complete("hold "), "hold |");
    assert!(complete("").contains("hold") && !complete("").contains("back"));
}
