// SPDX-License-Identifier: MIT OR Apache-2.0
//! Units in simulation: builds a unit's Verilog with Verilator into a small program and passes operations through it.
//! `rtl/tests/README.md` says how to use it.

use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use takt_isa::fp::{Flags, Reference, SIN_IDENTITY, SIN_LIMIT, Value};
use takt_isa::{Effect, Function, Op, Row, Type, Unit, compute};
use takt_rtl::verilator::{Sources, VerilatorError};
use takt_rtl::{Circuit, Library};

#[path = "../../../isa/tests/fp_common/mod.rs"]
#[allow(dead_code, reason = "of the arithmetic tests' operands this needs a part")]
mod fp_common;

pub(crate) use fp_common::full;
use fp_common::{Pairs, Random, Triples, special_values};

/// The C++ half of [`Simulation`].
const DRIVER: &str = include_str!("driver.cpp");

/// Maximum number of operations per batch.
const BATCH: usize = 1 << 15;

/// The Verilog files of the project.
pub(crate) fn library() -> Library {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("units");
    Library::load(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
}

/// The circuit of a unit.
pub(crate) fn circuit(library: &Library, unit: &Unit) -> Result<Circuit, String> {
    library.circuit(unit).map_err(|error| format!("unit `{}`: {error}", unit.name))
}

/// Runs a tool and returns its output; `Err` with the output if it failed.
fn run(command: &mut Command) -> Result<String, String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let output = match command.output() {
        Ok(output) => output,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            panic!("{program} is not installed: `cargo xtask test` installs what the tests need")
        }
        Err(error) => panic!("{program} cannot be started: {error}"),
    };
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    if output.status.success() { Ok(text.into_owned()) } else { Err(text.into_owned()) }
}

/// Waivers of `verilator -Wall`, each with its reason.
const WAIVERS: &[&str] = &[
    // A unit's file has the name of its row, `add.v`; modules have a prefix, `takt_add`, because their namespace is global.
    "-Wno-DECLFILENAME",
];

/// Lints a circuit with Verilator, which also elaborates it.
pub(crate) fn lint(library: &Library, circuit: &Circuit) -> Result<String, String> {
    let folder = Folder::new(circuit, "lint");
    run(Command::new("verilator")
        .args(["--lint-only", "-Wall"])
        .args(WAIVERS)
        .args(["--top-module", circuit.unit.rtl])
        .args(circuit.parameters().map(|(name, value)| format!("-G{name}={value}")))
        .args(folder.write(library, circuit)))
}

/// Elaborates a circuit with Icarus Verilog, which rejects the extensions of Verilog-2005 that Verilator accepts.
pub(crate) fn elaborate(library: &Library, circuit: &Circuit) -> Result<String, String> {
    let folder = Folder::new(circuit, "elaborate");
    let top = circuit.unit.rtl;
    run(Command::new("iverilog")
        .args(["-g2005", "-Wall", "-Wno-timescale", "-t", "null", "-s", top])
        .args(circuit.parameters().map(|(name, value)| format!("-P{top}.{name}={value}")))
        .args(folder.write(library, circuit)))
}

/// Temporary folder, unique to each use, and removed with its contents.
struct Folder(PathBuf);

