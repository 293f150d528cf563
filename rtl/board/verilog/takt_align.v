// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_align: holds a board's ticks back until they fall on a place of a carrier.
//
// Contract
//   run falls with wanted, and rises while wanted is 1 in a cycle in which place is 1.

module takt_align (
    input  wire clk,
    input  wire rst,
    input  wire wanted,
    input  wire place,
    output wire run
);

    reg held;
    assign run = wanted & (held | place);
    always @(posedge clk) held <= run & ~rst;

endmodule
