// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_arccosine: iterative arccosine of a binary32 number, by table lookup and digit recurrence, without a multiplier.
//
// Contract
//   Operand on the inputs in one cycle, with in_valid, gives result and flags on the outputs LATENCY - 1 cycles later, with
//   out_valid. An iterative unit: the next operation may follow INTERVAL cycles later, no sooner. No reset is needed: LATENCY
//   cycles without in_valid empty the unit.
//   flags = {invalid, divide by zero, overflow}. The meaning, bit for bit, is isa/src/fp/acos.rs: in [0, pi]; invalid and
//   7fc00000 beyond 1 and for a NaN.
//
//@ op - facos
//@ clears
//
// Method (acos.rs gives reasons and widths): with t = 1 - |x|, acos |x| = sqrt(2 t) G(t). G is a piecewise linear function from a
// table, its slope multiplied digit by digit. The square root is a digit recurrence of two bits per cycle, and each of its digits
// adds its multiple of G. For a negative x the result is pi minus that.
//
// Schedule: at[k] = 1 in stage k of an operation; its operand is on the inputs in stage 0.
//   0      |x|, 30 bits after the point
//   1      t
//   2, 3   the table is read; 2 t is normalised to [1, 4)
//   4-17   the root's digits
//   4-10   the slope times the place in the segment
//   11     G
//   12-25  G times the root's digits
//   26     aligned for a subtraction from pi, if there is one
//   27     subtracted from pi, if x is negative
//   28     rounded into the outputs
// No operation uses a register for more than 16 cycles: values needed at the end are copied on in stage 18.

