// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_fused: fused multiply-add for binary32, with one rounding, to nearest even, subnormals included; also product or sum alone, and
// the product of integers of 24 bits.
//
// Contract
//   Operands and op on the inputs in one cycle, with in_valid, give result and flags on the outputs LATENCY - 1 cycles later,
//   with out_valid. One operation per cycle. No reset is needed: LATENCY cycles without in_valid empty the pipeline.
//   flags = {invalid, divide by zero, overflow}. Every NaN result is 7fc00000.
//   A product alone has the bits and flags of takt_multiply, a sum or difference those of takt_add. Each has its own bit in the
//   code, so that synthesis removes the logic of operations that a machine does not have.
//
//@ op 4'b0000 fma
//@ op 4'b0001 fms
//@ op 4'b0010 fnma
//@ op 4'b0011 fnms
//@ op 4'b0100 fmul
//@ op 4'b0101 imul24
//@ op 4'b1000 fadd
//@ op 4'b1001 fsub
//@ clears
//
// op[0] negates the addend, op[1] the product; op[2]: the addend is a zero of the product's sign, which changes no product;
// op[3]: a + b is computed as a · 1 + b. op[2] and op[0]: the low 24 bits of a and b, without their signs, are multiplied; the addend
// is 2^24 (s_a b + s_b a), with s for a sign bit, which is subtracted, as (a - 2^24 s_a)·(b - 2^24 s_b) demands modulo 2^32.
//
// Notation: P is the product of the significands, 48 bits; C the addend's significand, 24 bits, leading one included. Both are in
// a window of 76 places: C at the top, two guard places, P, and two places after P:
//
//    75       52 51 50 49                 2 1 0
//   +-----------+-----+--------------------+---+
//   |     C     |     |          P         |   |
//   +-----------+-----+--------------------+---+
//
// C is shifted right by the difference of the exponents; the bits that it loses at the lower end are ORed to a sticky bit. The
// window is large enough, for these reasons:
//   An addend that belongs to the left of the top stays at the top. P is then too large in relation to it, but still below a
//   quarter of C's last place, where it only decides the rounding. If C has no leading one, its last place is that of subnormals.
//   C loses bits only if it reaches below place 23. A product of normal numbers reaches up to place 48, and the lost bits are far
//   below the result's last place. A product with one subnormal number begins with zeros, but reaches up to place 25: then the
//   result reaches up to place 24, and needs 24 places from there and a round bit, down to place 0.
//   The product of two subnormal numbers lies below every C.
// The exponent at the top is never below that of the smallest normal number: the normalising left shift stops where the exponent
// is 1, and no right shift is needed.
//
// Pipeline
//   1  partial products                    of 18 x 18 bits; the difference of the exponents
//   2  product, aligned addend
//   3  sum                                 or difference, of either sign
//   4  leading zeros, shifted by nibbles
//   5  normalised, rounded                 the result

