// SPDX-License-Identifier: MIT OR Apache-2.0
// In fma, fms, fnma and fnms, takt_fused and the reference multiply the factors' significands and add their exponents. The circuit takes a subnormal factor as it is, the reference normalises it: if the leading zeros of both are n,
// it has 2^n times the product, and an exponent that is less by n. Case: one.

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input  [31:0] c,
    input  [1:0]  op,
    input  [47:0] p,
    input  [47:0] cut_p,
    input  [9:0]  sum_p,
    output        bad,
    output        part
);

    wire [23:0] gate_a, gate_b;
    wire [47:0] cut_a, cut_b;
    wire [9:0]  exponents, sum_a, sum_b;
    gate dut (
        .clk(1'b0), .in_valid(1'b1), .op({2'b00, op}), .a(a), .b(b), .c(c), .exponents(exponents),
        .\u_product.a (gate_a), .\u_product.b (gate_b), .\u_product.p (p)
    );
    symfpu reference (
        .a({a[31] ^ op[1], a[30:0]}), .b(b), .c({c[31] ^ op[0], c[30:0]}),
        .\cut0.a (cut_a), .\cut0.b (cut_b), .\cut0.p (cut_p),
        .\sum0.a (sum_a), .\sum0.b (sum_b), .\sum0.p (sum_p)
    );

    wire [23:0] x = {|a[30:23], a[22:0]};
    wire [23:0] y = {|b[30:23], b[22:0]};
    wire [4:0]  x_zeros, y_zeros;
    leading_zeros of_x (.x(x), .zeros(x_zeros));
    leading_zeros of_y (.x(y), .zeros(y_zeros));
    wire        finite = ~&a[30:23] & ~&b[30:23] & (|x) & (|y);
    wire [9:0]  sum = {2'd0, a[30:24], a[23] | ~|a[30:23]} + {2'd0, b[30:24], b[23] | ~|b[30:23]};

    assign bad =
        (exponents != sum) | (gate_a != x) | (gate_b != y) |
        (finite & ((cut_a != x << x_zeros) | (cut_b != y << y_zeros) | (sum_a + sum_b != sum - 10'd254 - x_zeros - y_zeros)));
    assign part = 1'b0;

endmodule