impl Folder {
    fn new(circuit: &Circuit, purpose: &str) -> Folder {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let (process, count) = (std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let name = format!("{}-{purpose}-{process}-{count}", circuit.unit.name);
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        fs::create_dir_all(&folder).expect("the target folder can be written");
        Folder(folder)
    }

    /// Writes the files that the circuit needs, and returns their paths.
    fn write(&self, library: &Library, circuit: &Circuit) -> Vec<PathBuf> {
        let write = |name: &String| {
            let path = self.0.join(name.replace('/', "-"));
            let text = library.text(name).expect("the circuit's files are those of the library");
            fs::write(&path, text).expect("the target folder can be written");
            path
        };
        circuit.files.iter().map(write).collect()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Unit that is simulated in its own process.
pub(crate) struct Simulation {
    pub(crate) circuit: Circuit,
    program: PathBuf,
    process: Child,
    stdin: Option<ChildStdin>,
    stdout: ChildStdout,
}

/// An operation for the circuit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Request {
    pub(crate) op: Op,
    pub(crate) code: u32,
    pub(crate) sources: [u32; 3],
    /// Cycles without an operation before this operation, on top of the unit's interval.
    pub(crate) idle: u32,
}

impl Simulation {
    /// Builds a circuit and starts it. The program stays in the target folder until one of its sources changes.
    pub(crate) fn new(library: &Library, circuit: &Circuit) -> Result<Simulation, String> {
        Simulation::start(circuit, compile(library, circuit).map_err(|error| error.to_string())?, &[])
    }

    /// Starts a built circuit, with Verilog's plusargs.
    pub(crate) fn start(
        circuit: &Circuit,
        program: PathBuf,
        arguments: &[String],
    ) -> Result<Simulation, String> {
        let mut process = Command::new(&program)
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| format!("{}: {error}", program.display()))?;
        let (stdin, stdout) = (process.stdin.take(), process.stdout.take());
        Ok(Simulation { circuit: circuit.clone(), program, stdin, stdout: stdout.expect("piped"), process })
    }

    /// Removes the program of a circuit that will not be needed again.
    pub(crate) fn remove(self) {
        let _ = fs::remove_file(&self.program);
    }

    /// Passes operations through the circuit, in order, as densely as their `idle` allows.
    pub(crate) fn run(&mut self, requests: &[Request]) -> Result<Vec<Value>, String> {
        let mut bytes = Vec::with_capacity(4 + 20 * requests.len());
        bytes.extend((requests.len() as u32).to_le_bytes());
        for request in requests {
            let [a, b, c] = request.sources;
            for word in [request.code, a, b, c, request.idle] {
                bytes.extend(word.to_le_bytes());
            }
        }
        // The driver reads a whole batch before it answers, so that neither side waits for the other.
        let mut answer = vec![0; 8 * requests.len()];
        let exchanged = self
            .stdin
            .as_mut()
            .expect("open until dropped")
            .write_all(&bytes)
            .and_then(|()| self.stdout.read_exact(&mut answer));
        if exchanged.is_err() {
            self.stdin = None;
            let mut message = String::new();
            let stderr = self.process.stderr.as_mut().expect("piped");
            stderr.read_to_string(&mut message).map_err(|error| error.to_string())?;
            return Err(format!("the simulation ended: {message}"));
        }
        let word = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().expect("four bytes"));
        Ok(answer
            .chunks_exact(8)
            .map(|bytes| {
                // {invalid, divide_by_zero, overflow} are bits 4..2 of the status register.
                Value::new(word(&bytes[..4]), Flags::from_bits((word(&bytes[4..]) << 2) as u8))
            })
            .collect())
    }

    /// Passes operations through the circuit and compares each result with the meaning of its row.
    pub(crate) fn check(&mut self, requests: &[Request]) -> Result<(), String> {
        for batch in requests.chunks(BATCH) {
            for (request, got) in batch.iter().zip(self.run(batch)?) {
                let expected = meaning(request);
                if got != expected {
                    return Err(mismatch(request, expected, got));
                }
            }
        }
        Ok(())
    }

    /// Passes all pairs of special values through, for every operation; a third operand takes a few values. If all three operands are
    /// floats, the third takes every seventh special float, a different seventh for each pair; with `TAKT_FULL=1`, it takes all.
    fn check_special_values(&mut self) -> Result<u64, String> {
        let values = self.special_values();
        let mut count = 0;
        for operation in self.circuit.operations.clone() {
            let row = operation.op.row();
            let sources = row.shape.sources();
            let mut requests = Vec::new();
            if is_fused(row) {
                let (numbers, step) = (special_values(), if full() { 1 } else { 7 });
                for (i, &a) in numbers.iter().enumerate() {
                    for (j, &b) in numbers.iter().enumerate() {
                        for &c in numbers.iter().skip((i + j) % step).step_by(step) {
                            let sources = [a, b, c];
                            requests.push(Request {
                                op: operation.op,
                                code: operation.code,
                                sources,
                                idle: 0,
                            });
                        }
                    }
                    self.check(&requests)?;
                    count += requests.len() as u64;
                    requests.clear();
                }
                continue;
            }
            for (i, &a) in values.iter().enumerate() {
                for (j, &b) in values.iter().enumerate() {
                    if sources < 2 && j > 0 {
                        break;
                    }
                    let c = values[(i + 7 * j) % values.len()];
                    requests.push(Request {
                        op: operation.op,
                        code: operation.code,
                        sources: [a, b, c],
                        idle: 0,
                    });
                }
            }
            count += requests.len() as u64;
            self.check(&requests)?;
        }
        Ok(count)
    }

