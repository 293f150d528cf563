// SPDX-License-Identifier: MIT OR Apache-2.0
//! Checks that the files of the generated tables are current, and that the tables are as accurate as the circuits need.

use std::fs;
use std::path::Path;
use takt_rtl::tables::reciprocal::{Digits, Tables};

/// Compares each generated file with the file in `units/common`, or writes it if `TAKT_BLESS=1`, and checks the bounds on the table's
/// words.
#[test]
fn files_are_current() {
    for table in takt_rtl::tables::checked().unwrap_or_else(|error| panic!("{error}")) {
        let (folder, text) = (Path::new(env!("CARGO_MANIFEST_DIR")).join("units/common"), table.verilog());
        let path = folder.join(format!("{}.v", table.name));
        if std::env::var("TAKT_BLESS").is_ok_and(|value| value == "1") {
            fs::write(&path, &text).expect("the file can be written");
        }
        let stored = fs::read_to_string(&path).unwrap_or_default();
        assert!(
            stored == text,
            "{} is not what rtl/src/tables generates: run this test with TAKT_BLESS=1",
            path.display()
        );
    }
}

/// The check notices a word of the reciprocals that is 1 too large.
#[test]
fn bounds_notice_a_wrong_word() {
    let good = Tables::new();
    for row in (0..good.coarse.len()).step_by(61) {
        let mut tables = good.clone();
        tables.coarse[row] += 1;
        assert!(tables.check().is_err(), "row {row}");
    }
}

/// Checks the widths, and the last residual, that `units/divroot.v` states.
fn check_digits(digits: Digits) {
    let Digits { first, residual, second, last, unit } = digits;
    assert!(first < 1 << 15, "{digits:?}");
    assert!((0..1 << 27).contains(&residual), "{digits:?}");
    assert!(second < 1 << 12, "{digits:?}");
    assert!(-unit < last && last < unit, "{digits:?}");
}

/// Checks every root, and every divisor with extreme and random dividends, also shifted to the right as for subnormal quotients.
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
