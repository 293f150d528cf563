// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_sine: pipelined sine and cosine of a binary32 number of radians, by table lookup and quadratic interpolation in fixed
// point, with three multipliers.
//
// Contract
//   Operand on the inputs in one cycle, with in_valid, gives result and flags on the outputs LATENCY - 1 cycles later, with
//   out_valid. One operation per cycle. No reset is needed: LATENCY cycles without in_valid empty the pipeline.
//   flags = {invalid, divide by zero, overflow}. The meaning, bit for bit, is isa/src/fp/sin.rs: invalid and 7fc00000 for
//   magnitudes beyond 402.12384, and for a NaN.
//
//@ op 1'b0 fsin
//@ op 1'b1 fcos
//@ clears
//
// Method (sin.rs gives reasons and widths): argument reduction by the nearest multiple of pi/2, k pi/2, leaves r = |x| - k pi/2. The
// result is n - n V(r): for the sine of r, n = |r| normalised and V = 1 - sin(r)/r; for the cosine of r, n = 1 and
// V = 1 - cos(r). V is approximated by a piecewise quadratic polynomial.
//
// Pipeline
//   1   aligned              |x| with 27 bits after the point
//   2   multiple             k
//   3   table                of k pi/2, is read
//   4   multiple of pi/2     out of the table
//   5   remainder            r
//   6   segment              |r|; the table of coefficients is read; n, normalised over stages 6 to 9
//   7   coefficients         into the first multiplier: h, the position in the segment, and c1
//   8   linear term          h c1; c0 + c2 h^2, which comes from a table
//   9   polynomial           V; into the second multiplier, with n
//   10  product              of n and V; the one with the low bits of V is computed in logic
//   11  sums
//   12  difference           n - n V
//   13  rounded              the result

