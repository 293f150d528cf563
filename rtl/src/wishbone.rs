//! Wishbone slave around a core: the core as a peripheral, an example of integration that is simulated like the rest.

use crate::export::{Design, RESET_CYCLES, synthesis_top};
use crate::synthesis::Resources;
use std::fmt::Write as _;
use takt_isa::Machine;

/// A register of the slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// Its word address.
    pub address: u16,
    /// Its name.
    pub name: &'static str,
    /// `r`, `w` or `rw`.
    pub access: &'static str,
    /// Its purpose.
    pub text: &'static str,
    /// Its bit fields, from bit 0 on; empty if the register is a single number.
    pub fields: &'static [Field],
}

/// A bit field of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name; in `status`, that of the slave's signal.
    pub name: &'static str,
    /// Its lowest bit.
    pub low: u32,
    /// Its bits.
    pub width: u32,
    /// Its meaning.
    pub text: &'static str,
}

const fn field(name: &'static str, low: u32, width: u32, text: &'static str) -> Field {
    Field { name, low, width, text }
}

const CONTROL: Register = Register {
    address: 0,
    name: "control",
    access: "rw",
    text: "While run is 0 the core is in reset and can be loaded; 0 after `rst_i`. A reset, however short it is asked for, lasts as long as the core needs; with RESTORE, what was loaded is written again in it.",
    fields: &[field("run", 0, 1, "The program runs.")],
};
const STATUS: Register = Register {
    address: 1,
    name: "status",
    access: "r",
    text: "What the program does.",
    fields: &[
        field("waiting", 0, 1, "It waits for the tick: the outputs of the period stand."),
        field("deadline_missed", 1, 1, "A tick came before its `wait`, since reset."),
        field("halted", 2, 1, "It has halted."),
        field("fault", 3, 1, "It has stopped with a fault, which the other fields describe."),
        field(
            "fault_kind",
            4,
            3,
            "1 illegal word, 2 data address, 3 return stack full, 4 return stack empty.",
        ),
        field("fault_slot", 7, 3, "The slot of the fault."),
        field(
            "flags",
            10,
            3,
            "The sticky flags: invalid, divide by zero, overflow, the last in the lowest bit.",
        ),
        field("fault_address", 16, 16, "The bundle of the fault."),
    ],
};
const PERIOD: Register = Register {
    address: 2,
    name: "period",
    access: "rw",
    text: "Clock cycles from tick to tick, once the program has first waited; 0: ticks come from register 3 only.",
    fields: &[],
};
const TICK: Register =
    Register { address: 3, name: "tick", access: "w", text: "Any write is a tick.", fields: &[] };
const LOAD_PLACE: Register = Register {
    address: 4,
    name: "load_place",
    access: "w",
    text: "Where the loader writes.",
    fields: &[
        field("address", 0, 16, "Bundle, data word or register."),
        field("space", 16, 2, "0 program memory, 1 data memory, 2 registers."),
        field("slot", 18, 3, "In program memory, the word of the bundle."),
    ],
};
const LOAD_HIGH: Register = Register {
    address: 5,
    name: "load_high",
    access: "w",
    text: "Bits 47:32 of the words loaded from now on.",
    fields: &[],
};
const LOAD_LOW: Register = Register {
    address: 6,
    name: "load_low",
    access: "w",
    text: "Bits 31:0 of a word: loads it at `load_place`, which then moves on by one address. Acknowledged when the core's reset has lasted long enough.",
    fields: &[],
};

/// Registers of the slave, by address. The wrapper, its test and the headers of programs take them from here.
pub const REGISTERS: &[Register] = &[CONTROL, STATUS, PERIOD, TICK, LOAD_PLACE, LOAD_HIGH, LOAD_LOW];

/// Word address of input port 0.
pub const INPUTS: u16 = 0x1000;
/// Word address of output port 0.
pub const OUTPUTS: u16 = 0x2000;

/// Name of the slave's module.
pub fn name(design: &Design) -> String {
    format!("{}_wishbone", design.top)
}

/// The value of the slave's status register: the fields, with zeros between them.
fn status() -> String {
    let (mut parts, mut next) = (Vec::new(), 0);
    for field in STATUS.fields {
        if field.low > next {
            parts.push(format!("{}'d0", field.low - next));
        }
        parts.push(field.name.to_owned());
        next = field.low + field.width;
    }
    parts.reverse();
    format!("{{{}}}", parts.join(", "))
}

