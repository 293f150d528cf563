// SPDX-License-Identifier: MIT OR Apache-2.0
//! Cycles of a function on commercial processors, by LLVM's machine models: the graph as LLVM's intermediate code, through `opt`, `llc` and
//! `llvm-mca`. Caches are perfect, and nothing else runs.

use std::fmt::Write as _;
use std::io::Write as _;
use std::process::{Command, Stdio};
use takt_front::graph::{Binary, Function, Node, Unary};

/// A processor: its name in the table, and LLVM's arguments for it.
pub(crate) struct Processor {
    pub(crate) name: &'static str,
    target: &'static [&'static str],
    /// Calling convention for floats, if the target has no default.
    abi: &'static str,
}

/// Processors in the table of docs/models.md.
pub(crate) const PROCESSORS: [Processor; 3] = [
    Processor { name: "Cortex-M7", target: &["-mtriple=thumbv7em-none-eabihf", "-mcpu=cortex-m7"], abi: "" },
    Processor { name: "Cortex-A53", target: &["-mtriple=aarch64-none-elf", "-mcpu=cortex-a53"], abi: "" },
    // A class of soft cores with a single-precision unit: in order, one instruction a cycle.
    Processor {
        name: "Rocket",
        target: &["-mtriple=riscv32-none-elf", "-mcpu=rocket-rv32", "-mattr=+m,+f"],
        abi: "ilp32f",
    },
];

/// Sine and cosine of an angle up to some thousand turns, inlined as a programmer would: reduction by quarter turns in two parts, the
/// polynomials of Cephes' `sinf` and `cosf`, no branch.
const SINE: &str = "\
define internal float @quarter(float %x, i32 %turn) alwaysinline {
  %t = fmul contract float %x, 0x3FE45F3060000000
  %up = fadd float %t, 1.2582912e7
  %k = fadd float %up, -1.2582912e7
  %n = fptosi float %k to i32
  %q = add i32 %n, %turn
  %a = fmul contract float %k, 0x3FF921FB60000000
  %b = fsub contract float %x, %a
  %c = fmul contract float %k, 0xBE6777A5C0000000
  %r = fsub contract float %b, %c
  %z = fmul contract float %r, %r
  %s0 = fmul contract float %z, 0xBF29943F20000000
  %s1 = fadd contract float %s0, 0x3F811073C0000000
  %s2 = fmul contract float %s1, %z
  %s3 = fadd contract float %s2, 0xBFC5555460000000
  %s4 = fmul contract float %s3, %z
  %s5 = fmul contract float %s4, %r
  %s = fadd contract float %s5, %r
  %c0 = fmul contract float %z, 0x3EF99EB9C0000000
  %c1 = fadd contract float %c0, 0xBF56C0C340000000
  %c2 = fmul contract float %c1, %z
  %c3 = fadd contract float %c2, 0x3FA55554A0000000
  %c4 = fmul contract float %c3, %z
  %c5 = fadd contract float %c4, -5.0e-1
  %c6 = fmul contract float %c5, %z
  %cc = fadd contract float %c6, 1.0
  %odd = and i32 %q, 1
  %is = icmp ne i32 %odd, 0
  %v = select i1 %is, float %cc, float %s
  %half = and i32 %q, 2
  %sign = shl i32 %half, 30
  %bits = bitcast float %v to i32
  %flipped = xor i32 %bits, %sign
  %result = bitcast i32 %flipped to float
  ret float %result
}
declare float @llvm.sqrt.f32(float)
declare float @llvm.fabs.f32(float)
";

