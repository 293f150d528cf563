// SPDX-License-Identifier: MIT OR Apache-2.0
// The digits of takt_divroot's fsqrt, as divide_digits.v: q1 = x Y, q2 = residual Y / 2, s = 2^10 q1 + q2; what the last stage subtracts
// from last_9 leaves x - (s + 1)^2 in units of 2^-48, modulo 2^27. Case: one.

module miter (
    input  [48:0] x,
    input  [23:0] b,            // does not matter
    input  [15:0] y,
    input  [14:0] q1,
    input  [11:0] q2,
    input  [29:0] q1_q1,        // products of the digits
    input  [26:0] q1_q2,
    input  [23:0] q2_q2,
    input  [20:0] rest,         // bits of products that are not used
    output        bad,
    output        assumed,
    output        part
);

    wire [17:0] a_1, b_1, a_2, b_2, a_3, b_3, a_4, b_4, a_5, b_5, a_6, b_6;
    wire [24:0] s;
    wire [26:0] last, residual;
    gate dut (
        .clk(1'b0), .in_valid(1'b1), .op(1'b1), .x_4(x), .b_4(b), .y_4(y), .s_9(s), .last_9(last), .residual_7(residual),
        .\first_digit.a (a_1), .\first_digit.b (b_1), .\first_digit.p ({3'd0, q1, rest[17:0]}),
        .\first_low.a (a_2), .\first_low.b (b_2), .\first_low.p (36'd0),
        .\first_high.a (a_3), .\first_high.b (b_3), .\first_high.p ({6'd0, q1_q1}),
        .\second_digit.a (a_4), .\second_digit.b (b_4), .\second_digit.p ({3'd0, q2, rest}),
        .\second_low.a (a_5), .\second_low.b (b_5), .\second_low.p ({12'd0, q2_q2}),
        .\second_high.a (a_6), .\second_high.b (b_6), .\second_high.p ({9'd0, q1_q2})
    );

    wire [25:0] sum   = {1'b0, q1, 10'd0} + {14'd0, q2};
    wire [26:0] first = x[36:10] - {q1_q1[17:0], 9'd0};
    wire [26:0] parts = {3'd0, q2_q2} + {q1_q2[15:0], 11'd0};
    wire [26:0] all   = {first[15:0], 11'd0} - parts - {sum, 1'b0} - 27'd1;
    assign bad =
        (a_1 != x[48:31]) | (b_1 != {2'd0, y}) | (b_2 != 18'd0) | (a_3 != {3'd0, q1}) | (b_3 != {3'd0, q1}) |
        (residual != first) | (a_4 != first[26:9]) | (b_4 != {2'd0, y}) | (a_5 != {6'd0, q2}) | (b_5 != {6'd0, q2}) |
        (a_6 != {6'd0, q2}) | (b_6 != {3'd0, q1}) | (s != sum[24:0]) | (last - parts != all);
    assign assumed = x[9:0] == 0;
    assign part = 1'b0;

endmodule
