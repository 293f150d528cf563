// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_addmul against IEEE 754's sum and against the conversions of convert_of.v, for all operands of fadd, fsub, itof and ftoi; what
// its multiplier gives is arbitrary. Cases: the conversions; sums by the difference of the exponent fields, as in add.v.

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input  [1:0]  op,           // a conversion; the second of the two
    input  [47:0] p,
    output        bad,
    output [5:0]  part
);

    wire [31:0] result, sum, float, integer_;
    wire [2:0]  flags;
    wire        sum_invalid, overflow, integer_invalid;
    gate dut (
        .clk(1'b0), .in_valid(1'b1), .op({op[1], 1'b0, op[0]}), .a(a), .b(b), .result(result), .flags(flags), .\u_product.p (p)
    );
    symfpu reference (.a(a), .b({b[31] ^ op[0], b[30:0]}), .o(sum), .NV(sum_invalid), .OF(overflow));
    to_float of_integer (.x(a), .result(float));
    to_integer of_float (.x(a), .result(integer_), .invalid(integer_invalid));

    wire        nan   = (&sum[30:23]) & (|sum[22:0]);
    wire [31:0] exact = op[1] ? (op[0] ? integer_ : float) : nan ? 32'h7fc00000 : sum;
    wire [2:0]  raised = op[1] ? {op[0] & integer_invalid, 2'b00} : {sum_invalid, 1'b0, overflow};
    assign bad = (result != exact) | (flags != raised);

    wire [8:0]  above = {1'b0, a[30:23]} - {1'b0, b[30:23]};
    wire [8:0]  below = -above;
    wire [4:0]  distance = above[8] ? (below > 27 ? 5'd27 : below[4:0]) : (above > 27 ? 5'd27 : above[4:0]);
    assign part =
        op[1] ? {5'd28, op[0]} : distance == 0 ? {5'd0, a[31] ^ b[31] ^ op[0]} : {distance, above[8]};

endmodule
