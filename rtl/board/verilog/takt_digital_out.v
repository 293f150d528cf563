// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_digital_out: one pin, on or off.
//
// Contract
//   put: the pin is 1 from the next cycle on if w_level is not 0, else 0.
//   enable: while it is 0, and in reset, the pin is SAFE from the next cycle on.

module takt_digital_out #(
    parameter SAFE = 0
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        enable,
    input  wire        put,
    input  wire [31:0] w_level,
    output reg         pin_out
);

    initial pin_out = SAFE != 0;  // before the first clock edge, too

    always @(posedge clk) begin
        if (put) pin_out <= |w_level;
        if (rst | ~enable) pin_out <= SAFE != 0;
    end

endmodule
