// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_scale: conversion of a program's value to a peripheral's register.
//
// Contract
//   valid, is_float, exponent, value: stand together. result: three cycles later. An integer stays as it is. A number with point is
//   multiplied by 2^exponent (in two's complement), rounded to the nearest integer, ties to even, and saturated.
//   nan, a cycle later: it was no number; result is then 0.

module takt_scale #(
    parameter FTOI = 1        // the converter's code for a number with point to an integer
) (
    input  wire        clk,
    input  wire        valid,
    input  wire        is_float,
    input  wire [9:0]  exponent,
    input  wire [31:0] value,
    output wire [31:0] result,
    output reg         nan
);

    wire        no_number = &value[30:23] & |value[22:0];
    wire [9:0]  moved   = {2'b00, value[30:23]} + exponent;
    wire        zero    = value[30:23] == 8'd0 | (moved[9] | moved == 10'd0) | no_number;
    wire        beyond  = &value[30:23] | (~moved[9] & moved >= 10'd255);
    wire [31:0] scaled  = zero ? 32'd0 : beyond ? {value[31], 8'd254, 23'd0} : {value[31], moved[7:0], value[22:0]};
    localparam [0:0] OP = FTOI;
    wire [31:0] rounded;
    takt_convert #(.LATENCY(4)) convert (
        .clk(clk), .in_valid(valid), .op(OP), .a(scaled), .out_valid(), .result(rounded), .flags()
    );

    reg         float2, float3, float4;
    reg  [31:0] value2, value3, value4;
    assign result = float4 ? rounded : value4;
    always @(posedge clk) begin
        nan <= valid & is_float & no_number;
        {float4, float3, float2} <= {float3, float2, is_float};
        {value4, value3, value2} <= {value3, value2, value};
    end

endmodule
