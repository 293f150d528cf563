// SPDX-License-Identifier: MIT OR Apache-2.0
// CC_PLL: a stand-in for GateMate's PLL in simulation, in which the clock on the pin is that of the core. The PLL is locked after 20
// cycles.

module CC_PLL #(
    parameter REF_CLK = "", OUT_CLK = "", PERF_MD = "", LOW_JITTER = 1, LOCK_REQ = 1, CI_FILTER_CONST = 2, CP_FILTER_CONST = 4
) (
    input  wire CLK_REF, CLK_FEEDBACK, USR_CLK_REF, USR_LOCKED_STDY_RST,
    output wire USR_PLL_LOCKED_STDY, CLK0, CLK90, CLK180, CLK270, CLK_REF_OUT,
    output wire USR_PLL_LOCKED
);

    assign CLK0 = CLK_REF;
    assign {USR_PLL_LOCKED_STDY, CLK90, CLK180, CLK270, CLK_REF_OUT} = 5'd0;

    reg [4:0] cycles;
    initial cycles = 5'd0;
    assign USR_PLL_LOCKED = cycles == 5'd20;
    always @(posedge CLK_REF) if (!USR_PLL_LOCKED) cycles <= cycles + 5'd1;

endmodule
