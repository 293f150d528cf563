// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_boot: loader: holds the programs and first values of all cores in block RAM, and writes them into the cores at a start.
//
// Contract
//   The memory holds records {core, slot, space, address, value}, as a core's loader takes them; space 3 is an input port. A single
//   core has no number. The file IMAGE has its contents at power-up. count of them are valid.
//   boot: high for a cycle starts it, at any time: reset is high from the next cycle on, until program and data memories have been
//   written with zeros, input ports too, and all records have been written, and SETTLE cycles longer. A boot during a boot begins it
//   again. load and input_write have a bit for each core; zeros go to all cores at once.
//   The host writes a record in parts of 32 bits: 0 and 1 are the low and high bits of the value, 2 is the place {core, slot, space,
//   address} and completes the record. part_read: part `part` of record `at`, two cycles after `at` stands: one for the block RAM,
//   one for a register behind it, because the block RAM itself is slow.

module takt_boot #(
    parameter IMAGE   = "image.hex",
    parameter CORES   = 1,
    parameter ROOM    = 2048, // records
    parameter BITS    = 11,   // of a record's number
    parameter SLOTS   = 3,    // of the core with the most, like the following
    parameter CODE    = 10,   // bits of a bundle's address
    parameter DATA    = 10,   // bits of a data word's address
    parameter INPUTS  = 8,    // bits of an input port's number; the last is not one
    parameter SETTLE  = 128
) (
    input  wire            clk,
    input  wire            rst,
    input  wire            boot,
    input  wire [BITS:0]   count,
    output reg             reset,
    output wire [CORES-1:0] load,
    output wire [1:0]      load_space,
    output wire [2:0]      load_slot,
    output wire [15:0]     load_address,
    output wire [47:0]     load_value,
    output wire [CORES-1:0] input_write,
    // The host's side.
    input  wire            write,
    input  wire [1:0]      part,
    input  wire [BITS-1:0] at,
    input  wire [31:0]     value,
    output reg  [31:0]     part_read
);

    localparam WIDTH = CORES > 1 ? 73 : 69;
    // Bits of the counter of addresses and of cycles to settle; no memory has more than 2^16 words.
    localparam WORDS = CODE > DATA ? CODE : DATA;
    localparam MOST  = WORDS > INPUTS ? WORDS : INPUTS;
    localparam COUNT = MOST > $clog2(SETTLE) ? MOST : $clog2(SETTLE);
    reg  [WIDTH-1:0] records [0:ROOM-1];
    initial $readmemh(IMAGE, records);

    reg  [WIDTH-1:0] fetched, record;
    wire [72:0]     whole = record;
    reg  [31:0]     low;
    reg  [15:0]     high;
    reg  [BITS:0]   next;
    reg  [COUNT-1:0] clears;    // program words of each slot, then data, then input ports
    reg  [2:0]      slot;
    reg  [1:0]      state;      // 0: at rest, 1: zeros, 2: records, 3: settles
    reg             fetches, valid, clearing, clears_data, clears_input;
    reg  [COUNT-1:0] cleared;
    reg  [2:0]      cleared_slot;

    wire [BITS-1:0] read_at = state == 2'd0 ? at : next[BITS-1:0];
    localparam [COUNT-1:0] LAST_CODE = (1 << CODE) - 1;
    localparam [COUNT-1:0] LAST_DATA = (1 << DATA) - 1;
    localparam [COUNT-1:0] LAST_PORT = (1 << INPUTS) - 2;
    localparam [COUNT-1:0] LAST_SETTLE = SETTLE - 1;
    localparam [COUNT-1:0] ONE = 1;
    // Beyond the slots of program memory.
    localparam [2:0]  DATA_SLOT = SLOTS, PORT_SLOT = SLOTS + 1;
    wire [COUNT-1:0] last_clear = slot == PORT_SLOT ? LAST_PORT : slot == DATA_SLOT ? LAST_DATA : LAST_CODE;

    always @(posedge clk) begin
        fetched <= records[read_at];
        record  <= fetched;
        if (write & part == 2'd0) low <= value;
        if (write & part == 2'd1) high <= value[15:0];
    end
    wire [72:0]     written = {value[24:0], high, low};
    always @(posedge clk) begin
        if (write & part == 2'd2 & state == 2'd0) records[at] <= written[WIDTH-1:0];
    end

    always @* begin
        case (part)
            2'd0: part_read = record[31:0];
            2'd1: part_read = {16'd0, record[47:32]};
            2'd2: part_read = {7'd0, whole[72:48]};
            default: part_read = 32'd0;
        endcase
    end

    wire [CORES-1:0] mine;
    genvar c;
    generate
        for (c = 0; c < CORES; c = c + 1) begin : g_core
            assign mine[c] = whole[72:69] == c;
        end
    endgenerate
    assign load         = {CORES{clearing}} | (mine & {CORES{valid & record[65:64] != 2'd3}});
    assign input_write  = {CORES{clears_input}} | (mine & {CORES{valid & record[65:64] == 2'd3}});
    assign load_space   = clearing ? {1'b0, clears_data} : record[65:64];
    assign load_slot    = clearing ? cleared_slot : record[68:66];
    assign load_address = clearing | clears_input ? {{16-COUNT{1'b0}}, cleared} : record[63:48];
    assign load_value   = clearing | clears_input ? 48'd0 : record[47:0];

    always @(posedge clk) begin
        fetches      <= state == 2'd2 & next != count;
        valid        <= fetches;
        clearing     <= state == 2'd1 & slot != PORT_SLOT;
        clears_input <= state == 2'd1 & slot == PORT_SLOT;
        clears_data  <= slot == DATA_SLOT;
        cleared      <= clears;
        cleared_slot <= slot == DATA_SLOT ? 3'd0 : slot;
        case (state)
            2'd1: begin
                clears <= clears + ONE;
                if (clears == last_clear) begin
                    clears <= 0;
                    slot   <= slot + 3'd1;
                    if (slot == PORT_SLOT) state <= 2'd2;
                end
            end
            2'd2: begin
                if (next == count) state <= 2'd3;
                else next <= next + 1'b1;
            end
            2'd3: begin
                clears <= clears + ONE;
                if (clears == LAST_SETTLE) begin
                    state <= 2'd0;
                    reset <= 1'b0;
                end
            end
            default: ;
        endcase
        if (boot | rst) begin
            state   <= 2'd1;
            reset   <= 1'b1;
            next    <= 0;
            clears  <= 0;
            slot    <= 3'd0;
        end
    end

endmodule
