// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_memory: the data memory, with one load or store per cycle.
//
// Contract
//   x_load, x_store, with the operands a (base) and b (the value to store), come in the cycle after issue. A load's result is
//   valid (out_valid) in cycle LATENCY after issue. fault: the address is outside of the memory, and the access has no effect.
//   cancel: the access in execute is dropped.
//   load_write: the loader writes, in reset.
//
// Pipeline
//   1  address
//   2  memory output
//   3  output register

module takt_memory #(
    parameter LATENCY = 4,
    parameter DEPTH   = 1024,
    parameter ADDRESS = 10    // bits of an address, at most 16; DEPTH is 2 to this power
) (
    input  wire               clk,
    input  wire               rst,
    input  wire               load_write,
    input  wire [ADDRESS-1:0] load_address,
    input  wire [31:0]        load_value,
    input  wire               x_load,
    input  wire               x_store,
    input  wire [15:0]        offset,
    input  wire [31:0]        a,
    input  wire [31:0]        b,
    input  wire               cancel,
    output wire               fault,
    output reg                out_valid,
    output reg  [31:0]        result,
    // The store two cycles after issue, for verification.
    output reg                write,
    output reg  [ADDRESS-1:0] address,
    output reg  [31:0]        value
);

    generate
        if (LATENCY != 4) begin : g_latency
            takt_memory_has_latency_4 unsupported ();
        end
        if (DEPTH != 1 << ADDRESS || ADDRESS > 16) begin : g_depth
            takt_memory_has_a_power_of_two_of_words unsupported ();
        end
    endgenerate

    // offset + a lies in the memory if the sum of the low 16 bits does, and a's upper bits are all 0 without a carry from that sum,
    // or all 1 (a is negative) with a carry.
    wire [16:0] sum   = {1'b0, a[15:0]} + {1'b0, offset};
    wire        above = |(sum[15:0] >> ADDRESS);
    wire        upper = sum[16] ? &a[31:16] : ~|a[31:16];
    assign fault = (x_load | x_store) & (above | ~upper);

    (* no_rw_check *)
    reg [31:0] words [0:DEPTH-1];
    reg [31:0] read;
    reg        loading, delivers;

    always @(posedge clk) begin
        address <= rst ? load_address : sum[ADDRESS-1:0];
        value   <= rst ? load_value : b;
        write   <= rst ? load_write : x_store & ~fault & ~cancel;
        loading <= x_load & ~fault & ~rst;
        if (write) words[address] <= value;
        else read <= words[address];
        delivers  <= loading;
        out_valid <= delivers;
        result    <= read;
    end

endmodule
