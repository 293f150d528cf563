// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_alu: integer and logic operations, comparison, selection, and those binary32 operations that do not round.
//
// Contract
//   Operands and op on the inputs in one cycle, with in_valid, give result and flags on the outputs LATENCY - 1 cycles later,
//   with out_valid. One operation per cycle. No reset is needed: LATENCY cycles without in_valid empty the pipeline.
//   flags = {invalid, divide by zero, overflow}. Every NaN result is 7fc00000, except that mov, fabs and fneg are bit operations.
//   Operands that an operation does not have are ignored. The core uses mov's code also to pass an immediate (li) or the status
//   register (rdflags) through a.
//
//@ op 6'b000000 mov li rdflags
//@ op 6'b000001 fabs
//@ op 6'b000010 fneg
//@ op 6'b000011 fsign
//@ op 6'b000100 iand
//@ op 6'b000101 ior
//@ op 6'b000110 ixor
//@ op 6'b101000 iadd
//@ op 6'b001001 isub
//@ op 6'b001100 ishr
//@ op 6'b001101 ishl
//@ op 6'b001110 isar
//@ op 6'b010000 ieq
//@ op 6'b010001 ilt
//@ op 6'b010010 iltu
//@ op 6'b010100 feq
//@ op 6'b010101 flt
//@ op 6'b010110 fle
//@ op 6'b011000 fmin
//@ op 6'b011001 fmax
//@ op 6'b011010 fsat
//@ op 6'b011011 sel
//
// Pipeline: one register, the result. Everything before it is computed in parallel and selected once: the longest paths are a
// carry chain followed by a multiplexer, and the shifter.

