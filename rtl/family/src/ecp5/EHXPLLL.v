// SPDX-License-Identifier: MIT OR Apache-2.0
// EHXPLLL: a stand-in for ECP5's PLL in simulation, in which the clock on the pin is that of the core. LOCK rises after 20 cycles.

module EHXPLLL #(
    parameter PLLRST_ENA = "", INTFB_WAKE = "", STDBY_ENABLE = "", DPHASE_SOURCE = "", OUTDIVIDER_MUXA = "", OUTDIVIDER_MUXB = "",
    parameter OUTDIVIDER_MUXC = "", OUTDIVIDER_MUXD = "", CLKI_DIV = 1, CLKOP_ENABLE = "", CLKOP_DIV = 1, CLKOP_CPHASE = 0,
    parameter CLKOP_FPHASE = 0, FEEDBK_PATH = "", CLKFB_DIV = 1
) (
    input  wire RST, STDBY, CLKI, CLKFB, PHASESEL0, PHASESEL1, PHASEDIR, PHASESTEP, PHASELOADREG, PLLWAKESYNC, ENCLKOP,
    output wire CLKOP, CLKINTFB,
    output wire LOCK
);

    assign CLKOP    = CLKI;
    assign CLKINTFB = 1'b0;

    reg [4:0] cycles;
    initial cycles = 5'd0;
    assign LOCK = cycles == 5'd20;
    always @(posedge CLKI) if (!LOCK) cycles <= cycles + 5'd1;

endmodule
