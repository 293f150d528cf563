// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_fused's fma, fms, fnma and fnms against IEEE 754's fused multiply-add, for all operands. The product of the significands is an
// arbitrary number, as in multiply.v. Cases: sum or difference; by how far the product's exponent is above the addend's, from 30 below
// to 77 above; the leading zeros of a subnormal factor, both factors normal, or both subnormal.

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input  [31:0] c,
    input  [1:0]  op,
    input  [47:0] p,
    input  [47:0] unused_p,
    output        bad,
    output        assumed,
    output [13:0] part
);

    wire [47:0] product;
    wire [31:0] result, exact;
    wire [2:0]  flags;
    wire        invalid, overflow, finite, proper;
    wire [23:0] gate_a, gate_b;
    wire [47:0] cut_a, cut_b, normal;
    gate dut (
        .clk(1'b0), .in_valid(1'b1), .op({2'b00, op}), .a(a), .b(b), .c(c), .result(result), .flags(flags),
        .\u_product.a (gate_a), .\u_product.b (gate_b), .\u_product.p (product)
    );
    symfpu reference (
        .a({a[31] ^ op[1], a[30:0]}), .b(b), .c({c[31] ^ op[0], c[30:0]}), .o(exact), .NV(invalid), .OF(overflow),
        .\cut0.a (cut_a), .\cut0.b (cut_b), .\cut0.p (finite ? normal : unused_p)
    );

    wire [23:0] x, y;
    wire [4:0]  x_zeros, y_zeros;
    product_of cut (
        .a(a), .b(b), .p(p), .x(x), .y(y), .x_zeros(x_zeros), .y_zeros(y_zeros), .product(product), .normal(normal),
        .finite(finite), .proper(proper)
    );

    wire        nan = (&exact[30:23]) & (|exact[22:0]);
    assign bad =
        (result != (nan ? 32'h7fc00000 : exact)) | (flags != {invalid, 1'b0, overflow}) |
        (gate_a != x) | (gate_b != y) | (finite & ((cut_a != x << x_zeros) | (cut_b != y << y_zeros)));
    assign assumed = proper;

    wire        minus    = a[31] ^ b[31] ^ c[31] ^ op[0] ^ op[1];
    wire        a_normal = |a[30:23];
    wire        b_normal = |b[30:23];
    wire [7:0]  a_exponent = {a[30:24], a[23] | ~a_normal};
    wire [7:0]  b_exponent = {b[30:24], b[23] | ~b_normal};
    wire [7:0]  c_exponent = {c[30:24], c[23] | ~|c[30:23]};
    wire signed [10:0] above = {3'd0, a_exponent} + {3'd0, b_exponent} - {3'd0, c_exponent} - 11'd97;
    wire [6:0]  distance = above < 0 ? 7'd0 : above > 107 ? 7'd107 : above[6:0];
    wire [5:0]  group =
        ~a_normal & ~b_normal ? 6'd0 : ~a_normal ? {1'b0, x_zeros} : ~b_normal ? 6'd24 + y_zeros : 6'd49;
    // The normal factors come first.
    assign part = ((49 - group) * 108 + distance) * 2 + minus;

endmodule
