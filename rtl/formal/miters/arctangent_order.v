// SPDX-License-Identifier: MIT OR Apache-2.0
// The order of takt_arctangent's digits. Each stage's rest is arbitrary, and so is each digit, therefore: `digit_1_5` is that of stage 4.
// With f leading digits, stages 3 to f + 2 find them, the division pauses in f + 3 and f + 4, and stages f + 5 to 18 find the other 14 - f. The
// reference follows the loop in isa/src/fp/atan.rs: the divisor of each stage, the row of the table and its word, and the quotient.
//
// With e = 0, dividend and divisor are the same, and all digits are 0. Otherwise the digits are arbitrary here, and no sum has more than the
// circuit's 29 bits. Cases: e below 16, the others.

module miter (
    input  [8:0]  e_3,
    input  [24:0] dividend_3,
    input  [28:0] divisor_3,
    input  [1:0]  digit_1_4,
    input  [1:0]  digit_1_5,
    input  [1:0]  digit_1_6,
    input  [1:0]  digit_1_7,
    input  [1:0]  digit_1_8,
    input  [1:0]  digit_1_9,
    input  [1:0]  digit_1_10,
    input  [1:0]  digit_1_11,
    input  [1:0]  digit_1_12,
    input  [1:0]  digit_1_13,
    input  [1:0]  digit_1_14,
    input  [1:0]  digit_1_15,
    input  [1:0]  digit_1_16,
    input  [1:0]  digit_1_17,
    input  [1:0]  digit_1_18,
    input  [1:0]  digit_1_19,
    input  [28:0] divisor_4,
    input  [28:0] divisor_5,
    input  [28:0] divisor_6,
    input  [28:0] divisor_7,
    input  [28:0] divisor_8,
    input  [28:0] divisor_9,
    input  [28:0] divisor_10,
    input  [28:0] divisor_11,
    input  [28:0] divisor_12,
    input  [28:0] divisor_13,
    input  [28:0] divisor_14,
    input  [28:0] divisor_15,
    input  [28:0] divisor_16,
    input  [28:0] divisor_17,
    input  [28:0] divisor_18,
    input  [4:0]  stands_4,
    input  [4:0]  stands_5,
    input  [4:0]  stands_6,
    input  [4:0]  stands_7,
    input  [4:0]  stands_8,
    input  [4:0]  stands_9,
    input  [4:0]  stands_10,
    input  [4:0]  stands_11,
    input  [4:0]  stands_12,
    input  [4:0]  stands_13,
    input  [4:0]  stands_14,
    input  [4:0]  stands_15,
    input  [4:0]  stands_16,
    input  [4:0]  stands_17,
    input  [4:0]  stands_18,
    input  [27:0] quotient_19,
    input  [30:0] angle_19,
    output        bad,
    output        assumed,
    output [4:0]  part
);

    // By stage, from 3 on: the digit found, the divisor, whether the division pauses.
    wire [31:0]  digits   = {digit_1_19, digit_1_18, digit_1_17, digit_1_16, digit_1_15, digit_1_14, digit_1_13, digit_1_12, digit_1_11, digit_1_10, digit_1_9, digit_1_8, digit_1_7, digit_1_6, digit_1_5, digit_1_4};
    wire [463:0] divisors = {divisor_18, divisor_17, divisor_16, divisor_15, divisor_14, divisor_13, divisor_12, divisor_11, divisor_10, divisor_9, divisor_8, divisor_7, divisor_6, divisor_5, divisor_4, divisor_3};
    wire [15:0]  pauses   = {stands_18[0], stands_17[0], stands_16[0], stands_15[0], stands_14[0], stands_13[0], stands_12[0], stands_11[0], stands_10[0], stands_9[0], stands_8[0], stands_7[0], stands_6[0], stands_5[0], stands_4[0], e_3 > 12};

    wire [2:0] leading_digits = e_3 <= 3 ? 3'd4 : e_3 <= 6 ? 3'd3 : e_3 <= 9 ? 3'd2 : e_3 <= 12 ? 3'd1 : 3'd0;

    integer i, stage;
    reg [1:0]  digit;
    reg [33:0] step, grown, divisor;
    reg [7:0]  leading;
    reg [27:0] quotient;
    reg        differs;
    always @* begin
        divisor  = {5'd0, divisor_3};
        step     = e_3 < 16 ? {5'd0, dividend_3, 4'd0} >> {e_3[3:0], 1'b0} : 34'd0;
        grown    = divisor + step;
        leading  = 8'd0;
        quotient = 28'd0;
        differs  = 1'b0;
        for (i = 0; i < 14; i = i + 1) begin
            if (i == leading_digits) divisor = grown;
            step  = step >> 2;
            stage = i < leading_digits ? i : i + 2;
            digit = digits[2*stage +: 2];
            if (divisors[29*stage +: 29] != divisor || divisor[33:29] != 0 || pauses[stage]) differs = 1'b1;
            if (i < leading_digits) begin
                leading = {leading[5:0], digit};
                grown   = grown + (digit[0] ? step : 34'd0) + (digit[1] ? {step[32:0], 1'b0} : 34'd0);
            end else begin
                quotient = {quotient[25:0], digit};
            end
        end
        if (~pauses[leading_digits] || ~pauses[leading_digits+1]) differs = 1'b1;
    end

    wire [1:0] place = e_3[3:0] == 0 ? 2'd0 : (e_3[3:0] - 4'd1) % 3 + 2'd1;
    wire [9:0] row =
        e_3 == 0 ? 10'd1 : e_3 > 12 ? 10'd0 : ({8'd0, place} << {leading_digits, 1'b0}) | {2'd0, leading};
    wire [30:0] angle;
    takt_arctangent_table table (.clk(1'b0), .row(row), .angle(angle));

    assign bad     = differs | (quotient_19 != quotient) | (angle_19 != angle);
    assign assumed = ~divisor_3[28] & (e_3 != 0 | (digits == 0 & {dividend_3, 4'd0} == divisor_3));
    assign part    = e_3 > 15 ? 5'd16 : {1'b0, e_3[3:0]};

endmodule
