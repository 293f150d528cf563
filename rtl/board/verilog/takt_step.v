// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_step: step and direction, counted.
//
// Contract
//   count changes at each rising edge of step: up if direction is 1 then, else down. It wraps at 32 bits. Pins pass through
//   takt_filter with HOLD = FILTER; an edge of step in cycle t is in count in t + 3 + FILTER.
//   take: r_count holds from the next cycle on what count is in this one. rst: both are 0.

module takt_step #(
    parameter FILTER = 1
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        take,
    input  wire        pin_step,
    input  wire        pin_direction,
    output reg  [31:0] r_count
);

    wire step, direction;
    takt_filter #(.HOLD(FILTER), .BITS(8)) filter_step (.clk(clk), .rst(rst), .pin(pin_step), .level(step));
    takt_filter #(.HOLD(FILTER), .BITS(8)) filter_direction (.clk(clk), .rst(rst), .pin(pin_direction), .level(direction));

    reg        was;
    reg [31:0] count;

    always @(posedge clk) begin
        was <= step;
        if (step & ~was) count <= direction ? count + 32'd1 : count - 32'd1;
        if (take) r_count <= count;
        if (rst) {count, r_count} <= 64'd0;
    end

endmodule
