// SPDX-License-Identifier: MIT OR Apache-2.0
// For yosys' techmap: a register becomes a wire. balance.py says when that is right.

(* techmap_celltype = "$dff" *)
module no_register #(
    parameter WIDTH        = 1,
    parameter CLK_POLARITY = 1
) (
    input              CLK,
    input  [WIDTH-1:0] D,
    output [WIDTH-1:0] Q
);

    assign Q = D;

endmodule
