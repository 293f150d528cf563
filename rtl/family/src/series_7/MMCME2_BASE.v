// SPDX-License-Identifier: MIT OR Apache-2.0
// MMCME2_BASE and BUFG: stand-ins for the clock generator and the clock buffer of the 7 series in simulation, in which the clock on the
// pin is that of the core. LOCKED rises after 20 cycles.

module MMCME2_BASE #(
    parameter BANDWIDTH = "", CLKFBOUT_MULT_F = 5.0, CLKIN1_PERIOD = 0.0, CLKOUT0_DIVIDE_F = 1.0, DIVCLK_DIVIDE = 1
) (
    input  wire CLKIN1, CLKFBIN, PWRDWN, RST,
    output wire CLKFBOUT, CLKFBOUTB, CLKOUT0, CLKOUT0B, CLKOUT1, CLKOUT1B, CLKOUT2, CLKOUT2B, CLKOUT3, CLKOUT3B, CLKOUT4, CLKOUT5,
    output wire CLKOUT6,
    output wire LOCKED
);

    assign CLKOUT0 = CLKIN1;
    assign {CLKFBOUT, CLKFBOUTB, CLKOUT0B, CLKOUT1, CLKOUT1B, CLKOUT2, CLKOUT2B, CLKOUT3, CLKOUT3B, CLKOUT4, CLKOUT5, CLKOUT6} = 12'd0;

    reg [4:0] cycles;
    initial cycles = 5'd0;
    assign LOCKED = cycles == 5'd20;
    always @(posedge CLKIN1) if (!LOCKED) cycles <= cycles + 5'd1;

endmodule

module BUFG (
    input  wire I,
    output wire O
);

    assign O = I;

endmodule