    fn special_values(&self) -> Vec<u32> {
        let mut values = special_values();
        // Special integers are bounds, powers of two and their neighbours, shift counts.
        values.extend((0..=33).chain([0x8000_0000, 0x8000_0001, 0xffff_ffff, 0xffff_ffe0, 0xffff_fffe]));
        values.extend((6..31).flat_map(|k| [(1 << k) - 1, 1 << k, (1 << k) + 1, 1u32.wrapping_neg() << k]));
        // The sine's limits, and the numbers closest to a multiple of π and of π/2 (3π, 80.5π).
        for edge in [SIN_LIMIT, SIN_IDENTITY, 0x4116_cbe4, 0x437c_e5f1] {
            values.extend((edge - 2..=edge + 2).flat_map(|magnitude| [magnitude, magnitude | 0x8000_0000]));
        }
        // Divided by infinity, the value has the exponent that the smallest normal number would come from.
        values.push(0x40a0_0000);
        values.sort_unstable();
        values.dedup();
        values
    }

    /// Passes sums and differences of numbers whose exponents are up to 60 apart through, for every operation that adds. The larger number
    /// varies in its first and last bits; the smaller number has each bit alone, each bit with the lowest bit, and runs of ones from either
    /// end. Every distance therefore has a tie, a tie that a single bit decides, and a cancellation. A product of a third operand is a
    /// product by 1.
    fn check_sums(&mut self) -> Result<u64, String> {
        const MASK: u32 = 0x007f_ffff;
        const EXPONENT: u32 = 150;
        let larger = [0, 1, 2, 3, MASK - 3, MASK - 2, MASK - 1, MASK];
        let smaller: Vec<u32> = (0..23)
            .flat_map(|place| [1 << place, 1 << place | 1, (1 << place) - 1, u32::MAX << place & MASK])
            .collect();
        let one = 1.0_f32.to_bits();
        let mut count = 0;
        for operation in self.circuit.operations.clone() {
            let row = operation.op.row();
            if !matches!(row.function, Function::Add | Function::Fused) {
                continue;
            }
            let mut requests = Vec::new();
            for (distance, large) in (0..=60).flat_map(|distance| larger.map(|large| (distance, large))) {
                for (i, small) in smaller.iter().enumerate() {
                    for sign in [0, 0x8000_0000] {
                        let large = EXPONENT << 23 | large;
                        let small = sign | (EXPONENT - distance) << 23 | small;
                        // Pairs alternate between the two orders.
                        let (first, second) = if i % 2 == 0 { (large, small) } else { (small, large) };
                        let sources = if is_fused(row) { [first, one, second] } else { [first, second, 0] };
                        requests.push(Request { op: operation.op, code: operation.code, sources, idle: 0 });
                    }
                }
            }
            count += requests.len() as u64;
            self.check(&requests)?;
        }
        Ok(count)
    }

    /// Passes special values, sums, and `count` random operands through, and returns the number of each.
    pub(crate) fn check_all(&mut self, count: u64) -> Result<[u64; 3], String> {
        Ok([self.check_special_values()?, self.check_sums()?, self.check_random(count, 1)?])
    }

    /// `count` random operands for each operation; operations of the unit alternate at random. Half of the batches run
    /// back to back, the others with random gaps.
    fn check_random(&mut self, count: u64, seed: u64) -> Result<u64, String> {
        let operations = self.circuit.operations.clone();
        let mut operands = Operands::new(seed);
        let total = count * operations.len() as u64;
        let (mut done, mut requests) = (0, Vec::with_capacity(BATCH));
        while done < total {
            requests.clear();
            let gaps = (done / BATCH as u64) % 2 == 1;
            while requests.len() < BATCH && done < total {
                // Every round has each operation once, in a new order.
                let n = operations.len() as u64;
                let (round, turn) = (done / n, done % n);
                let operation = operations[((turn + round * 7 + round / n) % n) as usize];
                requests.push(Request {
                    op: operation.op,
                    code: operation.code,
                    sources: operands.next(operation.op),
                    idle: if gaps { operands.gap() } else { 0 },
                });
                done += 1;
            }
            self.check(&requests)?;
        }
        Ok(total)
    }
}

