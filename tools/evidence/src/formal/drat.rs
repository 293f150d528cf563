// SPDX-License-Identifier: MIT OR Apache-2.0
//! Check of a proof that a formula has no solution (DRAT), as `rtl/formal/solve.py` asks for: the crate `dratify` shares no code with the
//! solver that wrote the proof.

use anyhow::{Context, Result, bail, ensure};
use dratify::{Checker, Lit};
use std::fs;
use std::path::PathBuf;

/// Greatest variable, for which the checker has room.
const MOST: u32 = 1 << 24;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The formula, in the DIMACS format.
    formula: PathBuf,
    /// The proof, in the binary DRAT format.
    proof: PathBuf,
}

/// Entry of `cargo evidence drat`.
///
/// # Errors
/// If a file is damaged, a step of the proof does not follow, or the proof ends without the empty clause.
pub(crate) fn drat(arguments: &Arguments) -> Result<()> {
    let Arguments { formula, proof } = arguments;
    let text = fs::read_to_string(formula).with_context(|| format!("cannot read {}", formula.display()))?;
    let bytes = fs::read(proof).with_context(|| format!("cannot read {}", proof.display()))?;
    check(&text, &bytes)
}

/// Checks a proof.
fn check(formula: &str, proof: &[u8]) -> Result<()> {
    let (variables, clauses) = parse(formula)?;
    let mut checker = Checker::new(variables, &clauses, true, true);
    let mut rest = proof;
    let mut step = 0_u64;
    while let Some((kind, after)) = rest.split_first() {
        rest = after;
        step += 1;
        ensure!(matches!(kind, b'a' | b'd'), "step {step} is neither an addition nor a deletion");
        let clause = clause(&mut rest).with_context(|| format!("step {step} is damaged"))?;
        ensure!(checker.check_step(*kind == b'd', &clause), "step {step} does not follow");
        if *kind == b'a' && clause.is_empty() {
            return Ok(());
        }
    }
    // Solvers leave the last step out if clauses of one literal contradict one another.
    ensure!(checker.check_step(false, &[]), "the proof ends after {step} steps without the empty clause");
    Ok(())
}

/// Number of variables, and the clauses.
fn parse(formula: &str) -> Result<(u32, Vec<Vec<Lit>>)> {
    let mut lines = formula.lines().filter(|line| !line.starts_with('c'));
    let head: Vec<&str> = lines.next().unwrap_or_default().split_whitespace().collect();
    let ["p", "cnf", variables, count] = head[..] else { bail!("the formula has no head") };
    let (variables, count): (u32, usize) = (variables.parse()?, count.parse()?);
    ensure!(variables <= MOST, "the formula has more than {MOST} variables");
    let mut clauses = Vec::new();
    let mut open: Vec<Lit> = Vec::new();
    for word in lines.flat_map(str::split_whitespace) {
        match word.parse::<i32>()? {
            0 => clauses.push(std::mem::take(&mut open)),
            number => {
                let variable = number.unsigned_abs();
                ensure!(variable <= variables, "the formula's head leaves out the variable {variable}");
                open.push(2 * (variable - 1) + u32::from(number < 0));
            }
        }
    }
    ensure!(open.is_empty() && clauses.len() == count, "the formula is cut off");
    Ok((variables, clauses))
}

/// Literals of a step up to their end; each is a number of 7 bits a byte, the lowest first: twice the variable, plus 1 if negated.
fn clause(rest: &mut &[u8]) -> Result<Vec<Lit>> {
    let mut found = Vec::new();
    loop {
        let mut number = 0_u32;
        for place in 0.. {
            let (byte, after) = rest.split_first().context("it is cut off")?;
            *rest = after;
            ensure!(place < 4, "a number is too large");
            number |= u32::from(byte & 0x7f) << (7 * place);
            if byte & 0x80 == 0 {
                break;
            }
        }
        match number {
            0 => return Ok(found),
            number if (2..=2 * MOST + 1).contains(&number) => found.push(number - 2),
            _ => bail!("there is no literal {number}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::check;

    /// Two variables in all four ways: no solution.
    const FORMULA: &str = "c four\np cnf 2 4\n1 2 0\n1 -2 0\n-1 2 0\n-1 -2 0\n";

    #[test]
    fn a_proof_is_checked_step_by_step() {
        let said = |formula: &str, proof: &[u8]| check(formula, proof).map_err(|error| format!("{error:#}"));
        // 1 follows, and then nothing is left.
        assert_eq!(said(FORMULA, &[b'a', 2, 0, b'a', 0]), Ok(()));
        // The last step may be left out if clauses of one literal contradict one another.
        assert_eq!(said(FORMULA, &[b'a', 2, 0]), Ok(()));
        assert_eq!(said("p cnf 1 2\n1 0\n-1 0\n", &[]), Ok(()));
        assert_eq!(said(FORMULA, &[b'd', 2, 4, 0, b'a', 0]), Err("step 2 does not follow".to_owned()));
        assert_eq!(said("p cnf 2 2\n1 2 0\n-1 -2 0\n", &[b'a', 0]), Err("step 1 does not follow".to_owned()));
        let wrong = [
            (FORMULA, &[b'd', 2, 4, 0][..], "without the empty clause"),
            (FORMULA, &[b'a', 2], "step 1 is damaged: it is cut off"),
            (FORMULA, &[b'a', 1, 0], "no literal 1"),
            (FORMULA, &[b'a', 255, 255, 255, 255, 255], "too large"),
            (FORMULA, b"x", "neither"),
            ("p cnf 1 1\n1 2 0\n", &[b'a', 0], "leaves out the variable 2"),
            ("p cnf 2 2\n1 2 0\n", &[b'a', 0], "cut off"),
            ("", &[b'a', 0], "no head"),
        ];
        for (formula, proof, says) in wrong {
            let told = said(formula, proof).expect_err(says);
            assert!(told.contains(says), "{told}");
        }
    }
}
