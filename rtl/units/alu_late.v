// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_alu_late: takt_alu with its result delayed to the latency of slower units, for a slot whose single write port they share.
//
// Contract
//   That of takt_alu (alu.v), codes included, but with any LATENCY from 3 to 16. The result is delayed, not the operands, since
//   it has the fewest bits.
//
//@ as alu
//@ clears

module takt_alu_late #(
    parameter LATENCY = 5
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire [5:0]  op,
    input  wire [31:0] a,
    input  wire [31:0] b,
    input  wire [31:0] c,
    output wire        out_valid,
    output wire [31:0] result,
    output wire [2:0]  flags
);

    localparam WAIT = LATENCY - 2;

    wire        alu_valid;
    wire [31:0] alu_result;
    wire [2:0]  alu_flags;

    takt_alu #(.LATENCY(2)) alu (
        .clk(clk), .in_valid(in_valid), .op(op), .a(a), .b(b), .c(c),
        .out_valid(alu_valid), .result(alu_result), .flags(alu_flags)
    );

    generate
        if (LATENCY < 3 || LATENCY > 16) begin : g_latency
            takt_alu_late_has_latency_3_to_16 unsupported ();
        end else begin : g_wait
            reg [36*WAIT-1:0] waiting;
            wire [36*WAIT+35:0] next = {waiting, alu_valid, alu_result, alu_flags};
            always @(posedge clk) begin
                waiting <= next[36*WAIT-1:0];
                if (~next[36*WAIT-1]) waiting[36*WAIT-2 -: 35] <= 35'd0;
            end
            wire unused = &{1'b0, next[36*WAIT+35 -: 36]};
            assign {out_valid, result, flags} = waiting[36*WAIT-1 -: 36];
        end
    endgenerate

endmodule
