// SPDX-License-Identifier: MIT OR Apache-2.0
// For yosys' techmap: the sum of the factors' exponents in symfpu's multiplication becomes an instance of a module that is not there
// (cut_box.v). It is the addition of 10 bits whose operands are extended by a sign, so that their upper two bits are one signal.

(* techmap_celltype = "$add" *)
module cut_exponents #(
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

    parameter _TECHMAP_BITS_CONNMAP_ = 0;
    parameter [A_WIDTH*_TECHMAP_BITS_CONNMAP_-1:0] _TECHMAP_CONNMAP_A_ = 0;
    localparam BITS = _TECHMAP_BITS_CONNMAP_;

    generate
        if (A_WIDTH == 10 && Y_WIDTH == 10 && _TECHMAP_CONNMAP_A_[9*BITS +: BITS] == _TECHMAP_CONNMAP_A_[8*BITS +: BITS]) begin : g_cut
            takt_cut_exponents box (.a(A), .b(B), .p(Y));
        end else begin : g_other
            wire _TECHMAP_FAIL_ = 1'b1;
        end
    endgenerate

endmodule
