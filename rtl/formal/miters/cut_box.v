// SPDX-License-Identifier: MIT OR Apache-2.0
// The modules that take the place of multiplication and division in symfpu (cut.v) and are not there. Widths are symfpu's.

(* blackbox *)
module takt_cut_product (
    input  [47:0] a,
    input  [47:0] b,
    output [47:0] p
);
endmodule

(* blackbox *)
module takt_cut_quotient (
    input  [50:0] a,
    input  [50:0] b,
    output [50:0] p
);
endmodule

(* blackbox *)
module takt_cut_remainder (
    input  [50:0] a,
    input  [50:0] b,
    output [50:0] p
);
endmodule

(* blackbox *)
module takt_cut_exponents (
    input  [9:0] a,
    input  [9:0] b,
    output [9:0] p
);
endmodule
