// SPDX-License-Identifier: MIT OR Apache-2.0
// The module that takes a multiplication's place (cut.v) and is not there.

(* blackbox *)
module takt_cut #(
    parameter A = 48,
    parameter B = 48,
    parameter P = 48
) (
    input  [A-1:0] a,
    input  [B-1:0] b,
    output [P-1:0] p
);
endmodule
