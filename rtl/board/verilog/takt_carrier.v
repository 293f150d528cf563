// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_carrier: a triangular carrier, the common time of half bridges, samples and ticks.
//
// Contract
//   A period is two halves of HALF cycles: from the valley to the peak, then, while back is 1, to the next valley. place counts the
//   cycles of a half: 0 to HALF - 1. The valley is the first cycle of a period, the peak the first of its second half.
//   rst: the period stands at its cycle START, 0 to 2 * HALF - 1, which the first cycle after the reset still has.

module takt_carrier #(
    parameter HALF  = 1250,  // 1 to 65535
    parameter START = 0
) (
    input  wire        clk,
    input  wire        rst,
    output reg  [15:0] place,
    output reg         back
);

    localparam [15:0] TOP    = HALF - 1;
    localparam [0:0]  BEHIND = START >= HALF ? 1'b1 : 1'b0;
    localparam [15:0] FIRST  = START >= HALF ? START - HALF : START;

    always @(posedge clk) begin
        place <= place == TOP ? 16'd0 : place + 16'd1;
        if (place == TOP) back <= ~back;
        if (rst) {back, place} <= {BEHIND, FIRST};
    end

endmodule
