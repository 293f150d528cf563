// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_outputs: the output ports as seen from outside: merges the writes of all slots into one set of ports.
//
// Each bank has a memory of its own, since a memory has one write port. A live-value table, which holds the bank that wrote each
// port last, selects among them.
//
// Contract
//   write, index, value: a write to an output port of each bank, in the cycle of its writeback. The latest write to a port counts;
//   of several in the same cycle, that of the last bank.
//   shown: the value of the port `number`, READ_DELAY cycles later (0 or 1), from writes before the number came. If LATCHED, from
//   writes before the last publish, starting with the cycle of the publish.
//   rst: values that the loader writes are visible at once; values written but not yet published are dropped.
//   If the outputs are left open, synthesis removes the module.

module takt_outputs #(
    parameter LATCHED = 0,
    parameter BANKS   = 3,
    parameter INDEX   = 5,  // bits of a port's number
    parameter READ_DELAY = 0
) (
    input  wire                   clk,
    input  wire                   rst,
    input  wire                   publish,
    input  wire [BANKS-1:0]       write,
    input  wire [BANKS*INDEX-1:0] index,
    input  wire [BANKS*32-1:0]    value,
    input  wire [INDEX-1:0]       number,
    output reg  [31:0]            shown
);

    localparam PLACES = LATCHED == 0 ? 1 : 2;
    localparam DEPTH  = PLACES << INDEX;

    wire [BANKS-1:0] place;
    wire             number_place;
    takt_double_buffer #(.PORTS(LATCHED == 0 ? 0 : 1 << INDEX), .INDEX(INDEX), .WRITES(BANKS), .READS(1)) places (
        .clk(clk), .flip(publish), .open(rst), .drop(rst),
        .write(write), .write_index(index), .write_place(place), .read_index(number), .read_place(number_place)
    );

    // The buffer's number is 0 if there is only one.
    localparam ADDRESS = $clog2(DEPTH);
    wire [INDEX:0]           read_at = {number_place, number};
    wire [BANKS*ADDRESS-1:0] write_at;
    wire [BANKS*32-1:0]      held;
    genvar b;
    generate
        for (b = 0; b < BANKS; b = b + 1) begin : g_bank
            wire [INDEX:0] at = {place[b], index[b*INDEX +: INDEX]};
            assign write_at[b*ADDRESS +: ADDRESS] = at[ADDRESS-1:0];
            reg  [31:0] words [0:DEPTH-1];
            always @(posedge clk) if (write[b]) words[at[ADDRESS-1:0]] <= value[32*b +: 32];
            assign held[32*b +: 32] = words[read_at[ADDRESS-1:0]];
            wire unused = &{1'b0, at[INDEX]};
        end
    endgenerate
    wire unused = &{1'b0, read_at[INDEX]};

    // The port's value in each bank, READ_DELAY cycles later.
    wire [BANKS*32-1:0] stands;
    generate
        if (READ_DELAY == 0) begin : g_at_once
            assign stands = held;
        end else begin : g_later
            reg [BANKS*32-1:0] q;
            always @(posedge clk) q <= held;
            assign stands = q;
        end
    endgenerate

    generate
        if (BANKS == 1) begin : g_one
            always @* shown = stands;
            wire unused_one = &{1'b0, write_at};
        end else begin : g_several
            // The bank that was written last.
            localparam OWNER = $clog2(BANKS);
            reg  [OWNER-1:0] owner [0:DEPTH-1];
            wire [OWNER-1:0] read_owner = owner[read_at[ADDRESS-1:0]];
            reg  [OWNER-1:0] read_owner_q;
            always @(posedge clk) read_owner_q <= read_owner;
            wire [OWNER-1:0] of_number = READ_DELAY == 0 ? read_owner : read_owner_q;
            integer k;
            always @(posedge clk) begin
                for (k = 0; k < BANKS; k = k + 1) if (write[k]) owner[write_at[k*ADDRESS +: ADDRESS]] <= k[OWNER-1:0];
            end
            integer j;
            always @* begin
                shown = stands[31:0];
                for (j = 1; j < BANKS; j = j + 1) if (of_number == j[OWNER-1:0]) shown = stands[32*j +: 32];
            end
        end
    endgenerate

endmodule
