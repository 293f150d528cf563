// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_delay: delay line for a link (docs/system.md, From port to port: R = latency - 4).
//
// Contract
//   out_valid, out: in_valid and in, delayed by LENGTH cycles. in_valid must be 0 in reset, which lasts LENGTH cycles or more, so that
//   the line is empty when reset ends.
//   A short line is a shift register; a long one is a ring buffer in a memory, which reads a word one cycle before it is overwritten.

module takt_delay #(
    parameter LENGTH = 0,
    parameter WIDTH  = 32
) (
    input  wire             clk,
    input  wire             in_valid,
    input  wire [WIDTH-1:0] in,
    output wire             out_valid,
    output wire [WIDTH-1:0] out
);

    generate
        if (LENGTH == 0) begin : g_none
            assign {out_valid, out} = {in_valid, in};
            wire unused = &{1'b0, clk};
        end else if (LENGTH < 4) begin : g_line
            reg  [LENGTH*(WIDTH+1)-1:0]     line;
            wire [(LENGTH+1)*(WIDTH+1)-1:0] all = {line, in_valid, in};
            always @(posedge clk) line <= all[LENGTH*(WIDTH+1)-1:0];
            assign {out_valid, out} = all[(LENGTH+1)*(WIDTH+1)-1 -: WIDTH+1];
        end else begin : g_ring
            localparam BITS = $clog2(LENGTH);
            localparam LAST = LENGTH - 1;
            (* no_rw_check *)
            reg  [WIDTH:0]  ring [0:LENGTH-1];
            reg  [WIDTH:0]  read;
            reg  [BITS-1:0] at;
            wire [BITS-1:0] next = at >= LAST[BITS-1:0] ? {BITS{1'b0}} : at + 1'b1;
            always @(posedge clk) begin
                ring[at] <= {in_valid, in};
                read     <= ring[next];
                at       <= next;
            end
            assign {out_valid, out} = read;
        end
    endgenerate

endmodule
