// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_ecc_report: tells the outside of the words that were wrong.
//
// Contract
//   corrected: a word is corrected in this cycle; wrong: a word that a bundle takes cannot be, or the scrubber has found one.
//   corrections counts corrected since rst, to 255; upset stays until rst. What comes within eight cycles of rst counts as nothing:
//   words may have been read while the loader wrote them.

module takt_ecc_report (
    input  wire       clk,
    input  wire       rst,
    input  wire       corrected,
    input  wire       wrong,
    output reg  [7:0] corrections,
    output reg        upset
);

    reg [7:0] settling;
    reg       counts;

    always @(posedge clk) begin
        settling    <= {rst, settling[7:1]};
        counts      <= corrected & ~settling[0];
        corrections <= corrections + {7'd0, counts & ~&corrections};
        upset       <= upset | (wrong & ~settling[0]);
        if (rst) begin
            settling    <= 8'hff;
            counts      <= 1'b0;
            corrections <= 8'd0;
            upset       <= 1'b0;
        end
    end

endmodule
