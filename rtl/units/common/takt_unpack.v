// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_unpack: unpacks a binary32 number: its kind, its normalised significand, and the number of leading zeros removed from that.
//
// Contract
//   One number per cycle, x without its sign. exponent comes in the same cycle: the exponent field or, for a subnormal, 1. All
//   other outputs come in the next. significand is in [2^23, 2^24) unless the number is zero; zeros, up to 23, is the left shift
//   that brought it there.
//
// The significand is shifted by groups of four bits before the register, and by the rest after it.

module takt_unpack (
    input  wire        clk,
    input  wire [30:0] x,
    output wire [7:0]  exponent,
    output wire [23:0] significand,
    output wire [4:0]  zeros,
    output reg         zero,
    output wire        infinite,
    output wire        nan,
    output wire        signaling
);

    wire        normal = |x[30:23];
    wire [23:0] whole  = {normal, x[22:0]};
    assign exponent = {x[30:24], x[23] | ~normal};

    // The number of groups of zeros ahead of the first one, and the significand without them.
    reg [2:0]  groups;
    reg [23:0] shifted;
    always @* begin
        if      (|whole[23:20]) {groups, shifted} = {3'd0, whole};
        else if (|whole[19:16]) {groups, shifted} = {3'd1, whole[19:0], 4'd0};
        else if (|whole[15:12]) {groups, shifted} = {3'd2, whole[15:0], 8'd0};
        else if (|whole[11:8])  {groups, shifted} = {3'd3, whole[11:0], 12'd0};
        else if (|whole[7:4])   {groups, shifted} = {3'd4, whole[7:0], 16'd0};
        else                    {groups, shifted} = {3'd5, whole[3:0], 20'd0};
    end

    reg [2:0]  groups_1;
    reg [23:0] shifted_1;
    reg        ones, fraction, quiet;
    always @(posedge clk) begin
        groups_1  <= groups;
        shifted_1 <= shifted;
        zero      <= ~|x[30:0];
        ones      <= &x[30:23];
        fraction  <= |x[22:0];
        quiet     <= x[22];
    end

    wire        two    = ~|shifted_1[23:22];
    wire [23:0] by_two = two ? {shifted_1[21:0], 2'd0} : shifted_1;
    wire        one    = ~by_two[23];
    assign significand = one ? {by_two[22:0], 1'd0} : by_two;
    assign zeros       = {groups_1, two, one};
    assign infinite    = ones & ~fraction;
    assign nan         = ones & fraction;
    assign signaling   = ones & fraction & ~quiet;

endmodule
