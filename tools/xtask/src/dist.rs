// SPDX-License-Identifier: MIT OR Apache-2.0
//! Archives for hardware engineers without Rust: Verilog, FuseSoC core, headers and data sheet of each machine.

use anyhow::{Context, Result, ensure};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_automation::SPDX;
use takt_automation::command::{root, run};
use takt_automation::tracking::{PROGRAM, periods, program};
use takt_automation::venv::Venv;
use takt_isa::{MACHINES, Machine, Register};
use takt_programs::hybrid::ports::{INPUTS, OUTPUTS};
use takt_rtl::bench;
use takt_rtl::header::{Header, Language};
use takt_rtl::{Library, axi, export, wishbone};

/// Tools for the data sheet: pandoc as a wheel, and typst.
const DATA_SHEET: [&str; 2] = ["pypandoc-binary==1.17", "typst==0.15.2"];
/// Tools that check the core description.
const FUSESOC: [&str; 2] = ["edalize==0.6.8", "fusesoc==2.4.7"];

const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Writes the archive of one machine, or of all machines, into a folder.
pub(crate) fn archives(out: &Path, machine: Option<&str>) -> Result<()> {
    let is_wanted = |candidate: &&&Machine| machine.is_none_or(|name| name == candidate.name);
    let machines: Vec<&Machine> = MACHINES.iter().filter(is_wanted).copied().collect();
    let names = || MACHINES.iter().map(|machine| machine.name).collect::<Vec<_>>().join(", ");
    ensure!(!machines.is_empty(), "there is no such machine; there are {}", names());
    let folder = root().join("target/dist");
    fs::create_dir_all(&folder)?;
    let sheet = data_sheet(&folder)?;
    for machine in machines {
        let package = package(machine, &folder, &sheet)?;
        let name = package.file_name().context("the folder to archive has no name")?;
        archive(&package, &out.join(format!("{}.tar.gz", name.display())))?;
    }
    Ok(())
}

/// Archives a folder reproducibly: equal files yield equal archives.
pub(crate) fn archive(folder: &Path, archive: &Path) -> Result<()> {
    let parent = folder.parent().context("the folder to archive has no parent folder")?;
    let name = folder.file_name().context("the folder to archive has no name")?;
    let mut tar = Command::new("tar");
    tar.args(["--sort=name", "--mtime=@0", "--owner=0", "--group=0", "--numeric-owner", "--mode=go=rX,u+rw"]);
    tar.args(["--use-compress-program=gzip -n", "-C"]).arg(parent).arg("-cf").arg(archive).arg(name);
    run(&mut tar)?;
    println!("{}", archive.display());
    Ok(())
}

fn data_sheet(folder: &Path) -> Result<PathBuf> {
    let venv = Venv::with(&DATA_SHEET)?;
    let sheet = folder.join("takt.pdf");
    let mut make = Command::new(venv.tool("python3"));
    make.arg(root().join("rtl/dist/datasheet.py")).arg(root().join("docs")).arg(VERSION).arg(&sheet);
    run(&mut make)?;
    Ok(sheet)
}

/// Assembles the folder of one machine.
fn package(machine: &'static Machine, folder: &Path, sheet: &Path) -> Result<PathBuf> {
    let package = folder.join(format!("takt-{}-{VERSION}", machine.name));
    if package.exists() {
        fs::remove_dir_all(&package)?;
    }
    let write = |name: &str, text: &str| -> Result<()> {
        let path = package.join(name);
        fs::create_dir_all(path.parent().unwrap_or(&package))?;
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
    };
    let program = program(machine)?;
    let design = export(machine, &Library::builtin())?.latching(program.latched_inputs())?;
    let register = |name: &str| -> Result<Register> {
        let port = program.inputs.iter().find(|port| port.name == name);
        Ok(port.with_context(|| format!("{PROGRAM} has no input `{name}`"))?.register)
    };
    let registers = INPUTS.iter().map(|port| register(port.name)).collect::<Result<Vec<_>>>()?;
    let periods: Vec<Vec<(Register, u32)>> = periods()?
        .iter()
        .map(|(inputs, _)| registers.iter().copied().zip(inputs.to_words()).collect())
        .collect();
    for file in bench::folder(&design, Some(&program), &periods) {
        let is_bare = file.name.ends_with(".v") && !file.text.contains(SPDX);
        let line = if is_bare { format!("// {SPDX}\n") } else { String::new() };
        write(&file.name, &(line + &file.text))?;
    }
    let list = fs::read_to_string(package.join(format!("{}.f", design.top)))?;
    let slaves = [wishbone::name(&design), axi::name(&design)];
    write(&format!("{}.core", design.top), &core(machine, &design.top, list.lines(), &slaves))?;
    let header = Header::new(&program, "tracking", takt_analysis::section_cycles(&program));
    for (end, language) in [("h", Language::C), ("svd", Language::Svd), ("json", Language::Json)] {
        write(&format!("tracking.{end}"), &header.text(language))?;
    }
    let readme = fs::read_to_string(root().join("rtl/dist/README.md"))?;
    let values = [("@MACHINE@", machine.name), ("@VERSION@", VERSION), ("@TEXT@", machine.text)];
    write("README.md", &values.iter().fold(readme, |text, (name, value)| text.replace(name, value)))?;
    for licence in ["LICENSE-APACHE", "LICENSE-MIT"] {
        write(licence, &fs::read_to_string(root().join(licence))?)?;
    }
    fs::copy(sheet, package.join("takt.pdf"))?;
    Ok(package)
}

