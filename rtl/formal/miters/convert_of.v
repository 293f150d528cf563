// SPDX-License-Identifier: MIT OR Apache-2.0
// Conversions in the plainest way: a number with enough places is split into a kept part and a rest; it is rounded up
// if the rest is more than a half, or a half with the kept part odd.

module to_float (
    input      [31:0] x,
    output reg [31:0] result
);

    wire [31:0] magnitude = x[31] ? -x : x;
    reg  [5:0]  place;          // of the leading one
    reg  [54:0] wide;           // with the leading one in place 54: 24 places, and 31 to be cut off
    reg         up;
    integer     i;
    always @* begin
        place = 6'd0;
        for (i = 0; i < 32; i = i + 1) begin
            if (magnitude[i]) place = i;
        end
        wide   = {magnitude, 23'd0} << (31 - place);
        up     = wide[30:0] > 31'h40000000 | (wide[30:0] == 31'h40000000 & wide[31]);
        result = {x[31], 8'd126 + {2'd0, place}, 23'd0} + wide[54:31] + up;
        if (x == 32'd0) result = 32'd0;
    end

endmodule

module to_integer (
    input      [31:0] x,
    output reg [31:0] result,
    output reg        invalid
);

    wire [7:0]  exponent = x[30:23];
    wire        nan      = (&exponent) & (|x[22:0]);
    reg  [55:0] wide;           // |x| in units of 2^-24, below 2^32
    reg         up;
    reg  [31:0] magnitude;
    always @* begin
        // The significand's last place weighs 2^(exponent - 150). Bits below 2^-24 stay below every half.
        wide      = exponent < 126 ? 56'd0 : {32'd0, 1'b1, x[22:0]} << (exponent - 126);
        up        = wide[23:0] > 24'h800000 | (wide[23:0] == 24'h800000 & wide[24]);
        magnitude = wide[55:24] + up;
        invalid   = exponent > 158 | (exponent == 158 & x != 32'hcf000000);
        result    = invalid ? (x[31] & ~nan ? 32'h80000000 : 32'h7fffffff) : x[31] ? -magnitude : magnitude;
    end

endmodule
