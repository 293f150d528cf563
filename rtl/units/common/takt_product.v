// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_product: an 18 x 18 multiplier, to be mapped to one multiplier block of an FPGA.
//
// Contract
//   p = a * b. SIGNED_A, SIGNED_B: 1 if a, b is in two's complement. INPUT_REGS, OUTPUT_REG: 1 for a register before, after the
//   product. There is no reset.
//   This is a behavioural model. For a device in whose multiplier blocks synthesis does not place the registers by itself, a
//   module of the same name replaces it: that of the device's family, in rtl/family.

module takt_product #(
    parameter SIGNED_A   = 0,
    parameter SIGNED_B   = 0,
    parameter INPUT_REGS = 0,
    parameter OUTPUT_REG = 1
) (
    input  wire        clk,
    input  wire [17:0] a,
    input  wire [17:0] b,
    output wire [35:0] p
);

    wire [17:0] a_used, b_used;
    wire [35:0] a_wide = {{18{(SIGNED_A != 0) & a_used[17]}}, a_used};
    wire [35:0] b_wide = {{18{(SIGNED_B != 0) & b_used[17]}}, b_used};
    wire [35:0] product = a_wide * b_wide;

    generate
        if (INPUT_REGS != 0) begin : g_input
            reg [17:0] a_reg, b_reg;
            always @(posedge clk) begin
                a_reg <= a;
                b_reg <= b;
            end
            assign a_used = a_reg;
            assign b_used = b_reg;
        end else begin : g_no_input
            assign a_used = a;
            assign b_used = b;
        end
        if (OUTPUT_REG != 0) begin : g_output
            reg [35:0] p_reg;
            always @(posedge clk) begin
                p_reg <= product;
            end
            assign p = p_reg;
        end else begin : g_no_output
            assign p = product;
        end
    endgenerate

    // Without registers the clock is not used.
    wire unused = clk;

endmodule
