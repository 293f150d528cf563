//! The exported design, as other tools see it.

use std::fs;
use std::path::Path;
use std::process::Command;
use takt_isa::MACHINES;
use takt_rtl::export::synthesis_top;
use takt_rtl::{Design, Library, export};

fn write(design: &Design) -> Vec<String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("export-{}", design.machine.name));
    let mut paths = Vec::new();
    for file in &design.files {
        let path = folder.join(&file.name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("the target folder can be written");
        fs::write(&path, &file.text).expect("the target folder can be written");
        paths.push(path.display().to_string());
    }
    paths
}

fn silent(command: &mut Command) {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && text.trim().is_empty(), "{command:?}\n{text}");
}

#[test]
fn lint() {
    for machine in MACHINES {
        let design = export(machine, &Library::builtin()).expect("every machine has a circuit");
        let paths = write(&design);
        silent(
            Command::new("verilator")
                .args(["--lint-only", "-Wall", "--top-module", &synthesis_top(machine)])
                .args(&paths),
        );
        silent(
            Command::new("iverilog")
                .args(["-g2005", "-Wall", "-Wno-timescale", "-t", "null", "-s", &synthesis_top(machine)])
                .args(&paths),
        );
    }
}
