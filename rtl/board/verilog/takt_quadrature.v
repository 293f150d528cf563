// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_quadrature: an incremental encoder, four counts to a line, with index.
//
// Contract
//   count goes up by one at each edge of a or b while a leads b, down while b leads a, and wraps at 32 bits: differences of two's
//   complement numbers stay right. If a and b change in the same cycle, count stays and errors goes up by one.
//   at_index is count at the last rising edge of index, indices the number of those. Pins pass through takt_filter with HOLD = FILTER.
//   since is 1 in the cycle in which count or errors has an edge of a or b, and one more in each cycle after it; it stays at 2^31 - 1.
//   An edge of a pin in cycle t is in count in t + 3 + FILTER.
//   take: registers r_… hold from the next cycle on what they are in this one.
//   rst: count is START, since is at its end, the others are 0.

module takt_quadrature #(
    parameter FILTER = 1,
    parameter [31:0] START = 0
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        take,
    input  wire        pin_a,
    input  wire        pin_b,
    input  wire        pin_index,
    output reg  [31:0] r_count,
    output reg  [31:0] r_at_index,
    output reg  [31:0] r_indices,
    output reg  [31:0] r_errors,
    output reg  [31:0] r_since
);

    localparam [30:0] END = 31'h7fffffff;

    wire a, b, index;
    takt_filter #(.HOLD(FILTER), .BITS(8)) filter_a (.clk(clk), .rst(rst), .pin(pin_a), .level(a));
    takt_filter #(.HOLD(FILTER), .BITS(8)) filter_b (.clk(clk), .rst(rst), .pin(pin_b), .level(b));
    takt_filter #(.HOLD(FILTER), .BITS(8)) filter_index (.clk(clk), .rst(rst), .pin(pin_index), .level(index));

    reg        was_a, was_b, was_index;
    reg [31:0] count, at_index, indices, errors;
    reg [30:0] since;

    wire both = (a ^ was_a) & (b ^ was_b);
    wire one  = (a ^ was_a) ^ (b ^ was_b);
    wire up   = a ^ was_b;  // 00, 10, 11, 01 of (a, b): a is what b was not

    always @(posedge clk) begin
        {was_a, was_b, was_index} <= {a, b, index};
        if (one) count <= up ? count + 32'd1 : count - 32'd1;
        if (both) errors <= errors + 32'd1;
        since <= one | both ? 31'd1 : since == END ? END : since + 31'd1;
        if (index & ~was_index) begin
            at_index <= count;
            indices  <= indices + 32'd1;
        end
        if (take) {r_count, r_at_index, r_indices, r_errors, r_since} <= {count, at_index, indices, errors, 1'b0, since};
        if (rst) begin
            {count, at_index, indices, errors, since} <= {START, 96'd0, END};
            {r_count, r_at_index, r_indices, r_errors, r_since} <= {START, 96'd0, 1'b0, END};
        end
    end

endmodule
