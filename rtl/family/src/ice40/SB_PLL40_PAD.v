// SPDX-License-Identifier: MIT OR Apache-2.0
// SB_PLL40_PAD: a stand-in for iCE40's PLL in simulation, in which the clock on the pin is that of the core. LOCK rises after 20 cycles.

module SB_PLL40_PAD #(
    parameter FEEDBACK_PATH = "", DIVR = 0, DIVF = 0, DIVQ = 0, FILTER_RANGE = 0
) (
    input  wire PACKAGEPIN, RESETB, BYPASS,
    output wire PLLOUTGLOBAL,
    output wire LOCK
);

    assign PLLOUTGLOBAL = PACKAGEPIN;

    reg [4:0] cycles;
    initial cycles = 5'd0;
    assign LOCK = cycles == 5'd20;
    always @(posedge PACKAGEPIN) if (!LOCK) cycles <= cycles + 5'd1;

endmodule
