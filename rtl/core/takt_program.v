// takt_program: a slot's share of the program memory.
//
// Contract
//   word holds in cycle t + 1 the word at read_address of cycle t, and then keeps it until the next read.

module takt_program #(
    parameter DEPTH   = 1024,
    parameter ADDRESS = 10    // bits of an address
) (
    input  wire               clk,
    input  wire               write,
    input  wire [ADDRESS-1:0] write_address,
    input  wire [47:0]        write_word,
    input  wire               read,
    input  wire [ADDRESS-1:0] read_address,
    output reg  [47:0]        word
);

    (* no_rw_check *)
    reg [47:0] words [0:DEPTH-1];

    always @(posedge clk) begin
        if (write) words[write_address] <= write_word;
        if (read) word <= words[read_address];
    end

endmodule