module takt_alu #(
    parameter LATENCY = 2
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire [5:0]  op,
    input  wire [31:0] a,
    input  wire [31:0] b,
    input  wire [31:0] c,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    generate
        if (LATENCY != 2) begin : g_latency
            takt_alu_has_latency_2 unsupported ();
        end
    endgenerate

    // ---- operation codes: op[4:2] is the group, op[1:0] the operation in it; op[5] is set only for the one that adds

    wire is_pass    = op[4:2] == 3'b000;
    wire is_logic   = op[4:2] == 3'b001;
    wire is_sum     = op[4:2] == 3'b010;
    wire is_shift   = op[4:2] == 3'b011;
    wire is_integer = op[4:2] == 3'b100;  // comparison of integers
    wire is_float   = op[4:2] == 3'b101;  // comparison of binary32
    wire is_choice  = op[4:2] == 3'b110;

    wire is_sign    = is_pass & (op[1:0] == 2'b11);
    wire is_sel     = is_choice & (op[1:0] == 2'b11);

    // ---- sum and difference on one carry chain, whose carry in is made by an extra place below the others. The difference of the
    //      low 31 bits also compares the magnitudes of binary32 numbers, and integers: of two with the same sign in two's
    //      complement, the low bits decide.

    wire        minus      = ~op[5];
    wire [32:0] low_sum    = {1'b0, a[30:0], 1'b1} + {1'b0, b[30:0] ^ {31{minus}}, minus};
    wire        less       = ~low_sum[32];  // of the difference
    wire [31:0] arithmetic = {a[31] ^ b[31] ^ minus ^ low_sum[32], low_sum[31:1]} & {32{is_sum}};

    // ---- shift: a right rotation (by the negated count for a left shift), and a mask that clears the bits that wrapped around.
    //      The barrel shifter begins with the count's low bit, since the higher bits of the negated count arrive later.

    wire        left = op[0];
    wire [4:0]  turn = {
        b[4] ^ (left & (|b[3:0])), b[3] ^ (left & (|b[2:0])), b[2] ^ (left & (|b[1:0])), b[1] ^ (left & b[0]), b[0]
    };
    wire [31:0] turn1  = turn[0] ? {a[0], a[31:1]} : a;
    wire [31:0] turn2  = turn[1] ? {turn1[1:0], turn1[31:2]} : turn1;
    wire [31:0] turn4  = turn[2] ? {turn2[3:0], turn2[31:4]} : turn2;
    wire [31:0] turn8  = turn[3] ? {turn4[7:0], turn4[31:8]} : turn4;
    wire [31:0] turn16 = turn[4] ? {turn8[15:0], turn8[31:16]} : turn8;

    wire [31:0] keep;
    genvar i;
    generate
        for (i = 0; i < 32; i = i + 1) begin : g_keep
            assign keep[i] = left ? b[4:0] <= i : b[4:0] <= 31 - i;
        end
    endgenerate
    wire [31:0] shifted_in = {32{is_shift & op[1] & a[31]}} & ~keep;
    wire [31:0] shifted    = ({32{is_shift}} & keep & turn16) | shifted_in;

    // ---- comparison. `less` arrives last, from a carry chain; therefore both outcomes are prepared and it only selects.

    wire equal    = a[30:0] == b[30:0];
    wire a_zero   = a[30:0] == 31'd0;
    wire unlike   = a[31] ^ b[31];
    wire same     = equal & (~unlike | (is_float & a_zero));  // +0 and -0 are one number

    wire a_nan    = (&a[30:23]) & (|a[22:0]);
    wire b_nan    = (&b[30:23]) & (|b[22:0]);
    wire any_nan  = a_nan | b_nan;
    wire any_snan = (a_nan & ~a[22]) | (b_nan & ~b[22]);

    // If the signs differ, a < b is the sign of a, or of b for unsigned integers. Negative binary32 numbers are in
    // reverse order of their magnitudes.
    wire unsigned_order = is_integer & op[1];
    wire reversed       = is_float & a[31];
    wire before_if_less = unlike ? (unsigned_order ? b[31] : a[31]) : ~reversed;
    wire before_if_not  = unlike ? (unsigned_order ? b[31] : a[31]) : reversed;
    // ieq, feq: 00; ilt 01, iltu 10, flt 01: order; fle 10: both.
    wire wants_same  = is_integer ? op[1:0] == 2'b00 : is_float & ~op[0];
    wire wants_order = (is_integer | is_float) & (op[1:0] != 2'b00);
    wire possible    = ~(is_float & any_nan);
    wire holds       = possible & (same ? wants_same : wants_order & (less ? before_if_less : before_if_not));

    // ---- multiplexer: selects x or y; x also for every operation that does not depend on a condition

    // fmin takes b if it comes before a in the order in which -0 precedes +0 (if they are equal it does not matter), fmax if
    // it does not; fsat takes the bound if it is less; sel b and fsign ±1 if a is not zero.
    wire       b_first_if_less = unlike ? b[31] : a[31];
    wire       b_first_if_not  = unlike ? b[31] : ~a[31];
    wire       y_if_less    = is_choice & (op[1] ? is_sel & a[31] : b_first_if_less ^ op[0]);
    wire       y_if_not     = is_choice & (op[1] ? ~is_sel | a[31] : b_first_if_not ^ op[0]);
    wire       y_if_nonzero = is_sel | is_sign;
    wire       take_y       = (less ? y_if_less : y_if_not) | (y_if_nonzero & ~a_zero);

    wire [31:0] x =
        is_sel ? c :
        is_logic ? (op[1] ? a ^ b : op[0] ? a | b : a & b) :
        is_choice | (is_pass & ~is_sign) ? {(a[31] & ~(is_pass & op[0])) ^ (is_pass & op[1]), a[30:0]} :
        32'd0;
    wire [31:0] y =
        is_sign ? {a[31], 31'h3f800000} :
        {is_sel | ~op[1] ? b[31] : a[31], b[30:0]};  // fsat: the bound with the sign of a
    wire [31:0] chosen = take_y ? y : x;

    // ---- NaN and flags: equality is quiet, order is not

    wire makes_nan = is_sign | (is_choice & ~is_sel);
    wire nan       = makes_nan & (a_nan | (b_nan & ~is_sign));
    wire quiet     = (is_choice & ~is_sel) | (is_float & (op[1:0] == 2'b00));
    wire ordered   = is_float & (op[1:0] != 2'b00);
    wire invalid   = (quiet & any_snan) | (ordered & any_nan) | (is_sign & a_nan & ~a[22]);

    wire unused = low_sum[0];

    always @(posedge clk) begin
        out_valid <= in_valid;
        flags     <= {invalid, 2'b00};
        // This is no case of `chosen`, so that it becomes the register's synchronous set and reset.
        if (nan) begin
            result <= 32'h7fc00000;
        end else begin
            result <= chosen | arithmetic | shifted | {31'd0, holds};
        end
    end

endmodule
