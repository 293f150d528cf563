// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_multiply: multiplier for binary32, rounded to nearest even, subnormals included; also for integers of 24 bits.
//
// Contract
//   Operands and op on the inputs in one cycle, with in_valid, give result and flags on the outputs LATENCY - 1 cycles later,
//   with out_valid. One operation per cycle. No reset is needed: LATENCY cycles without in_valid empty the pipeline.
//   flags = {invalid, divide by zero, overflow}. Every NaN result is 7fc00000.
//
//@ op 1'b0 fmul
//@ op 1'b1 imul24
//@ clears
//
// Method: the significands are multiplied without normalisation, leading zeros of a subnormal included. A single shift then serves
// two purposes: to the left, it normalises such a product, as far as its exponent allows; to the right, it denormalises a product
// below the normal numbers.
// Integers: the multiplier's operands are the low 24 bits without a sign. With s for a sign bit, a·b = (a - 2^24 s_a)·(b - 2^24 s_b)
// is their product less 2^24 (s_a b + s_b a), modulo 2^32, which concerns the upper byte only.
//
// Pipeline
//   1  partial products         three 18 x 18 multipliers and 6 x 6 bits in logic; sum of the exponents; leading zeros
//   2  product, shift count
//   3  shifted
//   4  rounded                  the result

