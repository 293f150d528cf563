// takt_root: square root of a binary32 number, correctly rounded, by digits: small, no multiplier.
//
// Contract
//   An operation whose operand stands on the inputs in one cycle, with in_valid, has its result and flags on the outputs,
//   with out_valid, LATENCY - 1 cycles later. The next may follow INTERVAL cycles after it, no sooner. No reset: after
//   LATENCY cycles without in_valid nothing is left of what was before.
//   flags = {invalid, divide by zero, overflow}. IEEE 754, to nearest even, with subnormals; the one NaN that comes out is
//   7fc00000. The root of -0 is -0.
//
//@ op - fsqrt
//
// Method: digit by digit, restoring, two bits a cycle. The radicand is in [1, 4), so that the root begins with 1; twelve
// cycles give 24 more bits, the last of which rounds: no root lies in the middle between two numbers (it would have 25 bits
// and its square 49 or 50).
//
// Schedule: at[k] = 1 in stage k of an operation, whose operand stands on the inputs in stage 0.
//   0, 1   operand unpacked; the leading bit
//   2-13   digits
//   14     rounded into the outputs
// The registers of stages 2 to 14 belong to one operation at a time: the next is 13 cycles later.

module takt_root #(
    parameter LATENCY  = 16,
    parameter INTERVAL = 13
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire [31:0] a,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    generate
        if (LATENCY != 16 || INTERVAL < 13) begin : g_latency
            takt_root_has_latency_16_and_interval_13 unsupported ();
        end
    endgenerate

    reg [14:1] at;
    always @(posedge clk) begin
        at        <= {at[13:1], in_valid};
        out_valid <= at[14];
    end

    // ---- 0, 1: the operand

    wire [7:0]  field;
    wire [23:0] significand;
    wire [4:0]  zeros;
    wire        is_zero, infinite, is_nan, signaling;
    takt_unpack unpack (
        .clk(clk), .x(a[30:0]), .exponent(field), .significand(significand), .zeros(zeros),
        .zero(is_zero), .infinite(infinite), .nan(is_nan), .signaling(signaling)
    );

    reg       sign_1;
    reg [8:0] twice_1;          // the root's exponent field, twice, but for a subnormal's zeros
    always @(posedge clk) begin
        sign_1  <= a[31];
        twice_1 <= {1'b0, field} + 9'd127;
    end

    wire [8:0] twice     = twice_1 - {4'd0, zeros};
    wire       doubled   = twice[0];                            // the radicand is in [2, 4)
    wire       undefined = sign_1 & ~is_zero & ~is_nan;

    // ---- 2-13: two bits of the root. With q, the root so far in units of its last bit, the next is 1 if 4 q + 1 is not more
    //            than what remains followed by the radicand's next two bits; it is then taken away

    reg [24:0] rest;            // what remains, at most 2 q
    reg [24:0] q;               // significand and a bit
    reg [23:0] radicand;        // the bits to come
    reg        sign, nan, fixed, invalid;
    reg [7:0]  exponent_field;

    // The digit's bits, one after the other; the second for both values of the first.
    wire [27:0] first    = {1'b0, rest, radicand[23:22]} - {1'b0, q, 2'd1};
    wire [28:0] second_0 = {rest, radicand[23:20]} - {2'd0, q[23:0], 3'd1};
    wire [28:0] second_1 = {first[26:0], radicand[21:20]} - {2'd0, q[23:0], 3'd5};
    wire        high     = ~first[27];
    wire        low      = ~(high ? second_1[28] : second_0[28]);

    always @(posedge clk) begin
        if (at[1]) begin
            // The leading bit's square, 1, is gone.
            rest             <= {23'd0, doubled & significand[22], doubled & ~significand[22]};
            radicand         <= doubled ? {significand[21:0], 2'd0} : {significand[22:0], 1'd0};
            q                <= 25'd1;
            sign             <= sign_1 & is_zero;
            nan              <= is_nan | undefined;
            fixed            <= is_nan | undefined | infinite | is_zero;
            invalid          <= signaling | undefined;
            exponent_field   <= {8{is_nan | undefined | infinite}} | (twice[8:1] & {8{~is_zero}});
        end else begin
            rest     <= high ? (low ? second_1[24:0] : {first[22:0], radicand[21:20]})
                             : (low ? second_0[24:0] : {rest[20:0], radicand[23:20]});
            radicand <= {radicand[19:0], 4'd0};
            q        <= {q[22:0], high, low};
        end
    end

    // ---- 14: rounded; a carry into the exponent cannot be

    always @(posedge clk) begin
        result[31]    <= sign;
        result[30:23] <= exponent_field;
        result[22:0]  <= fixed ? {nan, 22'd0} : q[23:1] + {22'd0, q[0]};
        flags         <= {invalid, 2'b00};
    end

    wire unused = &{1'b0, significand[23], q[24], second_0[27:25], second_1[27:25]};

endmodule
