// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_wire: link that carries each value as it is written (docs/system.md, Wire).
//
// Contract
//   write, value: the sender's port, in the cycle of writeback, or the host's. arrives, arrived: the same, LENGTH cycles later.
//   LATCHED: the sender's ports are latched. Then publish, two cycles after its `publish` or `wait`, sends the last value written before
//   that cycle, if there was a write since the previous one. No result that follows a `publish` or `wait` is written before its publish.

module takt_wire #(
    parameter LATCHED = 0,
    parameter LENGTH  = 0
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        write,
    input  wire [31:0] value,
    input  wire        publish,
    output wire        arrives,
    output wire [31:0] arrived
);

    wire        sends;
    wire [31:0] sent;

    generate
        if (LATCHED == 0) begin : g_direct
            assign {sends, sent} = {write, value};
            wire unused = &{1'b0, rst, publish};
        end else begin : g_latched
            reg        changed;
            reg [31:0] held;
            always @(posedge clk) begin
                if (write) held <= value;
                changed <= ~rst & (write | (changed & ~publish));
            end
            assign {sends, sent} = {publish & changed, held};
        end
    endgenerate

    takt_delay #(.LENGTH(LENGTH), .WIDTH(32)) way (
        .clk(clk), .in_valid(sends), .in(sent), .out_valid(arrives), .out(arrived)
    );

endmodule
