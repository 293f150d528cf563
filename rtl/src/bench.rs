//! Generator of the files beside the core in an exported folder: file lists, memory image, test bench.

use crate::export::{Design, DesignFile, INPUT_DELAY, RESET_CYCLES, synthesis_top};
use crate::{axi, wishbone};
use std::fmt::Write as _;
use takt_isa::load::{LoadRecord, load_records};
use takt_isa::{Machine, Program, Register};

/// Records that the test bench takes from `inputs.hex`.
pub const STIMULI: usize = 1 << 16;

/// Cycles until the test bench gives up waiting for the program's `wait`, unless `+cycles` says otherwise.
const LIMIT: u32 = 1_000_000;

/// Every file of an exported folder. The test bench runs `program.hex` and `inputs.hex`, which are empty without a program.
pub fn folder(
    design: &Design,
    program: Option<&Program>,
    periods: &[Vec<(Register, u32)>],
) -> Vec<DesignFile> {
    let machine = design.machine;
    let top = &design.top;
    let latched = design.latched;
    let put = |name: String, text: String| DesignFile { name, text };
    let mut files = design.files.clone();
    files.extend(design.ecp5.clone());
    let list = |own: &[String], ecp5: bool| {
        let base = |name: &str| name.rsplit('/').next().map(str::to_owned);
        let replaced: Vec<_> = design.ecp5.iter().filter_map(|file| base(&file.name)).collect();
        let core = design
            .files
            .iter()
            .filter(|file| !ecp5 || base(&file.name).is_none_or(|name| !replaced.contains(&name)));
        let more = design.ecp5.iter().filter(|_| ecp5);
        own.iter()
            .chain(core.chain(more).map(|file| &file.name))
            .map(|name| format!("{name}\n"))
            .collect::<String>()
    };
    let synthesis = format!("{}.v", synthesis_top(machine));
    let bench_name = format!("{top}_bench");
    let bench_file = format!("{bench_name}.v");
    files.push(put(format!("{top}.f"), list(&[], false)));
    files.push(put(format!("{top}_ecp5.f"), list(&[], true)));
    files.push(put(format!("{bench_name}.f"), list(std::slice::from_ref(&bench_file), false)));
    files.push(put(synthesis, wishbone::on_few_pins(design)));
    files.push(put(format!("{}.v", wishbone::name(design)), wishbone::wrapper(design, latched)));
    files.push(put(format!("{}.v", axi::name(design)), axi::wrapper(design, latched)));
    files.push(put(bench_file, bench(machine, top, latched)));
    let nothing = || "// no program: `takt rtl --program FILE` writes one\n".to_owned();
    files.push(put("program.hex".to_owned(), program.map_or_else(nothing, image)));
    files.push(put("inputs.hex".to_owned(), stimuli(machine, periods)));
    files
}

/// The memory image for `$readmemh`: one record (space, slot, address, value) per line.
pub fn image(program: &Program) -> String {
    let mut text = String::from(
        "// space, slot, address, value: what the loader writes (docs/hardware.md in Takt's repository)\n",
    );
    for LoadRecord { space, slot, address, value } in load_records(program) {
        let _ = writeln!(text, "{:x}{slot:x}{address:04x}{value:012x}", space as u8);
    }
    text
}

/// Stimuli of the test bench for `$readmemh`: for each period its inputs, by register, and the tick.
fn stimuli(machine: &Machine, periods: &[Vec<(Register, u32)>]) -> String {
    let mut text = String::from("// 1: input port, index, value; 2: tick\n");
    for inputs in periods {
        for &(register, bits) in inputs {
            // A register that is no input is ignored.
            let Some(index) = machine.inputs.index(register) else { continue };
            let _ = writeln!(text, "1{:03x}{bits:08x}", index.get());
        }
        let _ = writeln!(text, "200000000000");
    }
    text
}

