// SPDX-License-Identifier: MIT OR Apache-2.0
//! Core behind a bus slave, in Icarus Verilog: loaded, run, read and restarted over the bus. A script defines the master's actions, the
//! same for every bus.
#![allow(clippy::print_stdout)]

use crate::common::{assemble, drive, folder};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;
use takt_emu::Emulator;
use takt_isa::load::{Space, load_records};
use takt_isa::{Machine, Program, Register};
use takt_rtl::wishbone::{INPUTS, OUTPUTS, REGISTERS};
use takt_rtl::{Design, Library, axi, bench, export, wishbone};

const PERIODS: usize = 2;
/// Expression that occurs once in a slave's text, and its replacement.
pub(crate) type Fault = (&'static str, &'static str);

/// Bus: the name of a design's slave, and a generator of a master in Verilog that follows the script, given the slave's name and
/// parameters.
#[derive(Clone, Copy)]
pub(crate) struct Protocol {
    pub(crate) name: &'static str,
    pub(crate) slave: fn(&Design) -> String,
    pub(crate) master: fn(&str, &str) -> String,
}

pub(crate) const WISHBONE: Protocol =
    Protocol { name: "wishbone", slave: wishbone::name, master: wishbone_master };
pub(crate) const AXI: Protocol = Protocol { name: "axi", slave: axi::name, master: axi_master };

fn run(folder: &Path, program: &str, arguments: &[&str]) -> Result<String, String> {
    let output = Command::new(program).current_dir(folder).args(arguments).output();
    let output = output.unwrap_or_else(|error| panic!("{program}: {error}"));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    match output.status.success() {
        true => Ok(text),
        false => Err(format!("{program}: {text}{}", String::from_utf8_lossy(&output.stderr))),
    }
}

