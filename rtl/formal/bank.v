// SPDX-License-Identifier: MIT OR Apache-2.0
// The contract of takt_bank as a circuit with one word, whose address is arbitrary and stays as it is (`core.py` drives `probe`). What is
// read elsewhere, or in the cycle of a write to the word, is arbitrary.

module takt_bank #(
    parameter INDEX = 8,
    parameter WIDTH = 32
) (
    input  wire             clk,
    input  wire             write,
    input  wire [INDEX-1:0] write_index,
    input  wire [WIDTH-1:0] write_value,
    input  wire [INDEX-1:0] read_index,
    output wire [WIDTH-1:0] value
);

    wire [INDEX-1:0] probe;
    wire [WIDTH-1:0] elsewhere;  // nothing drives it
    reg  [WIDTH-1:0] word, value1, value2;
    reg              known1, known2;
    wire             hit = write & (write_index == probe);

    always @(posedge clk) begin
        if (hit) word <= write_value;
        known1 <= (read_index == probe) & ~hit;
        value1 <= word;
        known2 <= known1;
        value2 <= value1;
    end
    assign value = known2 ? value2 : elsewhere;

endmodule
