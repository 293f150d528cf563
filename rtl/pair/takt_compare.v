// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_compare: latches that the nets of two cores have differed.
//
// Contract
//   differs is 1 from two cycles after the first cycle in which a and b differ on, until rst.

module takt_compare #(
    parameter WIDTH = 1
) (
    input  wire             clk,
    input  wire             rst,
    input  wire [WIDTH-1:0] a,
    input  wire [WIDTH-1:0] b,
    output reg              differs
);

    // A register for eight nets each: the nets come out of the second core's logic, and have two levels of their own before it.
    localparam GROUPS = (WIDTH + 7) / 8;
    wire [8*GROUPS-1:0] unequal = {{8*GROUPS-WIDTH{1'b0}}, a ^ b};
    reg  [GROUPS-1:0]   groups;

    integer g;
    always @(posedge clk) begin
        for (g = 0; g < GROUPS; g = g + 1) groups[g] <= |unequal[8*g +: 8] & ~rst;
        differs <= (differs | (|groups)) & ~rst;
    end

endmodule
