// SPDX-License-Identifier: MIT OR Apache-2.0
// What takt_divroot's fdiv makes of finite operands before the digits: the table's rows, the reciprocal Y from its words, the divisor b
// normalised, and x, the dividend with 47 bits after the point, doubled if it is less than the divisor, or shifted right for a
// subnormal quotient. Case: one.

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input  [14:0] coarse,
    input  [5:0]  fine,
    output        bad,
    output        assumed,
    output        part
);

    wire [10:0] coarse_row, fine_row;
    wire [48:0] found_x;
    wire [23:0] found_b;
    wire [15:0] found_y;
    gate dut (
        .clk(1'b0), .in_valid(1'b1), .op(1'b0), .a(a), .b(b), .x_4(found_x), .b_4(found_b), .y_4(found_y),
        .\table_of_reciprocals.coarse_row (coarse_row), .\table_of_reciprocals.fine_row (fine_row),
        .\table_of_reciprocals.coarse (coarse), .\table_of_reciprocals.fine (fine)
    );

    wire [23:0] x = {|a[30:23], a[22:0]};
    wire [23:0] y = {|b[30:23], b[22:0]};
    wire [4:0]  x_zeros, y_zeros;
    leading_zeros of_x (.x(x), .zeros(x_zeros));
    leading_zeros of_y (.x(y), .zeros(y_zeros));
    wire [23:0] x_normal = x << x_zeros;
    wire [23:0] y_normal = y << y_zeros;
    wire        less     = x_normal < y_normal;

    // 1 less the exponent field of a quotient in [1, 2).
    wire signed [10:0] right =
        $signed({3'd0, b[30:24], b[23] | ~|b[30:23]}) - $signed({3'd0, a[30:24], a[23] | ~|a[30:23]}) - 126 -
        $signed({6'd0, y_zeros}) + $signed({6'd0, x_zeros});
    wire [48:0] whole   = {1'b0, x_normal, 24'd0};
    wire [48:0] aligned = right >= 0 ? whole >> right[4:0] : whole << less;

    // A quotient that is shifted further than that is zero, whatever the digits are.
    assign assumed = ~&a[30:23] & ~&b[30:23] & (|x) & (|y) & right < 32;
    assign bad =
        (coarse_row != {1'b0, y_normal[22:13]}) | (fine_row != {1'b0, y_normal[22:18], y_normal[12:8]}) |
        (found_y != {1'b1, coarse} - {10'd0, fine}) | (found_b != y_normal) | (found_x != aligned);
    assign part = 1'b0;

endmodule