/// Open connections for the core's pins that report each write of an output port, which a slave that reads the ports does not need.
pub fn open_streams(machine: &Machine) -> String {
    let streams = machine.slots.iter().map(|slot| {
        let b = slot.bank.name;
        format!(".output_{b}_write(), .output_{b}_index(), .output_{b}_value(),")
    });
    streams.collect::<Vec<_>>().join(" ")
}

/// The slave. `latched` is the default of its parameter for latched ports
/// ([`Program::latched_inputs`](takt_isa::Program::latched_inputs)).
pub fn wrapper(design: &Design, latched: u16) -> String {
    let machine = design.machine;
    let name = name(design);
    let port_bits = machine.outputs_per_bank.trailing_zeros();
    let input_bits = machine.inputs.depth.trailing_zeros();
    let data_bits = machine.data_depth.trailing_zeros();
    let register_bits = takt_isa::Register::COUNT.trailing_zeros();
    let inputs_page = format!("{}'d{}", register_bits - input_bits, machine.inputs.base >> input_bits);
    // The words that RESTORE keeps: data, then registers.
    let half = data_bits.max(register_bits);
    let streams = open_streams(machine);
    let mut table = String::new();
    for Register { address, name, access, text, fields } in REGISTERS {
        let _ = writeln!(table, "//   {address:04x} {access:<2} {name}: {text}");
        for Field { name, low, width, text } in *fields {
            let bits = if *width == 1 { low.to_string() } else { format!("{}:{low}", low + width - 1) };
            let _ = writeln!(table, "//             {bits} {name}: {text}");
        }
    }
    let [control, period, tick, place, high, low] =
        [CONTROL, PERIOD, TICK, LOAD_PLACE, LOAD_HIGH, LOAD_LOW].map(|register| register.address);
    format!(
        r#"// {name}: the core as a Wishbone B4 slave (classic cycles, 32 bits). Generated by `takt rtl`.
//
// Contract
//   adr_i counts words; addresses are hexadecimal:
{table}//   {INPUTS:04x} + port  w  input port
//   {OUTPUTS:04x} + port  r  output port: the last value written to it; if LATCHED, before the last `wait`
//   Accesses are acknowledged two cycles later, since the address is decoded in a cycle of its own; reads of output ports five
//   cycles later, since the ports of the banks are read, and one is selected, in cycles of their own. load_low and, with RESTORE,
//   input ports are acknowledged only when a reset in progress has lasted long enough. A write to an unused address has no effect;
//   a read of one gives 0.
//   rst_i: must be high for at least one cycle after power-up.
//   waiting: the program waits for the tick, and the outputs of the period are stable. It can serve as an interrupt.
//   LATCHED: the core's parameter.
//   RESTORE: a reset restores the words that were loaded into data memory and registers, and written to input ports, while run was 0,
//   so that the program starts again from the same state. It costs {words} words of 33 bits in block RAM, and as many cycles of reset.
//   With 0, a reset leaves data memory and registers as the program left them: load them again before the next run.

module {name} #(
    parameter LATCHED = {latched},
    parameter RESTORE = 1
) (
    input  wire        clk_i,
    input  wire        rst_i,
    input  wire        cyc_i,
    input  wire        stb_i,
    input  wire        we_i,
    input  wire [15:0] adr_i,
    input  wire [31:0] dat_i,
    output reg  [31:0] dat_o,
    output reg         ack_o,
    output wire        waiting
);

    // ---- registers

    reg         run, ticks, loads, writes_input;
    reg  [6:0]  in_reset;     // cycles of reset so far; the core needs {RESET_CYCLES}
    reg         done, settled;
    reg  [31:0] period, last, elapsed, value, low;  // last: period - 1
    reg  [15:0] place, load_address, high;
    reg  [1:0]  space;
    reg  [2:0]  slot;
    reg  [{input_high}:0]  input_index;
    reg  [{port_high}:0]  output_index;
    reg  [31:0] output_value;
    reg  [2:0]  reading;      // an output port: its number is in output_index, the banks have read it, its value is in output_value
    reg         waited;       // since reset
    reg         periodic;     // the period is not 0
    // A request, with its decoded address.
    reg         asked, at_control, at_status, at_period, at_tick, at_place, at_high, at_low, at_input, at_output;

    wire        deadline_missed, halted, fault, restored;
    wire [2:0]  fault_kind, fault_slot, flags;
    wire [15:0] fault_address;
    wire [31:0] read_value;

    wire quiet    = in_reset == 7'd{RESET_CYCLES};
    wire rst      = ~(run & settled);
    wire held     = at_low | (at_input & RESTORE != 0);
    wire request  = cyc_i & stb_i & ~ack_o;
    wire access   = request & asked & (settled | ~held) & (reading[2] | ~at_output);
    wire writes   = access & we_i;
    wire due      = waited & periodic & elapsed >= last;

    always @(posedge clk_i) begin
        asked        <= request;
        at_control   <= adr_i == 16'd{control};
        at_status    <= adr_i == 16'd{status};
        at_period    <= adr_i == 16'd{period};
        at_tick      <= we_i & adr_i == 16'd{tick};
        at_place     <= we_i & adr_i == 16'd{place};
        at_high      <= we_i & adr_i == 16'd{high};
        at_low       <= we_i & adr_i == 16'd{low};
        at_input     <= we_i & adr_i[15:{input_bits}] == {input_page_bits}'d{input_page} & ~&adr_i[{input_high}:0];  // the last is `zero`
        at_output    <= ~we_i & adr_i[15:{port_bits}] == {output_page_bits}'d{output_page};
        ack_o        <= access;
        ticks        <= (access & at_tick) | due;
        loads        <= access & at_low;
        writes_input <= access & at_input;
        input_index  <= adr_i[{input_high}:0];
        // The condition keeps synthesis from merging this register with input_index.
        if (at_output) output_index <= adr_i[{port_high}:0];
        output_value <= read_value;
        reading      <= request & asked & at_output & ~access ? {{reading[1:0], 1'b1}} : 3'd0;
        value        <= dat_i;
        last         <= period - 32'd1;
        periodic     <= period != 32'd0;
        waited       <= ~rst & (waited | waiting);
        elapsed      <= due | ~waited ? 32'd0 : elapsed + 32'd1;
        if (~quiet) in_reset <= in_reset + 7'd1;
        // The last word has arrived before the reset ends.
        done         <= quiet & restored;
        settled      <= done;
        if (writes) begin
            if (at_control) begin
                run <= dat_i[0];
                if (~dat_i[0] & run) {{settled, done, in_reset}} <= 9'd0;
            end
            if (at_period) period <= dat_i;
            if (at_place) {{slot, space, place}} <= dat_i[20:0];
            if (at_high) high <= dat_i[15:0];
            if (at_low) begin
                low          <= dat_i;
                load_address <= place;
                place        <= place + 16'd1;
            end
        end
        if (rst_i) begin
            run      <= 1'b0;
            period   <= 32'd0;
            ack_o    <= 1'b0;
            {{settled, done, in_reset}} <= 9'd0;
        end
    end

    always @(posedge clk_i) begin
        if (access) begin
            dat_o <= at_output ? output_value : at_control ? {{31'd0, run}} : at_status ? {status_word} :
                     at_period ? period : 32'd0;
        end
    end

    // ---- loading, and restoring after a reset

    wire        replays, replays_register, replays_input;
    wire [{half_high}:0]  replay_address;
    wire [31:0] replay_value;
    generate
        if (RESTORE != 0) begin : g_restore
            reg  [32:0] kept [0:{last_word}];  // the highest bit: it was loaded. Data, then registers and input ports
            reg  [32:0] word;
            reg  [{half_bits}:0] at;
            reg  [{half_count}:0] next;
            reg         reads;
            integer     i;
            initial for (i = 0; i <= {last_word}; i = i + 1) kept[i] = 33'd0;

            wire        keeps_register = loads & space == 2'd2 & load_address[15:{register_bits}] == {register_rest}'d0;
            wire        keeps_data     = loads & space == 2'd1;
            wire [{half_high}:0] keeps_at = writes_input ? {inputs_at} : keeps_data ? {data_at} : {register_at};
            assign restored = next[{half_count}];
            always @(posedge clk_i) begin
                if (rst & (keeps_data | keeps_register | writes_input))
                    kept[{{~keeps_data, keeps_at}}] <= {{1'b1, writes_input ? value : low}};
                word  <= kept[next[{half_bits}:0]];
                at    <= next[{half_bits}:0];
                reads <= quiet & ~restored;
                if (~quiet) next <= {half_total}'d0;
                else if (~restored) next <= next + {half_total}'d1;
            end
            assign replays          = reads & word[32];
            assign replays_input    = at[{half_bits}] & at[{register_high}:{input_bits}] == {inputs_page};
            assign replays_register = at[{half_bits}];
            assign replay_address   = at[{half_high}:0];
            assign replay_value     = word[31:0];
        end else begin : g_lost
            assign restored = 1'b1;
            assign {{replays, replays_register, replays_input, replay_address, replay_value}} = {none}'d0;
        end
    endgenerate

    wire        core_load    = loads | (replays & ~replays_input);
    wire [1:0]  core_space   = replays ? {{replays_register, ~replays_register}} : space;
    wire [15:0] core_address = replays ? {{{address_pad}'d0, replay_address}} : load_address;
    wire [47:0] core_value   = replays ? {{16'd0, replay_value}} : {{high, low}};
    wire        core_input   = writes_input | (replays & replays_input);

    {top} #(.LATCHED(LATCHED), .READ_DELAY(1)) core (
        .clk(clk_i), .rst(rst),
        .load(core_load), .load_space(core_space), .load_slot(slot), .load_address(core_address), .load_value(core_value),
        .input_write(core_input), .input_index(replays ? replay_address[{input_high}:0] : input_index),
        .input_value(replays ? replay_value : value),
        {streams}
        .read_output(output_index), .read_value(read_value), .ended(),
        .tick(ticks), .waiting(waiting), .deadline_missed(deadline_missed), .tick_missed(), .tick_lost(),
        .halted(halted), .fault(fault), .fault_kind(fault_kind), .fault_slot(fault_slot), .fault_address(fault_address),
        .issued(), .issued_address(), .stored(), .stored_address(), .stored_value(),
        .retire(), .retire_address(), .retire_register(), .retire_value(), .retire_flags(), .status(flags)
    );

endmodule
"#,
        words = 2 << half,
        input_high = input_bits - 1,
        input_page_bits = 16 - input_bits,
        input_page = INPUTS >> input_bits,
        output_page_bits = 16 - port_bits,
        output_page = OUTPUTS >> port_bits,
        port_high = port_bits - 1,
        status = STATUS.address,
        status_word = status(),
        last_word = (2 << half) - 1,
        half_high = half - 1,
        half_bits = half,
        half_count = half + 1,
        half_total = half + 2,
        register_rest = 16 - register_bits,
        register_high = register_bits - 1,
        inputs_at = padded(half, register_bits, &format!("{inputs_page}, input_index")),
        data_at = padded(half, data_bits, &format!("load_address[{}:0]", data_bits - 1)),
        register_at = padded(half, register_bits, &format!("load_address[{}:0]", register_bits - 1)),
        none = 3 + half + 32,
        address_pad = 16 - half,
        top = design.top,
        inputs_page = inputs_page,
    )
}

/// The resources that [`on_few_pins`] takes beside the slave: its registers, and 3 LUT4 for each parity of eight bits, 3 for the rest.
pub const PINS: Resources =
    Resources { luts: 15, carries: None, flip_flops: 145, multipliers: 0, block_rams: 0 };

/// The slave on a few pins, for a place-and-route run without a board. It is between registers, as in a system on the same device.
/// RESTORE is left out, since its memory belongs to the system.
pub fn on_few_pins(design: &Design) -> String {
    let (name, slave) = (synthesis_top(design.machine), name(design));
    format!(
        r#"// {name}: {slave} on a few pins, to be placed and routed without a board. Generated by `takt rtl`.
//
// Requests are shifted in, and only now and then copied to a second register; otherwise synthesis would merge the two.

module {name} (
    input  wire clk,
    input  wire rst,
    input  wire serial_in,
    output reg  serial_out
);

    reg         reset;
    reg  [51:0] shift, request;
    wire [31:0] answer;
    wire        ack, waiting;
    reg  [33:0] held;
    reg  [4:0]  parity;

    {slave} #(.RESTORE(0)) slave (
        .clk_i(clk), .rst_i(reset), .cyc_i(request[50]), .stb_i(request[49]), .we_i(request[48]),
        .adr_i(request[47:32]), .dat_i(request[31:0]), .dat_o(answer), .ack_o(ack), .waiting(waiting)
    );

    wire unused = &{{1'b0, request[51]}};

    integer i;
    always @(posedge clk) begin
        reset <= rst;
        shift <= {{shift[50:0], serial_in}};
        if (shift[51]) request <= shift;
        held <= {{waiting, ack, answer}};
        for (i = 0; i < 4; i = i + 1) parity[i] <= ^held[8*i +: 8];
        parity[4]  <= ^held[33:32];
        serial_out <= ^parity;
    end

endmodule
"#
    )
}

/// Zero extension in Verilog: `what`, which has `bits` bits, extended to `wide` bits.
fn padded(wide: u32, bits: u32, what: &str) -> String {
    if wide == bits { format!("{{{what}}}") } else { format!("{{{}'d0, {what}}}", wide - bits) }
}
