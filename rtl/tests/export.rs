// SPDX-License-Identifier: MIT OR Apache-2.0
//! Other tools accept the exported designs without complaint.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_isa::{MACHINES, Machine};
use takt_rtl::{Library, bench, export};

fn silent(command: &mut Command) {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && text.trim().is_empty(), "{command:?}\n{text}");
}

/// Writes the folders of every machine, and of one machine with the smallest and one with the largest memories, and passes each to
/// `look`, with the core's name.
fn folders(mut look: impl FnMut(&Path, &Machine, &str)) {
    let other = ["t1,code=2,data=2", "t3,code=65536,data=65536"].map(Machine::from_name);
    let other = other.map(|machine| machine.expect("it is a machine"));
    for machine in MACHINES.iter().copied().chain(other) {
        let design = export(machine, &Library::builtin()).expect("every machine has a circuit");
        let folder = format!("export-{}", machine.identifier());
        let folder: PathBuf = Path::new(env!("CARGO_TARGET_TMPDIR")).join(folder);
        let _ = fs::remove_dir_all(&folder);
        for file in bench::folder(&design, None, &[]) {
            let path = folder.join(&file.name);
            fs::create_dir_all(path.parent().expect("a folder")).expect("the target folder can be written");
            fs::write(&path, &file.text).expect("the target folder can be written");
        }
        look(&folder, machine, &design.top);
    }
}

#[test]
fn no_tool_complains() {
    folders(|folder, machine, top| {
        let verilator = |files: &[String], top: &str| {
            let mut lint = Command::new("verilator");
            lint.current_dir(folder).args(["--lint-only", "-Wall", "--top-module", top]);
            silent(lint.args(files));
        };
        verilator(&["-f".to_owned(), format!("{top}.f")], top);
        // Ports can be latched: two of them, many, or all.
        assert_eq!(top, format!("takt_{}", machine.identifier()));
        let ports = machine.inputs.depth;
        for latched in [2, 32, ports] {
            verilator(&[format!("-GLATCHED={latched}"), "-f".to_owned(), format!("{top}.f")], top);
        }
        let synthesis = format!("{top}_synthesis");
        // The slave leaves some ports of the core open.
        let open = "-Wno-PINCONNECTEMPTY".to_owned();
        let own = [format!("{top}_wishbone.v"), format!("{synthesis}.v")];
        verilator(&[&[open, "-f".to_owned(), format!("{top}.f")], &own[..]].concat(), &synthesis);
        let axi = format!("{top}_axi");
        let own = [format!("{top}_wishbone.v"), format!("{axi}.v")];
        let open = "-Wno-PINCONNECTEMPTY".to_owned();
        verilator(&[&[open, "-f".to_owned(), format!("{top}.f")], &own[..]].concat(), &axi);
        let mut icarus = Command::new("iverilog");
        icarus.current_dir(folder).args(["-g2005", "-Wall", "-Wno-timescale", "-t", "null", "-s"]);
        silent(icarus.args([format!("{top}_bench"), "-f".to_owned(), format!("{top}_bench.f")]));
    });
}
