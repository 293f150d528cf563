// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_program: a slot's share of the program memory.
//
// Contract
//   word in cycle t + 1 is the word at read_address in cycle t; it then stays until the next read.
//   LOW: the number of low bits that are 0 in every operation of the slot, and are therefore not stored. A word with one of them
//   set is illegal, and is stored as the word 0, which is illegal, too.

module takt_program #(
    parameter DEPTH   = 1024,
    parameter ADDRESS = 10,   // bits of an address
    parameter LOW     = 0
) (
    input  wire               clk,
    input  wire               write,
    input  wire [ADDRESS-1:0] write_address,
    input  wire [47:0]        write_word,
    input  wire               read,
    input  wire [ADDRESS-1:0] read_address,
    output wire [47:0]        word
);

    (* no_rw_check *)
    reg [47:LOW] words [0:DEPTH-1];
    reg [47:LOW] kept;

    wire legal = ~|(write_word & ((48'd1 << LOW) - 48'd1));

    always @(posedge clk) begin
        if (write) words[write_address] <= write_word[47:LOW] & {48-LOW{legal}};
        if (read) kept <= words[read_address];
    end

    generate
        if (LOW == 0) begin : g_all
            assign word = kept;
        end else begin : g_high
            assign word = {kept, {LOW{1'b0}}};
        end
    endgenerate

endmodule
