// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_tick: the period's tick, and one ahead of it.
//
// Contract
//   run: high for a cycle at tick every `period` cycles, the first time `lead` + 2 cycles after run has risen; at early `lead` cycles before each
//   (with a lead of 0, in the same cycle). A lead of a period or more is taken as 0; a period below 2 gives no tick.
//   left: cycles until the next tick. A new period or lead counts from the next tick on.
//   While run is 0 nothing happens.

module takt_tick #(
    parameter BITS = 32       // of period, and of lead + 2
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        run,
    input  wire [31:0] period,
    input  wire [31:0] lead,
    output reg         tick,
    output reg         early,
    output wire [31:0] left
);

    localparam [BITS-1:0] ONE = 1;
    reg  [BITS-1:0] ahead, count;
    reg             runs;
    assign left = {{32-BITS{1'b0}}, count};
    wire            last  = count == ONE;
    wire            valid = period >= 32'd2;
    wire [31:0]     used  = lead < period ? lead : 32'd0;

    always @(posedge clk) begin
        tick  <= runs & last;
        early <= runs & (ahead == 0 ? last : count == ahead + ONE);
        if (~runs | last) ahead <= used[BITS-1:0];
        if (~runs) count <= used[BITS-1:0] + ONE;
        else count <= last ? period[BITS-1:0] : count - ONE;
        runs <= run & valid;
        if (rst) begin
            {tick, early, runs} <= 3'd0;
            count <= 0;
        end
    end

endmodule
