// SPDX-License-Identifier: MIT OR Apache-2.0
//! The generated tables: their files are current, and they are as accurate as the circuits need.

use std::fs;
use std::path::Path;
use takt_isa::fp::atan::{digits as digits_ahead, row};
use takt_isa::fp::tables::ANGLES;
use takt_rtl::tables::angle;
use takt_rtl::tables::reciprocal::{Digits, Function, Tables};
use takt_rtl::tables::sine;

/// Compares a generated file with the one in `units/common`, or writes it if `TAKT_BLESS=1`.
fn check_file(name: &str, text: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("units/common").join(name);
    if std::env::var("TAKT_BLESS").is_ok_and(|value| value == "1") {
        fs::write(&path, text).expect("the file can be written");
    }
    let stored = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        stored == text,
        "{} is not what rtl/src/tables generates: run this test with TAKT_BLESS=1",
        path.display()
    );
}

#[test]
fn reciprocal_file() {
    check_file("takt_reciprocal_table.v", &Tables::new().verilog());
}

#[test]
fn sine_files() {
    check_file("takt_quarter_table.v", &sine::multiples());
    check_file("takt_wave_table.v", &sine::polynomials());
}

#[test]
fn angle_files() {
    check_file("takt_arctangent_table.v", &angle::arctangents());
    check_file("takt_arccosine_table.v", &angle::arccosines());
}

/// The table's word and the quotient that is added to it are within the bounds that `formal/miters/arctangent_angle.v` assumes: of every
/// row, with any digits.
#[test]
fn angle_bounds() {
    for e in 0..31 {
        let leading = if e == 0 { 1 } else { 1 << (2 * digits_ahead(e)) };
        for leading in 0..leading {
            let word = u64::from(ANGLES[row(e, leading)]);
            // Of the quotient, and what stands behind its last digit; with e = 0 it has no digits but 0.
            let rest = if e == 0 { 2 } else { (1 << (2 * (15 - digits_ahead(e)))) - 2 };
            let most = word + rest;
            assert!(word + 2 >= 1 << 29 && most < 1 << 31, "e = {e}, leading digits {leading:o}: {most:#x}");
            assert!(most >> e <= 0x3300_0000, "e = {e}, leading digits {leading:o}: {:#x}", most >> e);
        }
    }
}

/// The widths and the last residual that `units/divroot.v` states.
fn check_digits(digits: Digits) {
    let Digits { first, residual, second, last, unit } = digits;
    assert!(first < 1 << 15, "{digits:?}");
    assert!((0..1 << 27).contains(&residual), "{digits:?}");
    assert!(second < 1 << 12, "{digits:?}");
    assert!(-unit < last && last < unit, "{digits:?}");
}

/// Every root; every divisor with extreme and random dividends, shifted to the right as for subnormal quotients too.
#[test]
fn digits() {
    let tables = Tables::new();
    for significand in 1 << 23..1 << 24 {
        check_digits(tables.root(significand, false));
        check_digits(tables.root(significand, true));
    }
    let mut random = 1_u64;
    for b in 1_u64 << 23..1 << 24 {
        random = random.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        let x = b + (random >> 33) % b;
        for x in [b, 2 * b - 1, x] {
            check_digits(tables.quotient(x << 24, b));
        }
        check_digits(tables.quotient(x << 24 >> ((random >> 20) % 25), b));
    }
}

/// For all operands at once: the error of the digits' sum stays below 2⁻²⁴, cell by cell of the tables, bounded from above in
/// real numbers. Then the result lies between the truncated sum and 2⁻²³ above it, and the last residual's sign tells on
/// which side of the middle.
#[test]
fn error_bound() {
    let tables = Tables::new();
    // The loss by truncating the operand of the first product and the product itself.
    let truncated = 0.5_f64.powi(16) + 0.5_f64.powi(14);
    let mut worst = [0.0_f64; 2];
    for function in Function::ALL {
        for cell in 0..1 << function.bits() {
            let y = tables.approximation(function, cell) as f64 / 65536.0;
            let at = |cell: usize| 1.0 + cell as f64 / f64::from(1 << function.bits());
            let (low, high) = (at(cell), at(cell + 1));
            let error = match function {
                Function::Reciprocal => {
                    assert!(y * high <= 1.0, "cell {cell}: {y} exceeds the reciprocal");
                    // A quotient is less than 2, so that y errs by less than 2·(1 − y·b) in it.
                    let first = 2.0 * (1.0 - y * low) + truncated;
                    first * (1.0 - y * low) + 0.5_f64.powi(28)
                }
                Function::Root { double } => {
                    let scale = if double { 2.0 } else { 1.0 };
                    let (low, high) = ((low * scale).sqrt(), (high * scale).sqrt());
                    assert!(y * high <= 1.0 + 1e-15, "cell {cell}: {y} exceeds the reciprocal root");
                    let first = high * (1.0 - y * low) + truncated;
                    // d = r/(2s − d) is approximated by r·y/2.
                    first * (first / (2.0 * low - first) + 1.0 - y * low) + 0.5_f64.powi(29)
                }
            };
            let kind = usize::from(function != Function::Reciprocal);
            worst[kind] = worst[kind].max(error * f64::from(1 << 24));
        }
    }
    let [quotient, root] = worst;
    assert!(quotient < 0.5 && root < 0.75, "errors of {quotient} and {root} units of 2^-24");
}
