// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_multiply, or another unit's fmul with the code OP, against IEEE 754's product, for all operands. The product of the significands is
// an arbitrary number p that has its leading one and its zeros where a product of these operands can have them; circuit and
// reference get the same. That both multiply the operands' significands is part of `bad`, that the circuit's multiplier
// multiplies is a proof of its own (product.v). Cases: leading zeros of a subnormal operand; both normal, or both subnormal.

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input  [31:0] c,            // of a fused unit: does not matter
    input  [47:0] p,
    input  [47:0] unused_p,
    output        bad,
    output        assumed,
    output [5:0]  part
);

    wire [47:0] product;
    wire [31:0] result, exact;
    wire [2:0]  flags;
    wire        invalid, overflow, finite, proper;
    wire [23:0] gate_a, gate_b;
    wire [47:0] cut_a, cut_b, normal;
    gate dut (
`ifdef OP
        .op(`OP),
`endif
`ifdef FUSED
        .c(c),
`endif
        .clk(1'b0), .in_valid(1'b1), .a(a), .b(b), .result(result), .flags(flags),
        .\u_product.a (gate_a), .\u_product.b (gate_b), .\u_product.p (product)
    );
    symfpu reference (
        .a(a), .b(b), .o(exact), .NV(invalid), .OF(overflow), .\cut0.a (cut_a), .\cut0.b (cut_b),
        .\cut0.p (finite ? normal : unused_p)
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

    wire        a_normal = |a[30:23];
    wire        b_normal = |b[30:23];
    assign part = ~a_normal & ~b_normal ? 6'd0 : ~a_normal ? {1'b0, x_zeros} : ~b_normal ? 6'd24 + y_zeros : 6'd49;

endmodule
