// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_loader: boot loader: a memory, initialised from the file IMAGE, with every core's program and first values, and the state
// machine that writes them into the cores in reset.
//
// Contract
//   rst: synchronous. After it, reset stays high until the cores' program and data memories have been cleared, all RECORDS have
//   been written, and SETTLE more cycles have passed.
//   All outputs are registers: the memory is many block RAMs behind a multiplexer, and its output goes to every core.
//   A record is {core, space, slot, address, value}, as the core's loader takes them (docs/hardware.md); space 3 is an input port.

module takt_loader #(
    parameter IMAGE   = "",
    parameter RECORDS = 1,
    parameter CORES   = 1,
    parameter SLOTS   = 1,     // of the core with the most
    parameter CODE    = 10,    // bits of a bundle's address, at most
    parameter DATA    = 10,    // bits of a data word's address, at most
    parameter SETTLE  = 128
) (
    input  wire             clk,
    input  wire             rst,
    output reg              reset,
    output reg  [CORES-1:0] load,
    output reg  [1:0]       load_space,
    output reg  [2:0]       load_slot,
    output reg  [15:0]      load_address,
    output reg  [47:0]      load_value,
    output reg  [CORES-1:0] load_input
);

    localparam BITS = RECORDS > 1 ? $clog2(RECORDS) : 1;
    localparam LAST_RECORD = RECORDS - 1;
    localparam [15:0] LAST_CODE = (1 << CODE) - 1, LAST_DATA = (1 << DATA) - 1;
    localparam [15:0] LAST_SETTLE = SETTLE + 1;   // the last record is two cycles on its way
    localparam [2:0]  DATA_SLOT = SLOTS;   // beyond the slots of program memory

    reg [72:0]     records [0:RECORDS-1];
    generate
        // A tool that checks this module alone has no image file.
        if (IMAGE != "") begin : g_image
            initial $readmemh(IMAGE, records);
        end
    endgenerate

    // 0: zeros, 1: records, 2: settles.
    reg [1:0]      state;
    reg [15:0]     address;
    reg [2:0]      slot;
    reg [BITS-1:0] next;
    // The memory's word, and a register behind the multiplexer of its block RAMs.
    reg [72:0]     read, record;
    reg            clears, reads, valid;
    reg [15:0]     cleared;
    reg [2:0]      cleared_slot;

    wire       clears_data = cleared_slot == DATA_SLOT;
    wire       is_input    = record[68:67] == 2'd3;
    integer c;

    always @(posedge clk) begin
        for (c = 0; c < CORES; c = c + 1) begin
            load[c]       <= clears | (valid & ~is_input & record[72:69] == c[3:0]);
            load_input[c] <= valid & is_input & record[72:69] == c[3:0];
        end
        load_space   <= clears ? {1'b0, clears_data} : record[68:67];
        load_slot    <= clears ? cleared_slot & {3{~clears_data}} : record[66:64];
        load_address <= clears ? cleared : record[63:48];
        load_value   <= clears ? 48'd0 : record[47:0];
        read         <= records[next];
        record       <= read;
        reads        <= state == 2'd1;
        valid        <= reads;
        clears       <= state == 2'd0;
        cleared      <= address;
        cleared_slot <= slot;
        address      <= address + 16'd1;
        case (state)
            2'd0: if (address == (slot == DATA_SLOT ? LAST_DATA : LAST_CODE)) begin
                address <= 16'd0;
                slot    <= slot + 3'd1;
                if (slot == DATA_SLOT) state <= 2'd1;
            end
            2'd1: begin
                next <= next + 1'b1;
                if (next == LAST_RECORD[BITS-1:0]) begin
                    address <= 16'd0;
                    state   <= 2'd2;
                end
            end
            default: if (address == LAST_SETTLE) reset <= 1'b0;
        endcase
        if (rst) begin
            state   <= 2'd0;
            address <= 16'd0;
            slot    <= 3'd0;
            next    <= {BITS{1'b0}};
            reset   <= 1'b1;
            {clears, reads, valid} <= 3'b000;
            {load, load_input}     <= {2 * CORES{1'b0}};
        end
    end

endmodule
