// takt_divide: quotient of binary32 numbers, correctly rounded, by digits: small, no multiplier.
//
// Contract
//   An operation whose operands stand on the inputs in one cycle, with in_valid, has its result and flags on the outputs,
//   with out_valid, LATENCY - 1 cycles later. The next may follow INTERVAL cycles after it, no sooner. No reset: after
//   LATENCY cycles without in_valid nothing is left of what was before.
//   flags = {invalid, divide by zero, overflow}. IEEE 754, to nearest even, with subnormals; the one NaN that comes out is
//   7fc00000.
//
//@ op - fdiv
//
// Method: radix 4, restoring: three differences show the digit. The dividend is doubled if it is less than the
// divisor, so that the quotient is in [1, 2) and thirteen digits give it to 24 bits after the point; what then remains of the
// dividend says whether the quotient is exact. A subnormal quotient begins with zeros: the dividend waits for their cycles
// to pass and loses nothing.
//
// Schedule: at[k] = 1 in stage k of an operation, whose operands stand on the inputs in stage 0.
//   0, 1   operands unpacked
//   2      aligned
//   3-15   digits
//   16     rounded into the outputs
// The registers of stages 3 to 16 belong to one operation at a time: the next is 14 cycles later.

module takt_divide #(
    parameter LATENCY  = 18,
    parameter INTERVAL = 14
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire [31:0] a,
    input  wire [31:0] b,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    generate
        if (LATENCY != 18 || INTERVAL < 14) begin : g_latency
            takt_divide_has_latency_18_and_interval_14 unsupported ();
        end
    endgenerate

    reg [16:1] at;
    always @(posedge clk) begin
        at        <= {at[15:1], in_valid};
        out_valid <= at[16];
    end

    // ---- 0, 1: operands

    wire [7:0]  a_exponent, b_exponent;
    wire [23:0] a_significand, b_significand;
    wire [4:0]  a_zeros, b_zeros;
    wire        a_zero, a_infinite, a_nan, a_signaling;
    wire        b_zero, b_infinite, b_nan, b_signaling;
    takt_unpack unpack_a (
        .clk(clk), .x(a[30:0]), .exponent(a_exponent), .significand(a_significand), .zeros(a_zeros),
        .zero(a_zero), .infinite(a_infinite), .nan(a_nan), .signaling(a_signaling)
    );
    takt_unpack unpack_b (
        .clk(clk), .x(b[30:0]), .exponent(b_exponent), .significand(b_significand), .zeros(b_zeros),
        .zero(b_zero), .infinite(b_infinite), .nan(b_nan), .signaling(b_signaling)
    );

    wire [5:0]  zeros_difference = {1'b0, b_zeros} - {1'b0, a_zeros};
    wire        undefined = (a_zero & b_zero) | (a_infinite & b_infinite);

    reg        sign_1;
    reg [9:0]  right_1;         // 1 less the exponent field of a quotient in [1, 2)
    reg        sign_2, nan_2, infinite_2, zero_2, invalid_2, by_zero_2;
    reg [9:0]  right_2;
    reg [23:0] a_2, b_2;
    always @(posedge clk) begin
        sign_1     <= a[31] ^ b[31];
        right_1    <= {2'b0, b_exponent} - {2'b0, a_exponent} - 10'd126;
        sign_2     <= sign_1 & ~a_nan & ~b_nan & ~undefined;
        nan_2      <= a_nan | b_nan | undefined;
        infinite_2 <= a_infinite | b_zero;
        zero_2     <= a_zero | b_infinite;
        invalid_2  <= a_signaling | b_signaling | undefined;
        by_zero_2  <= b_zero & ~a_zero & ~a_infinite & ~a_nan;
        right_2    <= right_1 - {{4{zeros_difference[5]}}, zeros_difference};
        a_2        <= a_significand;
        b_2        <= b_significand;
    end

    // ---- 2: the dividend or twice it, less than 4 b; for a subnormal quotient also the wait

    wire        subnormal = ~right_2[9];        // also the least exponent of normal quotients
    wire        less      = a_2 < b_2;
    // A digit is two bits: the first one's lower bit is the first of the quotient.
    wire        double    = subnormal ? right_2[0] : less;
    wire [9:0]  waits     = right_2 + 10'd1;    // digits, twice

    reg [25:0] rest;            // what remains, for the next digit
    reg [24:0] quotient;        // significand and a bit
    reg [3:0]  wait_digits;
    reg [23:0] divisor;
    reg        sign, nan, infinite, zero, invalid, by_zero, is_subnormal, is_less;
    reg [9:0]  right;

    // ---- 3-15: a digit

    // A digit of 2 or 3 or else of 0 or 1; with the last difference comes late what it decides.
    wire [26:0] less_1 = {1'b0, rest} - {3'd0, divisor};
    wire [26:0] less_2 = {1'b0, rest} - {2'd0, divisor, 1'b0};
    wire [26:0] less_3 = less_2 - {3'd0, divisor};
    wire        high   = ~less_2[26];
    wire        low    = high ? ~less_3[26] : ~less_1[26];
    wire [23:0] next_high = less_3[26] ? less_2[23:0] : less_3[23:0];
    wire [23:0] next_low  = less_1[26] ? rest[23:0] : less_1[23:0];
    wire [25:0] start     = double ? {1'b0, a_2, 1'b0} : {2'd0, a_2};

    always @(posedge clk) begin
        if (at[2]) begin
            wait_digits    <= ~subnormal ? 4'd0 : |waits[9:5] ? 4'd15 : waits[4:1];
            divisor        <= b_2;
            sign           <= sign_2;
            nan            <= nan_2;
            infinite       <= infinite_2;
            zero           <= zero_2;
            invalid        <= invalid_2;
            by_zero        <= by_zero_2;
            is_subnormal   <= subnormal;
            is_less        <= less;
            right          <= right_2;
        end else begin
            if (|wait_digits) begin
                wait_digits <= wait_digits - 4'd1;
                quotient    <= 25'd0;
            end else begin
                quotient <= {quotient[22:0], high, low};
            end
        end
        if (at[2] | ~|wait_digits) begin
            rest <= high & ~at[2] ? {next_high, 2'd0} : at[2] ? start : {next_low, 2'd0};
        end
    end

    // ---- 4, 5: the exponent; nothing more changes until the end

    reg [8:0] exponent;
    reg       overflow, fixed;
    reg [7:0] exponent_field;   // 0 if subnormal: then the significand's leading bit is the exponent
    always @(posedge clk) begin
        exponent       <= ~right[8:0] + {8'd0, ~is_less} + 9'd1;
        overflow       <= ~nan & ~infinite & ~zero & ~is_subnormal & (exponent[8] | &exponent[7:0]);
        fixed          <= nan | infinite | zero | (~is_subnormal & (exponent[8] | &exponent[7:0]));
        exponent_field <= {8{nan | infinite}} | ({8{exponent[8]}} | exponent[7:0]) & {8{~zero & ~is_subnormal}};
    end

    // ---- 16: rounded; a normal quotient is never in the middle, nor does it carry into the exponent

    wire        up          = quotient[0] & (quotient[1] | |rest[25:2]);
    wire [23:0] significand = quotient[24:1] + {23'd0, up};
    always @(posedge clk) begin
        result[31]    <= sign;
        result[30:23] <= {exponent_field[7:1], exponent_field[0] | (is_subnormal & significand[23])};
        result[22:0]  <= significand[22:0];
        if (fixed) begin
            result[30:23] <= exponent_field;
            result[22:0]  <= {nan, 22'd0};
        end
        flags <= {invalid, by_zero, overflow};
    end

    wire unused = &{1'b0, right[9], waits[0], less_1[25:24], less_2[25:24], less_3[25:24]};

endmodule
