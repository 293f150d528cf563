// SPDX-License-Identifier: MIT OR Apache-2.0
//! Compares every register and data word that a host reads of a running core with the emulator's, in the complete top level.

use std::ops::Range;
use std::panic::AssertUnwindSafe;
use std::path::Path;
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::protocol::{HOLD, IMAGE, LinkError, PAGE, RESTART, RUN};
use takt_board::simulation::Simulation;
use takt_board::{Application, Board, Host, Wiring, top};
use takt_emu::{Emulator, Status};
use takt_isa::{Program, Register, T3};
use takt_rtl::verilator;

/// Program in which all slots write registers, with the longest latencies just before the `wait`; a table changes from period to period.
const PROGRAM: &str = "
.schedule on
.input n:int x
.output y k:int
.state  sum
.data
table:  .float 1.0, 2.0, 3.0, 4.0
.once
        mov     sum, zero
        mov     y, zero
        mov     k, zero
        wait    period
.period
period:
.reg    i:int a b c d e f g
        iand    i, n, 3
        itof    a, n
        ld      b, table[i]
        fadd    c, b, x
        st      table[i], c
        fmul    d, a, x
        fadd    sum, sum, d
        fdiv    e, x, c
        fsqrt   f, b
        fsin    g, x
        fadd    y, e, g
        fadd    y, y, f
        mov     k, i
        wait    period
";

fn program(source: &str) -> Program {
    let loader = MemoryLoader::new(&[("p.s", source)]);
    let options = Options { machine: &T3, ..Options::default() };
    assemble("p.s", &loader, &options).unwrap_or_else(|e| panic!("{e:?}")).program
}

fn board() -> Board {
    Board::from_name("ulx3s-85f").expect("a board").expect("a right one")
}

/// A wiring without peripherals, with short periods and a fast line.
fn wiring(program: &Program) -> Wiring {
    Wiring { period: 2000, baud: 10_000_000, clock: 50.0, ..Wiring::none(&board(), program) }
}

/// Compares the board with the emulator, period by period: every value that the emulator knows, and the data words in the ranges.
fn compare(host: &mut Host<Simulation>, program: &Program, periods: u32, ranges: &[Range<u32>]) {
    let on_board = Application::from(program);
    let port = |name: &str| on_board.settable(name).expect("an input port").0;
    let mut emulator = Emulator::new(program).expect("it can be emulated");
    host.set("control", RUN | HOLD | RESTART).expect("control");
    assert_eq!(host.register("observed").expect("a register"), 1);
    emulator.run_to_wait().expect("no fault");
    let mut compared = [0, 0];
    for period in 0..periods {
        let (n, x) = (period.wrapping_mul(7), (period as f32 * 0.3).to_bits());
        host.write(port("n"), &[n]).expect("a port");
        host.write(port("x"), &[x]).expect("a port");
        for (input, bits) in program.inputs.iter().zip([n, x]) {
            emulator.set_input_bits(input.register, bits).expect("an input port");
        }
        host.set("step", 1).expect("step");
        emulator.run_period(&[]).expect("no fault");
        let Status::Waiting { address, .. } = *emulator.status() else { panic!("it waits") };
        // A read of a core's own addresses waits until the period is over; a read of a register of the board does not.
        for bank in program.machine.banks() {
            let first = Register::new(bank.base.into()).expect("a register");
            let at = on_board.register(0, first).expect("it can be read");
            // The last input is `zero`, which is not a port.
            let count = usize::from(bank.depth) - usize::from(*bank == program.machine.inputs);
            let read = host.read(at, count).expect("a bank");
            for (register, bits) in bank.registers().zip(read) {
                if let Some(expected) = emulator.register(register) {
                    assert_eq!(bits, expected, "period {period}: {}", program.register_text(register));
                    compared[0] += 1;
                }
            }
        }
        assert_eq!(host.register("issued").expect("a register"), address.get(), "the wait");
        for range in ranges {
            let words = &emulator.memory()[range.start as usize..range.end as usize];
            let at = on_board.word(0, range.start).expect("it can be read");
            let read = host.read(at, words.len()).expect("the memory");
            let differs = words.iter().zip(&read).position(|(word, read)| word != read);
            assert_eq!(differs, None, "period {period}: a data word of {range:?}");
            compared[1] += words.len();
        }
    }
    let words = ranges.iter().map(ExactSizeIterator::len).sum::<usize>() * periods as usize;
    assert!(compared[0] > 10 * periods as usize && compared[1] == words, "{compared:?}");
}

fn connect(sim: Simulation) -> Host<Simulation> {
    Host::connect(sim, 3).unwrap_or_else(|error| panic!("{error}"))
}

/// Program with more data memory than the host has addresses for, and with an image of more than four pages: the words that have addresses
/// equal the emulator's, tables beyond the addresses included, and the host reads the records on the last page.
#[test]
fn memories_of_other_depths() {
    let zeros_and_records =
        "table:  .float 1.0, 2.0, 3.0, 4.0\nlow: .space 12000\n.rep i, 1, 17000\n.float i\n.endr\n";
    let source = PROGRAM.replace("table:  .float 1.0, 2.0, 3.0, 4.0\n", zeros_and_records);
    let source = source.replace(".reg    i:int", "ld b, 28000\nst 16383, b\nst 28000, x\n.reg    i:int");
    let first = program(&format!(".machine t1 code=4096 data=32768\n{source}"));
    let wiring = wiring(&first);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("board-depths");
    let image = top::image(&first).expect("there is room").records;
    assert!(image.len() > 4 * PAGE, "{} records", image.len());
    let circuit = top::circuit(&board(), &wiring, &first).unwrap_or_else(|error| panic!("{error}"));
    let sim = Simulation::of(&circuit.files, &board(), &wiring, &folder);
    let mut host = connect(sim.unwrap_or_else(|error| panic!("{error}")));
    let last = image.len() - 1;
    host.set("control", 0).expect("control");
    host.set("page", (last / PAGE) as u32).expect("a page");
    let read = host.read(IMAGE + 4 * (last % PAGE) as u16, 3).expect("a record");
    assert_eq!(read, image[last]);
    compare(&mut host, &first, 3, &[0..16, 12_000..12_016, 16_368..16_384]);
    assert_eq!(Application::from(&first).word(0, 16_384), None);
}

