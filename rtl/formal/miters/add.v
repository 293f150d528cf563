// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_add against IEEE 754's sum, for all operands of both operations. Cases: differences of the exponent fields, those from
// 27 on as one; of equal exponents, sums and differences are separate.

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input         op,
    output        bad,
    output [5:0]  part
);

    wire [31:0] result, exact;
    wire [2:0]  flags;
    wire        invalid, overflow;
    gate dut (.clk(1'b0), .in_valid(1'b1), .op(op), .a(a), .b(b), .result(result), .flags(flags));
    symfpu reference (.a(a), .b({b[31] ^ op, b[30:0]}), .o(exact), .NV(invalid), .OF(overflow));

    wire        nan = (&exact[30:23]) & (|exact[22:0]);
    assign bad = (result != (nan ? 32'h7fc00000 : exact)) | (flags != {invalid, 1'b0, overflow});

    wire [8:0]  above = {1'b0, a[30:23]} - {1'b0, b[30:23]};
    wire [8:0]  below = -above;
    wire [4:0]  distance = above[8] ? (below > 27 ? 5'd27 : below[4:0]) : (above > 27 ? 5'd27 : above[4:0]);
    assign part = distance == 0 ? {5'd0, a[31] ^ b[31] ^ op} : {distance, above[8]};

endmodule
