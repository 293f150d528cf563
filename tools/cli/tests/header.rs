// SPDX-License-Identifier: MIT OR Apache-2.0
//! The option `takt asm --header`: headers checked by compilers and tools of each language.

use crate::common::Folder;
use std::process::Command;

/// Port names that are keywords in other languages, or that these cannot distinguish.
const PROGRAM: &str = "
.ports  latched
.input  x, n:int @ 7, type, X:bits, self
.output F, f, fn:int, p.q, p_q:bits @ 31, all
.preset type = 2.5
.data
        .float 1.5, 0, -2
.once
        wait    period
.period
period: fmul    F, x, type
        fadd    f, x, 0.125
        iadd    fn, n, 3
        fadd    p.q, f, F
        mov     p_q, X
        mov     all, self
        wait    period
";

fn silent(command: &mut Command) {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && text.trim().is_empty(), "{command:?}\n{text}");
}

fn write(language: &str, file: &str) -> Folder {
    let folder = Folder::new();
    folder.write("2-pd*.s", PROGRAM);
    let done = folder.line(&format!("asm 2-pd*.s --header {language} --header-file {file}"));
    assert!(done.ok().contains("assembled"));
    // To standard output: the same text, and no image.
    assert_eq!(folder.line(&format!("asm 2-pd*.s --header {language}")).ok(), folder.read_text(file));
    assert!(!folder.path().join("2-pd*.takt").exists());
    folder
}

#[test]
fn c_compiles_and_reaches_the_ports() {
    let folder = write("c", "pd.h");
    folder.write(
        "main.c",
        r#"#include "pd.h"
static uint32_t bus[0x2020];
int main(void)
{
    int wrong = 0;
    takt_2_pd__write_x(bus, 1.5f);
    takt_2_pd__write_n(bus, -2);
    takt_2_pd__write_X(bus, 0xdeadbeefu);
    wrong |= bus[0x1000] != 0x3fc00000u || bus[0x1007] != 0xfffffffeu || bus[0x1002] != 0xdeadbeefu;
    bus[0x2000] = 0x40200000u;
    bus[0x2002] = 0xffffffffu;
    bus[0x201f] = 77u;
    wrong |= takt_2_pd__read_F(bus) != 2.5f || takt_2_pd__read_fn(bus) != -1;
    wrong |= takt_2_pd__read_p_q_2(bus) != 77u || TAKT_2_PD__OUT_p_q_2 != 0x201fu;
    wrong |= TAKT_2_PD__CYCLES_PERIOD_WORST < TAKT_2_PD__CYCLES_PERIOD_BEST;
    takt_2_pd__load(bus);
    wrong |= bus[0x1001] != 0x40200000u || bus[TAKT_2_PD__CONTROL] != 0u;
    bus[TAKT_2_PD__STATUS] = 5u << TAKT_2_PD__STATUS_FAULT_KIND_SHIFT;
    wrong |= (bus[TAKT_2_PD__STATUS] & TAKT_2_PD__STATUS_FAULT_KIND_MASK) != 0x50u;
    return wrong;
}
"#,
    );
    let cc = |arguments: &[&str]| {
        let mut gcc = Command::new("cc");
        silent(
            gcc.current_dir(folder.path()).args(["-std=c99", "-Wall", "-Wextra", "-Werror"]).args(arguments),
        );
    };
    cc(&["-c", "-x", "c", "pd.h", "-o", "alone.o"]);
    cc(&["main.c", "-o", "main"]);
    silent(&mut Command::new(folder.path().join("main")));
}

#[test]
fn rust_compiles_without_the_standard_library() {
    let folder = write("rust", "pd.rs");
    folder.write(
        "lib.rs",
        "#![no_std]
#![deny(warnings, missing_docs)]
//! A host.
pub mod pd;
const _: () = {
    assert!(pd::input::n.address == 0x1007 && pd::output::p_q_2.number == 31);
    assert!(pd::input::ALL.len() == 5 && pd::output::ALL.len() == 6 && pd::LATCHED);
    assert!(matches!(pd::output::fn_2.ty, pd::Type::Int));
    assert!(pd::cycles::PERIOD_BEST <= pd::cycles::PERIOD_WORST);
    assert!(pd::register::STATUS_FAULT_KIND_MASK == 0x70 && pd::RECORDS.len() > 10);
};
",
    );
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let mut rustc = Command::new(rustc);
    rustc.current_dir(folder.path()).args(["--edition", "2024", "--crate-type", "lib", "--emit", "metadata"]);
    silent(rustc.arg("lib.rs"));
}

