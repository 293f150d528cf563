// SPDX-License-Identifier: MIT OR Apache-2.0
// imul24 of the unit with the code OP, for all operands: what its multiplier takes, and what it makes of an arbitrary product p of that.
// The multiplier takes A = a + 2^24 s and B = b + 2^24 t, for operands a and b in two's complement of 24 bits with the signs s and t. So
// a·b = AB - 2^24 (s B + t A) modulo 2^32: of B and A only the low byte counts. That it multiplies is a proof of its own (product.v).

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input  [31:0] c,            // of a fused unit: does not matter
    input  [47:0] p,
    output        bad,
    output [5:0]  part
);

    wire [31:0] result;
    wire [2:0]  flags;
    wire [23:0] gate_a, gate_b;
    gate dut (
`ifdef FUSED
        .c(c),
`endif
        .clk(1'b0), .in_valid(1'b1), .op(`OP), .a(a), .b(b), .result(result), .flags(flags),
        .\u_product.a (gate_a), .\u_product.b (gate_b), .\u_product.p (p)
    );

    wire [31:0] of_a = a[23] ? {b[7:0], 24'd0} : 32'd0;
    wire [31:0] of_b = b[23] ? {a[7:0], 24'd0} : 32'd0;
    assign bad = (result != p[31:0] - of_a - of_b) | (|flags) | (gate_a != a[23:0]) | (gate_b != b[23:0]);
    assign part = 6'd0;

endmodule
