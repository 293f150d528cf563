// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_watchdog: a pin for a watchdog beside the FPGA, which takes the power stage's supply away once the pin no longer changes.
//
// Contract
//   pin changes each time when every core has published its outputs since the last change, while drive is 1: with one core, once a
//   period. It stays as it is while drive is 0, and when the clock stops.
//   done: a bit for each core, high for a cycle when the core has published.

module takt_watchdog #(
    parameter CORES = 1
) (
    input  wire             clk,
    input  wire             rst,
    input  wire             drive,
    input  wire [CORES-1:0] done,
    output reg              pin
);

    initial pin = 1'b0;

    reg  [CORES-1:0] published;  // cores that have published since the last change
    wire [CORES-1:0] all = published | done;

    always @(posedge clk) begin
        published <= &all ? {CORES{1'b0}} : all;
        if (&all) pin <= ~pin;
        if (rst | ~drive) begin
            published <= {CORES{1'b0}};
            pin    <= pin & ~rst;
        end
    end

endmodule
