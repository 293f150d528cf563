// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_fused's fma, fms, fnma and fnms have the same result and flags for twice the product and an exponent that is less by 1, if the
// product is below 2^47. Step by step, that makes of any product that of the normalised significands, which is below 2^48. A product
// is 2^23 or more if a factor is normal; if both are subnormal, the exponent is 2. After a step it is still so, or less than 2. Cases:
// as fused.v.

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input  [31:0] c,
    input  [1:0]  op,
    input  [47:0] p,
    input  signed [9:0] e,
    output        bad,
    output        assumed,
    output [7:0]  part
);

    wire [31:0] result, other_result;
    wire [2:0]  flags, other_flags;
    gate one (
        .clk(1'b0), .in_valid(1'b1), .op({2'b00, op}), .a(a), .b(b), .c(c), .result(result), .flags(flags),
        .exponents(e), .\u_product.p (p)
    );
    gate other (
        .clk(1'b0), .in_valid(1'b1), .op({2'b00, op}), .a(a), .b(b), .c(c), .result(other_result), .flags(other_flags),
        .exponents(e - 10'd1), .\u_product.p ({p[46:0], 1'b0})
    );

    wire        finite = ~&a[30:23] & ~&b[30:23] & (|a[30:0]) & (|b[30:0]);
    assign assumed = finite & ~p[47] & (|p[46:23] | e <= 2) & e >= -43 & e <= 508;
    assign bad = (result != other_result) | (flags != other_flags);

    wire        minus = a[31] ^ b[31] ^ c[31] ^ op[0] ^ op[1];
    wire [7:0]  c_exponent = {c[30:24], c[23] | ~|c[30:23]};
    wire signed [10:0] above = e - $signed({2'd0, c_exponent}) - 97;
    wire [6:0]  distance = above < 0 ? 7'd0 : above > 107 ? 7'd107 : above[6:0];
    assign part = {distance, minus};

endmodule
