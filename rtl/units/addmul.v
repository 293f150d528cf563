// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_addmul: adder, multiplier and integer converter for binary32 in one shared pipeline, to save area; also multiplies integers of
// 24 bits.
//
// Contract
//   Operands and op on the inputs in one cycle, with in_valid, give result and flags on the outputs LATENCY - 1 cycles later,
//   with out_valid. One operation per cycle. No reset is needed: LATENCY cycles without in_valid empty the pipeline.
//   flags = {invalid, divide by zero, overflow}. Rounding is to nearest even, subnormals are supported (IEEE 754); every NaN
//   result is 7fc00000. An integer that does not fit saturates; a NaN gives the largest. Conversions ignore b.
//
//@ op 3'b000 fadd
//@ op 3'b001 fsub
//@ op 3'b010 fmul
//@ op 3'b011 imul24
//@ op 3'b100 itof
//@ op 3'b101 ftoi
//@ clears
//
// Method: all operations go through one right shift, one sum, one left shift and one rounding:
//   sum, difference   the operand of smaller magnitude, S, is aligned with the other, L, and added or subtracted
//   product           is shifted right if it is below the normal numbers, left if an operand was subnormal
//   itof              the sum is the integer's magnitude, 0 - x or 0 + x; the left shift normalises it
//   ftoi              is shifted right to its place; the sum rounds and negates: with n for the integer part and up (0 or 1)
//                     for rounding, -(n + up) = ~n + ~up
//   imul24            the product of the low 24 bits without their signs; the sum takes 2^24 (s_a b + s_b a) from it, with s for a
//                     sign bit, as (a - 2^24 s_a)·(b - 2^24 s_b) demands modulo 2^32
//
// The datapath has places 32 to 0. Bits shifted out below are ORed to a sticky bit. The lower part of a product, `below`, is in
// places -1 to -15; it is not shifted right with the rest, since a product that is shifted right is never shifted left. S and L
// have their leading ones in place 31, a product in 32 or 31; an integer is in places 32 to 1. `exponent` is one less than the
// exponent field of a number with its leading one in place 32, because the leading one is added to it when the result is rounded.
// The left shift stops where the exponent is 0.
//
// Pipeline
//   1  swapped operands     S and L; difference or sum of the exponents; partial products
//   2  product, distance    of the right shift
//   3  shifted right
//   4  sum
//   5  shifted left         by bytes
//   6  normalised
//   7  rounded              the result