module takt_multiply #(
    parameter LATENCY = 5
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire        op,
    input  wire [31:0] a,
    input  wire [31:0] b,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    generate
        if (LATENCY != 5) begin : g_latency
            takt_multiply_has_latency_5 unsupported ();
        end
    endgenerate

    reg valid1, valid2, valid3;
    always @(posedge clk) begin
        valid1    <= in_valid;
        valid2    <= valid1;
        valid3    <= valid2;
        out_valid <= valid3;
    end

    // =============================================================== 1: partial products

    wire        a_small = a[30:23] == 8'd0;  // zero or subnormal
    wire        b_small = b[30:23] == 8'd0;
    wire [23:0] a_significand = {op ? a[23] : ~a_small, a[22:0]};
    wire [23:0] b_significand = {op ? b[23] : ~b_small, b[22:0]};

    wire [47:0] product;  // of the next stage
    takt_significand_product u_product (.clk(clk), .a(a_significand), .b(b_significand), .p(product));

    // Zeros before the leading one of a subnormal's significand; of two subnormals, whose product is far below everything,
    // those of a.
    wire [4:0]  a_zeros, b_zeros;
    wire        a_none, b_none;
    takt_leading_zeros u_a_zeros (.x({1'b0, a[22:0], 8'hff}), .none(a_none), .zeros(a_zeros));
    takt_leading_zeros u_b_zeros (.x({1'b0, b[22:0], 8'hff}), .none(b_none), .zeros(b_zeros));
    wire        unused_none = a_none | b_none;  // never, for the ones at the end

    wire        a_empty   = ~|a[22:0];
    wire        b_empty   = ~|b[22:0];
    wire        a_special = &a[30:23];
    wire        b_special = &b[30:23];
    wire        a_nan     = a_special & ~a_empty;
    wire        b_nan     = b_special & ~b_empty;
    wire        a_zero    = a_small & a_empty;
    wire        b_zero    = b_small & b_empty;
    wire        improper  = (a_special & b_zero) | (a_zero & b_special);  // 0 · ∞, if there is no NaN

    reg  [8:0]  exponents1;  // sum of the biased exponents; that of a subnormal is 1
    reg  [4:0]  zeros1;
    reg         sign1, nan1, infinite1, zero1, invalid1, integer1;
    reg  [7:0]  excess1;     // of an integer product's upper byte

    always @(posedge clk) begin
        integer1   <= op;
        excess1    <= ({8{a[23]}} & b[7:0]) + ({8{b[23]}} & a[7:0]);
        exponents1 <= {1'b0, a[30:24], a[23] | a_small} + {1'b0, b[30:24], b[23] | b_small};
        zeros1     <= a_small ? a_zeros : b_small ? b_zeros : 5'd0;
        sign1      <= a[31] ^ b[31];
        nan1       <= a_nan | b_nan | improper;
        infinite1  <= a_special | b_special;
        zero1      <= a_zero | b_zero;
        invalid1   <= (a_nan & ~a[22]) | (b_nan & ~b[22]) | (improper & ~a_nan & ~b_nan);
    end

    // =============================================================== 2: product; shift count

    // `product` has 48 bits, the leading one of two normal significands in place 47 or 46.
    // With the leading one in place 46, the exponent field is exponents - 127 - zeros; `field` is one less, since the leading one is
    // added to it (see 4). If that is negative, the result is subnormal: the field is 0, and the shift stops where the exponent is 1.
    // The product starts 23 places to the left, so that all shifts are right shifts: by 23 - zeros, or by 24 - (exponents - 127).
    wire [9:0]  field     = {1'b0, exponents1} - {5'b00100, zeros1};
    wire [9:0]  deep      = 10'd151 - {1'b0, exponents1};
    wire        subnormal = field[9];

    reg  [47:0] product2;
    reg  [5:0]  shift2;  // 63 leaves nothing
    reg  [8:0]  field2;
    reg         sign2, nan2, infinite2, zero2, invalid2, integer2;
    reg  [7:0]  excess2;

    always @(posedge clk) begin
        integer2  <= integer1;
        excess2   <= excess1;
        product2  <= product;
        shift2    <= integer1 ? 6'd0 : ~subnormal ? {1'b0, 5'd23 - zeros1} : |deep[9:6] ? 6'd63 : deep[5:0];
        field2    <= field[8:0] & {9{~subnormal}};
        sign2     <= sign1;
        nan2      <= nan1;
        infinite2 <= infinite1;
        zero2     <= zero1;
        invalid2  <= invalid1;
    end

    // =============================================================== 3: shift

    // Places 47 to 22 are kept: 24 bits and a round bit, for both places of the leading one. Bits below go to the sticky bit `lost`.
    wire [70:22] shift0 = {product2, 1'b0};
    wire [70:22] by32   = shift2[5] ? {32'd0, shift0[70:54]} : shift0;
    wire [62:22] by16   = shift2[4] ? {8'd0, by32[70:38]} : by32[62:22];
    wire [54:22] by8    = shift2[3] ? by16[62:30] : by16[54:22];
    wire [50:22] by4    = shift2[2] ? by8[54:26] : by8[50:22];
    wire [48:22] by2    = shift2[1] ? by4[50:24] : by4[48:22];
    wire [47:22] by1    = shift2[0] ? by2[48:23] : by2[47:22];
    wire         lost   =
        (shift2[5] & (|shift0[53:22])) | (shift2[4] & (|by32[37:22])) | (shift2[3] & (|by16[29:22])) |
        (shift2[2] & (|by8[25:22])) | (shift2[1] & (|by4[23:22])) | (shift2[0] & by2[22]);

    reg  [47:22] shifted3;
    reg          lost3;
    reg  [7:0]   field3;
    reg          field_253, field_252;
    reg          sign3, nan3, infinite3, zero3, invalid3, overflow3, integer3;
    reg  [31:24] upper3;    // of an integer product, whose other places are 46 to 23 of the shifted one

    always @(posedge clk) begin
        integer3  <= integer2;
        upper3    <= product2[31:24] - excess2;
        shifted3  <= by1;
        lost3     <= lost;
        field3    <= field2[7:0];
        field_253 <= field2 == 9'd253;
        field_252 <= field2 == 9'd252;
        sign3     <= sign2;
        nan3      <= nan2;
        infinite3 <= infinite2 | (field2 >= 9'd254);
        overflow3 <= ~infinite2 & (field2 >= 9'd254);
        zero3     <= zero2;
        invalid3  <= invalid2;
    end

    // =============================================================== 4: round

    wire        top   = shifted3[47];
    wire [22:0] kept  = top ? shifted3[46:24] : shifted3[45:23];
    wire        up    =
        top ? shifted3[23] & (shifted3[22] | lost3 | shifted3[24]) : shifted3[22] & (lost3 | shifted3[23]);

    // The leading one is added to the exponent field, twice if it is in place 47, and so is a carry of the rounding; beyond the
    // largest number, that gives infinity.
    wire [30:0] rounded = {field3, kept} + {6'd0, top, ~top & shifted3[46], 22'd0, up};
    wire        top_overflows      = field_253 & top;
    wire        rounds_to_infinity = up & (&kept) & (top ? field_252 : field_253 & shifted3[46]);
    wire        infinite           = infinite3 | top_overflows;

    always @(posedge clk) begin
        result[31] <= sign3 & ~nan3;
        if (integer3) begin
            result <= {upper3, shifted3[46:23]};
        end else if (nan3 | infinite) begin
            result[30:0] <= {8'hff, nan3, 22'd0};
        end else if (zero3) begin
            result[30:0] <= 31'd0;
        end else begin
            result[30:0] <= rounded;
        end
        flags <= {invalid3, 1'b0, ~nan3 & (overflow3 | (~infinite3 & (top_overflows | rounds_to_infinity)))} & {3{~integer3}};
        if (~valid3) {result, flags} <= 35'd0;
    end

endmodule
