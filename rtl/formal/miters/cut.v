// SPDX-License-Identifier: MIT OR Apache-2.0
// For yosys' techmap: a multiplication or division becomes an instance of a module that is not there (cut_box.v), so that its
// result can be cut off.

(* techmap_celltype = "$mul" *)
module cut_product #(
    parameter A_SIGNED = 0,
    parameter B_SIGNED = 0,
    parameter A_WIDTH  = 1,
    parameter B_WIDTH  = 1,
    parameter Y_WIDTH  = 1
) (
    input  [A_WIDTH-1:0] A,
    input  [B_WIDTH-1:0] B,
    output [Y_WIDTH-1:0] Y
);

    takt_cut_product _TECHMAP_REPLACE_ (.a(A), .b(B), .p(Y));

endmodule

(* techmap_celltype = "$div" *)
module cut_quotient #(
    parameter A_SIGNED = 0,
    parameter B_SIGNED = 0,
    parameter A_WIDTH  = 1,
    parameter B_WIDTH  = 1,
    parameter Y_WIDTH  = 1
) (
    input  [A_WIDTH-1:0] A,
    input  [B_WIDTH-1:0] B,
    output [Y_WIDTH-1:0] Y
);

    takt_cut_quotient _TECHMAP_REPLACE_ (.a(A), .b(B), .p(Y));

endmodule

(* techmap_celltype = "$mod" *)
module cut_remainder #(
    parameter A_SIGNED = 0,
    parameter B_SIGNED = 0,
    parameter A_WIDTH  = 1,
    parameter B_WIDTH  = 1,
    parameter Y_WIDTH  = 1
) (
    input  [A_WIDTH-1:0] A,
    input  [B_WIDTH-1:0] B,
    output [Y_WIDTH-1:0] Y
);

    takt_cut_remainder _TECHMAP_REPLACE_ (.a(A), .b(B), .p(Y));

endmodule
