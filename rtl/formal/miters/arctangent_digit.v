// SPDX-License-Identifier: MIT OR Apache-2.0
// A step of takt_arctangent's division, in stages 3 (FIRST) to 18 (LAST). If the rest is less than the divisor, the digit is the quotient of
// four times the rest, and the next rest what remains of it, less than the divisor again; or the rest stays, where the division
// pauses. After the last digit nothing needs the rest. Case: one.

module miter (
    input  [28:0] rest_now,
    input  [28:0] divisor_now,
    input  [4:0]  stands_now,
    input  [8:0]  e_now,
    input  [28:0] rest_next,
    input  [1:0]  digit_1_next,
    output        bad,
    output        assumed,
    output        part
);

    wire [30:0] four  = {rest_now, 2'd0};
    wire [30:0] taken = (digit_1_next[0] ? {2'd0, divisor_now} : 31'd0) + (digit_1_next[1] ? {1'd0, divisor_now, 1'b0} : 31'd0);
    wire        digit = taken <= four & four - taken < {2'd0, divisor_now};

    assign assumed = rest_now < divisor_now;
`ifdef LAST
    assign bad = ~digit;
`else
`ifdef FIRST
    wire stays = e_now > 12;
`else
    wire stays = stands_now[0];
`endif
    wire [30:0] left = four - taken;
    assign bad = ~digit | rest_next != (stays ? rest_now : left[28:0]);
`endif
    assign part = 1'b0;

endmodule
