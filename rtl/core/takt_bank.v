// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_bank: one copy of a register bank, with one write port and one read port.
//
// Contract
//   value in cycle t + 2 is the word at read_index in cycle t, after all writes up to cycle t - 1. A word that is read in the
//   cycle in which it is written is undefined: takt_source forwards it instead. The read takes two cycles, because the delay of
//   the block RAM, half a cycle, and of the wires from it need a cycle of their own.

module takt_bank #(
    parameter INDEX = 8,  // bits of an index
    parameter WIDTH = 32
) (
    input  wire             clk,
    input  wire             write,
    input  wire [INDEX-1:0] write_index,
    input  wire [WIDTH-1:0] write_value,
    input  wire [INDEX-1:0] read_index,
    output reg  [WIDTH-1:0] value
);

    (* no_rw_check *)
    reg [WIDTH-1:0] words [0:(1<<INDEX)-1];
    reg [WIDTH-1:0] read;

    // With parities, words that were never written must have the right ones.
    generate
        if (WIDTH > 32) begin : g_zeros
            integer i;
            initial for (i = 0; i < 1 << INDEX; i = i + 1) words[i] = 0;
        end
    endgenerate

    always @(posedge clk) begin
        if (write) words[write_index] <= write_value;
        read  <= words[read_index];
        value <= read;
    end

endmodule
