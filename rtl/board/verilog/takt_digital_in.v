// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_digital_in: a switch, debounced.
//
// Contract
//   level is the pin (INVERT: its complement) once it has been so for HOLD cycles on end; rises counts its rising edges and wraps.
//   take: registers r_… hold from the next cycle on what they are in this one. rst: rises is 0.

module takt_digital_in #(
    parameter HOLD   = 1,  // 1 to 2^24
    parameter INVERT = 0
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        take,
    input  wire        pin_in,
    output reg  [31:0] r_level,
    output reg  [31:0] r_rises
);

    wire level;
    takt_filter #(.HOLD(HOLD), .BITS(24)) filter (.clk(clk), .rst(rst), .pin(pin_in ^ (INVERT != 0)), .level(level));

    reg        was;
    reg [31:0] rises;

    always @(posedge clk) begin
        was <= level;
        if (level & ~was) rises <= rises + 32'd1;
        if (take) {r_level, r_rises} <= {31'd0, level, rises};
        if (rst) {rises, r_level, r_rises} <= 96'd0;
    end

endmodule
