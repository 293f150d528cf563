//! The core behind its Wishbone slave, in Icarus Verilog: loaded, run and read over the bus, with the tracking program.

mod common;

use common::{assemble, drive, folder};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;
use takt_emu::Emulator;
use takt_isa::{Machine, T1, T3};
use takt_rtl::bench::{Space, load_records};
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
fn master(name: &str) -> String {
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

    {name} slave (
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
            for (polls = 0; script[i][51:48] == 4'd3 && (read & script[i][31:0]) == 32'd0 && polls < 2000; polls = polls + 1)
                access(1'b0, script[i][47:32], script[i][31:0]);
        end
        $display("end");
        $finish;
    end
endmodule
"#
    )
}

fn tracking(machine: &'static Machine) {
    let program = assemble(machine, "hybrid/tracking.s");
    let mut emulator = Emulator::new(&program).expect("it fits");
    let register = |name: &str| REGISTERS.iter().find(|row| row.1 == name).expect("a register").0;
    let mut script = String::new();
    let mut put = |kind: u8, address: u16, value: u32| {
        writeln!(script, "{kind:x}{address:04x}{value:08x}").expect("a string takes it");
    };
    // The program's own bundles and what the fetch runs ahead to, and the constants.
    for record in load_records(&program) {
        match record.space {
            Space::Program if u32::from(record.address) >= program.bundles() + 16 => {}
            Space::Data if record.value == 0 => {}
            Space::Input => put(1, INPUTS + record.address, record.value as u32),
            space => {
                let place = u32::from(record.address) | (space as u32) << 16 | u32::from(record.slot) << 18;
                put(1, register("load_place"), place);
                put(1, register("load_high"), (record.value >> 32) as u32);
                put(1, register("load_low"), record.value as u32);
            }
        }
    }
    put(1, register("control"), 1);
    put(3, register("status"), 1);
    // A reset asked for briefly, while the program runs, lasts its time. A constant loaded at once waits for what is underway.
    let kept = load_records(&program).into_iter().find(|record| record.space == Space::Register);
    let kept = kept.expect("the program has constants");
    put(1, register("load_place"), u32::from(kept.address) | (Space::Register as u32) << 16);
    put(1, register("load_high"), 0);
    put(1, register("tick"), 1);
    (0..20).for_each(|_| put(4, register("status"), 0));
    put(1, register("control"), 0);
    put(1, register("load_low"), kept.value as u32);
    put(1, register("control"), 1);
    put(3, register("status"), 1);
    put(1, register("control"), 0);
    put(1, register("control"), 1);
    put(3, register("status"), 1);
    let mut expected = String::new();
    // Nowhere: further pages of the inputs and the outputs, the last input port.
    put(1, INPUTS + 0x300, 0x7fc0_0000);
    put(1, INPUTS + machine.inputs.depth - 1, 1);
    put(2, OUTPUTS + 0x80, 0);
    writeln!(expected, "{:04x} 00000000", OUTPUTS + 0x80).expect("a string takes it");
    let place = |address: u16| {
        let s = machine.slots.iter().position(|slot| slot.bank.contains(address)).expect("a bank's");
        let bank = machine.slots[s].bank;
        let first = bank.base + bank.depth - machine.outputs_per_bank;
        OUTPUTS + s as u16 * machine.outputs_per_bank + (address - first)
    };
    let outputs: Vec<u16> = program.outputs.iter().map(|port| port.register).collect();
    drive(&program, PERIODS, |inputs| -> Result<Vec<(u16, u32)>, takt_emu::PeriodError> {
        for &(register, bits) in inputs {
            emulator.set_input_bits(register, bits).expect("an input");
            put(1, INPUTS + (register - machine.inputs.base), bits);
        }
        put(1, register("tick"), 1);
        // A few reads later the tick has been seen and the program no longer waits.
        (0..3).for_each(|_| put(4, register("status"), 0));
        put(3, register("status"), 1);
        emulator.run_period(&[])?;
        let values = outputs.iter().map(|&port| (port, emulator.register(port).expect("written")));
        let values: Vec<_> = values.collect();
        for &(port, value) in &values {
            put(2, place(port), 0);
            writeln!(expected, "{:04x} {value:08x}", place(port)).expect("a string takes it");
        }
        Ok(values)
    });
    expected.push_str("end\n");

    let design = export(machine, &Library::builtin()).expect("it has a circuit");
    let name = takt_rtl::wishbone::name(&design);
    let folder = folder().join(&name);
    let mut list = vec!["master.v".to_owned(), format!("{name}.v")];
    list.extend(design.files.iter().map(|file| file.name.clone()));
    let files = bench::folder(&design, None, &[]).into_iter().map(|file| (file.name, file.text));
    let own = [("master.v".to_owned(), master(&name)), ("bus.hex".to_owned(), script)];
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
    // Some versions of Icarus Verilog remark that the script does not fill its memory.
    let said = run(&folder, "vvp", &["-n", "master"]);
    let said: String =
        said.lines().filter(|line| !line.starts_with("WARNING")).map(|line| format!("{line}\n")).collect();
    assert_eq!(said, expected);
    let waivers = ["-Wno-DECLFILENAME", "-Wno-PINCONNECTEMPTY"];
    let mut lint = vec!["--lint-only", "-Wall"];
    lint.extend(waivers);
    lint.extend(["--top-module", &name]);
    let sources: Vec<&str> = list[1..].iter().map(String::as_str).collect();
    lint.extend(sources);
    run(&folder, "verilator", &lint);
}

#[test]
fn tracking_over_the_bus_on_t3() {
    tracking(&T3);
}

#[test]
fn tracking_over_the_bus_on_t1() {
    tracking(&T1);
}
