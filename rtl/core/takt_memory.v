// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_memory: the data memory, with one load or store per cycle, and with PORTS = 2 another load beside it.
//
// Contract
//   x_load[p], x_store, with the operands of port p in a (base) and b (the value to store), come in the cycle after issue. Stores are
//   port 0's. A load's result is valid (out_valid[p]) in cycle LATENCY after issue, and 0 in other cycles; beside a store to its word
//   it is the word's old value. fault[p]: the address is outside of the memory; neither port's access has an effect then.
//   cancel: the accesses in execute are dropped.
//   load_write: the loader writes, in reset.
//
// Pipeline
//   1  address
//   2  memory output
//   3  output register

module takt_memory #(
    parameter LATENCY = 4,
    parameter DEPTH   = 1024,
    parameter ADDRESS = 10,   // bits of an address, at most 16; DEPTH is 2 to this power
    parameter PORTS   = 1
) (
    input  wire                  clk,
    input  wire                  rst,
    input  wire                  load_write,
    input  wire [ADDRESS-1:0]    load_address,
    input  wire [31:0]           load_value,
    input  wire [PORTS-1:0]      x_load,
    input  wire                  x_store,
    input  wire [16*PORTS-1:0]   offset,
    input  wire [32*PORTS-1:0]   a,
    input  wire [31:0]           b,
    input  wire                  cancel,
    output wire [PORTS-1:0]      fault,
    output reg  [PORTS-1:0]      out_valid,
    output reg  [32*PORTS-1:0]   result,
    // The store two cycles after issue, for verification.
    output reg                   write,
    output reg  [ADDRESS-1:0]    address,
    output reg  [31:0]           value
);

    generate
        if (LATENCY != 4) begin : g_latency
            takt_memory_has_latency_4 unsupported ();
        end
        if (DEPTH != 1 << ADDRESS || ADDRESS > 16) begin : g_depth
            takt_memory_has_a_power_of_two_of_words unsupported ();
        end
        if (PORTS < 1 || PORTS > 2) begin : g_ports
            takt_memory_has_ports_1_to_2 unsupported ();
        end
    endgenerate

    // offset + a lies in the memory if the sum of the low 16 bits does, and a's upper bits are all 0 without a carry from that sum,
    // or all 1 (a is negative) with a carry.
    wire [ADDRESS*PORTS-1:0] word;
    genvar p;
    generate
        for (p = 0; p < PORTS; p = p + 1) begin : g_port
            wire [16:0] sum    = {1'b0, a[32*p +: 16]} + {1'b0, offset[16*p +: 16]};
            wire        above  = |(sum[15:0] >> ADDRESS);
            wire        upper  = sum[16] ? &a[32*p+16 +: 16] : ~|a[32*p+16 +: 16];
            wire        stores = p == 0 ? x_store : 1'b0;
            assign fault[p] = (x_load[p] | stores) & (above | ~upper);
            assign word[ADDRESS*p +: ADDRESS] = sum[ADDRESS-1:0];
        end
    endgenerate

    reg [PORTS-1:0] loading, delivers;

    always @(posedge clk) begin
        address   <= rst ? load_address : word[ADDRESS-1:0];
        value     <= rst ? load_value : b;
        write     <= rst ? load_write : x_store & ~(|fault) & ~cancel;
        loading   <= x_load & ~fault & {PORTS{~rst}};
        delivers  <= loading;
        out_valid <= delivers;
    end

    generate
        if (PORTS == 1) begin : g_one
            (* no_rw_check *)
            reg [31:0] words [0:DEPTH-1];
            reg [31:0] read;
            always @(posedge clk) begin
                if (write) words[address] <= value;
                else read <= words[address];
                result <= read & {32{delivers}};
            end
        end else begin : g_two
            // Port 0 reads the old word when it writes (block RAM mode READBEFOREWRITE). Port 1 reads an undefined word
            // if port 0 is writing it: for equal addresses, both ports deliver port 0's word.
            reg [31:0] words [0:DEPTH-1];
            reg [31:0] read, second;
            reg [ADDRESS-1:0] other;
            reg same;
            always @(posedge clk) begin
                other <= word[ADDRESS +: ADDRESS];
                same  <= other == address;
                if (write) words[address] <= value;
                read <= words[address];
                if (write & (other == address)) second <= 32'hxxxxxxxx;
                else second <= words[other];
                result <= {(same ? read : second) & {32{delivers[PORTS-1]}}, read & {32{delivers[0]}}};
            end
        end
    endgenerate

endmodule
