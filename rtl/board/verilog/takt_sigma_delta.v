// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_sigma_delta: one pin as an analogue output: a stream of pulses whose density is the value. A low-pass filter follows outside.
//
// Contract
//   Of 65536 cycles the pin is 1 in w_value, spread as evenly as whole cycles allow; SIGNED adds 32768. Beyond 0 and 65536 it stays there.
//   put: w_value is taken, and used from the next cycle on.
//   enable: while it is 0, and in reset, the pin is 0 from the next cycle on, and value is 0 (SIGNED: one half).

module takt_sigma_delta #(
    parameter SIGNED = 1
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        enable,
    input  wire        put,
    input  wire [31:0] w_value,
    output reg         pin_out
);

    initial pin_out = 1'b0;  // before the first clock edge, too

    localparam [16:0] ZERO = SIGNED != 0 ? 17'd32768 : 17'd0;

    wire signed [33:0] wanted = $signed({{2{w_value[31]}}, w_value}) + $signed({17'd0, ZERO});
    reg  [16:0] value;
    reg  [15:0] sum;
    wire [16:0] next = {1'b0, sum} + value;

    always @(posedge clk) begin
        if (put) value <= wanted[33] ? 17'd0 : |wanted[32:16] ? 17'd65536 : wanted[16:0];
        {pin_out, sum} <= next;
        if (rst | ~enable) begin
            value <= ZERO;
            {pin_out, sum} <= 17'd0;
        end
    end

endmodule