module takt_sine #(
    parameter LATENCY = 14
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire        op,
    input  wire [31:0] a,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    generate
        if (LATENCY != 14) begin : g_latency
            takt_sine_has_latency_14 unsupported ();
        end
    endgenerate

    localparam [30:0] LIMIT    = 31'h43c90fda;  // largest accepted magnitude
    localparam [7:0]  IDENTITY = 8'd115;        // exponent field, below which the sine is its argument and the cosine 1

    reg [12:1] valid;
    always @(posedge clk) {out_valid, valid} <= {valid, in_valid};

    // =============================================================== 1: |x| with 27 bits after the point

    // Right shift by 135, the exponent field of the largest magnitudes, minus the exponent field, modulo 32.
    wire [4:0]  right = {a[27] ^ a[26], a[26], ~a[25:23]};
    wire [35:0] by16  = right[4] ? {16'd0, 1'b1, a[22:4]} : {1'b1, a[22:0], 12'd0};
    wire [35:0] by8   = right[3] ? {8'd0, by16[35:8]} : by16;
    wire [35:0] by4   = right[2] ? {4'd0, by8[35:4]} : by8;
    wire [35:0] by2   = right[1] ? {2'd0, by4[35:2]} : by4;
    wire [35:0] by1   = right[0] ? {1'd0, by2[35:1]} : by2;

    reg [35:0] fixed1;
    reg        tiny1, op1, sign1, refused1;
    reg [30:0] x1;
    always @(posedge clk) begin
        fixed1   <= by1;
        tiny1    <= a[30:23] < IDENTITY;
        op1      <= op;
        sign1    <= a[31] & ~op;    // the cosine is even
        refused1 <= a[30:0] > LIMIT;
        x1       <= a[30:0];
    end

    // =============================================================== 2: k = fixed 163/256, rounded

    wire [14:0] whole = fixed1[35:21];          // 6 bits after the point
    wire [17:0] by_5  = {1'b0, whole, 2'd0} + {3'd0, whole};
    wire [16:0] by_3  = {1'b0, whole, 1'b0} + {2'd0, whole};
    wire [22:0] by163 = {by_5, 5'b0} + {6'd0, by_3} + 23'd8192;

    reg [8:0]  k;
    reg [27:0] fixed2;                          // modulo 2
    reg        tiny2, op2, sign2, refused2;
    reg [30:0] x2;
    always @(posedge clk) begin
        k      <= by163[22:14];
        fixed2 <= fixed1[27:0];
        {tiny2, op2, sign2, refused2, x2} <= {tiny1, op1, sign1, refused1, x1};
    end

    // =============================================================== 3: the table of k pi/2

    wire [56:0] multiple;
    takt_quarter_table multiples (.clk(clk), .k(k), .value(multiple));

    reg [27:0] fixed3;
    reg        first3, op3, tiny3, sign3, refused3;
    reg [1:0]  quadrant3;
    reg [30:0] x3;
    always @(posedge clk) begin
        first3    <= tiny2 | (k == 9'd0);
        quadrant3 <= k[1:0] & {2{~tiny2}};
        {fixed3, tiny3, op3, sign3, refused3, x3} <= {fixed2, tiny2, op2, sign2, refused2, x2};
    end

    // =============================================================== 4: out of the block RAM

    reg [56:0] multiple4;
    reg [27:0] fixed4;
    reg        first4, cosine4, tiny4, negative4, refused4;
    reg [30:0] x4;
    always @(posedge clk) begin
        multiple4 <= multiple;
        fixed4    <= fixed3;
        cosine4   <= quadrant3[0] ^ op3;
        negative4 <= sign3 ^ quadrant3[1] ^ (quadrant3[0] & op3);
        {first4, tiny4, refused4, x4} <= {first3, tiny3, refused3, x3};
    end

    // =============================================================== 5: r, 56 bits after the point

    // The value in the place of |r| in n: the operand's own significand, or 1 for a cosine.
    reg [56:0] r5;
    reg        given5, cosine5, tiny5, negative5, refused5;
    reg [22:0] given_fraction5;
    reg [7:0]  given_field5;
    always @(posedge clk) begin
        r5              <= {fixed4 + multiple4[56:29], multiple4[28:0]};
        given5          <= first4 | cosine4;
        given_fraction5 <= x4[22:0] & {23{~cosine4}};
        given_field5    <= cosine4 ? 8'd127 : x4[30:23];
        {cosine5, tiny5, negative5, refused5} <= {cosine4, tiny4, negative4, refused4};
    end

    // =============================================================== 6: |r|, by one's complement; n without 16 zeros

    wire        minus = r5[56];
    wire [55:0] r     = r5[55:0] ^ {56{minus}};
    wire [55:0] n0    = given5 ? {1'b1, given_fraction5, 32'd0} : r;
    wire        zeros16 = ~|n0[55:40];

    // The six leading bits of |h|, by one's complement; h is in two's complement.
    wire [17:0] h = {~r[46], r[45:29]};
    wire [45:0] coefficients;
    wire [7:0]  bend;
    takt_wave_table polynomials (
        .clk(clk),
        .row({cosine5, r[55:47]}), .coefficients(coefficients),
        .place({cosine5, r[55:51], h[16:11] ^ {6{h[17]}}}), .bend(bend)
    );

    reg [17:0] h6;
    reg [42:0] n6;
    reg        zeros16_6, given6, cosine6, tiny6, negative6, refused6;
    reg [7:0]  given_field6;
    always @(posedge clk) begin
        h6        <= h & {18{~tiny5}};
        n6        <= zeros16 ? {n0[39:0], 3'd0} : n0[55:13];
        zeros16_6 <= zeros16;
        negative6 <= negative5 ^ (minus & ~given5);
        {given6, given_field6, cosine6, tiny6, refused6} <= {given5, given_field5, cosine5, tiny5, refused5};
    end

    // =============================================================== 7: into the first multiplier; n without 8 zeros

    wire        zeros8 = ~|n6[42:35];
    wire [35:0] slope_product;
    takt_product #(.SIGNED_A(1), .INPUT_REGS(1)) slope (
        .clk(clk), .a(h6), .b(coefficients[17:0]), .p(slope_product)
    );

    reg [27:0] c0_7;
    reg [7:0]  bend7;
    reg [34:0] n7;
    reg        zeros16_7, zeros8_7, given7, cosine7, negative7, refused7;
    reg [7:0]  given_field7;
    always @(posedge clk) begin
        // A tiny operand's V is 0.
        c0_7     <= coefficients[45:18] & {28{~tiny6}};
        bend7    <= bend & {8{~tiny6}};
        n7       <= zeros8 ? n6[34:0] : n6[42:8];
        zeros8_7 <= zeros8;
        {zeros16_7, given7, given_field7, cosine7, negative7, refused7} <=
            {zeros16_6, given6, given_field6, cosine6, negative6, refused6};
    end

    // =============================================================== 8: slope's product; n without 4 zeros and 2

    wire        zeros4 = ~|n7[34:31];
    wire [30:0] n7_4   = zeros4 ? n7[30:0] : n7[34:4];
    wire        zeros2 = ~|n7_4[30:29];

    reg [27:0] c0_8;
    reg [28:0] n8;
    reg        zeros16_8, zeros8_8, zeros4_8, zeros2_8, given8, cosine8, negative8, refused8;
    reg [7:0]  given_field8;
    always @(posedge clk) begin
        c0_8     <= c0_7 + {20'd0, bend7};
        n8       <= zeros2 ? n7_4[28:0] : n7_4[30:2];
        zeros4_8 <= zeros4;
        zeros2_8 <= zeros2;
        {zeros16_8, zeros8_8, given8, given_field8, cosine8, negative8, refused8} <=
            {zeros16_7, zeros8_7, given7, given_field7, cosine7, negative7, refused7};
    end

    // =============================================================== 9: V, 29 bits after the point (27 are used); n

    wire        zeros1 = ~n8[28];
    wire [27:0] n      = zeros1 ? n8[27:0] : n8[28:1];
    wire [27:0] v      = c0_8 + {{8{slope_product[35]}}, slope_product[35:16]};

    // V of a sine is less than 1/8.
    wire [35:0] high_high;
    takt_product #(.INPUT_REGS(1)) products (.clk(clk), .a(n[27:10]), .b(v[25:8]), .p(high_high));
    wire [35:0] low_high;                       // the next 7 bits of n
    takt_product #(.INPUT_REGS(1)) low_products (.clk(clk), .a({11'd0, n[9:3]}), .b({10'd0, v[25:18]}), .p(low_high));

    reg [27:0] n9;
    reg [25:0] v9;
    reg [7:0]  field9;
    reg        cosine9, negative9, refused9;
    always @(posedge clk) begin
        n9        <= n;
        v9        <= v[27:2];
        field9    <= given8 ? given_field8 : 8'd126 - {3'd0, zeros16_8, zeros8_8, zeros4_8, zeros2_8, zeros1};
        {cosine9, negative9, refused9} <= {cosine8, negative8, refused8};
    end

    // =============================================================== 10: products; that with the low 6 bits of V row by row

    wire [7:0]  p = n9[27:20];
    reg  [9:0]  high_low01, high_low23, high_low45;
    reg  [27:0] n10;
    reg  [25:0] v10;
    reg  [7:0]  field10;
    reg         cosine10, negative10, refused10;
    always @(posedge clk) begin
        high_low01 <= {2'd0, p & {8{v9[0]}}} + {1'd0, p & {8{v9[1]}}, 1'd0};
        high_low23 <= {2'd0, p & {8{v9[2]}}} + {1'd0, p & {8{v9[3]}}, 1'd0};
        high_low45 <= {2'd0, p & {8{v9[4]}}} + {1'd0, p & {8{v9[5]}}, 1'd0};
        {n10, v10, field10, cosine10, negative10, refused10} <= {n9, v9, field9, cosine9, negative9, refused9};
    end

    // =============================================================== 11, 12: n - n V in (0.6, 2), 36 bits after the point

    wire [35:0] most = cosine10 ? {1'b0, v10, 9'd0} : {2'd0, high_high[35:2]};
    reg [36:0] most11, result12;
    reg [13:0] high_low11;
    reg [14:0] low_high11;
    reg [7:0]  field11, field12, less12;
    reg        cosine11, negative11, refused11, negative12, refused12;
    wire [16:0] least11 = {1'd0, high_low11, 2'd0} + {1'd0, low_high11, 1'd0};
    always @(posedge clk) begin
        most11     <= {n10, 9'd0} - {1'b0, most};
        high_low11 <= {4'd0, high_low01} + {2'd0, high_low23, 2'd0} + {high_low45, 4'd0};
        low_high11 <= low_high[14:0];
        result12   <= most11 - {20'd0, least11 & {17{~cosine11}}};
        field12    <= field11;
        less12     <= field11 - 8'd1;
        {field11, cosine11, negative11, refused11} <= {field10, cosine10, negative10, refused10};
        {negative12, refused12} <= {negative11, refused11};
    end

    // =============================================================== 13: rounded to nearest, by adding half a unit

    // The leading one is not added to the exponent field, which is therefore one less below 1.
    wire        one     = result12[36];
    wire [30:0] rounded = {one ? field12 : less12, one ? result12[35:13] : result12[34:12]} + {30'd0, one ? result12[12] : result12[11]};
    always @(posedge clk) begin
        result <= refused12 ? 32'h7fc00000 : {negative12, rounded};
        flags  <= {refused12, 2'b00};
        if (~valid[12]) {result, flags} <= 35'd0;
    end

    wire unused = &{1'b0, by163[13:0], slope_product[15:0], v[1:0], high_high[1:0], low_high[35:15], result12[10:0]};

endmodule
