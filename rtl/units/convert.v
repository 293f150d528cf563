// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_convert: conversion of 32-bit integers to binary32 and back, rounded to nearest even.
//
// Contract
//   Operands and op on the inputs in one cycle, with in_valid, give result and flags on the outputs LATENCY - 1 cycles later,
//   with out_valid. One operation per cycle. No reset is needed: LATENCY cycles without in_valid empty the pipeline.
//   flags = {invalid, divide by zero, overflow}. An integer that does not fit saturates; a NaN gives the largest.
//
//@ op 1'b0 itof
//@ op 1'b1 ftoi
//@ clears
//
// Method: both directions share one datapath. A fixed-point number is shifted right. With n for the integer part and up (0 or 1) for
// rounding, taking the magnitude (itof) or applying the sign (ftoi) of a negative number is one addition,
//     -(n + up) = ~n + ~up,     in general (n ^ sign) + (up ^ sign),
// which includes itof's exponent. An integer is shifted in two's complement: rounding to nearest even is symmetric.
//
// Pipeline
//   0  operand                    only with LATENCY = 5, which matches the adder's; with LATENCY = 4 there is no such register
//   1  magnitude, leading zeros   fixed-point number and shift count
//   2  shifted
//   3  rounded                    the result

module takt_convert #(
    parameter LATENCY = 5
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire [0:0]  op,
    input  wire [31:0] a,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    // =============================================================== 0: wait

    wire        valid;
    wire        to_integer;
    wire [31:0] x;

    generate
        if (LATENCY == 4) begin : g_at_once
            assign {valid, to_integer, x} = {in_valid, op, a};
        end else if (LATENCY == 5) begin : g_wait
            reg        valid0;
            reg        op0;
            reg [31:0] a0;
            always @(posedge clk) begin
                valid0 <= in_valid;
                op0    <= op[0];
                a0     <= a;
            end
            assign {valid, to_integer, x} = {valid0, op0, a0};
        end else begin : g_latency
            takt_convert_has_latency_4_or_5 unsupported ();
        end
    endgenerate

    reg valid1, valid2;
    always @(posedge clk) begin
        valid1    <= valid;
        valid2    <= valid1;
        out_valid <= valid2;
    end

    // =============================================================== 1: fixed-point number and shift count

    // Places 32 to 1 of the shifted number are the addend; place 0 is the round bit, and the bits lost below it are the sticky bit.

    // ---- ftoi: the significand in places 31 to 8 goes 157 - exponent places to the right. An exponent below 126 means less
    //      than 1/2; one above 157 does not fit, but for -2^31.

    wire [7:0]  exponent   = x[30:23];
    wire        below_half = exponent < 8'd126;
    wire        too_large  = exponent >= 8'd158;
    wire        nan        = (&exponent) & (|x[22:0]);
    wire [23:0] significand = {1'b1, x[22:0]} & {24{~below_half}};
    wire [4:0]  units_shift = 5'd29 - exponent[4:0];  // modulo 32

    // ---- itof: the integer in places 55 to 24, with its sign above, goes to the right until its leading one is in place 24.
    //      For a negative one that is the leading zero; a power of two then is one place off, and all ones before rounding.

    wire        negative = x[31];
    wire        none;
    wire [4:0]  zeros;
    takt_leading_zeros u_zeros (.x(x ^ {32{negative}}), .none(none), .zeros(zeros));

    reg  [55:8] number1;
    reg  [4:0]  shift1;
    reg         to_integer1, sign1, empty1, too_large1, saturate_low1, invalid1;

    always @(posedge clk) begin
        number1       <= to_integer ? {24'd0, significand} : {x, 16'd0};
        shift1        <= to_integer ? units_shift : ~zeros;
        to_integer1   <= to_integer;
        sign1         <= x[31];
        empty1        <= none & ~x[31];  // zero
        too_large1    <= to_integer & too_large;
        saturate_low1 <= x[31] & ~nan;
        invalid1      <= to_integer & too_large & (x != 32'hcf000000);
    end

    // =============================================================== 2: shift

    wire [63:0] shift0 = {{8{sign1 & ~to_integer1}}, number1, 8'd0};
    wire [47:0] by16   = shift1[4] ? shift0[63:16] : shift0[47:0];
    wire [39:0] by8    = shift1[3] ? by16[47:8] : by16[39:0];
    wire [35:0] by4    = shift1[2] ? by8[39:4] : by8[35:0];
    wire [33:0] by2    = shift1[1] ? by4[35:2] : by4[33:0];
    wire [32:0] by1    = shift1[0] ? by2[33:1] : by2[32:0];
    wire        lost   =
        (shift1[4] & (|shift0[15:8])) | (shift1[3] & (|by16[7:0])) | (shift1[2] & (|by8[3:0])) |
        (shift1[1] & (|by4[1:0])) | (shift1[0] & by2[0]);

    reg  [31:0] addend2;
    reg         half2, lost2;
    reg  [8:0]  sign_field2;  // of itof: the sign, and the exponent field less the leading one, which adds itself
    reg         sign2, too_large2, saturate_low2, invalid2;

    always @(posedge clk) begin
        addend2       <= by1[32:1] ^ {32{sign1}};
        half2         <= by1[0];
        lost2         <= lost;
        sign_field2   <= {sign1, (8'd126 + {3'd0, shift1}) & {8{~empty1}}} & {9{~to_integer1}};
        sign2         <= sign1;
        too_large2    <= too_large1;
        saturate_low2 <= saturate_low1;
        invalid2      <= invalid1;
    end

    // =============================================================== 3: round

    wire        up  = half2 & (lost2 | (addend2[0] ^ sign2));
    wire [31:0] sum = addend2 + {sign_field2, 22'd0, up ^ sign2};

    always @(posedge clk) begin
        result <= too_large2 ? {saturate_low2, {31{~saturate_low2}}} : sum;
        flags  <= {invalid2, 2'b00};
        if (~valid2) {result, flags} <= 35'd0;
    end

endmodule