/// Module of a master, with its bus's parts filled in: nets and the slave, the effect of each reset, the tasks `put` and `get`, and
/// further actions. A line of `bus.hex` is an action: kind, address and value. Kinds 1 to 5 write, read and print, read until a bit is
/// set, read, and pause for a number of cycles; 6 and 7 are specific to the bus.
fn module(nets: &str, reset: &str, tasks: &str, own: &str) -> String {
    format!(
        r#"`timescale 1ns / 1ps
module master;
    reg         clk, rst;
    reg  [51:0] script [0:65535];
    reg  [3:0]  kind;
    reg  [15:0] address;
    reg  [31:0] value;
    reg  [31:0] got;
    reg  [15:0] noise;      // what a master may do or leave
    integer     i, polls, silence, hush;
    localparam  MOST = 4000;   // cycles of an access, and reads until a bit is set

{nets}
    initial clk = 1'b0;
    always #4 clk = ~clk;

    task next;
        begin
            @(posedge clk); #1;
            noise = {{noise[14:0], noise[15] ^ noise[13] ^ noise[12] ^ noise[10]}};
        end
    endtask

{tasks}
    initial begin
        for (i = 0; i < 65536; i = i + 1) script[i] = 52'd0;
        $readmemh("bus.hex", script);
        {{rst, noise, got, silence, hush}} = {{1'b1, 16'hace1, 96'd0}};
        {reset}
        repeat (4) @(posedge clk);
        #1 rst = 1'b0;
        for (i = 0; script[i] != 52'd0 && silence < MOST && hush < MOST; i = i + 1) begin
            {{kind, address, value}} = script[i];
            case (kind)
                4'd1: put(address, value);
                4'd2: begin get(address); $display("%h %h", address, got); end
                4'd3: begin
                    get(address);
                    for (polls = 0; (got & value) == 32'd0 && polls < MOST && hush < MOST; polls = polls + 1) get(address);
                    if (polls == MOST) hush = MOST;
                end
                4'd4: get(address);
                4'd5: repeat (value) next;
                {own}default: ;
            endcase
        end
        $display("end");
        $finish;
    end
endmodule
"#
    )
}

/// Wishbone master of classic cycles, which it ends at the clock edge at which it sees the acknowledgement.
fn wishbone_master(slave: &str, parameters: &str) -> String {
    let nets = format!(
        "    reg         stb, we;
    reg  [15:0] adr;
    reg  [31:0] dat;
    wire [31:0] read;
    wire        ack;
    {slave} #({parameters}) slave (
        .clk_i(clk), .rst_i(rst), .cyc_i(stb), .stb_i(stb), .we_i(we), .adr_i(adr), .dat_i(dat), .dat_o(read), .ack_o(ack), .waiting()
    );
"
    );
    let tasks = "    task access(input write, input [15:0] at, input [31:0] word);
        begin
            {stb, we, adr, dat} = {1'b1, write, at, word};
            @(posedge clk);
            for (silence = 0; !ack && silence < MOST; silence = silence + 1) @(posedge clk);
            got = read;
            #1 {stb, adr, dat} = {1'b0, ~adr, ~dat};
            repeat (noise[2:1]) next;
            next;
        end
    endtask
    task put(input [15:0] at, input [31:0] word); access(1'b1, at, word); endtask
    task get(input [15:0] at); access(1'b0, at, 32'd0); endtask
";
    module(&nets, "{stb, we, adr, dat} = 50'd0;", tasks, "")
}

/// AXI4-Lite master that offers addresses, data and readiness in any order, and checks that the slave holds its outputs until they are
/// accepted. Its own actions: 6 writes with the value's low bits as strobes and prints the response; 7 writes and reads an address at
/// once, and prints the order in which they were served, and the value read.
fn axi_master(slave: &str, parameters: &str) -> String {
    let nets = format!(
        "    reg         awvalid, wvalid, bready, arvalid, rready, at_once;
    reg  [17:0] awaddr, araddr;
    reg  [31:0] wdata;
    reg  [3:0]  wstrb;
    wire        awready, wready, bvalid, arready, rvalid;
    wire [1:0]  bresp, rresp;
    wire [31:0] rdata;
    reg  [1:0]  resp;
    reg  [15:0] order;   // of what was taken last: two letters
    {slave} #({parameters}) slave (
        .aclk(clk), .aresetn(~rst), .s_axi_awaddr(awaddr), .s_axi_awprot(3'd0), .s_axi_awvalid(awvalid), .s_axi_awready(awready),
        .s_axi_wdata(wdata), .s_axi_wstrb(wstrb), .s_axi_wvalid(wvalid), .s_axi_wready(wready),
        .s_axi_bresp(bresp), .s_axi_bvalid(bvalid), .s_axi_bready(bready),
        .s_axi_araddr(araddr), .s_axi_arprot(3'd0), .s_axi_arvalid(arvalid), .s_axi_arready(arready),
        .s_axi_rdata(rdata), .s_axi_rresp(rresp), .s_axi_rvalid(rvalid), .s_axi_rready(rready), .waiting()
    );
    always @(posedge clk) begin
        if (awvalid & awready) order <= {{order[7:0], \"w\"}};
        if (arvalid & arready) order <= {{order[7:0], \"r\"}};
        if (awready !== wready) $display(\"data and address are not taken together\");
        if (awready & ~(awvalid & wvalid) | arready & ~arvalid) $display(\"ready for nothing\");
    end
"
    );
    let tasks = "    task write(input [15:0] at, input [31:0] word, input [3:0] strobes);
        begin
            {awaddr, wdata, wstrb} = {at, noise[1:0], word, strobes};
            // The address, the data, or both come first.
            {awvalid, wvalid, bready} = {at_once | noise[2], at_once | ~noise[2] | noise[3], noise[4]};
            if (~(awvalid & wvalid)) repeat (noise[6:5]) next;
            {awvalid, wvalid} = 2'b11;
            @(posedge clk);
            for (silence = 0; !awready && silence < MOST; silence = silence + 1) @(posedge clk);
            #1 {awvalid, wvalid, awaddr, wdata, wstrb} = {2'b00, ~awaddr, ~wdata, ~wstrb};
            while (!bvalid && silence < MOST) begin silence = silence + 1; @(posedge clk); #1; end
            resp = bresp;
            if (!bready) repeat (noise[8:7]) begin
                next;
                if (!bvalid | bresp !== resp) $display(\"the response did not stay\");
            end
            bready = 1'b1;
            @(posedge clk); #1;
            bready = 1'b0;
            if (bvalid) $display(\"the response stayed\");
        end
    endtask
    task put(input [15:0] at, input [31:0] word);
        begin
            write(at, word, 4'hf);
            if (resp !== 2'b00) $display(\"a write was refused\");
            next;
        end
    endtask
    task get(input [15:0] at);
        begin
            {arvalid, araddr, rready} = {1'b1, at, noise[1:0], noise[2]};
            @(posedge clk);
            for (hush = 0; !arready && hush < MOST; hush = hush + 1) @(posedge clk);
            #1 {arvalid, araddr} = {1'b0, ~araddr};
            while (!rvalid && hush < MOST) begin hush = hush + 1; @(posedge clk); #1; end
            got = rdata;
            if (!rready) repeat (noise[5:4]) begin
                next;
                if (!rvalid | rdata !== got) $display(\"what was read did not stay\");
            end
            if (rresp !== 2'b00) $display(\"a read was refused\");
            rready = 1'b1;
            @(posedge clk); #1;
            rready = 1'b0;
            if (rvalid) $display(\"what was read stayed\");
            next;
        end
    endtask
";
    let own =
        "4'd6: begin write(address, value, value[3:0]); $display(\"%h answered %h\", address, resp); end
            4'd7: begin
                at_once = 1'b1;
                fork put(address, value); get(address); join
                at_once = 1'b0;
                $display(\"%h %s %h\", address, order, got);
            end
            ";
    let reset = "{awvalid, wvalid, bready, arvalid, rready, at_once} = 6'd0; {order, hush} = 48'd0;";
    module(&nets, reset, tasks, own)
}

/// Actions of the master, and the text that it must print.
#[derive(Default)]
pub(crate) struct Bus {
    script: String,
    pub(crate) expected: String,
}

impl Bus {
    pub(crate) fn put(&mut self, kind: u8, address: u16, value: u32) {
        writeln!(self.script, "{kind:x}{address:04x}{value:08x}").expect("a string takes it");
    }

    pub(crate) fn write(&mut self, name: &str, value: u32) {
        self.put(1, register(name), value);
    }

    /// Reads an address and expects a value.
    pub(crate) fn read(&mut self, address: u16, value: u32) {
        self.put(2, address, 0);
        writeln!(self.expected, "{address:04x} {value:08x}").expect("a string takes it");
    }

    pub(crate) fn until_waiting(&mut self) {
        self.put(3, register("status"), 1);
    }

    pub(crate) fn pause(&mut self, cycles: u32) {
        self.put(5, 0, cycles);
    }

    /// Loads a program: its bundles and those that fetch runs ahead to, its data and registers. Skips the write of a place that follows
    /// the last one, and of upper bits that stay the same.
    pub(crate) fn load(&mut self, program: &Program) {
        let (mut next, mut high) = (None, None);
        for record in load_records(program) {
            match record.space {
                Space::Program if u32::from(record.address) >= program.bundles() + 16 => {}
                Space::Data if record.value == 0 => {}
                Space::Input => self.put(1, INPUTS + record.address, record.value as u32),
                space => {
                    let place =
                        u32::from(record.address) | (space as u32) << 16 | u32::from(record.slot) << 18;
                    if next != Some(place) {
                        self.write("load_place", place);
                    }
                    let upper = (record.value >> 32) as u32;
                    if high.replace(upper) != Some(upper) {
                        self.write("load_high", upper);
                    }
                    self.write("load_low", record.value as u32);
                    next = Some(place + 1);
                }
            }
        }
    }

    /// Writes inputs, by register, ticks, and waits for the end of the period.
    pub(crate) fn period(&mut self, machine: &Machine, inputs: &[(Register, u32)]) {
        for &(register, bits) in inputs {
            self.put(1, INPUTS + machine.input_number(register).expect("an input"), bits);
        }
        self.write("tick", 1);
        // A few reads later the tick has been seen and the program no longer waits.
        (0..3).for_each(|_| self.put(4, register("status"), 0));
        self.until_waiting();
    }

    /// Makes a job of the script for a machine, whose slave has these parameters, with the judge of its output.
    pub(crate) fn job(
        mut self,
        name: String,
        machine: &'static Machine,
        parameters: String,
        judge: impl Fn(&str, &str) -> Result<(), String> + 'static,
    ) -> Job {
        self.expected.push_str("end\n");
        Job {
            name,
            machine,
            parameters,
            script: self.script,
            expected: self.expected,
            judge: Box::new(judge),
        }
    }
}

/// The output equals the expected text.
pub(crate) fn is_same(said: &str, expected: &str) -> Result<(), String> {
    if said == expected { Ok(()) } else { Err(format!("it says\n{said}instead of\n{expected}")) }
}

/// Comparison of the output of a simulation with the expected output; an error states the difference.
type Judge = Box<dyn Fn(&str, &str) -> Result<(), String>>;

/// Script for a machine, and its expected output.
pub(crate) struct Job {
    name: String,
    machine: &'static Machine,
    parameters: String,
    script: String,
    expected: String,
    judge: Judge,
}

impl Job {
    /// Runs the job over a bus, optionally with a fault in the slave.
    ///
    /// # Errors
    /// Description of the difference from the expected output.
    pub(crate) fn run(&self, protocol: Protocol, fault: Option<Fault>) -> Result<(), String> {
        let design = export(self.machine, &Library::builtin()).expect("it has a circuit");
        let slave = (protocol.slave)(&design);
        let folder = folder().join(format!(
            "{}-{}{}",
            protocol.name,
            self.name,
            if fault.is_some() { "-fault" } else { "" }
        ));
        let mut list = vec!["master.v".to_owned(), format!("{slave}.v")];
        let below = wishbone::name(&design);
        list.extend((below != slave).then(|| format!("{below}.v")));
        list.extend(design.files.iter().map(|file| file.name.clone()));
        let own = format!("{slave}.v");
        let files = bench::folder(&design, None, &[]).into_iter().map(|file| match fault {
            Some((from, to)) if file.name == own => {
                assert_eq!(file.text.matches(from).count(), 1, "`{from}` must occur once in {own}");
                (file.name, file.text.replace(from, to))
            }
            _ => (file.name, file.text),
        });
        let master = (protocol.master)(&slave, &self.parameters);
        let own = [("master.v".to_owned(), master), ("bus.hex".to_owned(), self.script.clone())];
        for (path, text) in files.chain(own).chain([("files.f".to_owned(), list.join("\n") + "\n")]) {
            let path = folder.join(path);
            fs::create_dir_all(path.parent().expect("a folder")).expect("the target folder can be written");
            fs::write(&path, text).expect("the target folder can be written");
        }
        let compiler = ["-g2005", "-Wall", "-Wno-timescale", "-s", "master", "-f", "files.f", "-o", "master"];
        run(&folder, "iverilog", &compiler)?;
        if fault.is_none() {
            let mut lint = vec!["--lint-only", "-Wall", "-Wno-DECLFILENAME", "-Wno-PINCONNECTEMPTY"];
            let given = self.parameters.split_terminator(", ");
            let given: Vec<String> = given
                .map(|parameter| format!("-G{}", parameter.trim_matches(['.', ')']).replace('(', "=")))
                .collect();
            lint.extend(given.iter().map(String::as_str));
            lint.extend(["--top-module", &slave]);
            lint.extend(list[1..].iter().map(String::as_str));
            run(&folder, "verilator", &lint)?;
        }
        // Some versions of Icarus Verilog warn that the script does not fill its memory.
        let said = run(&folder, "vvp", &["-n", "master"])?;
        let said: String = said
            .lines()
            .filter(|line| !line.starts_with("WARNING"))
            .map(|line| format!("{line}\n"))
            .collect();
        (self.judge)(&said, &self.expected)
            .map_err(|text| format!("{} on {}: {text}", protocol.name, self.name))
    }
}

/// Faults in a bus's slave that none of the jobs finds. The jobs are in order of increasing cost.
pub(crate) fn survivors(protocol: Protocol, jobs: &[Job], faults: &[Fault]) -> Vec<String> {
    let mut survivors = Vec::new();
    for &fault in faults {
        match jobs.iter().find_map(|job| job.run(protocol, Some(fault)).err().map(|_| &job.name)) {
            Some(name) => println!("{} `{}`: {name}", protocol.name, fault.0),
            None => survivors.push(format!("{fault:?}")),
        }
    }
    survivors
}

pub(crate) fn register(name: &str) -> u16 {
    REGISTERS.iter().find(|row| row.name == name).expect("a register").address
}

/// Address of an output port on the bus.
pub(crate) fn output(machine: &Machine, register: Register) -> u16 {
    OUTPUTS + machine.output_number(register).expect("an output")
}

/// Controller of the robot, for a few periods.
pub(crate) fn tracking(machine: &'static Machine) -> Job {
    let program = assemble(machine, "hybrid/tracking.s");
    let mut emulator = Emulator::new(&program).expect("it fits");
    let mut bus = Bus::default();
    bus.load(&program);
    bus.write("control", 1);
    bus.until_waiting();
    // A reset requested briefly while the program runs lasts its full time. A constant loaded immediately afterwards waits for results in
    // flight.
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
    // Addresses without a port: further pages of the inputs and the outputs, the last input port.
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
    bus.job(format!("tracking-{}", machine.name), machine, String::new(), is_same)
}

/// Program whose outputs depend on the registers and data memory that earlier periods left; an output and an input have initial values.
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

/// Runs periods, restarts the program over the bus, and runs them again: the outputs must be the same, and equal those of the emulator
/// after a reset. Without the memory for initial values, the second run continues where the first ended.
pub(crate) fn restart(machine: &'static Machine, latched: bool, restores: bool) -> Job {
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
            // Only from the second period on: the first uses the loader's value.
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
    // Stopped in the middle of a period, with a write to an input under way.
    bus.write("tick", 1);
    bus.put(1, INPUTS + machine.input_number(port("x")).expect("an input"), 1);
    bus.write("control", 0);
    emulator.reset();
    run(&mut bus, &mut emulator, 2);
    let ports = program.latched_inputs();
    let name = format!("restart-{}-{ports}-{}", machine.name, u8::from(restores));
    let parameters = format!(".LATCHED({ports}){}", if restores { "" } else { ", .RESTORE(0)" });
    bus.job(name, machine, parameters, move |said, expected| {
        if restores {
            return is_same(said, expected);
        }
        let goes_on = || {
            said.lines().skip(once.lines().count()).zip(once.lines()).any(|(second, first)| second != first)
        };
        if said.starts_with(&once) && goes_on() { Ok(()) } else { is_same(said, expected) }
    })
}

/// Program that counts its periods, and faults if `n` is beyond the memory.
const COUNT: &str = "
.input  n:int
.output count:int
.reg    t
.state  k:int
.preset k = 0
.preset count = 0
.data
table:  .float 1, 2
.once
        wait    period
.period
period: iadd    k, k, 1
        mov     count, k
        ld      t, table[n]
        wait    period
";
/// Period of the slave in cycles, and the number of periods in a pause.
const PERIOD: u32 = 40;
const PERIODS_PAUSED: u32 = 50;
/// A period that would be over before the program runs, if it were counted from the write.
const LONG: u32 = 400;

/// Bits of the status that are meaningful: without a fault, the fields of the fault are not.
fn meant(status: u32) -> u32 {
    let row = REGISTERS.iter().find(|row| row.name == "status").expect("a register");
    let mask = |name: &str| {
        let field = row.fields.iter().find(|field| field.name == name).expect("a field");
        ((1 << field.width) - 1) << field.low
    };
    let of_fault =
        ["fault_kind", "fault_slot", "fault_address"].map(mask).into_iter().fold(0, |all, bits| all | bits);
    if status & mask("fault") == 0 { status & !of_fault } else { status }
}

/// Status word with these fields; the others are 0.
fn status(fields: &[(&str, u32)]) -> u32 {
    let row = REGISTERS.iter().find(|row| row.name == "status").expect("a register");
    let place = |name: &str| row.fields.iter().find(|field| field.name == name).expect("a field").low;
    fields.iter().fold(0, |word, (name, value)| word | value << place(name))
}

/// Ticks by the slave's own period, each field of its status, a fault, and a restart after it. The number of periods is printed before
/// and after a pause.
pub(crate) fn counts_and_faults(machine: &'static Machine) -> Job {
    let options = takt_asm::Options { machine, ..takt_asm::Options::default() };
    let loader = takt_asm::MemoryLoader::of("count.s", COUNT);
    let assembled = takt_asm::assemble("count.s", &loader, &options);
    let program = assembled.unwrap_or_else(|errors| panic!("{}", errors.render(false))).program;
    let mut emulator = Emulator::new(&program).expect("it fits");
    let count = output(machine, program.outputs[0].register);
    let (n, beyond) = (program.inputs[0].register, machine.data_depth);
    let input = INPUTS + machine.input_number(n).expect("an input");
    let mut bus = Bus::default();
    bus.load(&program);
    bus.put(1, input, 0);
    // The period is counted from the first `wait` on, not from this write.
    bus.write("period", LONG);
    bus.pause(LONG);
    bus.write("control", 1);
    bus.until_waiting();
    bus.pause(LONG / 2);
    bus.read(count, 0);
    bus.read(register("status"), status(&[("waiting", 1)]));
    bus.write("period", PERIOD);
    for pause in [PERIOD, PERIOD * PERIODS_PAUSED] {
        bus.pause(pause);
        bus.read(count, 0);
    }
    // The period in which it is stopped is the last one.
    bus.write("period", 0);
    bus.pause(2 * PERIOD);
    bus.read(register("status"), status(&[("waiting", 1)]));
    bus.read(register("period"), 0);
    bus.read(register("control"), 1);
    // The second tick is early.
    (0..2).for_each(|_| bus.write("tick", 1));
    bus.pause(2 * PERIOD);
    bus.read(register("status"), status(&[("waiting", 1), ("deadline_missed", 1)]));
    emulator.set_input_bits(n, beyond).expect("an input");
    let fault_of = match emulator.run_period(&[]) {
        Err(takt_emu::PeriodError::Fault(fault)) => fault,
        other => panic!("{other:?}"),
    };
    bus.put(1, input, beyond);
    bus.write("tick", 1);
    bus.pause(2 * PERIOD);
    let slot = u32::from(fault_of.slot.expect("a slot's fault").get());
    let fields = [("deadline_missed", 1), ("fault", 1), ("fault_kind", 2), ("fault_slot", slot)];
    bus.read(register("status"), status(&fields) | status(&[("fault_address", fault_of.address.get())]));
    bus.write("control", 0);
    bus.load(&program);
    bus.put(1, input, 0);
    // The next run's first period is not counted from the last run, either.
    bus.write("period", LONG);
    bus.pause(LONG);
    bus.write("control", 1);
    bus.until_waiting();
    bus.pause(LONG / 2);
    bus.read(register("status"), status(&[("waiting", 1)]));
    bus.read(count, 0);
    bus.write("period", 0);
    bus.period(machine, &[]);
    bus.read(count, 1);
    bus.job(format!("counts-{}", machine.name), machine, ".RESTORE(0)".to_owned(), move |said, expected| {
        let pair = |line: &str| {
            let (address, value) = line.split_once(' ')?;
            Some((u16::from_str_radix(address, 16).ok()?, u32::from_str_radix(value, 16).ok()?))
        };
        let told: Vec<_> = said.lines().filter_map(pair).collect();
        let counted: Vec<u32> = told.iter().skip(2).take(2).map(|(_, value)| *value).collect();
        if !matches!(counted[..], [first, second] if (PERIODS_PAUSED..=PERIODS_PAUSED + 1).contains(&second.wrapping_sub(first))) {
            return Err(format!("counts of periods: {counted:?}"));
        }
        let lines = |text: &str| -> String {
            let line = |(i, line)| match pair(line) {
                _ if i == 2 || i == 3 => String::new(),
                Some((address, value)) if address == register("status") => format!("status {:08x}\n", meant(value)),
                _ => format!("{line}\n"),
            };
            text.lines().enumerate().map(line).collect()
        };
        is_same(&lines(said), &lines(expected))
    })
}