/// The function as LLVM's intermediate code: inputs are arguments, outputs the fields of the returned structure; products may be fused into
/// sums. `None` if no processor has an instruction for some operation.
fn code(function: &Function) -> Option<String> {
    let graph = &function.graph;
    let nodes = function.nodes();
    let uses = graph.uses(&nodes);
    let value = |id: takt_front::graph::Id| match graph.node(id) {
        Node::Constant(bits) => {
            format!("0x{:016X}", f64::from(f64::from_bits(bits) as f32).to_bits())
        }
        Node::Input(index) => format!("%i{index}"),
        _ => format!("%n{}", id.index()),
    };
    let fields = vec!["float"; function.outputs.len()].join(", ");
    let arguments: Vec<String> = (0..function.inputs.len()).map(|index| format!("float %i{index}")).collect();
    let mut text = format!("{SINE}define {{ {fields} }} @f({}) {{\n", arguments.join(", "));
    for index in (0..graph.len()).filter(|index| uses[*index] > 0) {
        let id = graph.id_at(index);
        let made = match graph.node(id) {
            Node::Constant(_) | Node::Input(_) => continue,
            Node::Unary(op, x) => {
                let x = value(x);
                match op {
                    Unary::Neg => format!("fneg float {x}"),
                    Unary::Sqrt => format!("call float @llvm.sqrt.f32(float {x})"),
                    Unary::Abs => format!("call float @llvm.fabs.f32(float {x})"),
                    Unary::Sin => format!("call float @quarter(float {x}, i32 0)"),
                    Unary::Cos => format!("call float @quarter(float {x}, i32 1)"),
                    _ => return None,
                }
            }
            Node::Binary(op, x, y) => {
                let name = match op {
                    Binary::Add => "fadd contract",
                    Binary::Sub => "fsub contract",
                    Binary::Mul => "fmul contract",
                    Binary::Div => "fdiv",
                    Binary::Less => "fcmp olt",
                    Binary::LessEqual => "fcmp ole",
                    Binary::Equal => "fcmp oeq",
                    Binary::NotEqual => "fcmp une",
                    Binary::Atan2 | Binary::Pow | Binary::Fmod | Binary::Min | Binary::Max => return None,
                };
                format!("{name} float {}, {}", value(x), value(y))
            }
            Node::Select(c, x, y) => {
                format!("select i1 {}, float {}, float {}", value(c), value(x), value(y))
            }
        };
        writeln!(text, "  %n{index} = {made}").expect("a string");
    }
    let mut last = "undef".to_owned();
    for (place, id) in nodes.iter().enumerate() {
        writeln!(text, "  %o{place} = insertvalue {{ {fields} }} {last}, float {}, {place}", value(*id))
            .expect("a string");
        last = format!("%o{place}");
    }
    writeln!(text, "  ret {{ {fields} }} {last}\n}}").expect("a string");
    Some(text)
}

/// Runs a program of LLVM's and returns its output.
fn through(name: &str, arguments: &[&str], text: &str) -> String {
    let mut child = Command::new(name)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap_or_else(|error| panic!("no {name} ({error}): `cargo xtask test` installs LLVM"));
    let mut input = child.stdin.take().expect("piped");
    let text = text.to_owned();
    let writer = std::thread::spawn(move || input.write_all(text.as_bytes()));
    let output = child.wait_with_output().expect("it ends");
    writer.join().expect("no panic").expect("it reads");
    assert!(output.status.success(), "{name} {arguments:?} fails");
    String::from_utf8(output.stdout).expect("text")
}

/// Release of LLVM, which decides about the models.
pub(crate) fn release() -> String {
    let text = through("llvm-mca", &["--version"], "");
    let version = text.split("LLVM version ").nth(1).and_then(|rest| rest.split('.').next());
    version.expect("llvm-mca says its version").to_owned()
}

/// Cycles from the first instruction to the last result, on each of [`PROCESSORS`]. Both sides of a branch count (Rocket has no conditional
/// move).
pub(crate) fn cycles(function: &Function) -> Option<[u64; PROCESSORS.len()]> {
    let code = through("opt", &["-O2", "-S"], &code(function)?);
    Some(PROCESSORS.each_ref().map(|processor| {
        let abi = format!("-target-abi={}", processor.abi);
        let compile = [&["-O3", &abi], processor.target].concat();
        let assembly = through("llc", &compile, &code);
        // Models take a return and a jump for calls, which wait for a hundred cycles.
        let jumps =
            |line: &&str| ["ret", "bx", "j"].contains(&line.split_whitespace().next().unwrap_or_default());
        let straight: String =
            assembly.lines().filter(|line| !jumps(line)).map(|line| format!("{line}\n")).collect();
        let report = through("llvm-mca", &[&["-iterations=1"], processor.target].concat(), &straight);
        let line = report.lines().find_map(|line| line.strip_prefix("Total Cycles:"));
        line.and_then(|text| text.trim().parse().ok()).expect("llvm-mca counts cycles")
    }))
}
