// SPDX-License-Identifier: MIT OR Apache-2.0
// PLLA: a stand-in for GW5A's PLL in simulation, in which the clock on the pin is that of the core. LOCK rises after 20 cycles.

module PLLA #(
    parameter FCLKIN = "", IDIV_SEL = 1, FBDIV_SEL = 1, MDIV_SEL = 8, MDIV_FRAC_SEL = 0, ODIV0_SEL = 8, ODIV0_FRAC_SEL = 0,
    parameter CLKOUT0_EN = "", CLKFB_SEL = "", ODIV1_SEL = 8, ODIV2_SEL = 8, ODIV3_SEL = 8, ODIV4_SEL = 8, ODIV5_SEL = 8,
    parameter ODIV6_SEL = 8
) (
    input  wire CLKIN, CLKFB, RESET, PLLPWD, RESET_I, RESET_O, PSDIR, PSPULSE, SSCPOL, SSCON, MDCLK, MDAINC,
    input  wire [2:0] PSSEL, SSCMDSEL_FRAC,
    input  wire [6:0] SSCMDSEL,
    input  wire [1:0] MDOPC,
    input  wire [7:0] MDWDI,
    output wire CLKOUT0, CLKOUT1, CLKOUT2, CLKOUT3, CLKOUT4, CLKOUT5, CLKOUT6, CLKFBOUT,
    output wire [7:0] MDRDO,
    output wire LOCK
);

    assign CLKOUT0 = CLKIN;
    assign {CLKOUT1, CLKOUT2, CLKOUT3, CLKOUT4, CLKOUT5, CLKOUT6, CLKFBOUT} = 7'd0;
    assign MDRDO = 8'd0;

    reg [4:0] cycles;
    initial cycles = 5'd0;
    assign LOCK = cycles == 5'd20;
    always @(posedge CLKIN) if (!LOCK) cycles <= cycles + 5'd1;

endmodule