#[test]
fn registers_and_data_are_the_emulators() {
    let first = program(PROGRAM);
    let wiring = wiring(&first);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("board-observe");
    let circuit = top::circuit(&board(), &wiring, &first).expect("there is a circuit");
    let sim = Simulation::of(&circuit.files, &board(), &wiring, &folder);
    let mut host = connect(sim.unwrap_or_else(|error| panic!("{error}")));
    compare(&mut host, &first, 12, std::slice::from_ref(&(0..1024)));

    // The host reads, with the same names, between two ticks of a program that runs by itself, and of a program that has stopped.
    let on_board = Application::from(&first);
    let at = |name: &str| on_board.find(name).unwrap_or_else(|text| panic!("{text}")).read;
    host.set("control", RUN | RESTART).expect("control");
    host.write(at("x"), &[2.0_f32.to_bits()]).expect("a port");
    host.line.run(20_000, &[]).expect("it runs");
    let [a, b] = [at("table"), at("table[0]")].map(|at| host.read(at, 1).expect("a word")[0]);
    assert!(f32::from_bits(a) > 10.0 && f32::from_bits(b) >= f32::from_bits(a), "it grows by 2.0 a period");
    // The stream, too, has the results of the period's last operations: `g` is the sine.
    host.set("stream", 1 << 20 | 1 << 16 | u32::from(at("g"))).expect("stream");
    let mut frames = Vec::new();
    while frames.len() < 5 {
        frames.extend(host.streamed().expect("a line").map(|frame| frame.words));
    }
    host.set("stream", 0).expect("stream");
    let mut emulator = Emulator::new(&first).expect("it can be emulated");
    emulator.run_to_wait().expect("no fault");
    for (input, bits) in first.inputs.iter().zip([0, 2.0_f32.to_bits()]) {
        emulator.set_input_bits(input.register, bits).expect("an input port");
    }
    emulator.run_period(&[]).expect("no fault");
    let sine = first.registers.iter().find(|known| known.name == "g").expect("a name").register;
    assert!(frames.iter().all(|words| Some(words[1]) == emulator.register(sine)), "{frames:?}");
    assert!(frames.windows(2).all(|pair| pair[1][0] == pair[0][0] + 1), "{frames:?}");
    host.set("control", 0).expect("control");
    let [a, b] = [at("table"), at("[0]")].map(|at| host.read(at, 1).expect("a word")[0]);
    assert_eq!(a, b, "it stands");
    for wrong in ["tabel", "table[1024]", "[1024]", "@m999", "@q1", "table[-1]", "table[", "@"] {
        assert!(on_board.find(wrong).is_err(), "{wrong}");
    }
    assert!(on_board.settable("table[1]").is_err_and(|text| text.contains("only its program writes")));

    // A host can look at a program that has stopped with a fault, but not at a program that never waits.
    let fault =
        PROGRAM.replace("        mov     k, i\n", "        mov     k, i\n        ld      a, table[n]\n");
    let fault = program(&fault);
    host.load(&top::image(&fault).expect("it fits").records).expect("it is loaded");
    host.set("control", RUN | HOLD).expect("control");
    host.write(at("n"), &[5000]).expect("a port");
    host.set("step", 1).expect("step");
    let sum = Application::from(&fault).find("n").expect("a port").read;
    assert_eq!(host.read(sum, 1).expect("it has stopped")[0], 5000);
    assert!(host.status().expect("status").fault());
    assert!(host.read(at("table"), 4).is_ok());
    let endless = program(".input n:int x\n.output y k:int\nloop:   jmp     loop\n");
    host.load(&top::image(&endless).expect("it fits").records).expect("it is loaded");
    host.set("control", RUN).expect("control");
    // The line of a simulation has less patience than the board.
    assert!(matches!(host.read(at("table"), 1), Err(LinkError::Busy)));

    // Faults in the copies are noticed.
    let faults = [
        ("index <= loads ? load_address[INDEX-1:0] : retired[INDEX-1:0]", "index <= load_address[INDEX-1:0]"),
        (
            "words[stored_address[DATA-1:0]] <= stored_value",
            "words[stored_address[DATA-1:0]] <= issued ? stored_value : words[stored_address[DATA-1:0]]",
        ),
    ];
    let faults = faults.map(|(from, to)| ("board/takt_shadow_memory.v", from, to));
    let mut files = circuit.files.clone();
    verilator::plant(&mut files, top::TOP, &faults).unwrap_or_else(|error| panic!("{error}"));
    for fault in 0..=faults.len() {
        let sim = Simulation::with_fault(&files, &board(), &wiring, &folder, fault);
        let sim = sim.unwrap_or_else(|error| panic!("{error}"));
        let noticed = std::panic::catch_unwind(AssertUnwindSafe(|| {
            compare(&mut connect(sim), &first, 12, std::slice::from_ref(&(0..1024)))
        }));
        assert_eq!(noticed.is_err(), fault > 0, "{:?}", fault.checked_sub(1).map(|fault| faults[fault]));
    }
}