/// FuseSoC core description (CAPI2) of a machine.
fn core<'a>(machine: &Machine, top: &str, files: impl Iterator<Item = &'a str>, slaves: &[String]) -> String {
    let list = |files: &mut dyn Iterator<Item = String>| -> String {
        files.fold(String::new(), |mut text, file| {
            let _ = writeln!(text, "      - {file}");
            text
        })
    };
    let rtl = list(&mut files.map(str::to_owned));
    let bus = list(&mut slaves.iter().map(|slave| format!("{slave}.v")));
    let axi = slaves.last().map_or(top, String::as_str);
    format!(
        "CAPI=2:
name: takt:takt:{name}:{VERSION}
description: \"Takt {name}: a floating-point processor for robot control\"

filesets:
  rtl:
    files:
{rtl}    file_type: verilogSource-2005
  bus:
    files:
{bus}    file_type: verilogSource-2005
  bench:
    files:
      - {top}_bench.v: {{file_type: verilogSource-2005}}
      - program.hex: {{file_type: user, copyto: program.hex}}
      - inputs.hex: {{file_type: user, copyto: inputs.hex}}

targets:
  default:
    filesets: [rtl, bus]
    toplevel: {axi}
  sim:
    description: The test bench with its program, in Icarus Verilog
    flow: sim
    flow_options:
      tool: icarus
      iverilog_options: [-g2005]
    filesets: [rtl, bench]
    toplevel: {top}_bench
  lint:
    description: Verilator's warnings
    flow: lint
    flow_options:
      tool: verilator
      verilator_options: [-Wall, -Wno-PINCONNECTEMPTY, -Wno-DECLFILENAME]
    filesets: [rtl, bus]
    toplevel: {axi}
",
        name = machine.name,
    )
}

/// Assembles the smallest machine's folder, runs its targets with FuseSoC, and compares the forces with binary64.
pub(crate) fn test() -> Result<()> {
    let machine = MACHINES.iter().copied().min_by_key(|machine| machine.slots.len()).context("a machine")?;
    let folder = root().join("target/dist/test");
    fs::create_dir_all(&folder)?;
    let package = package(machine, &folder, &data_sheet(&folder)?)?;
    let venv = Venv::with(&FUSESOC)?;
    let fusesoc = |target: &str| -> Result<String> {
        let mut command = Command::new(venv.tool("fusesoc"));
        command.current_dir(&folder).arg("--cores-root").arg(&package);
        command.args(["run", "--build-root", "build", "--target", target]);
        command.arg(format!("takt:takt:{}", machine.name));
        let output = command.output().context("cannot start fusesoc")?;
        let text =
            String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
        ensure!(output.status.success(), "fusesoc, target {target}:\n{text}");
        Ok(text)
    };
    let lint = fusesoc("lint")?;
    ensure!(!lint.contains("%Warning"), "fusesoc, target lint:\n{lint}");
    let sim = fusesoc("sim")?;
    ensure!(sim.lines().any(|line| line == "end"), "the test bench did not come to its end:\n{sim}");
    let program = program(machine)?;
    let number = |port: &str| {
        let port = program.outputs.iter().find(|output| output.name == port)?;
        machine.output_number(port.register)
    };
    // Writes of the last period, from lines `cycle output number bits`.
    let written = |number: u16| {
        let of = |line: &str| {
            let [_, "output", port, bits] = line.split_whitespace().collect::<Vec<_>>()[..] else {
                return None;
            };
            let bits = u32::from_str_radix(bits, 16).ok()?;
            (port.parse() == Ok(number)).then(|| f64::from(f32::from_bits(bits)))
        };
        sim.lines().filter_map(of).next_back()
    };
    let periods = periods()?;
    let (_, expected) = periods.last().context("there are periods")?;
    for (port, expected) in OUTPUTS.iter().zip(expected.to_array()).take(3) {
        let force =
            number(port.name).and_then(written).with_context(|| format!("no {} in\n{sim}", port.name))?;
        // Lengths in binary32 are off by up to 8e-8 m, which the gain amplifies to 0.7 N.
        ensure!((force - expected).abs() < 1.0, "{}: {force} N, binary64 {expected} N", port.name);
    }
    let pages = fs::metadata(package.join("takt.pdf"))?.len();
    ensure!(pages > 100_000, "the data sheet has {pages} bytes");
    println!("{}: FuseSoC's targets lint and sim, three forces as in binary64", package.display());
    Ok(())
}
