// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_fused's fadd and fsub against IEEE 754's sum, for all operands: as add.v, and whatever c is. The product, of a and 1, is a's
// significand in the upper place.

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input  [31:0] c,
    input         op,
    output        bad,
    output [5:0]  part
);

    wire [31:0] result, exact;
    wire [2:0]  flags;
    wire        invalid, overflow;
    wire [23:0] gate_a, gate_b;
    gate dut (
        .clk(1'b0), .in_valid(1'b1), .op({3'b100, op}), .a(a), .b(b), .c(c), .result(result), .flags(flags),
        .\u_product.a (gate_a), .\u_product.b (gate_b), .\u_product.p ({1'b0, |a[30:23], a[22:0], 23'd0})
    );
    symfpu reference (.a(a), .b({b[31] ^ op, b[30:0]}), .o(exact), .NV(invalid), .OF(overflow));

    wire        nan = (&exact[30:23]) & (|exact[22:0]);
    assign bad =
        (result != (nan ? 32'h7fc00000 : exact)) | (flags != {invalid, 1'b0, overflow}) |
        (gate_a != {|a[30:23], a[22:0]}) | (gate_b != 24'h800000);

    wire [8:0]  above = {1'b0, a[30:23]} - {1'b0, b[30:23]};
    wire [8:0]  below = -above;
    wire [4:0]  distance = above[8] ? (below > 27 ? 5'd27 : below[4:0]) : (above > 27 ? 5'd27 : above[4:0]);
    assign part = distance == 0 ? {5'd0, a[31] ^ b[31] ^ op} : {distance, above[8]};

endmodule
