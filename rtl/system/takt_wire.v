// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_wire: link that carries each value as it is written (docs/system.md, Wire).
//
// Contract
//   write, value: the sender's port, in the cycle of writeback, or the host's. arrives, arrived: the same, LENGTH cycles later.
//   LATCHED: the sender's ports are latched. Then ended, two cycles after its `wait`, sends the last value written before that cycle,
//   if there was a write since the previous `wait`. Every writeback between a `wait` and its `ended` belongs to that period.

module takt_wire #(
    parameter LATCHED = 0,
    parameter LENGTH  = 0
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        write,
    input  wire [31:0] value,
    input  wire        ended,
    output wire        arrives,
    output wire [31:0] arrived
);

    wire        sends;
    wire [31:0] sent;

    generate
        if (LATCHED == 0) begin : g_direct
            assign {sends, sent} = {write, value};
            wire unused = &{1'b0, rst, ended};
        end else begin : g_latched
            reg        changed;
            reg [31:0] held;
            always @(posedge clk) begin
                if (write) held <= value;
                changed <= ~rst & (write | (changed & ~ended));
            end
            assign {sends, sent} = {ended & changed, held};
        end
    endgenerate

    takt_delay #(.LENGTH(LENGTH), .WIDTH(32)) way (
        .clk(clk), .in_valid(sends), .in(sent), .out_valid(arrives), .out(arrived)
    );

endmodule
