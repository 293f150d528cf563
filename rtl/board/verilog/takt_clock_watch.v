// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_clock_watch: says by another clock that this one has stopped.
//
// Contract
//   stopped is 1 from power-up until clk has run for DIVIDE cycles, and again from at most LIMIT + 5 cycles of oscillation after the last
//   edge of clk, until clk has run for DIVIDE cycles. It stays 0 while DIVIDE cycles of clk take less than LIMIT cycles of oscillation.
//   stopped is a register of the clock oscillation.

module takt_clock_watch #(
    parameter DIVIDE = 16,  // cycles of clk, 2 or more
    parameter LIMIT  = 16   // cycles of oscillation
) (
    input  wire clk,
    input  wire oscillation,
    output reg  stopped
);

    localparam             BITS  = $clog2(DIVIDE);
    localparam             WIDTH = $clog2(LIMIT + 1);
    localparam [BITS-1:0]  LAST  = DIVIDE - 1, ONE = 1;
    localparam [WIDTH-1:0] MOST  = LIMIT, ONE_LONGER = 1;

    reg [BITS-1:0]  place;
    reg             beat;  // changes every DIVIDE cycles
    (* ASYNC_REG = "TRUE", altera_attribute = "-name SYNCHRONIZER_IDENTIFICATION FORCED_IF_ASYNCHRONOUS" *)
    reg [2:0]       seen;
    reg [WIDTH-1:0] silence;

    initial {place, beat, seen, silence} = 0;
    initial stopped = 1'b1;

    always @(posedge clk) begin
        place <= place == LAST ? {BITS{1'b0}} : place + ONE;
        if (place == LAST) beat <= ~beat;
    end

    always @(posedge oscillation) begin
        seen <= {seen[1:0], beat};
        if (seen[2] != seen[1]) {stopped, silence} <= 0;
        else if (silence == MOST) stopped <= 1'b1;
        else silence <= silence + ONE_LONGER;
    end

endmodule
