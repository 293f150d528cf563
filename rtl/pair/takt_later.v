// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_later: nets as they were DELAY cycles ago, for the second core of a pair.
//
// Contract
//   out: in, DELAY cycles later; 1 or more. No reset: after DELAY cycles nothing earlier is left.
//   The registers stay its own: a tool that merged the first of them with a register of the first core, which takes the same net, would
//   give both cores the same wrong value when it flips.

(* keep_hierarchy = "yes" *)
module takt_later #(
    parameter WIDTH = 1,
    parameter DELAY = 2
) (
    input  wire             clk,
    input  wire [WIDTH-1:0] in,
    output wire [WIDTH-1:0] out
);

    (* dont_merge *)
    reg  [DELAY*WIDTH-1:0]     line;
    wire [(DELAY+1)*WIDTH-1:0] all = {line, in};

    always @(posedge clk) line <= all[DELAY*WIDTH-1:0];
    assign out = all[(DELAY+1)*WIDTH-1 -: WIDTH];

endmodule
