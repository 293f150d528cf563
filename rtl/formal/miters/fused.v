// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_fused's fma, fms, fnma and fnms against IEEE 754's fused multiply-add, for all operands. The product of the significands is
// arbitrary, as in multiply.v, and normalised: its leading one is in one of the upper two places. The exponent that belongs to it is
// arbitrary, too, from that of two subnormal factors to that of two large ones. fused_operands.v and fused_shift.v show that this is
// all that matters of the factors, if they are finite and not zero. Cases: sum or difference; by how far the product's exponent is
// above the addend's, from 30 below to 77 above; a factor zero, infinite or NaN.

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input  [31:0] c,
    input  [1:0]  op,
    input  [47:0] p,
    input  [9:0]  e,            // the product's exponent: the sum of two biased ones
    input  [47:0] unused_p,
    output        bad,
    output        assumed,
    output [7:0]  part
);

    wire [31:0] result, exact;
    wire [2:0]  flags;
    wire        invalid, overflow;

    wire [23:0] x = {|a[30:23], a[22:0]};
    wire [23:0] y = {|b[30:23], b[22:0]};
    wire        finite = ~&a[30:23] & ~&b[30:23] & (|x) & (|y);

    wire [7:0]  a_exponent = {a[30:24], a[23] | ~|a[30:23]};
    wire [7:0]  b_exponent = {b[30:24], b[23] | ~|b[30:23]};
    wire [7:0]  c_exponent = {c[30:24], c[23] | ~|c[30:23]};
    wire [9:0]  sum = {2'd0, a_exponent} + {2'd0, b_exponent};
    wire signed [9:0] exponent;

`ifdef EXACT
    // A single multiplication serves both: the reference multiplies the same significands, normalised.
    assign exponent = sum;
    assign assumed  = 1'b1;
    wire [4:0]  x_zeros, y_zeros;
    leading_zeros of_x (.x(x), .zeros(x_zeros));
    leading_zeros of_y (.x(y), .zeros(y_zeros));
    wire [47:0] product = x * y;
    gate dut (
        .clk(1'b0), .in_valid(1'b1), .op({2'b00, op}), .a(a), .b(b), .c(c), .result(result), .flags(flags),
        .\u_product.p (product)
    );
    wire [9:0]  sum_a, sum_b;
    symfpu reference (
        .a({a[31] ^ op[1], a[30:0]}), .b(b), .c({c[31] ^ op[0], c[30:0]}), .o(exact), .NV(invalid), .OF(overflow),
        .\cut0.p (product << x_zeros << y_zeros), .\sum0.a (sum_a), .\sum0.b (sum_b), .\sum0.p (sum_a + sum_b)
    );
`else
    // 2 - 46 for two subnormal factors, each with one significant bit; 254 + 254.
    assign exponent = finite ? e : sum;
    assign assumed  = ~finite | ((p[47] | p[46]) & exponent >= -44 & exponent <= 508);
    gate dut (
        .clk(1'b0), .in_valid(1'b1), .op({2'b00, op}), .a(a), .b(b), .c(c), .result(result), .flags(flags),
        .exponents(exponent), .\u_product.p ((|x & |y) ? p : 48'd0)
    );
    wire [9:0]  sum_a, sum_b;
    symfpu reference (
        .a({a[31] ^ op[1], a[30:0]}), .b(b), .c({c[31] ^ op[0], c[30:0]}), .o(exact), .NV(invalid), .OF(overflow),
        .\cut0.p (finite ? p : unused_p),
        .\sum0.a (sum_a), .\sum0.b (sum_b), .\sum0.p (finite ? exponent - 10'd254 : sum_a + sum_b)
    );
`endif

    wire        nan = (&exact[30:23]) & (|exact[22:0]);
    assign bad = (result != (nan ? 32'h7fc00000 : exact)) | (flags != {invalid, 1'b0, overflow});

    wire        minus = a[31] ^ b[31] ^ c[31] ^ op[0] ^ op[1];
    wire signed [10:0] above = exponent - $signed({2'd0, c_exponent}) - 97;
    wire [6:0]  distance = above < 0 ? 7'd0 : above > 107 ? 7'd107 : above[6:0];
    assign part = finite ? {distance, minus} : 8'd216;

endmodule
