// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_onehot_mux: multiplexer of 32-bit values with one-hot select.
//
// Each bit is a chain of 4-input lookup tables, half as many as there are values: each link of the chain takes the next two
// values and the output of the link before it.
//
// Contract
//   choose: one-hot; if it is all 0, value is 0. With AHEAD, choose comes one cycle before the values that it selects from.

module takt_onehot_mux #(
    parameter VALUES = 6,  // 2 at least
    parameter AHEAD  = 0
) (
    input  wire                 clk,
    input  wire [VALUES-1:0]    choose,
    input  wire [32*VALUES-1:0] values,
    output reg  [31:0]          value
);

    localparam LINKS = (VALUES + 1) / 2;

    // An odd number of values is padded with one that is never chosen.
    reg [2*LINKS-1:0]  choices;
    reg [64*LINKS-1:0] chosen;
    always @* begin
        choices = {2*LINKS{1'b0}};
        chosen  = {64*LINKS{1'b0}};
        choices[VALUES-1:0]   = choose;
        chosen[32*VALUES-1:0] = values;
    end

    // Encoding of the selects. The first link has two select bits, now[0] for its low value and now[1] for its high one: neither gives
    // 0, both give all ones. Each later link has one bit: if it is on, the previous output selects its second value (1) or its first (0).
    reg             second;
    reg [LINKS-1:0] on;
    integer         i;
    always @* begin
        second = 1'b0;
        on     = {LINKS{1'b0}};
        for (i = 1; i < LINKS; i = i + 1) begin
            second = second | choices[2*i+1];
            on[i]  = choices[2*i] | choices[2*i+1];
        end
    end
    wire [LINKS+1:0] next = {on, choices[1] | second, choices[0] | second};

    wire [LINKS+1:0] now;
    generate
        if (AHEAD != 0) begin : g_ahead
            reg [LINKS+1:0] kept;
            always @(posedge clk) kept <= next;
            assign now = kept;
        end else begin : g_now
            assign now = next;
        end
    endgenerate

    integer j;
    always @* begin
        value = now[1] ? chosen[63:32] | {32{now[0]}} : chosen[31:0] & {32{now[0]}};
        for (j = 1; j < LINKS; j = j + 1) begin
            if (now[j+2]) value = (value & chosen[64*j+32 +: 32]) | (~value & chosen[64*j +: 32]);
        end
    end

    wire unused = &{1'b0, clk, now[2]};

endmodule
