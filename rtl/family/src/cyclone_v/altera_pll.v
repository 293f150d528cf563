// SPDX-License-Identifier: MIT OR Apache-2.0
// altera_pll: a stand-in for the PLL of Cyclone V in simulation, in which the clock on the pin is that of the core. locked rises after 20
// cycles.

module altera_pll #(
    parameter fractional_vco_multiplier = "", reference_clock_frequency = "", operation_mode = "", number_of_clocks = 1,
    parameter output_clock_frequency0 = "", phase_shift0 = "", duty_cycle0 = 50, pll_type = "", pll_subtype = ""
) (
    input  wire                        refclk, rst, fbclk,
    output wire [number_of_clocks-1:0] outclk,
    output wire                        fboutclk, locked
);

    assign outclk   = {number_of_clocks{refclk}};
    assign fboutclk = 1'b0;

    reg [4:0] cycles;
    initial cycles = 5'd0;
    assign locked = cycles == 5'd20;
    always @(posedge refclk) if (!locked) cycles <= cycles + 5'd1;

endmodule
