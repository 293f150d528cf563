// SPDX-License-Identifier: MIT OR Apache-2.0
//! The core behind its Wishbone slave, in Icarus Verilog: loaded, run, read and started again over the bus.

use crate::common::{assemble, drive, folder};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;
use takt_emu::Emulator;
use takt_isa::load::{Space, load_records};
use takt_isa::{Machine, Program, Register, T1, T3};
use takt_rtl::wishbone::{INPUTS, OUTPUTS, REGISTERS};
use takt_rtl::{Library, bench, export};

const PERIODS: usize = 2;

fn run(folder: &Path, program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).current_dir(folder).args(arguments).output();
    let output = output.unwrap_or_else(|error| panic!("{program}: {error}"));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{program}: {text}{}", String::from_utf8_lossy(&output.stderr));
    text
}

/// A bus master that writes, reads and prints, reads until a bit is set, or reads: a line of `bus.hex` each, with its kind 1 to 4 first.
fn master(name: &str, parameters: &str) -> String {
    format!(
        r#"`timescale 1ns / 1ps
module master;
    reg         clk, rst, stb, we;
    reg  [15:0] adr;
    reg  [31:0] dat;
    wire [31:0] read;
    wire        ack, waiting;
    reg  [51:0] script [0:65535];
    integer     i, polls;

    {name} #({parameters}) slave (
        .clk_i(clk), .rst_i(rst), .cyc_i(stb), .stb_i(stb), .we_i(we), .adr_i(adr), .dat_i(dat),
        .dat_o(read), .ack_o(ack), .waiting(waiting)
    );

    initial clk = 1'b0;
    always #4 clk = ~clk;

    task access(input write, input [15:0] address, input [31:0] value);
        begin
            {{stb, we, adr, dat}} = {{1'b1, write, address, value}};
            @(posedge clk); #1;
            while (!ack) begin @(posedge clk); #1; end
            stb = 1'b0;
            @(posedge clk); #1;
        end
    endtask

    initial begin
        for (i = 0; i < 65536; i = i + 1) script[i] = 52'd0;
        $readmemh("bus.hex", script);
        {{rst, stb, we, adr, dat}} = {{1'b1, 50'd0}};
        repeat (4) @(posedge clk);
        #1 rst = 1'b0;
        for (i = 0; script[i] != 52'd0; i = i + 1) begin
            access(script[i][51:48] == 4'd1, script[i][47:32], script[i][31:0]);
            if (script[i][51:48] == 4'd2) $display("%h %h", script[i][47:32], read);
            for (polls = 0; script[i][51:48] == 4'd3 && (read & script[i][31:0]) == 32'd0 && polls < 4000; polls = polls + 1)
                access(1'b0, script[i][47:32], script[i][31:0]);
        end
        $display("end");
        $finish;
    end
endmodule
"#
    )
}

/// The master's actions, and the text that it is to print.
#[derive(Default)]
struct Bus {
    script: String,
    expected: String,
}

impl Bus {
    fn put(&mut self, kind: u8, address: u16, value: u32) {
        writeln!(self.script, "{kind:x}{address:04x}{value:08x}").expect("a string takes it");
    }

    fn write(&mut self, name: &str, value: u32) {
        self.put(1, register(name), value);
    }

    /// Reads an address, where a value is to stand.
    fn read(&mut self, address: u16, value: u32) {
        self.put(2, address, 0);
        writeln!(self.expected, "{address:04x} {value:08x}").expect("a string takes it");
    }

    fn until_waiting(&mut self) {
        self.put(3, register("status"), 1);
    }

    /// Loads a program: its own bundles and what the fetch runs ahead to, its data and registers.
    fn load(&mut self, program: &Program) {
        for record in load_records(program) {
            match record.space {
                Space::Program if u32::from(record.address) >= program.bundles() + 16 => {}
                Space::Data if record.value == 0 => {}
                Space::Input => self.put(1, INPUTS + record.address, record.value as u32),
                space => {
                    let place =
                        u32::from(record.address) | (space as u32) << 16 | u32::from(record.slot) << 18;
                    self.write("load_place", place);
                    self.write("load_high", (record.value >> 32) as u32);
                    self.write("load_low", record.value as u32);
                }
            }
        }
    }

    /// Writes inputs, by register, ticks, and waits for the end of the period.
    fn period(&mut self, machine: &Machine, inputs: &[(Register, u32)]) {
        for &(register, bits) in inputs {
            self.put(1, INPUTS + machine.input_number(register).expect("an input"), bits);
        }
        self.write("tick", 1);
        // A few reads later the tick has been seen and the program no longer waits.
        (0..3).for_each(|_| self.put(4, register("status"), 0));
        self.until_waiting();
    }

    /// Runs the script on a machine whose slave has these parameters, and gives what it prints.
    fn run(&mut self, machine: &'static Machine, folder_name: &str, parameters: &str) -> String {
        let design = export(machine, &Library::builtin()).expect("it has a circuit");
        let name = takt_rtl::wishbone::name(&design);
        let folder = folder().join(folder_name);
        let mut list = vec!["master.v".to_owned(), format!("{name}.v")];
        list.extend(design.files.iter().map(|file| file.name.clone()));
        let files = bench::folder(&design, None, &[]).into_iter().map(|file| (file.name, file.text));
        let own =
            [("master.v".to_owned(), master(&name, parameters)), ("bus.hex".to_owned(), self.script.clone())];
        for (path, text) in files.chain(own).chain([("files.f".to_owned(), list.join("\n") + "\n")]) {
            let path = folder.join(path);
            fs::create_dir_all(path.parent().expect("a folder")).expect("the target folder can be written");
            fs::write(&path, text).expect("the target folder can be written");
        }
        run(
            &folder,
            "iverilog",
            &["-g2005", "-Wall", "-Wno-timescale", "-s", "master", "-f", "files.f", "-o", "master"],
        );
        let mut lint = vec!["--lint-only", "-Wall", "-Wno-DECLFILENAME", "-Wno-PINCONNECTEMPTY"];
        let parameters: Vec<String> = parameters
            .split_terminator(", ")
            .map(|parameter| format!("-G{}", parameter.trim_matches(['.', ')']).replace('(', "=")))
            .collect();
        lint.extend(parameters.iter().map(String::as_str));
        lint.extend(["--top-module", &name]);
        lint.extend(list[1..].iter().map(String::as_str));
        run(&folder, "verilator", &lint);
        // Some versions of Icarus Verilog remark that the script does not fill its memory.
        let said = run(&folder, "vvp", &["-n", "master"]);
        said.lines().filter(|line| !line.starts_with("WARNING")).map(|line| format!("{line}\n")).collect()
    }
}

fn register(name: &str) -> u16 {
    REGISTERS.iter().find(|row| row.name == name).expect("a register").address
}

/// The address of an output port on the bus.
fn output(machine: &Machine, register: Register) -> u16 {
    OUTPUTS + machine.output_number(register).expect("an output")
}

fn tracking(machine: &'static Machine) {
    let program = assemble(machine, "hybrid/tracking.s");
    let mut emulator = Emulator::new(&program).expect("it fits");
    let mut bus = Bus::default();
    bus.load(&program);
    bus.write("control", 1);
    bus.until_waiting();
    // A reset asked for briefly, while the program runs, lasts its time. A constant loaded at once waits for what is in flight.
    let kept = load_records(&program).into_iter().find(|record| record.space == Space::Register);
    let kept = kept.expect("the program has constants");
    bus.write("load_place", u32::from(kept.address) | (Space::Register as u32) << 16);
    bus.write("load_high", 0);
    bus.write("tick", 1);
    (0..20).for_each(|_| bus.put(4, register("status"), 0));
    bus.write("control", 0);
    bus.write("load_low", kept.value as u32);
    bus.write("control", 1);
    bus.until_waiting();
    bus.write("control", 0);
    bus.write("control", 1);
    bus.until_waiting();
    // Nowhere: further pages of the inputs and the outputs, the last input port.
    bus.put(1, INPUTS + 0x300, 0x7fc0_0000);
    bus.put(1, INPUTS + machine.inputs.depth - 1, 1);
    bus.read(OUTPUTS + machine.outputs_per_bank, 0);
    let outputs: Vec<Register> = program.outputs.iter().map(|port| port.register).collect();
    drive(&program, PERIODS, |inputs| -> Result<Vec<(Register, u32)>, takt_emu::PeriodError> {
        for &(register, bits) in inputs {
            emulator.set_input_bits(register, bits).expect("an input");
        }
        bus.period(machine, inputs);
        emulator.run_period(&[])?;
        let values = outputs.iter().map(|&port| (port, emulator.output_bits(port).expect("written")));
        let values: Vec<_> = values.collect();
        for &(port, value) in &values {
            bus.read(output(machine, port), value);
        }
        Ok(values)
    });
    bus.expected.push_str("end\n");
    let said = bus.run(machine, &format!("bus-{}", machine.name), "");
    assert_eq!(said, bus.expected);
}

/// Its outputs depend on what earlier periods left in registers and data memory; an output and an input have a first value.
const MEMORY: &str = "
.input  x, gain, n:int
.output sum, product, k:int, first
.reg    t u
.state  s c:int
.preset s = 1.5
.preset c = 0
.preset gain = 3.0
.preset first = 7.5
.data
table:  .float 2, 4, 8, 16
.once
        wait    period
.period
period: fadd    s, s, x
        ld      t, table[c]
        fmul    u, t, s
        st      table[c], u
        fmul    product, u, gain
        fadd    sum, s, t
        iadd    c, c, n
        iand    c, c, 3
        iadd    k, c, n
        wait    period
";

/// Runs periods, starts again over the bus, runs them again: the same outputs, those of the emulator, which is reset.
fn restart(machine: &'static Machine, latched: bool) {
    let options = takt_asm::Options { machine, ..takt_asm::Options::default() };
    let source = if latched { format!(".ports latched\n{MEMORY}") } else { MEMORY.to_owned() };
    let assembled = takt_asm::assemble("memory.s", &takt_asm::MemoryLoader::of("memory.s", source), &options);
    let program = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false))).program;
    let mut emulator = Emulator::new(&program).expect("it fits");
    let port = |name: &str| {
        let mut ports = program.inputs.iter().chain(&program.outputs);
        ports.find(|port| port.name == name).expect("a port").register
    };
    let mut bus = Bus::default();
    bus.load(&program);
    let run = |bus: &mut Bus, emulator: &mut Emulator, periods: u32| {
        bus.write("control", 1);
        bus.until_waiting();
        bus.read(output(machine, port("first")), 7.5f32.to_bits());
        for i in 0..periods {
            let mut inputs = vec![(port("x"), (i as f32 * 0.75 - 1.0).to_bits()), (port("n"), 1 + i % 2)];
            // From the second period on: in the first it is what the loader wrote.
            if i > 0 {
                inputs.push((port("gain"), (1.0 + i as f32).to_bits()));
            }
            for &(register, bits) in &inputs {
                emulator.set_input_bits(register, bits).expect("an input");
            }
            bus.period(machine, &inputs);
            emulator.run_period(&[]).unwrap_or_else(|error| panic!("{error}"));
            for name in ["sum", "product", "k", "first"] {
                let value = emulator.output_bits(port(name)).expect("written");
                bus.read(output(machine, port(name)), value);
            }
        }
    };
    run(&mut bus, &mut emulator, 5);
    let once = bus.expected.clone();
    bus.write("control", 0);
    emulator.reset();
    run(&mut bus, &mut emulator, 5);
    assert_eq!(bus.expected, once.repeat(2));
    // Stopped amid a period, with an input written on the way.
    bus.write("tick", 1);
    bus.put(1, INPUTS + machine.input_number(port("x")).expect("an input"), 1);
    bus.write("control", 0);
    emulator.reset();
    run(&mut bus, &mut emulator, 2);
    bus.expected.push_str("end\n");
    let ports = program.latched_inputs();
    let folder = format!("restart-{}-{ports}", machine.name);
    let said = bus.run(machine, &folder, &format!(".LATCHED({ports})"));
    assert_eq!(said, bus.expected);
    // Without what keeps it, the second run goes on where the first ended.
    let said = bus.run(machine, &folder, &format!(".LATCHED({ports}), .RESTORE(0)"));
    let lines = once.lines().count();
    assert!(said.starts_with(&once));
    assert!(said.lines().skip(lines).zip(once.lines()).any(|(second, first)| second != first));
}

#[test]
fn a_program_starts_again_on_t3() {
    restart(&T3, false);
    restart(&T3, true);
}

#[test]
fn a_program_starts_again_on_t1() {
    restart(&T1, false);
    restart(&T1, true);
}

#[test]
fn tracking_over_the_bus_on_t3() {
    tracking(&T3);
}

#[test]
fn tracking_over_the_bus_on_t1() {
    tracking(&T1);
}
