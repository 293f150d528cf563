// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_tick_divider: divides base ticks into a core's ticks, which come an offset later (docs/system.md, One time), and times its snapshots.
//
// Contract
//   due: high for a cycle, LEAD cycles before a base tick B. Every one of EVERY, the first one first, begins a period of the core: begins is
//   high in that cycle. The core sees its tick in T = B + OFFSET: tick is high one cycle before. take is high in T - SNAPSHOTS - 2,
//   SNAPSHOTS being the number of fields of all its snapshots. pending: from begins to the cycle of tick; a period that would begin
//   meanwhile does not, and dropped is high in that cycle.
//   stop: no tick comes any more.

module takt_tick_divider #(
    parameter EVERY     = 1,
    parameter OFFSET    = 0,
    parameter LEAD      = 6,
    parameter SNAPSHOTS = 0
) (
    input  wire clk,
    input  wire rst,
    input  wire due,
    input  wire stop,
    output wire begins,
    output wire dropped,
    output wire tick,
    output reg  take,
    output reg  pending
);

    localparam [31:0] FIRST = LEAD + OFFSET - 2;
    localparam [31:0] TAKE  = SNAPSHOTS + 2;  // the cycle before: take is a register, as it is in every mailbox of the core's snapshots
    localparam [31:0] LAST  = EVERY - 1;

    reg  [31:0] left, turns;
    wire        mine = due & turns == 32'd0 & ~stop;
    wire        last = left == 32'd0;
    assign begins  = mine & (~pending | last);
    assign dropped = mine & ~(~pending | last);
    assign tick    = pending & last;

    always @(posedge clk) begin
        if (due) turns <= turns == LAST ? 32'd0 : turns + 32'd1;
        left    <= begins ? FIRST : left - 32'd1;
        pending <= begins | (pending & ~last);
        take    <= pending & left == TAKE;
        if (rst | stop) {pending, take} <= 2'b00;
        if (rst) turns <= 32'd0;
    end

endmodule
