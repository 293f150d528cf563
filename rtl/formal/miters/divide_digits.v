// SPDX-License-Identifier: MIT OR Apache-2.0
// The digits of takt_divroot's fdiv. Its products, of 18 bits, are arbitrary; what they multiply is part of `bad`. With x, b and Y of stage 4,
// the digits q1 = x Y and q2 = residual Y truncated, s = 2^10 q1 + q2, in units of 2^-24; and what the last stage subtracts from
// last_9 leaves x - (2^10 q1 + q2 + 1) b in units of 2^-47, modulo 2^27, b being the sum of its parts. Case: one.

module miter (
    input  [48:0] x,
    input  [23:0] b,
    input  [15:0] y,
    input  [14:0] q1,
    input  [11:0] q2,
    input  [23:0] q1_low,       // q1 times the low 9 bits of b
    input  [29:0] q1_high,      // and the high 15 bits
    input  [22:0] q2_low,       // q2 times the low 11 bits of b
    input  [24:0] q2_high,      // and the high 13 bits
    input  [20:0] rest,         // bits of products that are not used
    output        bad,
    output        part
);

    wire [17:0] a_1, b_1, a_2, b_2, a_3, b_3, a_4, b_4, a_5, b_5, a_6, b_6;
    wire [24:0] s;
    wire [26:0] last, residual;
    gate dut (
        .clk(1'b0), .in_valid(1'b1), .op(1'b0), .x_4(x), .b_4(b), .y_4(y), .s_9(s), .last_9(last), .residual_7(residual),
        .\first_digit.a (a_1), .\first_digit.b (b_1), .\first_digit.p ({3'd0, q1, rest[17:0]}),
        .\first_low.a (a_2), .\first_low.b (b_2), .\first_low.p ({12'd0, q1_low}),
        .\first_high.a (a_3), .\first_high.b (b_3), .\first_high.p ({6'd0, q1_high}),
        .\second_digit.a (a_4), .\second_digit.b (b_4), .\second_digit.p ({4'd0, q2, rest[19:0]}),
        .\second_low.a (a_5), .\second_low.b (b_5), .\second_low.p ({13'd0, q2_low}),
        .\second_high.a (a_6), .\second_high.b (b_6), .\second_high.p ({11'd0, q2_high})
    );

    // x is in units of 2^-47, the first residual in units of 2^-37.
    wire [26:0] first = x[36:10] - {3'd0, q1_low} - {q1_high[17:0], 9'd0};
    wire [26:0] all   = {first[16:0], x[9:0]} - {3'd0, b} - {4'd0, q2_low} - {q2_high[15:0], 11'd0};
    wire [26:0] found = last - {4'd0, q2_low} - {q2_high[15:0], 11'd0};
    assign bad =
        (a_1 != x[48:31]) | (b_1 != {2'd0, y}) | (a_2 != {3'd0, q1}) | (b_2 != {9'd0, b[8:0]}) | (a_3 != {3'd0, q1}) |
        (b_3 != {3'd0, b[23:9]}) | (residual != first) | (a_4 != first[26:9]) | (b_4 != {2'd0, y}) | (a_5 != {6'd0, q2}) |
        (b_5 != {7'd0, b[10:0]}) | (a_6 != {6'd0, q2}) | (b_6 != {5'd0, b[23:11]}) | (s != {q1, 10'd0} + {13'd0, q2}) |
        (found != all);
    assign part = 1'b0;

endmodule
