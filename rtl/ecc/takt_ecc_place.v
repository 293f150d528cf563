// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_ecc_place: what the syndrome of a word tells (takt_ecc_code). No registers.
//
// Contract
//   low, high: one-hot, the low 4 and the high 3 bits of the syndrome.
//   one_wrong: one bit is wrong, perhaps a check bit; two_wrong: two are, and cannot be corrected.

module takt_ecc_place (
    input  wire [6:0]  syndrome,
    output wire [15:0] low,
    output wire [7:0]  high,
    output wire        one_wrong,
    output wire        two_wrong
);

    assign low    = 16'd1 << syndrome[3:0];
    assign high   = 8'd1 << syndrome[6:4];
    assign one_wrong = ^syndrome;
    assign two_wrong = |syndrome & ~one_wrong;

endmodule
