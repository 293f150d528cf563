// takt_divroot_serial: quotient and square root of binary32 numbers, correctly rounded, a bit a cycle: small, no multiplier.
//
// Contract
//   An operation whose operands and op stand on the inputs in one cycle, with in_valid, has its result and flags on the
//   outputs, with out_valid, LATENCY - 1 cycles later. The next may follow INTERVAL cycles after it, no sooner. No reset:
//   after LATENCY cycles without in_valid nothing is left of what was before.
//   flags = {invalid, divide by zero, overflow}. IEEE 754, to nearest even, with subnormals; the one NaN that comes out is
//   7fc00000. The root is that of a; b is ignored. The root of -0 is -0.
//
//@ op 1'b0 fdiv
//@ op 1'b1 fsqrt
//
// Method: digit by digit, restoring, to 24 bits and the one that rounds. A quotient's first digit is its integer part; if that
// is 0 there is one digit more. A subnormal quotient has fewer: those that its format has room for. Only it can lie in the
// middle between two numbers.
//
// Schedule: at[k] = 1 in stage k of an operation, whose operands stand on the inputs in stage 0.
//   0, 1   a unpacked
//   1, 2   b unpacked by the same circuit
//   2, 3   the number of digits
//   4-29   digits
//   30     rounded into the outputs
// The registers belong to one operation at a time: stage 1 of the next may be stage 30 of this one.

module takt_divroot_serial #(
    parameter LATENCY  = 32,
    parameter INTERVAL = 29
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire [0:0]  op,
    input  wire [31:0] a,
    input  wire [31:0] b,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    generate
        if (LATENCY != 32 || INTERVAL < 29) begin : g_latency
            takt_divroot_serial_has_latency_32_and_interval_29 unsupported ();
        end
    endgenerate

    wire [30:0] at;
    reg  [30:1] at_later;
    assign at = {at_later, in_valid};
    always @(posedge clk) begin
        at_later  <= at[29:0];
        out_valid <= at[30];
    end

    // ---- 0-2: the operands, one after the other

    reg [30:0] b_1;
    reg        root_1, negative_1, sign_1;
    always @(posedge clk) begin
        root_1     <= op[0];
        negative_1 <= a[31];
        sign_1     <= a[31] ^ (b[31] & ~op[0]);
        b_1        <= b[30:0];
        if (op[0]) b_1 <= 31'h00800000;     // a number like others; its exponent field, 1, is used
    end

    wire [7:0]  field;
    wire [23:0] significand;
    wire [4:0]  zeros;
    wire        is_zero, is_infinite, is_nan, is_signaling;
    takt_unpack unpack (
        .clk(clk), .x(at[0] ? a[30:0] : b_1), .exponent(field), .significand(significand), .zeros(zeros),
        .zero(is_zero), .infinite(is_infinite), .nan(is_nan), .signaling(is_signaling)
    );

    // a's in stage 1, b's in stage 2: the exponent field, as if subnormals had one.
    reg  [7:0] field_1;
    wire [8:0] exponent = {1'b0, field_1} - {4'd0, zeros};
    always @(posedge clk) field_1 <= field;

    reg       root;
    reg [8:0] a_exponent;
    reg       a_zero, a_infinite, a_nan, a_signaling, a_below, sign_2;
    always @(posedge clk) begin
        sign_2 <= sign_1;
        if (at[1]) begin
            root        <= root_1;
            a_exponent  <= exponent;
            a_zero      <= is_zero;
            a_infinite  <= is_infinite;
            a_nan       <= is_nan;
            a_signaling <= is_signaling;
            a_below     <= root_1 & negative_1 & ~is_zero & ~is_nan;
        end
    end

    wire undefined = (a_zero & is_zero) | (a_infinite & is_infinite) | a_below;

    reg sign, nan, infinite, zero, invalid, by_zero;
    always @(posedge clk) if (at[2]) begin
        sign     <= sign_2 & ~a_nan & ~is_nan & ~undefined;
        nan      <= a_nan | is_nan | undefined;
        infinite <= a_infinite | is_zero;
        zero     <= a_zero | is_infinite;
        invalid  <= a_signaling | is_signaling | undefined;
        by_zero  <= is_zero & ~a_zero & ~a_infinite & ~a_nan;
    end

    // ---- 2, 3: with d, the difference of the exponents, a quotient in [1, 2) has the exponent field d + 127, and its format room
    //            for d + 151 digits. From stage 4 on `left` is the number of those that remain, less 1

    reg [9:0] left;
    always @(posedge clk)
        if (at[2]) left <= {a_exponent[8], a_exponent} - {exponent[8], exponent};
        else       left <= left + (at[3] ? 10'd150 : 10'h3ff);

    // ---- 4-29: a digit, as long as there is room for it and the leading one has not come to its place

    reg [24:0] q;               // significand and a bit
    reg [24:0] rest;            // what remains
    reg [26:0] taken;           // what a digit of 1 takes away: twice b; 4 q + 1, q in units of its last bit
    reg [24:0] radicand;        // its bits to come, two a digit

    wire        active  = ~q[24] & ~left[9];
    wire [26:0] minuend = root ? {rest, radicand[24:23]} : {1'b0, rest, 1'b0};
    wire [27:0] difference = {1'b0, minuend} - {1'b0, taken};
    wire        digit   = ~difference[27];
    wire        doubled = ~exponent[0];     // the radicand is in [2, 4)

    always @(posedge clk) begin
        if (at[1]) begin
            rest     <= {1'b0, significand & {24{~root_1}}};
            radicand <= doubled ? {significand, 1'b0} : {1'b0, significand};
        end else if (active) begin
            rest     <= digit ? difference[24:0] : minuend[24:0];
            radicand <= {radicand[22:0], 2'b00};
        end
        if (at[2]) begin
            taken <= root ? 27'd1 : {2'b00, significand, 1'b0};
        end else if (active & root) begin
            taken <= {taken[25:2], digit, 2'b01};
        end
        if (at[3]) begin
            q     <= 25'd0;
        end else if (at[1]) begin
            q[24] <= 1'b1;                  // nothing moves until stage 4
        end else if (active) begin
            q     <= {q[23:0], digit};
        end
    end

    // ---- 28, 29: the exponent field, less 1 for the leading one, which adds itself; one less if there is a digit more

    reg [8:0] below;
    always @(posedge clk)
        if (at[28] & left[9])                 below <= 9'd0;
        else if (at[28] | (at[29] & active))  below <= root ? {1'b0, left[8:1]} : left[8:0];

    // ---- 30: rounded

    wire        up        = q[0] & (q[1] | |rest | root);
    wire [30:0] rounded   = {below[7:0], q[23:1]} + {7'd0, q[24], 22'd0, up};
    wire        fixed     = nan | infinite | zero;
    wire        too_large = below[8] | &below[7:1];
    always @(posedge clk) begin
        result <= {sign, rounded};
        if (fixed | too_large) begin
            result[30:23] <= {8{nan | infinite | ~zero}};
            result[22:0]  <= {nan, 22'd0};
        end
        flags <= {invalid, by_zero, too_large & ~fixed};
    end

    wire unused = &{1'b0, difference[26:25]};

endmodule
