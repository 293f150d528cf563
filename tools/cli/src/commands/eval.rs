// SPDX-License-Identifier: MIT OR Apache-2.0
//! The command `takt eval`: applies one operation to operands from standard input, in TestFloat's line format.

use crate::commands::left_out;
use crate::terminal::files::Out;
use crate::terminal::options::{self, MachineArgument};
use crate::terminal::output::Failure;
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use std::io::{ErrorKind, Read, Write};
use takt_isa::fp::{HAS_SOFTFLOAT, Host, Reference, Value};
use takt_isa::{Effect, Row, compute};

/// Evaluate an operation on operands read from standard input.
///
/// Each line holds hexadecimal operands separated by blanks; further columns are ignored, so that the lines of
/// Berkeley TestFloat's `testfloat_gen f32_add` serve as they are. For each line the result and the exception flags are
/// written in hexadecimal: flags are the sum of 10 invalid, 08 divide by zero, 04 overflow (TestFloat's positions; its
/// underflow 02 and inexact 01 are not kept).
#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Eval {
    /// Mnemonic of the operation: fadd, fmul, fsin, itof, …
    #[arg(value_parser = options::instruction)]
    operation: &'static Row,
    #[command(flatten)]
    machine: MachineArgument,
    /// Compute with Berkeley SoftFloat, the definition, in place of the emulator's arithmetic (x86-64 Linux only).
    #[arg(long)]
    reference: bool,
}

const EXAMPLES: &str = "\
Examples:
  echo 3F800000 40000000 | takt eval fadd   1 + 2: prints 40400000 00
  echo 3F800000 00000000 | takt eval fdiv   1 / 0: prints 7F800000 08, divide by zero
  testfloat_gen f32_mul | takt eval fmul    TestFloat's operands";

/// Maximum length of a line in bytes.
const LINE_LIMIT: usize = 1 << 20;
const CHUNK: usize = 1 << 16;

pub(crate) fn run(arguments: &Eval, out: &mut Out) -> Result<()> {
    let (row, machine) = (arguments.operation, arguments.machine.machine);
    if row.effect != Effect::Compute {
        bail!("`{}` has no result that could be evaluated: {}", row.mnemonic, row.summary);
    }
    if machine.host(row.function).is_none() {
        bail!("machine {} has no unit for `{}`", machine.name, row.mnemonic);
    }
    if arguments.reference && !cfg!(feature = "reference") {
        return left_out::left_out("reference");
    }
    if arguments.reference && !HAS_SOFTFLOAT {
        let text = "--reference needs Berkeley SoftFloat, which is built on x86-64 Linux with glibc only; \
                    without --reference the same bits are computed with the host's arithmetic";
        return Err(Failure::Usage(text.to_owned()).into());
    }
    let evaluate = if arguments.reference { compute::<Reference> } else { compute::<Host> };
    stream(row, |[a, b, c]| evaluate(row.op, a, b, c), out)
}

/// Applies `evaluate` to each line of standard input. Answers are written as soon as each chunk of input is processed.
fn stream(row: &Row, evaluate: impl Fn([u32; 3]) -> Value, out: &mut Out) -> Result<()> {
    let mut input = std::io::stdin().lock();
    let (mut buffer, mut filled, mut line) = (vec![0; 2 * CHUNK], 0, 1u64);
    loop {
        if buffer.len() - filled < CHUNK {
            buffer.resize(buffer.len() + CHUNK, 0);
        }
        let read = match input.read(&mut buffer[filled..]) {
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            result => result.context("cannot read standard input")?,
        };
        filled += read;
        let is_end = read == 0;
        // Process complete lines; at the end of input, the remainder counts as a line.
        let (mut done, mut text) = (0, Vec::with_capacity(CHUNK));
        while done < filled {
            let rest = &buffer[done..filled];
            let (length, next) = match rest.iter().position(|&byte| byte == b'\n') {
                Some(length) => (length, length + 1),
                None if is_end => (rest.len(), rest.len()),
                None => break,
            };
            match operands(row, &rest[..length]) {
                Ok(None) => {}
                Ok(Some(operands)) => {
                    let value = evaluate(operands);
                    hexadecimal(&mut text, value.bits, 8);
                    text.push(b' ');
                    hexadecimal(&mut text, value.flags.bits().into(), 2);
                    text.push(b'\n');
                }
                Err(reason) => {
                    // Write the answers to preceding lines first.
                    out.write_all(&text)?;
                    return Err(anyhow!("standard input:{line}: {reason}"));
                }
            }
            done += next;
            line += 1;
        }
        out.write_all(&text)?;
        out.flush()?;
        buffer.copy_within(done..filled, 0);
        filled -= done;
        if is_end {
            return Ok(());
        }
        if filled > LINE_LIMIT {
            bail!("standard input:{line}: the line is longer than {} MiB", LINE_LIMIT >> 20);
        }
    }
}

fn hexadecimal(text: &mut Vec<u8>, value: u32, digits: u32) {
    for digit in (0..digits).rev() {
        text.push(b"0123456789ABCDEF"[(value >> (4 * digit)) as usize & 15]);
    }
}

/// Parses the operands of a line; `None` for a blank line.
fn operands(row: &Row, line: &[u8]) -> Result<Option<[u32; 3]>, String> {
    let mut columns =
        line.split(|byte| byte.is_ascii_whitespace()).filter(|column| !column.is_empty()).peekable();
    if columns.peek().is_none() {
        return Ok(None);
    }
    let mut operands = [0; 3];
    let count = row.shape.sources();
    for (found, operand) in operands.iter_mut().take(count).enumerate() {
        let column = columns.next().ok_or_else(|| {
            format!(
                "{} takes {count} operand{}, the line has {found}",
                row.mnemonic,
                if count == 1 { "" } else { "s" }
            )
        })?;
        *operand = parse(column).ok_or_else(|| {
            let shown = String::from_utf8_lossy(&column[..column.len().min(40)]);
            let more = if column.len() > 40 { "…" } else { "" };
            format!("`{shown}{more}` is not a hexadecimal number of at most 8 digits")
        })?;
    }
    Ok(Some(operands))
}

fn parse(column: &[u8]) -> Option<u32> {
    let digits = column.strip_prefix(b"0x").unwrap_or(column);
    if digits.is_empty() || digits.len() > 8 {
        return None;
    }
    digits.iter().try_fold(0, |value, &byte| {
        let digit = match byte {
            b'0'..=b'9' => byte - b'0',
            b'a'..=b'f' => byte - b'a' + 10,
            b'A'..=b'F' => byte - b'A' + 10,
            _ => return None,
        };
        Some(value << 4 | u32::from(digit))
    })
}
