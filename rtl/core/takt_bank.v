// takt_bank: one copy of a register bank; one port writes, one reads.
//
// Contract
//   value holds in cycle t + 2 the word at read_index of cycle t, as writes of cycle t - 1 and before have left it. What is read
//   in the very cycle in which it is written is undefined: takt_source does not use it. The second cycle is the block RAM's own
//   delay, half a cycle, and the way from it.

module takt_bank #(
    parameter INDEX = 8  // bits of an index
) (
    input  wire             clk,
    input  wire             write,
    input  wire [INDEX-1:0] write_index,
    input  wire [31:0]      write_value,
    input  wire [INDEX-1:0] read_index,
    output reg  [31:0]      value
);

    (* no_rw_check *)
    reg [31:0] words [0:(1<<INDEX)-1];
    reg [31:0] read;

    always @(posedge clk) begin
        if (write) words[write_index] <= write_value;
        read  <= words[read_index];
        value <= read;
    end

endmodule
