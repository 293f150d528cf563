// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_alu against the operations in the words of docs/isa.md; order and equality of binary32 numbers are those of symfpu. All
// operands of every operation that has a code. Cases: the code.

module miter (
    input  [31:0] a,
    input  [31:0] b,
    input  [31:0] c,
    input  [5:0]  op,
    output        bad,
    output        assumed,
    output [5:0]  part
);

    wire [31:0] result;
    wire [2:0]  flags;
    gate dut (.clk(1'b0), .in_valid(1'b1), .op(op), .a(a), .b(b), .c(c), .result(result), .flags(flags));

    wire equal, less, less_or_equal, signaling, any_nan;
    symfpu reference (
        .a(a), .b(b), .ieee754Equal(equal), .lessThan(less), .lessThanOrEqual(less_or_equal), .sNV(any_nan), .qNV(signaling)
    );

    localparam [31:0] NAN = 32'h7fc00000;
    wire        a_nan  = (&a[30:23]) & (|a[22:0]);
    wire        b_nan  = (&b[30:23]) & (|b[22:0]);
    wire        a_zero = a[30:0] == 0;
    // The zeros are equal, but -0 comes before +0.
    wire        before = less | (equal & a[31] & ~b[31]);

    reg [31:0] exact;
    reg        invalid, known;
    always @* begin
        invalid = 1'b0;
        known   = 1'b1;
        case (op)
            6'b000000: exact = a;
            6'b000001: exact = {1'b0, a[30:0]};
            6'b000010: exact = {~a[31], a[30:0]};
            6'b000011: {exact, invalid} = {a_nan ? NAN : a_zero ? 32'd0 : {a[31], 31'h3f800000}, a_nan & ~a[22]};
            6'b000100: exact = a & b;
            6'b000101: exact = a | b;
            6'b000110: exact = a ^ b;
            6'b101000: exact = a + b;
            6'b001001: exact = a - b;
            6'b001100: exact = a >> b[4:0];
            6'b001101: exact = a << b[4:0];
            6'b001110: exact = $signed(a) >>> b[4:0];
            6'b010000: exact = a == b;
            6'b010001: exact = $signed(a) < $signed(b);
            6'b010010: exact = a < b;
            6'b010100: {exact, invalid} = {31'd0, equal, signaling};
            6'b010101: {exact, invalid} = {31'd0, less, any_nan};
            6'b010110: {exact, invalid} = {31'd0, less_or_equal, any_nan};
            6'b011000: {exact, invalid} = {a_nan | b_nan ? NAN : before ? a : b, signaling};
            6'b011001: {exact, invalid} = {a_nan | b_nan ? NAN : before ? b : a, signaling};
            6'b011010: {exact, invalid} = {a_nan | b_nan ? NAN : a[30:0] <= b[30:0] ? a : {a[31], b[30:0]}, signaling};
            6'b011011: exact = a != 0 ? b : c;
            default:   {exact, known} = 33'd0;
        endcase
    end

    assign bad     = (result != exact) | (flags != {invalid, 2'b00});
    assign assumed = known;
    assign part    = op;

endmodule
