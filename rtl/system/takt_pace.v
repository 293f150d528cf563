// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_pace: tick generator of a core (docs/system.md, One time); it also times the latching of snapshots before each tick.
//
// Contract
//   starts is high LEAD cycles before the first base tick B. The core sees its ticks in T = B + OFFSET, and every PERIOD cycles from
//   then on: tick is high one cycle before each. take is high in T - SNAPSHOTS - 2, SNAPSHOTS being the number of fields of all the
//   core's snapshots. stop: no more ticks.

module takt_pace #(
    parameter PERIOD    = 2,
    parameter OFFSET    = 0,
    parameter LEAD      = 6,
    parameter SNAPSHOTS = 0,
    parameter BITS      = 4     // of the greatest number of cycles to count
) (
    input  wire clk,
    input  wire rst,
    input  wire starts,
    input  wire stop,
    output wire tick,
    output reg  take
);

    // Cycles from the start, in the cycle after `starts`, to the first tick.
    localparam FIRST = LEAD + OFFSET - 2;
    localparam LAST  = PERIOD - 1;
    localparam TAKE  = SNAPSHOTS + 2;   // the cycle before: take is a register, as it is in every mailbox of the core's snapshots
    reg [BITS-1:0] left;
    reg            runs;
    assign tick = runs & left == {BITS{1'b0}};

    always @(posedge clk) begin
        runs <= ~rst & ~stop & (runs | starts);
        take <= ~rst & ~stop & runs & left == TAKE[BITS-1:0];
        left <= starts ? FIRST[BITS-1:0] : left == {BITS{1'b0}} ? LAST[BITS-1:0] : left - 1'b1;
    end

endmodule
