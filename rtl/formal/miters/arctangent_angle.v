// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_arctangent's result and flags, from the table's word and the quotient of the division: `octant` and `pack` of isa/src/fp/atan.rs.
//
// The sum of word and quotient is within bounds that ../../tests/tables.rs shows for every row of the table: it is 1/2 at least, and of an
// angle that is taken from an axis, 2^-e of it is little more than pi/4. Cases: e, where it matters.

module miter (
    input  [8:0]  e_3,
    input         steep_3,
    input         left_3,
    input         sign_3,
    input         nan_3,
    input         none_3,
    input  [27:0] quotient_19,
    input  [30:0] angle_19,
    input  [31:0] result,
    input  [2:0]  flags,
    output        bad,
    output        assumed,
    output [6:0]  part
);

    localparam [31:0] EIGHTH = 32'h3243f6a9; // pi/4, 30 bits after the point
    localparam [31:0] MOST   = 32'h33000000;

    wire [32:0] sum   = {2'd0, angle_19} + {3'd0, quotient_19, 2'd2};
    wire [32:0] moved = e_3 < 31 ? sum >> e_3[4:0] : 33'd0;

    // The angle, and the exponent field of 1 in its units.
    wire        direct = ~steep_3 & ~left_3;
    wire [31:0] offset = none_3 ? 32'd0 : moved[31:0];
    wire [31:0] fixed  =
        direct ? sum[31:0] : steep_3 ? (left_3 ? 2 * EIGHTH + offset : 2 * EIGHTH - offset) : 4 * EIGHTH - offset;
    wire signed [11:0] unit = direct ? 12'sd127 - $signed({3'd0, e_3}) : 12'sd127;

    // The number of bits that are lost is at least 6; of a subnormal result more are.
    wire signed [11:0] above = fixed[31] ? 12'sd2 : fixed[30] ? 12'sd1 : 12'sd0;
    wire signed [11:0] field = unit - 12'sd1 + above;
    wire signed [11:0] lost  = 12'sd6 + above + (field < 1 ? 12'sd1 - field : 12'sd0);
    wire [39:0] half    = 40'd1 << (lost[5:0] - 6'd1);
    wire [39:0] rounded = ({8'd0, fixed} + half) >> lost[5:0];
    wire [31:0] packed  = lost > 34 ? 32'd0 : ((field < 1 ? 32'd0 : {20'd0, field} - 32'd1) << 23) + rounded[31:0];
    wire [31:0] expected = nan_3 ? 32'h7fc00000 : {sign_3, direct & none_3 ? 31'd0 : packed[30:0]};

    assign assumed = nan_3 | none_3 | (sum[32:31] == 0 & sum[31:0] >= 32'h20000000 & (direct | moved <= {1'b0, MOST}));
    assign bad     = (result != expected) | (flags != {nan_3, 2'b00});
    assign part    = e_3 < 42 ? e_3[6:0] : e_3 < 126 ? 7'd42 : e_3 < 168 ? e_3 - 9'd83 : 7'd85;

endmodule
