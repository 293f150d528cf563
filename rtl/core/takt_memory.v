// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_memory: the data memory, with one load or store per cycle, and with PORTS = 2 another load beside it.
//
// Contract
//   x_load[p], x_store, with the operands of port p in a (base) and b (the value to store), come in the cycle after issue. Stores are
//   port 0's. A load's result is valid (out_valid[p]) in cycle LATENCY after issue, and 0 in other cycles; beside a store to its word
//   it is the word's old value. fault[p]: the address is outside of the memory; neither port's access has an effect then.
//   cancel: the accesses in execute are dropped.
//   rst: the address is load_address; load_write: the loader writes there.
//   ECC: words have check bits (rtl/ecc/takt_ecc_code.v); a result is corrected. one_wrong[p], two_wrong[p]: port p's word, valid or not, has one
//   wrong bit, or two; corrected is port 0's.
//
// Pipeline
//   1  address
//   2  memory output
//   3  output register

module takt_memory #(
    parameter LATENCY = 4,
    parameter DEPTH   = 1024,
    parameter ADDRESS = 10,   // bits of an address, at most 16; DEPTH is 2 to this power
    parameter PORTS   = 1,
    parameter ECC     = 0     // 0 or 1
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
    output wire [32*PORTS-1:0]   result,
    output wire [PORTS-1:0]      one_wrong,
    output wire [PORTS-1:0]      two_wrong,
    output wire [31:0]           corrected,
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

    // A word in memory, and the words that the ports read.
    localparam WIDTH = ECC == 0 ? 32 : 39;
    wire [WIDTH-1:0]       stored;
    wire [WIDTH*PORTS-1:0] loaded;

    generate
        if (PORTS == 1) begin : g_one
            (* no_rw_check *)
            reg [WIDTH-1:0] words [0:DEPTH-1];
            reg [WIDTH-1:0] read;
            if (ECC != 0) begin : g_zeros
                integer i;
                initial for (i = 0; i < DEPTH; i = i + 1) words[i] = 0;  // valid words
            end
            always @(posedge clk) begin
                if (write) words[address] <= stored;
                else read <= words[address];
            end
            assign loaded = read;
        end else begin : g_two
            // Port 0 reads the old word when it writes (block RAM mode READBEFOREWRITE). Port 1 reads an undefined word
            // if port 0 is writing it: for equal addresses, both ports deliver port 0's word.
            reg [WIDTH-1:0] words [0:DEPTH-1];
            reg [WIDTH-1:0] read, second;
            reg [ADDRESS-1:0] other;
            reg same;
            if (ECC != 0) begin : g_zeros
                integer i;
                initial for (i = 0; i < DEPTH; i = i + 1) words[i] = 0;
            end
            always @(posedge clk) begin
                other <= word[ADDRESS +: ADDRESS];
                same  <= other == address;
                if (write) words[address] <= stored;
                read <= words[address];
                if (write & (other == address)) second <= {WIDTH{1'bx}};
                else second <= words[other];
            end
            assign loaded = {same ? read : second, read};
        end

        for (p = 0; p < PORTS; p = p + 1) begin : g_result
            wire [31:0] read = loaded[WIDTH*p +: 32];
            if (ECC == 0) begin : g_plain
                reg [31:0] q;
                always @(posedge clk) q <= read & {32{delivers[p]}};
                assign result[32*p +: 32] = q;
                assign {one_wrong[p], two_wrong[p]} = 2'd0;
            end else begin : g_ecc
                // The way from the block RAM takes half a cycle: the syndrome is known at its end, the word in the next one. The module stays
                // apart, so that synthesis, which does not count that half, gives it its least depth.
                wire [6:0]  syndrome, unused_check;
                wire [31:0] fixed;
                wire [33:0] unused;
                reg  [31:0] q;
                reg  [6:0]  q_syndrome;
                (* keep_hierarchy = "yes" *)
                takt_ecc_code #(.BITS(32)) checks (
                    .data(read), .given(loaded[WIDTH*p+32 +: 7]), .check(syndrome), .corrected(unused[33:2]), .wrong(unused[1:0])
                );
                always @(posedge clk) {q, q_syndrome} <= {read, syndrome};
                takt_ecc_code #(.BITS(32), .CORRECTS(1)) corrects (
                    .data(q), .given(q_syndrome), .check(unused_check), .corrected(fixed), .wrong({two_wrong[p], one_wrong[p]})
                );
                assign result[32*p +: 32] = fixed & {32{out_valid[p]}};
                if (p == 0) assign corrected = fixed;
            end
        end

        if (ECC == 0) begin : g_stored
            assign stored    = value;
            assign corrected = 32'd0;
        end else begin : g_stored_with_check
            wire [6:0]  check;
            wire [33:0] unused;
            takt_ecc_code #(.BITS(32)) encodes (
                .data(value), .given(7'd0), .check(check), .corrected(unused[33:2]), .wrong(unused[1:0])
            );
            assign stored = {check, value};
        end
    endgenerate

endmodule
