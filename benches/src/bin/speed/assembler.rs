// SPDX-License-Identifier: MIT OR Apache-2.0
//! Speed of the assembler compared with other assemblers.

use crate::{Outcome, ROUNDS, Ratios, fastest};
use std::fmt::Write as _;
use std::hint::black_box;
use std::path::Path;
use std::process::{Command, Stdio};
use takt_asm::{MemoryLoader, Options};
use takt_benches::{DEEP, source};

/// Argument that turns this program into a bare assembler: [`assemble`].
pub(crate) const ALONE: &str = "assemble";

/// Another assembler, and the mix of lines of [`source`] in its language: comments, blank lines, labels, constants, uses of a macro.
struct OtherAssembler {
    command: &'static str,
    /// Name in the document, printed before the version.
    name: &'static str,
    /// Description of the source language.
    language: &'static str,
    arguments: &'static [&'static str],
    /// Start of every source: definitions that the blocks use.
    head: &'static str,
    /// Writes the twelve lines of a block, given the block's number.
    block: fn(usize) -> String,
    comment: &'static str,
    /// Lengths of the compared sources, in lines.
    lines: &'static [usize],
    is_here: bool,
}

const OTHERS: [OtherAssembler; 2] = [
    OtherAssembler {
        command: "as",
        name: "GNU `as`",
        language: "x86-64",
        arguments: &["-o"],
        head: ".set k, 502\n.macro scale to, by\n mulss \\by, \\to\n.endm\n.text\n",
        block: |label| {
            let constant = label % 64;
            format!(
                "# block {label}: a proportional controller\n\nstep{label}:\n        mulss   k(%rsi), %xmm1\n        \
                 mulss   8(%rsi), %xmm2         # m\n        addss   %xmm1, %xmm2\n        scale   %xmm1, 2*k+{constant}(%rdi)\n\
                 \x20       subss   %xmm1, %xmm3\n        movss   %xmm3, %xmm4\n        cvtsi2ss %eax, %xmm5\n        \
                 sqrtss  %xmm6, %xmm1\n        addss   %xmm5, %xmm3\n"
            )
        },
        comment: "# rest\n",
        lines: &[10_000, 100_000, 1_000_000],
        is_here: cfg!(target_arch = "x86_64"),
    },
    OtherAssembler {
        command: "customasm",
        name: "customasm",
        language: "a machine with such instructions, described in its language",
        arguments: &["-q", "-f", "binary", "-o"],
        head: "#subruledef reg {\n a => 0`8\n b => 1`8\n c => 2`8\n d => 3`8\n t => 4`8\n x => 5`8\n y => 6`8\n n => 7`8\n \
               F => 8`8\n}\n#ruledef {\n fmul {d: reg}, {s: reg}, {v: i16} => 0x01 @ d @ s @ v\n \
               fadd {d: reg}, {s: reg}, {v: reg} => 0x02 @ d @ s @ v @ 0x00\n \
               fsub {d: reg}, {s: reg}, {v: reg} => 0x03 @ d @ s @ v @ 0x00\n \
               mov {d: reg}, {s: reg} => 0x04 @ d @ s @ 0x0000\n itof {d: reg}, {s: reg} => 0x05 @ d @ s @ 0x0000\n \
               fsqrt {d: reg}, {s: reg} => 0x06 @ d @ s @ 0x0000\n scale {d: reg}, {v: i16} => asm { fmul {d}, {d}, {v} }\n}\n\
               k = 502\n",
        block: |label| {
            let constant = label % 64;
            format!(
                "; block {label}: a proportional controller\n\nstep{label}:\n        fmul    a, x, k\n        \
                 fmul    b, y, 25         ; m\n        fadd    c, a, b\n        scale   a, 2*k + {constant}\n        \
                 fsub    c, c, a\n        mov     d, x\n        itof    t, n\n        fsqrt   a, x\n        fadd    F, c, t\n"
            )
        },
        comment: "; rest\n",
        // A longer source would take too long: this assembler needs about ten microseconds per line.
        lines: &[10_000, 100_000],
        is_here: true,
    },
];

impl OtherAssembler {
    /// First line of the `--version` output; `None` if the assembler is not installed or does not run here.
    fn version(&self) -> Option<String> {
        let output = Command::new(self.command).arg("--version").output();
        let output = output.ok().filter(|output| output.status.success() && self.is_here)?;
        Some(String::from_utf8_lossy(&output.stdout).lines().next()?.to_owned())
    }

    /// A source with `lines` lines.
    fn source(&self, lines: usize) -> String {
        let mut text = self.head.to_owned();
        let (before, block) = (text.lines().count(), (self.block)(0).lines().count());
        let blocks = lines.saturating_sub(before) / block;
        text.extend((0..blocks).map(self.block));
        text.push_str(&self.comment.repeat(lines.saturating_sub(before + blocks * block)));
        text
    }