impl Drop for Simulation {
    fn drop(&mut self) {
        self.stdin = None;
        let _ = self.process.wait();
    }
}

/// The instruction takes three floats.
fn is_fused(row: &Row) -> bool {
    row.shape.sources() == 3 && (0..3).all(|index| row.source_type(index) == Type::F)
}

/// The result of an operation by the specification. The values that the core puts in place of a source (an immediate, the status register)
/// pass through.
fn meaning(request: &Request) -> Value {
    let [a, b, c] = request.sources;
    match request.op.row().effect {
        Effect::Compute => compute::<Reference>(request.op, a, b, c),
        _ => Value::exact(a),
    }
}

fn mismatch(request: &Request, expected: Value, got: Value) -> String {
    let Request { op, sources: [a, b, c], .. } = request;
    let operands = match op.row().shape.sources() {
        0 | 1 => format!("{a:#010x}"),
        2 => format!("{a:#010x}, {b:#010x}"),
        _ => format!("{a:#010x}, {b:#010x}, {c:#010x}"),
    };
    format!(
        "{}({operands}): the circuit gives {:#010x} [{}], the specification {:#010x} [{}]",
        op.row().mnemonic,
        got.bits,
        got.flags,
        expected.bits,
        expected.flags
    )
}

/// Builds a circuit into a program.
pub(crate) fn compile(library: &Library, circuit: &Circuit) -> Result<PathBuf, VerilatorError> {
    let unit = &circuit.unit;
    let text = |name: &'_ String| library.text(name).expect("the circuit's files are those of the library");
    let names: Vec<String> = circuit.files.iter().map(|name| name.replace('/', "-")).collect();
    let files = names.iter().map(String::as_str).zip(circuit.files.iter().map(text)).collect();
    let parameters = circuit.parameters().map(|(name, value)| format!("-G{name}={value}"));
    let waivers = WAIVERS.iter().copied().chain(["-Wno-fatal"]).map(str::to_owned);
    let mut defines = vec![
        format!("-DLATENCY={}", unit.latency),
        format!("-DINTERVAL={}", unit.interval),
        format!("-DOPERANDS={}", circuit.operands),
    ];
    defines.extend((circuit.op_bits > 0).then(|| format!("-DOP={}", circuit.op_bits)));
    let sources = Sources {
        name: unit.name,
        top: unit.rtl,
        prefix: "Vdut",
        files,
        driver: DRIVER,
        headers: Vec::new(),
        arguments: parameters.chain(waivers).collect(),
        defines,
        // Millions of operations run through the program: optimise it.
        optimise: "-O2",
        trace: false,
    };
    sources.build(Path::new(env!("CARGO_TARGET_TMPDIR")))
}

/// Operands for an instruction, by the types of its sources.
struct Operands {
    pairs: Pairs,
    triples: Triples,
    random: Random,
}

impl Operands {
    fn new(seed: u64) -> Operands {
        Operands { pairs: Pairs::new(seed), triples: Triples::new(seed), random: Random::new(!seed) }
    }

    /// A number of idle cycles: mostly few, sometimes enough to empty the unit.
    fn gap(&mut self) -> u32 {
        match self.random.bits() >> 29 {
            0..=3 => 0,
            4..=6 => self.random.bits() & 3,
            _ => self.random.bits() & 31,
        }
    }