module takt_fused #(
    parameter LATENCY = 6
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire [3:0]  op,
    input  wire [31:0] a,
    input  wire [31:0] b,
    input  wire [31:0] c,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    generate
        if (LATENCY != 6) begin : g_latency
            takt_fused_has_latency_6 unsupported ();
        end
    endgenerate

    reg valid1, valid2, valid3, valid4;
    always @(posedge clk) begin
        valid1    <= in_valid;
        valid2    <= valid1;
        valid3    <= valid2;
        valid4    <= valid3;
        out_valid <= valid4;
    end

    // =============================================================== 1: partial products; distance

    // The factors are a and y, the addend is z.
    wire [31:0] y      = op[3] ? 32'h3f800000 : b;
    wire [30:0] z      = op[2] ? 31'd0 : op[3] ? b[30:0] : c[30:0];
    wire        p_sign = a[31] ^ y[31] ^ op[1];
    wire        z_sign = op[2] ? p_sign : (op[3] ? b[31] : c[31]) ^ op[0];
    wire        minus  = p_sign ^ z_sign;
    wire        integers = op[2] & op[0];  // imul24

    // Zero or subnormal. Of y and z, the operands are tested before one is chosen: the exponents' sums begin with these.
    wire        b_small = b[30:23] == 8'd0;
    wire        c_small = c[30:23] == 8'd0;
    wire        a_small = a[30:23] == 8'd0;
    wire        y_small = ~op[3] & b_small;
    wire        z_small = op[2] | (op[3] ? b_small : c_small);

    wire [47:0] product;  // of the next stage
    takt_significand_product u_product (
        .clk(clk), .a({integers ? a[23] : ~a_small, a[22:0]}), .b({integers ? y[23] : ~y_small, y[22:0]}), .p(product)
    );
    wire [7:0]  excess = ({8{a[23]}} & b[7:0]) + ({8{b[23]}} & a[7:0]);  // of an integer product's upper byte

    wire        a_empty   = ~|a[22:0];
    wire        y_empty   = ~|y[22:0];
    wire        z_empty   = ~|z[22:0];
    wire        a_special = &a[30:23];
    wire        y_special = &y[30:23];
    wire        z_special = &z[30:23];
    wire        a_nan     = a_special & ~a_empty;
    wire        y_nan     = y_special & ~y_empty;
    wire        z_nan     = z_special & ~z_empty;
    wire        a_zero    = a_small & a_empty;
    wire        y_zero    = y_small & y_empty;
    wire        improper  = (a_special & a_empty & y_zero) | (a_zero & y_special & y_empty);  // 0 · ∞
    wire        opposed   = (a_special | y_special) & z_special & minus;  // infinities, if there is no NaN
    wire        any_nan   = a_nan | y_nan | z_nan;
    wire        signaling = (a_nan & ~a[22]) | (y_nan & ~y[22]) | (z_nan & ~z[22]);

    // Biased exponents; 1 for a subnormal number.
    wire [7:0]  a_exponent = {a[30:24], a[23] | a_small};
    wire [7:0]  y_exponent = {y[30:24], y[23] | y_small};
    wire [7:0]  z_exponent = {z[30:24], z[23] | z_small};
    wire [9:0]  exponents  = {2'd0, a_exponent} + {2'd0, y_exponent};
    wire [9:0]  distance   = exponents - {2'd0, z_exponent} - 10'd100;

    reg  [8:0]  distance1;   // places by which C goes to the right
    reg         at_top1;     // C stays at the top
    reg  [8:0]  above_p1;    // exponent of a number with its leading one in place 75, less 1: by that of the product
    reg  [7:0]  above_z1;    // by that of an addend that stays at the top
    reg  [23:0] c1;
    reg         minus1, p_sign1, z_sign1, nan1, infinite1, p_infinite1, invalid1, integers1;

    wire [9:0]  above_p = exponents - 10'd101;  // not used if negative: then C stays at the top
    wire        unused_above = above_p[9];

    always @(posedge clk) begin
        distance1   <= integers ? 9'd41 : distance[8:0];
        at_top1     <= ~integers & (distance[9] | a_zero | y_zero);
        above_p1    <= above_p[8:0];
        above_z1    <= z_exponent - 8'd1;
        c1          <= {~z_small, z[22:0]};
        if (integers) c1[22:15] <= excess;  // places 33 to 26
        integers1   <= integers;
        minus1      <= minus | integers;
        p_sign1     <= p_sign;
        z_sign1     <= z_sign;
        nan1        <= ~integers & (any_nan | improper | opposed);
        infinite1   <= ~integers & (a_special | y_special | z_special);
        p_infinite1 <= a_special | y_special;
        invalid1    <= ~integers & (signaling | improper | (opposed & ~any_nan));
    end

    // =============================================================== 2: product; aligned addend

    // Barrel shifter: by up to 3, by fours up to 12, by sixteens; only the last step can lose bits.
    wire [8:0]  right    = distance1 & {9{~at_top1}};
    wire [26:0] by1      = {c1, 3'd0} >> right[1:0];
    wire [38:0] by4      = {by1, 12'd0} >> {right[3:2], 2'd0};
    wire        at_0     = right[8:4] == 5'd0;
    wire        at_16    = right[8:4] == 5'd1;
    wire        at_32    = right[8:4] == 5'd2;
    wire        at_48    = right[8:4] == 5'd3;
    wire        at_64    = right[8:4] == 5'd4;
    wire        beyond   = ~(at_0 | at_16 | at_32 | at_48 | at_64);
    wire [75:0] aligned  =
        ({by4, 37'd0} & {76{at_0}}) | ({16'd0, by4, 21'd0} & {76{at_16}}) | ({32'd0, by4, 5'd0} & {76{at_32}}) |
        ({48'd0, by4[38:11]} & {76{at_48}}) | ({64'd0, by4[38:27]} & {76{at_64}});
    wire        lost     = (at_48 & (|by4[10:0])) | (at_64 & (|by4[26:0])) | (beyond & (|c1));

    reg  [47:0] product2;
    reg  [75:0] addend2;  // inverted, if it is to be subtracted
    reg         lost2;
    reg  [8:0]  above2;
    reg         minus2, p_sign2, z_sign2, nan2, infinite2, invalid2, integers2;

    always @(posedge clk) begin
        integers2 <= integers1;
        product2  <= product;
        addend2   <= aligned ^ {76{minus1}};
        lost2     <= lost;
        above2    <= at_top1 ? {1'b0, above_z1} : above_p1;
        minus2    <= minus1;
        // The finite side gets the infinite side's sign, so that the sum has it, too.
        p_sign2   <= infinite1 & ~p_infinite1 ? z_sign1 : p_sign1;
        z_sign2   <= infinite1 & p_infinite1 ? p_sign1 : z_sign1;
        nan2      <= nan1;
        infinite2 <= infinite1;
        invalid2  <= invalid1;
    end

    // =============================================================== 3: sum

    // P - C is P + ~C + 1, with the carry in left out if C has lost bits. C - P is ~(P + ~C); the carry of that sum is 1 if P is the
    // larger, as it always is if C has lost bits.
    wire [76:0] plain = {27'd0, product2, 2'd0} + {1'b0, addend2};
    wire [75:0] sum   = {26'd0, product2, 2'd0} + addend2 + {75'd0, minus2 & ~lost2};
    wire        swap  = minus2 & ~plain[76] & ~integers2;

    reg  [75:0] sum3;
    reg  [18:0] stop3;  // the nibble, from the top, at which the exponent is 1 to 4
    reg  [8:0]  above3;
    reg         lost3, minus3, sign3, nan3, infinite3, invalid3, integers3;

    genvar i;
    generate
        for (i = 0; i < 19; i = i + 1) begin : g_stop
            always @(posedge clk) begin
                stop3[i] <= above2[8:2] == i;
            end
        end
    endgenerate

    always @(posedge clk) begin
        integers3 <= integers2;
        sum3      <= swap ? ~plain[75:0] : sum;
        above3    <= above2;
        lost3     <= lost2;
        minus3    <= minus2;
        sign3     <= swap ? z_sign2 : p_sign2;
        nan3      <= nan2;
        infinite3 <= infinite2;
        invalid3  <= invalid2;
    end

    // =============================================================== 4: leading zeros, shift by nibbles

    // Nibbles are counted from the top. `some`: a nibble has a one; `ends`: or the count of zeros ends there.
    wire [19:0] some;
    wire [18:0] ends;
    generate
        for (i = 0; i < 19; i = i + 1) begin : g_nibble
            assign some[i] = |sum3[75 - 4*i -: 4];
            assign ends[i] = (|sum3[75 - 4*i -: 4]) | stop3[i];
        end
    endgenerate
    assign some[19] = 1'b0;

    // The first group of four nibbles that ends the count, the last if none does; in it the first nibble.
    wire [3:0]  group_ends = {|ends[15:12], |ends[11:8], |ends[7:4], |ends[3:0]};
    wire [2:0]  group;
    assign group[2] = ~|group_ends;
    assign group[1] = ~|group_ends[1:0] & (|group_ends[3:2]);
    assign group[0] = ~group_ends[0] & (group_ends[1] | (~group_ends[2] & group_ends[3]));

    wire [43:0] grouped =
        group[2] ? {sum3[11:0], 32'd0} :
        group[1] ? (group[0] ? {sum3[27:0], 16'd0} : sum3[43:0]) : (group[0] ? sum3[59:16] : sum3[75:32]);
    wire [2:0]  group_nibbles =
        group[2] ? ends[18:16] :
        group[1] ? (group[0] ? ends[14:12] : ends[10:8]) : (group[0] ? ends[6:4] : ends[2:0]);
    wire [3:0]  group_stops =
        group[2] ? {1'b0, stop3[18:16]} :
        group[1] ? (group[0] ? stop3[15:12] : stop3[11:8]) : (group[0] ? stop3[7:4] : stop3[3:0]);
    wire [1:0]  nibble = {~(group_nibbles[0] | group_nibbles[1]),
                          ~group_nibbles[0] & (group_nibbles[1] | ~group_nibbles[2])};

    // Sticky bits: the nibbles behind the 32 places that are kept, from the eighth after this one.
    wire [19:8] after;
    generate
        for (i = 8; i < 20; i = i + 1) begin : g_after
            assign after[i] = |some[19:i];
        end
    endgenerate
    wire [3:0]  group_after =
        group[2] | (group[1] & group[0]) ? 4'd0 :
        group[1] ? {after[19], after[18], after[17], after[16]} :
        group[0] ? {after[15], after[14], after[13], after[12]} : {after[11], after[10], after[9], after[8]};

    reg  [31:0] shifted4;
    reg  [4:0]  nibbles4;  // zeros before it, in fours
    reg         limited4;  // the exponent may become 1 within the first nibble
    reg  [8:0]  above4;
    reg         lost4, zero4, sign4, nan4, infinite4, invalid4, integers4;
    reg  [31:0] product4;  // of integers

    always @(posedge clk) begin
        integers4 <= integers3;
        product4  <= sum3[33:2];
        case (nibble)
            2'd0: shifted4 <= grouped[43:12];
            2'd1: shifted4 <= grouped[39:8];
            2'd2: shifted4 <= grouped[35:4];
            2'd3: shifted4 <= grouped[31:0];
        endcase
        nibbles4  <= {group, nibble};
        limited4  <= group_stops[nibble];
        above4    <= above3;
        lost4     <= lost3 | group_after[nibble];
        zero4     <= ~|some;
        sign4     <= sign3 & ~(minus3 & ~infinite3 & ~|some);
        nan4      <= nan3;
        infinite4 <= infinite3;
        invalid4  <= invalid3;
    end

    // =============================================================== 5: normalise, round

    // The leading zeros in the first nibble, limited to the place where the exponent is 1.
    wire [2:0]  first = shifted4[31:29] |
        {limited4 & (above4[1:0] == 2'd0), limited4 & (above4[1:0] == 2'd1), limited4 & (above4[1:0] == 2'd2)};
    wire [1:0]  zeros = {~(first[2] | first[1]), ~(first[2] | (~first[1] & first[0]))};

    reg  [24:0] kept;  // and the place after it
    reg         rest;
    always @* begin
        case (zeros)
            2'd0: {kept, rest} = {shifted4[31:7], |shifted4[6:0]};
            2'd1: {kept, rest} = {shifted4[30:6], |shifted4[5:0]};
            2'd2: {kept, rest} = {shifted4[29:5], |shifted4[4:0]};
            2'd3: {kept, rest} = {shifted4[28:4], |shifted4[3:0]};
        endcase
    end
    wire        up    = kept[0] & (rest | lost4 | kept[1]);

    // The leading one is added to the exponent field, and so is a carry of the rounding; beyond the largest number, that gives
    // infinity. Without a leading one the field is 0.
    wire [8:0]  field    = above4 - {2'd0, nibbles4, zeros};
    wire [30:0] rounded  = {field[7:0], kept[23:1]} + {7'd0, kept[24], 22'd0, up};
    wire        too_large          = field[8] | (field[7:0] >= 8'd254);
    wire        rounds_to_infinity = (field == 9'd253) & up & (&kept[24:1]);
    wire        special            = nan4 | infinite4;

    always @(posedge clk) begin
        result[31] <= sign4 & ~nan4;
        if (integers4) begin
            result <= product4;
        end else if (special | (too_large & ~zero4)) begin
            result[30:0] <= {8'hff, nan4, 22'd0};
        end else if (zero4) begin
            result[30:0] <= 31'd0;
        end else begin
            result[30:0] <= rounded;
        end
        flags <= {invalid4, 1'b0, ~special & ~zero4 & ~integers4 & (too_large | rounds_to_infinity)};
        if (~valid4) {result, flags} <= 35'd0;
    end

endmodule
