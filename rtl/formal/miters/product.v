// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_significand_product: with products of 18 bits that are right, its sum is the product of its operands, which is
//     low low + 2^18 (high low + low high) + 2^36 high high;
// the product of the high parts, made in logic, is compared with a multiplication. Cases: the high part of a.

module miter (
    input  [23:0] a,
    input  [23:0] b,
    input  [35:0] low_low,
    input  [23:0] high_low,
    input  [23:0] low_high,
    output        bad,
    output [5:0]  part
);

    wire [17:0] a_ll, b_ll, a_hl, b_hl, a_lh, b_lh;
    wire [47:0] p;
    wire [35:0] ll;
    wire [23:0] hl, lh;
    gate dut (
        .clk(1'b0), .a(a), .b(b), .p(p),
        .\u_low_low.a (a_ll), .\u_low_low.b (b_ll), .\u_low_low.p (ll),
        .\u_high_low.a (a_hl), .\u_high_low.b (b_hl), .\u_high_low.p ({12'd0, hl}),
        .\u_low_high.a (a_lh), .\u_low_high.b (b_lh), .\u_low_high.p ({12'd0, lh})
    );

`ifdef EXACT
    assign ll = a[17:0] * b[17:0];
    assign hl = a[23:18] * b[17:0];
    assign lh = a[17:0] * b[23:18];
`else
    assign ll = low_low;
    assign hl = high_low;
    assign lh = low_high;
`endif

    wire [11:0] high_high = a[23:18] * b[23:18];
    wire [24:0] middle    = hl + lh;
    assign bad =
        (p != {high_high, ll} + {middle, 18'd0}) | (a_ll != a[17:0]) | (b_ll != b[17:0]) | (a_hl != a[23:18]) |
        (b_hl != b[17:0]) | (a_lh != a[17:0]) | (b_lh != b[23:18]);
    assign part = a[23:18];

endmodule
