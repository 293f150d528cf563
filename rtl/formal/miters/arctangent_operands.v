// SPDX-License-Identifier: MIT OR Apache-2.0
// The digits of takt_arctangent begin with these registers, in stage 3: octant, special operands, the lesser magnitude as dividend and the
// greater as divisor, with their significands normalised, the quotient's exponent e, and the rest after the first digit, 1. The
// quotient is at most 1. Case: one.

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input  [28:0] rest_3,
    input  [28:0] divisor_3,
    input  [24:0] dividend_3,
    input  [8:0]  e_3,
    input         steep_3,
    input         left_3,
    input         sign_3,
    input         nan_3,
    input         none_3,
    output        bad,
    output        part
);

    wire        nan    = ((&a[30:23]) & (|a[22:0])) | ((&b[30:23]) & (|b[22:0]));
    wire        steep  = a[30:0] > b[30:0];
    wire [30:0] lesser  = steep ? b[30:0] : a[30:0];
    wire [30:0] greater = steep ? a[30:0] : b[30:0];
    wire        none   = lesser == 0 | (greater == 31'h7f800000 & lesser != 31'h7f800000);

    wire [23:0] x = {|lesser[30:23], lesser[22:0]};
    wire [23:0] y = {|greater[30:23], greater[22:0]};
    wire [4:0]  x_zeros, y_zeros;
    leading_zeros of_x (.x(x), .zeros(x_zeros));
    leading_zeros of_y (.x(y), .zeros(y_zeros));
    wire [23:0] x_normal = x << x_zeros;
    wire [23:0] y_normal = y << y_zeros;
    wire signed [10:0] x_exponent = $signed({3'd0, lesser[30:24], lesser[23] | ~|lesser[30:23]}) - $signed({6'd0, x_zeros});
    wire signed [10:0] y_exponent = $signed({3'd0, greater[30:24], greater[23] | ~|greater[30:23]}) - $signed({6'd0, y_zeros});

    wire        less     = x_normal < y_normal;
    wire [24:0] dividend = less ? {x_normal, 1'b0} : {1'b0, x_normal};
    wire [10:0] e        = y_exponent - x_exponent + $signed({10'd0, less});
    wire [28:0] divisor  = {1'b0, y_normal, 4'd0};
    wire [28:0] rest     = {dividend, 4'd0} - divisor;

    wire        begun =
        {2'd0, e_3} == e & dividend_3 == dividend & divisor_3 == divisor & rest_3 == rest & rest_3 < divisor_3 & divisor_3[28:27] == 2'b01 &
        (e != 0 | rest == 0);
    assign bad =
        (nan_3 != nan) | (~nan & ((steep_3 != steep) | (left_3 != b[31]) | (sign_3 != a[31]) | (none_3 != none) | (~none & ~begun)));
    assign part = 1'b0;

endmodule