    fn assemble(&self, file: &Path) -> Outcome<()> {
        let mut command = Command::new(self.command);
        let status = command
            .args(self.arguments)
            .arg(file.with_extension("out"))
            .arg(file)
            .stdin(Stdio::null())
            .status()?;
        if status.success() { Ok(()) } else { Err(format!("{} failed", self.name).into()) }
    }
}

/// Options for [`DEEP`], which has room for the longest source.
fn options() -> Options {
    Options { machine: &DEEP, ..Options::default() }
}

/// Assembles a file to an image for [`DEEP`], as `takt asm` does.
pub(crate) fn assemble(file: &Path, image: &Path) -> Outcome<()> {
    let loader = MemoryLoader::of("source.s", std::fs::read_to_string(file)?);
    let assembled = takt_asm::assemble("source.s", &loader, &options());
    let assembled = assembled.map_err(|mistakes| mistakes.render(false))?;
    std::fs::write(image, takt_asm::image::write(&assembled.program)?)?;
    Ok(())
}

fn in_a_process(file: &Path) -> Outcome<()> {
    let mut command = Command::new(std::env::current_exe()?);
    let status = command.arg(ALONE).arg(file).arg(file.with_extension("takt")).status()?;
    if status.success() { Ok(()) } else { Err("Takt's assembler failed".into()) }
}

pub(crate) fn measure(text: &mut String) -> Outcome<()> {
    let folder = std::env::temp_dir().join(format!("takt-speed-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let result = measure_in(&folder, text);
    std::fs::remove_dir_all(&folder)?;
    result
}

fn measure_in(folder: &Path, text: &mut String) -> Outcome<()> {
    text.push_str(
        "## Assembler\n\nLines a second beside other assemblers, of as many lines of the same mix: comments, labels, constants, \
         expressions, a macro.\n\n\
         - *Process*: each assembles from file to file in a process of its own; what it takes for the shortest source is taken \
         off.\n\
         - *Call*: Takt's assembler is called again and again in one process, its source in memory, as by an editor or from \
         Python; memory that the system has given stays with the allocator.\n",
    );
    for other in &OTHERS {
        match other.version() {
            Some(version) => against(other, &version, folder, text)?,
            None => writeln!(text, "\nNot compared with {}: it is not here.", other.name)?,
        }
    }
    text.push('\n');
    Ok(())
}

fn against(other: &OtherAssembler, version: &str, folder: &Path, text: &mut String) -> Outcome<()> {
    let OtherAssembler { name, language, .. } = other;
    writeln!(
        text,
        "\n{name} ({version}) assembles for {language}.\n\n\
         | lines | process, times {name} | rounds | call, times {name} | rounds | cost of a line in a call, times that of the \
         shortest source |\n|---|---|---|---|---|---|"
    )?;
    let [empty, least, theirs, ours] =
        ["empty.s", "least.s", "theirs.s", "ours.s"].map(|file| folder.join(file));
    std::fs::write(&empty, other.head)?;
    std::fs::write(&least, source(0))?;
    let mut shortest = None;
    for &lines in other.lines {
        std::fs::write(&theirs, other.source(lines))?;
        std::fs::write(&ours, source(lines))?;
        let loader = MemoryLoader::of("source.s", source(lines));
        let (mut processes, mut calls, mut best) = (Ratios::default(), Ratios::default(), f64::INFINITY);
        let samples = 2 + 100_000 / lines;
        for _ in 0..ROUNDS {
            let mut failed = None;
            let mut time = |assemble: &dyn Fn(&Path) -> Outcome<()>, file: &Path| {
                fastest(samples, |_| failed = assemble(file).err().or(failed.take()))
            };
            let their_time =
                time(&|file| other.assemble(file), &theirs) - time(&|file| other.assemble(file), &empty);
            let our_time = time(&in_a_process, &ours) - time(&in_a_process, &least);
            let call = time(
                &|_| {
                    let assembled = black_box(takt_asm::assemble("source.s", &loader, &options()));
                    assembled.map(drop).map_err(|mistakes| mistakes.render(false).into())
                },
                &ours,
            );
            if let Some(error) = failed {
                return Err(error);
            }
            processes.0.push(their_time / our_time);
            calls.0.push(their_time / call);
            best = best.min(call / lines as f64);
        }
        let shortest = *shortest.get_or_insert(best);
        writeln!(text, "| {lines} | {} | {} | {:.2} |", processes.text(), calls.text(), best / shortest)?;
    }
    Ok(())
}
