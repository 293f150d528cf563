// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_outputs: the output ports as seen from outside: merges the writes of all slots into one set of ports.
//
// Each bank has a memory of its own, since a memory has one write port. The bank that wrote a port last follows from memories with
// one write port, too: of two banks, each keeps a bit for every port, and the earlier bank wrote last if the bits are equal. A
// write makes them equal or different, whatever the other bank's bit is. A table of owners with a write port for each bank would
// be flip-flops, four times as large.
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
            // told[b*BANKS+k]: bit of bank b against bank k, at the port that bank k writes; kept: at the port that is read. A word
            // that was never written counts as 0 in simulation, where it is undefined. yields: bank k, a later one than b, writes
            // the same port in this cycle.
            wire [BANKS*BANKS-1:0] told, kept, yields;
            genvar k;
            for (b = 0; b < BANKS; b = b + 1) begin : g_order
                reg  [BANKS-2:0] order [0:DEPTH-1];
                wire [BANKS-2:0] read = order[read_at[ADDRESS-1:0]];
                wire [BANKS-2:0] next;
                for (k = 0; k < BANKS; k = k + 1) begin : g_other
                    if (k == b) begin : g_itself
                        assign {told[b*BANKS+k], kept[b*BANKS+k], yields[b*BANKS+k]} = 3'd0;
                    end else begin : g_pair
                        localparam BIT = k < b ? k : k - 1;
                        assign told[b*BANKS+k]   = order[write_at[k*ADDRESS +: ADDRESS]][BIT] === 1'b1;
                        assign kept[b*BANKS+k]   = read[BIT] === 1'b1;
                        assign yields[b*BANKS+k] = (k > b) & write[k] &
                            (write_at[k*ADDRESS +: ADDRESS] == write_at[b*ADDRESS +: ADDRESS]);
                        assign next[BIT]         = told[k*BANKS+b] ^ (k < b);
                    end
                end
                wire orders = write[b] & ~|yields[b*BANKS +: BANKS];
                always @(posedge clk) if (orders) order[write_at[b*ADDRESS +: ADDRESS]] <= next;
            end

            // The bank that wrote the port last: it is later than all others.
            reg  [BANKS-1:0] read_last, read_last_q;
            integer i, j;
            always @* begin
                read_last = {BANKS{1'b1}};
                for (i = 0; i < BANKS; i = i + 1) begin
                    for (j = 0; j < i; j = j + 1) begin
                        if (kept[i*BANKS+j] == kept[j*BANKS+i]) read_last[i] = 1'b0;
                        else read_last[j] = 1'b0;
                    end
                end
            end
            always @(posedge clk) read_last_q <= read_last;
            wire [BANKS-1:0] of_number = READ_DELAY == 0 ? read_last : read_last_q;
            always @* begin
                shown = stands[31:0];
                for (j = 1; j < BANKS; j = j + 1) if (of_number[j]) shown = stands[32*j +: 32];
            end
        end
    endgenerate

endmodule
