// SPDX-License-Identifier: MIT OR Apache-2.0
// A step of takt_recurrence, which finds two bits h and l of the result. R is `rest`, K `known`, P `place`, without the even bits,
// which are 0; Q is `digits`; primes are for what is after the step.
//
// A quotient has P = 0, and K is the divisor. If 0 <= R < 4 K, then
//     Q' = 4 Q + 2 h + l,  R' = 4 (R - (2 h + l) K),  0 <= R' < 4 K;
// or, as long as the unit waits for the first digit of a subnormal quotient, Q and R stay. So, if R is X and Q is 0 before the first of
// n steps, 4^n X = 4 Q K + R holds after each.
//
// A root has P = 2^25, then 2^23 and so on, and K is Q in units of 2 P. If 0 <= R < 4 K + 4 P, then Q' is as above,
//     K' = K + h P + l P/2,  R' = 4 R - h (8 K + 4 P) - l (4 K + P + 4 h P),  0 <= R' < 4 K' + 4 P',  P' = P / 4.
// That is P R - P' R' = K'^2 - K^2. So, if R is X and Q is 0 before the first step, 2^25 X = K^2 + P R holds after each.
//
// Cases: quotient, root.

module miter (
    input  [27:1] rest_now,
    input  [25:1] known_now,
    input  [25:0] place_now,
    input  [24:0] digits_now,
    input  [3:0]  wait_digits_now,
    input  [27:1] rest_next,
    input  [25:1] known_next,
    input  [25:0] place_next,
    input  [24:0] digits_next,
    input  [3:0]  wait_digits_next,
    output        bad,
    output        assumed,
    output        part
);

    wire [31:0] rest   = {5'd0, rest_now};
    wire [31:0] known  = {7'd0, known_now};
    wire [31:0] place  = {6'd0, place_now & 26'h2aaaaaa};
    wire [31:0] rest2  = {5'd0, rest_next};
    wire [31:0] known2 = {7'd0, known_next};
    wire [31:0] place2 = {6'd0, place_next & 26'h2aaaaaa};

    wire        root  = place != 0;
    wire        waits = wait_digits_now != 0;
    wire        high  = digits_next[1];
    wire        low   = digits_next[0];

    wire [31:0] p     = high ? place : 32'd0;
    wire [31:0] taken = (high ? 8 * known + 4 * place : 32'd0) + (low ? 4 * known + place + 4 * p : 32'd0);

    assign assumed =
        rest < 4 * known + 4 * place &
        (root ? (place & (place - 1)) == 0 & (known & (2 * place - 1)) == 0 & (~place[25] | rest < 32'h2000000) & ~waits :
                ~known_now[25]);
    wire        moved =
        digits_next == {digits_now[22:0], high, low} & rest2 == 4 * rest - taken & taken <= 4 * rest &
        known2 == (root ? known + p + (low ? place / 2 : 32'd0) : known) & rest2 < 4 * known2 + place & wait_digits_next == 0;
    wire        stayed =
        digits_next == digits_now & rest2 == rest & known2 == known & wait_digits_next == wait_digits_now - 4'd1;
    assign bad  = ~(waits ? stayed : moved) | (place2 != place / 4);
    assign part = root;

endmodule