module takt_arccosine #(
    parameter LATENCY  = 30,
    parameter INTERVAL = 16
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire [31:0] a,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    generate
        if (LATENCY != 30 || INTERVAL < 16) begin : g_latency
            takt_arccosine_has_latency_30_and_interval_16 unsupported ();
        end
    endgenerate

    localparam [30:0] ONE       = 31'h3f800000;
    localparam [31:0] HALF_TURN = 32'hc90fdaa2; // pi, 30 bits after the point

    reg [28:1] at;
    always @(posedge clk) begin
        at        <= {at[27:1], in_valid};
        out_valid <= at[28];
    end

    // ---- 0, 1: |x| and t = 1 - |x|

    wire [30:0] by16 = ~a[27] ? {16'd0, 1'b1, a[22:9]} : {1'b1, a[22:0], 7'd0};
    wire [30:0] by8  = ~a[26] ? {8'd0, by16[30:8]} : by16;
    wire [30:0] by4  = ~a[25] ? {4'd0, by8[30:4]} : by8;
    wire [30:0] by2  = ~a[24] ? {2'd0, by4[30:2]} : by4;
    wire [30:0] by1  = ~a[23] ? {1'd0, by2[30:1]} : by2;

    reg [30:0] magnitude_1, t_2;
    reg        negative_1, refused_1, negative_2, refused_2;
    always @(posedge clk) begin
        magnitude_1 <= a[30:23] < 8'd96 ? 31'd0 : by1;
        negative_1  <= a[31];
        refused_1   <= a[30:0] > ONE;
        t_2         <= 31'h40000000 - magnitude_1;
        negative_2  <= negative_1;
        refused_2   <= refused_1;
    end

    // ---- 2, 3: t = 1 is in the last segment; 2 t normalised by pairs of bits

    wire [23:0] t_table = t_2[29:6] | {24{t_2[30]}};
    wire [26:0] value;
    wire [14:0] slope;
    takt_arccosine_table function_g (.clk(clk), .row(t_table[23:14]), .value(value), .slope(slope));

    wire        eight_2 = ~|t_2[30:15];
    wire [31:0] r16     = eight_2 ? {t_2[14:0], 17'd0} : {t_2, 1'b0};
    wire        four_2  = ~|r16[31:24];
    reg  [31:0] radicand_3;
    reg  [13:0] place_3;
    reg         eight, four, negative, refused, zero;
    always @(posedge clk) if (at[2]) begin
        radicand_3 <= four_2 ? {r16[23:0], 8'd0} : r16;
        place_3    <= t_table[13:0];
        eight      <= eight_2;
        four       <= four_2;
        negative   <= negative_2;
        refused    <= refused_2;
        zero       <= ~|t_2;
    end
    wire        two_3 = ~|radicand_3[31:28];
    wire [31:0] r4    = two_3 ? {radicand_3[27:0], 4'd0} : radicand_3;
    wire        one_3 = ~|r4[31:30];
    wire [31:0] r2    = one_3 ? {r4[29:0], 2'd0} : r4;

    // ---- 4-17: two bits of the root, by restoring square root. With q, the root so far in units of its last bit, the next bit
    //            is 1 if 4 q + 1 is not more than the remainder followed by the radicand's next two bits; it is then subtracted

    reg [27:0] rest;                    // what remains, at most 2 q
    reg [26:0] q;
    reg [29:0] radicand;                // the bits to come
    reg        two, one;
    wire [30:0] first    = {1'b0, rest, radicand[29:28]} - {2'b0, q, 2'd1};
    wire [31:0] second_0 = {rest, radicand[29:26]} - {2'd0, q, 3'd1};
    // The second bit in case the first is 1 is computed in parallel: the subtrahend 4 (4 q + 1) + 8 q + 5 on one carry chain.
    wire [31:0] second_1 = {rest, radicand[29:26]} - {1'b0, q, 4'd4} - {2'd0, q, 3'd5};
    wire        high     = ~first[30];
    wire        low      = ~(high ? second_1[31] : second_0[31]);
    always @(posedge clk) begin
        if (at[3]) begin
            // The square of the root's leading bit, 1, has been subtracted.
            rest     <= {26'd0, r2[31] & r2[30], r2[31] & ~r2[30]};
            q        <= 27'd1;
            radicand <= r2[29:0];
            two      <= two_3;
            one      <= one_3;
        end else begin
            rest     <= high ? (low ? second_1[27:0] : {first[25:0], radicand[27:26]})
                             : (low ? second_0[27:0] : {rest[23:0], radicand[29:26]});
            q        <= {q[24:0], high, low};
            radicand <= {radicand[25:0], 4'd0};
        end
    end

    reg [15:0] digits;                  // the last ones, to wait for G
    always @(posedge clk) digits <= {digits[13:0], high, low};

    // ---- 4-10: the slope times the position in the segment, which is relative to its middle; two bits per cycle

    reg  [26:0] value_4;
    reg  [14:0] slope_4;
    reg  [13:0] place;
    // With its first bit inverted, the position is in two's complement, relative to the middle.
    reg  [28:0] product;
    wire        less     = at[4] & ~place[13];
    wire [15:0] doubled  = {slope_4 & {15{at[4] ^ place[13]}}, 1'b0};
    wire [28:0] multiple = {14'd0, slope_4 & {15{place[12]}}} + ({13'd0, doubled} ^ {29{less}}) + {28'd0, less};
    always @(posedge clk) begin
        if (at[3]) begin
            value_4 <= value;
            slope_4 <= slope;
            place   <= place_3;
            product <= 29'd0;
        end else begin
            place   <= {place[11:0], 2'd0};
            product <= {product[26:0], 2'd0} + multiple;
        end
    end

    // ---- 11-25: G, 30 bits after the point, and its multiples

    wire [30:0] g = {4'b1000, value_4} + {{13{product[28]}}, product[28:11]};
    reg  [30:0] addend;
    reg  [31:0] sum;
    always @(posedge clk) begin
        addend <= at[11] ? {2'd0, g[30:2]} : {2'd0, addend[30:2]};
        sum    <= at[11] ? {1'b0, g}
                         : sum + {1'b0, addend & {31{digits[14]}}} + {addend & {31{digits[15]}}, 1'b0};
    end

    // ---- 18: copies for the last stages

    reg       negative_19, refused_19, zero_19;
    reg [3:0] e_19;
    always @(posedge clk) if (at[18]) begin
        negative_19 <= negative;
        refused_19  <= refused;
        zero_19     <= zero;
        e_19        <= {eight, four, two, one};
    end

    // ---- 26-28: to its place; from pi; rounded to nearest, by adding half a unit. The result is in [1, 4) 2^-e

    reg  [31:0] shifted, angle;
    reg  [7:0]  field;                  // of a result in [1, 2)
    wire [3:0]  places  = e_19 & {4{negative_19}};
    wire [30:0] rounded = {field + {7'd0, angle[31]}, angle[31] ? angle[30:8] : angle[29:7]} + {30'd0, angle[31] ? angle[7] : angle[6]};
    always @(posedge clk) begin
        shifted <= zero_19 ? 32'd0 : sum >> places;
        angle   <= negative_19 ? HALF_TURN - shifted : shifted;
        field   <= negative_19 ? 8'd127 : 8'd127 - {4'd0, e_19};
        result  <= refused_19 ? 32'h7fc00000 : {1'b0, rounded & {31{negative_19 | ~zero_19}}};
        flags   <= {refused_19, 2'b00};
        if (~at[28]) {result, flags} <= 35'd0;
    end

    wire unused = &{1'b0, second_0[30:28], second_1[30:28], first[29:26], product[10:0], angle[5:0]};

endmodule