#[test]
fn json_equals_the_loaders_words() {
    let folder = write("json", "pd.json");
    let json: serde_json::Value = serde_json::from_str(&folder.read_text("pd.json")).expect("JSON");
    assert_eq!(
        (&json["schema"], &json["machine"], &json["latched"]),
        (&1.into(), &"t3".into(), &true.into())
    );
    assert_eq!(json["latched_inputs"], 8);
    let port = |list: &str, i: usize| {
        let port = &json[list][i];
        (port["name"].clone(), port["number"].clone(), port["address"].clone(), port["type"].clone())
    };
    assert_eq!(port("inputs", 1), ("n".into(), 7.into(), 0x1007.into(), "int".into()));
    assert_eq!(port("outputs", 4), ("p_q".into(), 31.into(), 0x201f.into(), "bits".into()));
    // Nonzero words of the circuit's memory image.
    folder.line("rtl -o out --program 2-pd*.s").ok();
    let hex = folder.read_text("out/program.hex");
    let image = hex.lines().filter(|line| !line.starts_with("//")).map(|line| {
        let field = |from, to| u64::from_str_radix(&line[from..to], 16).expect("digits");
        [field(0, 1), field(1, 2), field(2, 6), field(6, 18)]
    });
    let image: Vec<_> = image.filter(|record| record[0] >= 2 || record[3] != 0).collect();
    let record = |record: &serde_json::Value| {
        ["space", "slot", "address", "value"].map(|name| record[name].as_u64().expect("a number"))
    };
    let records = json["load"]["records"].as_array().expect("a list");
    assert_eq!(records.iter().map(record).collect::<Vec<_>>(), image);
    // The bounds equal those of `takt bound`.
    let bound: serde_json::Value =
        serde_json::from_str(&folder.line("bound 2-pd*.s --json").ok()).expect("JSON");
    assert_eq!(json["cycles"][1]["cycles"], bound["sections"][1]["in_time"]);
    assert_eq!(json["cycles"][1]["missed"], bound["sections"][1]["missed"]);
}

#[test]
fn svd_is_accepted_by_its_parser() {
    let folder = write("svd", "pd.svd");
    let config = svd_parser::Config::default().validate_level(svd_parser::ValidateLevel::Strict);
    let device = svd_parser::parse_with_config(&folder.read_text("pd.svd"), &config);
    let device = device.unwrap_or_else(|error| panic!("{error:?}"));
    let peripheral = &device.peripherals[0];
    let register = |name: &str| {
        let register = peripheral.registers().find(|register| register.name == name);
        register.unwrap_or_else(|| panic!("no register {name}"))
    };
    assert_eq!(register("in_n").address_offset, 4 * 0x1007);
    assert_eq!(register("out_p_q_2").address_offset, 4 * 0x201f);
    // Names in SVD are case-insensitive.
    assert_eq!(register("out_f_2").address_offset, 4 * 0x2001);
    let status = register("status").fields.as_ref().expect("fields");
    assert!(
        status
            .iter()
            .any(|field| field.name == "fault_kind" && field.bit_offset() == 4 && field.bit_width() == 3)
    );
    let block = &peripheral.address_block.as_ref().expect("one")[0];
    assert!(peripheral.registers().all(|register| register.address_offset + 4 <= block.size));
}

#[test]
fn a_header_needs_no_bound_and_no_ports() {
    let folder = Folder::new();
    folder.write("p.s", "start: jmp start\n");
    for language in ["c", "rust", "json", "svd"] {
        let done = folder.line(&format!("asm p.s --header {language} --header-file p.{language}"));
        done.ok();
    }
    assert!(folder.read_text("p.c").contains("There are no bounds"));
    silent(
        Command::new("cc")
            .current_dir(folder.path())
            .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-c", "p.c"]),
    );
    let done = folder.line("asm p.s --header-file p.h");
    assert!(done.status == Some(2) && done.stderr.contains("--header"), "{}", done.stderr);
    let done = folder.line("asm p.s --header c --listing -");
    assert!(done.status == Some(2) && done.stderr.contains("standard output"), "{}", done.stderr);
}
