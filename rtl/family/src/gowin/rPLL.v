// SPDX-License-Identifier: MIT OR Apache-2.0
// rPLL: a stand-in for GW2A's PLL in simulation, in which the clock on the pin is that of the core. LOCK rises after 20 cycles.

module rPLL #(
    parameter DEVICE = "", FCLKIN = "", IDIV_SEL = 0, FBDIV_SEL = 0, ODIV_SEL = 8, DYN_IDIV_SEL = "", DYN_FBDIV_SEL = "",
    parameter DYN_ODIV_SEL = "", CLKFB_SEL = ""
) (
    input  wire CLKIN, CLKFB, RESET, RESET_P,
    input  wire [5:0] FBDSEL, IDSEL, ODSEL,
    input  wire [3:0] DUTYDA, PSDA, FDLY,
    output wire CLKOUT, CLKOUTP, CLKOUTD, CLKOUTD3,
    output wire LOCK
);

    assign CLKOUT = CLKIN;
    assign {CLKOUTP, CLKOUTD, CLKOUTD3} = 3'd0;

    reg [4:0] cycles;
    initial cycles = 5'd0;
    assign LOCK = cycles == 5'd20;
    always @(posedge CLKIN) if (!LOCK) cycles <= cycles + 5'd1;

endmodule