    /// An integer as programs have them: of any magnitude, near a power of two, with trailing zeros or ones.
    fn integer(&mut self) -> u32 {
        let (bits, width) = (self.random.bits(), self.random.bits() & 31);
        let magnitude = match self.random.bits() >> 29 {
            0 | 1 => bits,
            2 | 3 => bits >> width,
            4 => bits >> width << (width / 2),
            5 => (1u32 << width).wrapping_add_signed(self.random.between(-2, 2)),
            // Halfway between two binary32 numbers, and near it.
            6 => (bits | 0x0100_0000) << 7 >> width & !0x7f | 0x40 | bits & 1,
            _ => (u32::MAX << width) ^ (bits & 3),
        };
        if self.random.bits() & 1 == 0 { magnitude } else { magnitude.wrapping_neg() }
    }

    /// A binary32 about the range of integers, often halfway between two.
    fn near_integer(&mut self) -> u32 {
        let exponent = self.random.between(-3, 34);
        let kept = 22u32.saturating_sub(exponent.max(0) as u32).min(23);
        let fraction = match self.random.bits() >> 30 {
            0 => self.random.bits(),
            1 => self.random.bits() >> kept << kept,
            2 => (self.random.bits() >> kept << kept).wrapping_sub(1),
            _ => self.random.bits() >> kept << kept | 1,
        };
        self.random.bits() & 0x8000_0000 | ((127 + exponent) as u32) << 23 | fraction & 0x007f_ffff
    }

    /// Two numbers whose product has, below the place of rounding, only its lowest bit set: significands with a·b = 1 modulo 2^place, for
    /// a result that is rounded at that place, subnormal if need be.
    fn lone_bit(&mut self) -> (u32, u32) {
        let place = 22 + self.random.bits() % 10;
        let (a, b) = loop {
            let a = self.random.bits() >> 8 | 0x0080_0001;
            // Newton's iteration doubles the correct bits; an odd number is its own inverse modulo 8.
            let inverse = (0..4).fold(a, |x, _| x.wrapping_mul(2u32.wrapping_sub(a.wrapping_mul(x))));
            let above = if place < 24 { self.random.bits() >> 8 >> place << place } else { 0 };
            let b = inverse & ((1 << place) - 1) | above;
            if b >> 23 == 1 {
                break (a, b);
            }
        };
        let sum = if place < 24 { self.random.between(128, 380) } else { 150 - place as i32 };
        let exponent = self.random.between((sum - 254).max(1), (sum - 1).min(254));
        let number = |significand, exponent| (exponent as u32) << 23 | significand & 0x007f_ffff;
        let sign = self.random.bits() & 0x8000_0000;
        (sign | number(a, exponent), number(b, sum - exponent))
    }

    fn next(&mut self, op: Op) -> [u32; 3] {
        use takt_isa::Type::{B, F, I};
        let row = op.row();
        if is_fused(row) {
            let (a, b, c) = self.triples.next();
            return [a, b, c];
        }
        let (mut a, mut b) = self.pairs.next();
        let mut c = self.random.bits();
        let integers = (0..row.shape.sources()).any(|index| matches!(row.source_type(index), I | B));
        if integers && self.random.bits() & 3 != 0 {
            (a, b, c) = (self.integer(), self.integer(), self.integer());
            match self.random.bits() >> 29 {
                0 => b = a,
                1 => b = a.wrapping_add_signed(self.random.between(-2, 2)),
                2 => b = a ^ 1 << (self.random.bits() & 31),
                3 => a = 0,
                4 => a = 1 << (self.random.bits() & 31),
                _ => (),
            }
        }
        if row.shape.sources() == 2 && !integers && self.random.bits() >> 27 == 0 {
            (a, b) = self.lone_bit();
        }
        if row.shape.sources() == 1 && row.source_type(0) == F && self.random.bits() & 1 == 0 {
            a = self.near_integer();
        }
        // Operands at which the trigonometric functions are neither trivial nor outside their domain.
        use takt_isa::Function::{Arccosine, Arctangent, Sine};
        if matches!(row.function, Sine | Arctangent | Arccosine) && self.random.bits() & 3 != 0 {
            let highest = if row.function == Sine { 135 } else { 126 };
            for operand in [&mut a, &mut b] {
                let bits = self.random.bits();
                let field = self.random.between(if bits & 1 == 0 { 111 } else { highest - 3 }, highest);
                *operand = bits & 0x807f_ffff | (field as u32) << 23;
            }
        }
        [a, b, c]
    }
}
