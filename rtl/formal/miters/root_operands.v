// SPDX-License-Identifier: MIT OR Apache-2.0
// What takt_divroot's fsqrt makes of a positive number before the digits: the table's rows, Y from its words, and the radicand x with
// 47 bits after the point, in [1, 4). Case: one.

module miter (
    input  [31:0] a,
    input  [31:0] b,            // does not matter
    input  [14:0] coarse,
    input  [5:0]  fine,
    output        bad,
    output        assumed,
    output        part
);

    wire [10:0] coarse_row, fine_row;
    wire [48:0] found_x;
    wire [15:0] found_y;
    gate dut (
        .clk(1'b0), .in_valid(1'b1), .op(1'b1), .a(a), .b(b), .x_4(found_x), .y_4(found_y),
        .\table_of_reciprocals.coarse_row (coarse_row), .\table_of_reciprocals.fine_row (fine_row),
        .\table_of_reciprocals.coarse (coarse), .\table_of_reciprocals.fine (fine)
    );

    wire [23:0] x = {|a[30:23], a[22:0]};
    wire [4:0]  zeros;
    leading_zeros of_x (.x(x), .zeros(zeros));
    wire [23:0] normal = x << zeros;
    // The exponent is this less 127.
    wire [8:0]  field  = {1'b0, a[30:24], a[23] | ~|a[30:23]} - {4'd0, zeros};
    wire        odd    = ~field[0];

    assign assumed = ~a[31] & ~&a[30:23] & (|x);
    assign bad =
        (coarse_row != {1'b1, odd, normal[22:14]}) | (fine_row != {1'b1, odd, normal[22:19], normal[13:9]}) |
        (found_y != {1'b1, coarse} - {10'd0, fine}) | (found_x != {1'b0, normal, 24'd0} << odd);
    assign part = 1'b0;

endmodule