module takt_addmul #(
    parameter LATENCY = 8
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire [2:0]  op,
    input  wire [31:0] a,
    input  wire [31:0] b,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    generate
        if (LATENCY != 8) begin : g_latency
            takt_addmul_has_latency_8 unsupported ();
        end
    endgenerate

    reg [6:1] valid;
    always @(posedge clk) {out_valid, valid} <= {valid, in_valid};

    // =============================================================== 1: compare and swap

    wire        multiplies = op[1];
    wire        converts   = op[2];
    wire        from_integer = op[2] & ~op[0];
    wire        integers   = op[1] & op[0];   // imul24
    wire        of_floats  = ~op[2] & ~integers;

    wire        b_sign  = b[31] ^ op[0];
    wire        a_small = a[30:23] == 8'd0;  // zero or subnormal: the same exponent as that of a field of 1
    wire        b_small = b[30:23] == 8'd0;
    wire [7:0]  a_exponent = {a[30:24], a[23] | a_small};
    wire [7:0]  b_exponent = {b[30:24], b[23] | b_small};
    wire        b_larger = {1'b0, a[30:0]} < {converts, b[30:0]};  // the operand of a conversion is S

    wire        a_empty   = ~|a[22:0];
    wire        b_empty   = ~|b[22:0];
    wire        a_special = &a[30:23];
    wire        b_special = &b[30:23];
    wire        a_nan     = a_special & ~a_empty;
    wire        b_nan     = b_special & ~b_empty;
    // 0 · ∞, or infinities of opposed signs, if there is no NaN.
    wire        improper  = multiplies ? (a_special & b_small & b_empty) | (b_special & a_small & a_empty)
                                       : a_special & b_special & (a[31] ^ b_sign);

    wire [47:0] product;    // of the next stage
    takt_significand_product #(.SMALL(1)) u_product (
        .clk(clk), .a({integers ? a[23] : ~a_small, a[22:0]}), .b({integers ? b[23] : ~b_small, b[22:0]}), .p(product)
    );
    // What the signs of integers add to the upper byte of their product; otherwise 0.
    wire [7:0]  excess = ({8{integers & a[23]}} & b[7:0]) + ({8{integers & b[23]}} & a[7:0]);

    // The carry in is made by an extra place below the others.
    wire [9:0]  other     = converts ? -10'd157 : {2'd0, b_exponent} ^ {10{~multiplies}};
    wire [10:0] exponents = {2'd0, a_exponent, 1'b1} + {other, ~multiplies & ~converts};

    reg [31:8] s1, l1;
    reg [39:32] above1;     // of an integer, which is in places 39 to 8
    reg [7:0]  exponent1;   // of L
    reg [7:0]  excess1;
    reg [9:0]  distance1;   // exponent of a less that of b; their sum; exponent of a less 157
    reg        multiplies1, converts1, from_integer1, subtracts1, sign1, nan1, special1, invalid1, empty1, high1, integers1;

    always @(posedge clk) begin
        s1            <= b_larger ? {from_integer ? a[23] : ~a_small, a[22:0]} : {~b_small, b[22:0]};
        l1            <= b_larger ? {~b_small, b[22:0]} : {~a_small, a[22:0]};
        if (multiplies | converts) l1 <= 24'd0;
        excess1       <= excess;
        above1        <= a[31:24];
        if (~from_integer) above1 <= 8'd0;
        exponent1     <= b_larger ? b_exponent : a_exponent;
        distance1     <= exponents[10:1];
        multiplies1   <= multiplies;
        converts1     <= converts;
        from_integer1 <= from_integer;
        subtracts1    <= ~multiplies & (a[31] ^ (b_sign & ~converts));
        sign1         <= (multiplies ? a[31] ^ b[31] : b_larger & ~converts ? b_sign : a[31]);
        integers1     <= integers;
        nan1          <= of_floats & (a_nan | b_nan | improper);
        special1      <= of_floats & (a_special | b_special);
        invalid1      <= of_floats & ((a_nan & ~a[22]) | (b_nan & ~b[22]) | (improper & ~a_nan & ~b_nan));
        empty1        <= a_empty;
        high1         <= ~a[31] | a_nan;
    end

    // =============================================================== 2: product; distance

    // A product whose exponents' sum is below 127 is shifted right by the difference.
    wire        minus    = multiplies1 | converts1 | distance1[9];
    wire [10:0] to_right = {distance1 ^ {10{minus}}, 1'b1} + {3'd0, {7{multiplies1}}, minus};
    wire [9:0]  distance = to_right[10:1];
    wire        to_integer1 = converts1 & ~from_integer1;
    wire        too_large   = to_integer1 & distance[9];
    wire        shifts      = ~distance[9] & ~integers1;

    reg [32:0]  s2;
    reg [14:0]  below2;
    reg [39:33] above2;
    reg [31:8]  l2;
    reg [4:0]   right2;
    reg         beyond2;    // so far to the right that nothing is left
    reg [9:0]   distance2;
    reg [7:0]   exponent2;
    reg         multiplies2, to_integer2, too_large2, subtracts2, sign2, nan2, special2, invalid2, integers2;

    always @(posedge clk) begin
        s2[32:8]    <= multiplies1 ? product[47:23] : {above1[32], s1};
        s2[7:0]     <= product[22:15];
        below2      <= product[14:0];
        if (~multiplies1) {s2[7:0], below2} <= 23'd0;
        above2      <= above1[39:33];
        l2          <= l1;
        l2[16:9]    <= l1[16:9] - excess1;  // of a product, l1 is 0
        right2      <= distance[4:0] & {5{shifts}};
        beyond2     <= distance[9] ? to_integer1 : ~integers1 & (|distance[8:5]);
        exponent2   <= exponent1;
        if (from_integer1) begin
            right2    <= 5'd7;
            beyond2   <= 1'b0;
            exponent2 <= 8'd157;
        end
        integers2   <= integers1;
        distance2   <= distance;
        multiplies2 <= multiplies1;
        to_integer2 <= to_integer1;
        too_large2  <= too_large;
        subtracts2  <= too_large ? high1 : subtracts1;
        sign2       <= sign1;
        nan2        <= nan1;
        special2    <= special1 | nan1;
        invalid2    <= invalid1 | (too_large & ~(sign1 & empty1 & (distance == 10'h3ff)));  // but for -2^31
    end

    // =============================================================== 3: right shift

    wire [32:0] by16 = beyond2 ? 33'd0 : right2[4] ? {16'd0, s2[32:16]} : s2;
    wire [32:0] by8  = right2[3] ? {8'd0, by16[32:8]} : by16;
    wire [32:0] by4  = right2[2] ? {above2[36:33], by8[32:4]} : by8;
    wire [32:0] by2  = right2[1] ? {above2[38:37], by4[32:2]} : by4;
    wire [32:0] by1  = right2[0] ? {above2[39], by2[32:1]} : by2;
    // Beyond all places, not even the sticky bit matters: the value is far below half a unit.
    wire        lost =
        (right2[4] & (|s2[15:0])) | (right2[3] & (|by16[7:0])) | (right2[2] & (|by8[3:0])) |
        (right2[1] & (|by4[1:0])) | (right2[0] & by2[0]);
    wire [9:0]  product_exponent = 10'd0 - distance2;

    reg [32:0]  s3;
    reg [14:0]  below3;
    reg [31:8]  l3;
    reg         lost3;
    reg [8:0]   exponent3;
    reg         to_integer3, too_large3, subtracts3, sign3, nan3, special3, invalid3, integers3;

    always @(posedge clk) begin
        s3          <= by1 ^ {33{subtracts2}};
        below3      <= below2;
        l3          <= l2;
        lost3       <= lost;
        exponent3   <= multiplies2 ? product_exponent[8:0] & {9{distance2[9]}} : {1'b0, exponent2};
        to_integer3 <= to_integer2;
        integers3   <= integers2;
        too_large3  <= too_large2;
        subtracts3  <= subtracts2;
        sign3       <= sign2;
        nan3        <= nan2;
        special3    <= special2;
        invalid3    <= invalid2;
    end

    // =============================================================== 4: sum

    // An integer is rounded here: place 0 is the first after its point, and two ones added there carry into place 1.
    wire        half   = s3[0] ^ subtracts3;
    wire        odd    = s3[1] ^ subtracts3;
    wire        up     = to_integer3 & ~too_large3 & ((half & (lost3 | odd)) ^ subtracts3);
    wire        one    = to_integer3 ? up : subtracts3 & ~lost3;
    wire [33:0] sum    = {1'b0, l3, 7'd0, up, 1'b1} + {s3, one};

    reg [32:0]  sum4;
    reg [14:0]  below4;
    reg         lost4;
    reg [8:0]   exponent4;
    reg [3:1]   allowed4;   // as many bytes to the left
    reg         to_integer4, saturates4, cancels4, sign4, nan4, special4, invalid4, integers4;

    always @(posedge clk) begin
        sum4        <= sum[33:1];
        below4      <= below3;
        lost4       <= lost3;
        exponent4   <= exponent3;
        allowed4[1] <= |exponent3[8:3];
        allowed4[2] <= |exponent3[8:4];
        allowed4[3] <= (|exponent3[8:5]) | (&exponent3[4:3]);
        if (to_integer3) allowed4 <= 3'd0;
        to_integer4 <= to_integer3;
        integers4   <= integers3;
        saturates4  <= too_large3;
        cancels4    <= subtracts3;
        sign4       <= sign3;
        nan4        <= nan3;
        special4    <= special3;
        invalid4    <= invalid3;
    end

    // =============================================================== 5: to the left by bytes; an integer by one, a product of two by three

    wire        none3  = ~|sum4[32:25];
    wire        none2  = ~|sum4[24:17];
    wire        none1  = ~|sum4[16:9];
    wire        bytes1 = (none3 & allowed4[1]) | to_integer4;
    wire        bytes2 = none3 & none2 & allowed4[2];
    wire        bytes3 = none3 & none2 & none1 & allowed4[3];
    wire [1:0]  bytes  = {bytes2, bytes3 | (bytes1 & ~bytes2)} | {2{integers4}};
    wire [5:0]  exponent_bytes = exponent4[8:3] - {4'd0, bytes};

    reg [32:0]  moved5;
    reg         lost5, zero5;
    reg [8:0]   exponent5;
    reg         to_integer5, cancels5, sign5, nan5, special5, invalid5;

    always @(posedge clk) begin
        case (bytes)
            2'd0: moved5 <= sum4;
            2'd1: moved5 <= {sum4[24:0], below4[14:7]};
            2'd2: moved5 <= {sum4[16:0], below4, 1'b0};
            2'd3: moved5 <= {sum4[8:0], below4, 9'd0};
        endcase
        lost5       <= lost4 | (~bytes2 & (|below4[6:0])) | (~bytes1 & (|below4[14:7]));
        zero5       <= none3 & none2 & none1 & ~|sum4[8:0];
        exponent5   <= to_integer4 ? {1'b0, sum4[31:24]} : integers4 ? {1'b0, sum4[15:8]} : {exponent_bytes, exponent4[2:0]};
        to_integer5 <= to_integer4 | integers4;
        cancels5    <= cancels4;
        sign5       <= to_integer4 ? sum4[32] ^ saturates4 : integers4 ? sum4[16] : sign4;
        nan5        <= nan4;
        special5    <= special4;
        invalid5    <= invalid4;
    end

    // =============================================================== 6: by up to seven places

    // at_least[n]: n places are allowed.
    wire [7:1] at_least;
    genvar i;
    generate
        for (i = 1; i < 8; i = i + 1) begin : g_at_least
            assign at_least[i] = ~to_integer5 & ((|exponent5[8:3]) | (exponent5[2:0] >= i));
        end
    endgenerate

    wire        left4 = ~|moved5[32:29] & at_least[4];
    wire        left2 = left4 ? ~|moved5[28:27] & at_least[6] : ~|moved5[32:31] & at_least[2];
    wire        left1 = left4 ? (left2 ? ~moved5[26] & at_least[7] : ~moved5[28] & at_least[5])
                              : (left2 ? ~moved5[30] & at_least[3] : ~moved5[32] & at_least[1]);
    wire [32:0] moved4 = left4 ? {moved5[28:0], 4'd0} : moved5;
    wire [32:0] moved2 = left2 ? {moved4[30:0], 2'd0} : moved4;

    reg [32:8]  number6;
    reg         lost6;
    reg [7:0]   exponent6;
    reg [2:0]   left6;
    reg         leading6;   // adds itself to the exponent
    reg         least_255, is_254;
    reg         to_integer6, sign6, nan6, special6, invalid6;

    always @(posedge clk) begin
        number6     <= left1 ? moved2[31:7] : moved2[32:8];
        leading6    <= (left1 ? moved2[31] : moved2[32]) & ~to_integer5;
        lost6       <= lost5 | (|moved2[6:0]) | (moved2[7] & ~left1);
        exponent6   <= exponent5[7:0];
        left6       <= {left4, left2, left1};
        least_255   <= exponent5[8] | (&exponent5[7:0]);
        is_254      <= (&exponent5[7:1]) & ~exponent5[0];
        if (zero5) begin
            exponent6 <= 8'd0;
            left6     <= 3'd0;
            least_255 <= 1'b0;
            is_254    <= 1'b0;
        end
        to_integer6 <= to_integer5;
        sign6       <= sign5 & ~(zero5 & cancels5);
        nan6        <= nan5;
        special6    <= special5;
        invalid6    <= invalid5;
    end

    // =============================================================== 7: round

    // Leading one and shift on the exponent: 1 - left, or -left. Rounding's carry may take it to infinity's.
    wire        rounds   = number6[8] & (lost6 | number6[9]) & ~to_integer6;
    wire [3:0]  change   = {3'd0, leading6} - {1'b0, left6};
    wire [31:0] rounded  = {exponent6, number6[31:9], 1'b1} + {{5{change[3]}}, change[2:0], 23'd0, rounds};
    // The numbers concerned here are shifted by less than two places.
    wire        overflows = ~to_integer6 & (least_255 | (is_254 & ~|left6));

    always @(posedge clk) begin
        result[31]    <= sign6 & ~nan6;
        result[30:23] <= rounded[31:24];
        result[22]    <= special6 | overflows ? nan6 : rounded[23];
        result[21:0]  <= rounded[22:1];
        if (special6 | overflows) begin
            result[30:23] <= 8'hff;
            result[21:0]  <= 22'd0;
        end
        flags <= {invalid6, 1'b0, ~special6 & ~to_integer6 & (overflows | (&rounded[31:24]))};
        if (~valid[6]) {result, flags} <= 35'd0;
    end

    wire unused = &{1'b0, exponents[0], to_right[0], product_exponent[9], number6[32], rounded[0], sum[0]};

endmodule