fn bench(machine: &Machine, top: &str, latched: u16) -> String {
    let input_bits = machine.inputs.depth.trailing_zeros();
    let port_bits = machine.outputs_per_bank.trailing_zeros();
    let mut outputs = String::new();
    let mut ports = String::new();
    let mut shown = String::new();
    for slot in machine.slots {
        let b = slot.bank.name;
        let _ = writeln!(
            outputs,
            "    wire        output_{b}_write;\n    wire [{}:0]  output_{b}_index;\n    wire [31:0] output_{b}_value;",
            port_bits - 1
        );
        let _ = writeln!(
            ports,
            "        .output_{b}_write(output_{b}_write), .output_{b}_index(output_{b}_index), .output_{b}_value(output_{b}_value),"
        );
        let _ = writeln!(
            shown,
            "            if (output_{b}_write) {};",
            if latched > 0 {
                format!("written[output_{b}_index] = 1'b1")
            } else {
                format!("$display(\"%0d output %0d %h\", cycle, output_{b}_index, output_{b}_value)")
            }
        );
    }
    let count = machine.outputs_per_bank;
    // With latched ports, those written since the last time are read one after the other, before the `wait` is reported.
    let published = if latched > 0 {
        format!(
            r#"    always @(posedge clk) begin
        #0.5;
        if (!rst && ended) begin
            for (port = 0; port < {count}; port = port + 1) begin
                read_output = port;
                #0.01 if (written[port]) $display("%0d output %0d %h", cycle - 2, port, read_value);
            end
            written = {count}'d0;
        end
    end
"#
        )
    } else {
        String::new()
    };
    let records =
        machine.code_depth as usize * machine.slots.len() + machine.data_depth as usize + Register::COUNT;
    format!(
        r#"// {top}_bench: loads program.hex and runs the periods of inputs.hex. Generated by `takt rtl`.
//
// Prints a line for each value on an output port, `<cycle> output <number> <value>` (if latched, in the cycle of the `wait`),
// for each period that ends, `<cycle> wait`, and at the end `halt`, `fault <kind> <slot> <address>`, `end` or
// `error: <what>`. +program=<file> and +inputs=<file> name other files; +cycles=<n> limits the cycles until the program's
// `wait` ({limit} by default).

`timescale 1ns / 1ps

module {top}_bench;

    reg         clk, rst, load, input_write, tick;
    reg  [1:0]  load_space;
    reg  [2:0]  load_slot;
    reg  [15:0] load_address;
    reg  [47:0] load_value;
    reg  [{index_high}:0]  input_index;
    reg  [31:0] input_value;
    wire        waiting, halted, fault, ended;
    reg  [{port_high}:0]  read_output;
    reg  [{written_high}:0] written;
    wire [31:0] read_value;
    wire [2:0]  fault_kind, fault_slot;
    wire [15:0] fault_address;
{outputs}
    {top} #(.LATCHED({latched})) core (
        .clk(clk), .rst(rst),
        .load(load), .load_space(load_space), .load_slot(load_slot), .load_address(load_address), .load_value(load_value),
        .input_write(input_write), .input_index(input_index), .input_value(input_value),
{ports}        .read_output(read_output), .read_value(read_value), .ended(ended),
        .tick(tick), .waiting(waiting), .deadline_missed(), .tick_missed(), .tick_lost(),
        .halted(halted), .fault(fault), .fault_kind(fault_kind), .fault_slot(fault_slot), .fault_address(fault_address),
        .issued(), .issued_address(), .stored(), .stored_address(), .stored_value(),
        .retire(), .retire_address(), .retire_register(), .retire_value(), .retire_flags(), .status()
    );

    initial clk = 1'b0;
    always #4 clk = ~clk;

    reg  [71:0]   image [0:{last_record}];
    reg  [47:0]   stimuli [0:{last_stimulus}];
    reg  [8*256:1] program_file, inputs_file;
    integer       i, port, cycle, waited, limit;

    // Outputs are looked at just before the clock's edge, inputs change just after it.
    always @(negedge clk) begin
        if (!rst) begin
{shown}        end
    end
{published}    always @(posedge clk) cycle <= rst ? 0 : cycle + 1;

    task edge_passes;
        begin
            @(posedge clk);
            #1;
        end
    endtask

    task stops;
        begin
            if (fault) $display("fault %0d %0d %0d", fault_kind, fault_slot, fault_address);
            else $display("halt");
            $finish;
        end
    endtask

    // A wait takes effect two cycles after its issue, a fault likewise.
    task until_waiting;
        begin
            for (waited = 0; !waiting && !halted && !fault && waited < limit; waited = waited + 1) edge_passes;
            if (waiting) $display("%0d wait", cycle - 2);
            else if (!halted && !fault) begin
                $display("error: no wait within %0d cycles (+cycles=<n>)", limit);
                $finish;
            end else begin
                for (i = 0; i < {reset}; i = i + 1) edge_passes;
                stops;
            end
        end
    endtask

    initial begin
        program_file = "program.hex";
        inputs_file  = "inputs.hex";
        if (!$value$plusargs("program=%s", program_file)) program_file = "program.hex";
        if (!$value$plusargs("inputs=%s", inputs_file)) inputs_file = "inputs.hex";
        for (i = 0; i < {records}; i = i + 1) image[i] = {{72{{1'b1}}}};
        for (i = 0; i <= {last_stimulus}; i = i + 1) stimuli[i] = 48'd0;
        if (!$value$plusargs("cycles=%d", limit)) limit = {limit};
        $readmemh(program_file, image);
        $readmemh(inputs_file, stimuli);
        if (image[0] == {{72{{1'b1}}}}) begin
            $display("error: %0s has no program: `takt rtl --program FILE` writes one", program_file);
            $finish;
        end
        {{rst, load, input_write, tick}} = 4'b1000;
        read_output = 0;
        written     = 0;
        {{load_space, load_slot, load_address, load_value, input_index, input_value}} = 0;
        for (i = 0; i < {reset}; i = i + 1) edge_passes;
        for (i = 0; i < {records} && image[i] != {{72{{1'b1}}}}; i = i + 1) begin
            load         = image[i][69:68] != 2'd3;
            load_space   = image[i][69:68];
            load_slot    = image[i][66:64];
            load_address = image[i][63:48];
            load_value   = image[i][47:0];
            input_write  = image[i][69:68] == 2'd3;
            input_index  = image[i][{index_top}:48];
            input_value  = image[i][31:0];
            edge_passes;
        end
        {{load, input_write}} = 2'b00;
        for (i = 0; i < 8; i = i + 1) edge_passes;
        rst = 1'b0;
        edge_passes;
        until_waiting;
        for (i = 0; i <= {last_stimulus} && stimuli[i] != 48'd0; i = i + 1) begin
            input_write = stimuli[i][47:44] == 4'd1;
            input_index = stimuli[i][{stimulus_top}:32];
            input_value = stimuli[i][31:0];
            if (stimuli[i][47:44] == 4'd2) begin
                // The inputs of the period are seen before its first bundle issues.
                for (cycle_of_inputs = 0; cycle_of_inputs < {delay}; cycle_of_inputs = cycle_of_inputs + 1) edge_passes;
                tick = 1'b1;
                edge_passes;
                tick = 1'b0;
                edge_passes;
                edge_passes;
                until_waiting;
            end else edge_passes;
            input_write = 1'b0;
        end
        for (i = 0; i < {reset}; i = i + 1) edge_passes;
        $display("end");
        $finish;
    end

    integer cycle_of_inputs;

endmodule
"#,
        index_high = input_bits - 1,
        port_high = port_bits - 1,
        written_high = count - 1,
        last_record = records - 1,
        last_stimulus = STIMULI - 1,
        limit = LIMIT,
        index_top = 48 + input_bits - 1,
        stimulus_top = 32 + input_bits - 1,
        reset = RESET_CYCLES,
        delay = INPUT_DELAY,
    )
}
