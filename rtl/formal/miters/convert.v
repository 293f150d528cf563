// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_convert against the conversions of convert_of.v, for all operands. Cases: the operation.

module miter (
    input  [31:0] a,
    input         op,
    output        bad,
    output        part
);

    wire [31:0] result, float, integer_;
    wire [2:0]  flags;
    wire        invalid;
    gate dut (.clk(1'b0), .in_valid(1'b1), .op(op), .a(a), .result(result), .flags(flags));
    to_float of_integer (.x(a), .result(float));
    to_integer of_float (.x(a), .result(integer_), .invalid(invalid));

    assign bad  = (result != (op ? integer_ : float)) | (flags != {op & invalid, 2'b00});
    assign part = op;

endmodule
