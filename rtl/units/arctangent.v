// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_arctangent: iterative two-argument arctangent of binary32 numbers, by digit recurrence and table lookup, without a
// multiplier.
//
// Contract
//   Operands on the inputs in one cycle, with in_valid, give result and flags on the outputs LATENCY - 1 cycles later, with
//   out_valid. An iterative unit: the next operation may follow INTERVAL cycles later, no sooner. No reset is needed: LATENCY
//   cycles without in_valid empty the unit.
//   flags = {invalid, divide by zero, overflow}. The meaning, bit for bit, is isa/src/fp/atan.rs: the angle of (x, y) = (b, a) in
//   [-pi, pi]; invalid and 7fc00000 for a NaN.
//
//@ op - fatan2
//@ clears
//
// Method (atan.rs gives reasons and widths): a restoring radix-4 division of the lesser magnitude by the greater. Its first digits
// select an arctangent from a table. The remainder is then divided by a larger divisor, to which those digits' multiples of the
// dividend have been added (the argument reduction of the arctangent); this quotient is the rest of the angle. At the end, the
// octant is applied.
//
// Schedule: at[k] = 1 in stage k of an operation; its operands are on the inputs in stage 0.
//   0, 1   operands unpacked; the lesser and the greater
//   2      the first digit, which is 1: the quotient is normalised to [1, 2)
//   3-18   0 to 4 digits, two stages in which the divisor is completed, and the other digits, 14 in all
//   19     the table's angle, and the rest
//   20     aligned for a subtraction or addition of the octant, if there is one
//   21     octant
//   22     rounded into the outputs
// One operation at a time uses the registers of stages 3 to 18, and those of stages 19 to 22: the next is 16 cycles later.

module takt_arctangent #(
    parameter LATENCY  = 24,
    parameter INTERVAL = 16
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
        if (LATENCY != 24 || INTERVAL < 16) begin : g_latency
            takt_arctangent_has_latency_24_and_interval_16 unsupported ();
        end
    endgenerate

    localparam [31:0] HALF_TURN = 32'hc90fdaa4; // pi, 30 bits after the point: four times what atan.rs has for pi/4

    reg [22:1] at;
    always @(posedge clk) begin
        at        <= {at[21:1], in_valid};
        out_valid <= at[22];
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

    reg        steep_1, left_1, sign_1;
    reg [8:0]  fields_1;                // exponent fields' difference
    reg        steep_2, left_2, sign_2, nan_2, none_2;
    reg [8:0]  fields_2;                // that of the greater less that of the lesser
    reg [5:0]  zeros_2;                 // zeros of the lesser less those of the greater
    reg [23:0] lesser_2, greater_2;
    always @(posedge clk) begin
        steep_1   <= a[30:0] > b[30:0];
        left_1    <= b[31];
        sign_1    <= a[31];
        fields_1  <= {1'b0, b_exponent} - {1'b0, a_exponent};
        steep_2   <= steep_1;
        left_2    <= left_1;
        sign_2    <= sign_1;
        nan_2     <= a_nan | b_nan;
        // No division: 0, or a number over infinity.
        none_2    <= steep_1 ? b_zero | (a_infinite & ~b_infinite) : a_zero | (b_infinite & ~a_infinite);
        fields_2  <= steep_1 ? 9'd0 - fields_1 : fields_1;
        zeros_2   <= steep_1 ? {1'b0, b_zeros} - {1'b0, a_zeros} : {1'b0, a_zeros} - {1'b0, b_zeros};
        lesser_2  <= steep_1 ? b_significand : a_significand;
        greater_2 <= steep_1 ? a_significand : b_significand;
    end

    // ---- 2: the first digit; e, the quotient's exponent

    wire [24:0] once  = {1'b0, lesser_2} - {1'b0, greater_2};
    wire [24:0] twice = {lesser_2, 1'b0} - {1'b0, greater_2};
    wire        less  = once[24];
    wire [9:0]  e_once  = {fields_2[8], fields_2} + {{4{zeros_2[5]}}, zeros_2};
    wire [9:0]  e_twice = {fields_2[8], fields_2} + {{4{zeros_2[5]}}, zeros_2} + 10'd1;
    wire [9:0]  e_2     = less ? e_twice : e_once;

    reg        steep, left, sign, nan, none;
    reg [8:0]  e;
    reg [24:0] dividend;
    always @(posedge clk) if (at[2]) begin
        steep    <= steep_2;
        left     <= left_2;
        sign     <= sign_2;
        nan      <= nan_2;
        none     <= none_2;
        e        <= e_2[8:0];
        dividend <= less ? {lesser_2, 1'b0} : {1'b0, lesser_2};
    end

    // Digits that choose the row: 4 up to e = 3, then 3, 2, 1 for three e each, and none from 13 on. place = (e - 1) modulo 3 + 1. With
    // the last pattern yosys makes no table memory of it, which would take the register e along, behind this logic.
    wire      beyond = (|e[8:4]) | ((&e[3:2]) & (|e[1:0]));
    reg [4:0] first;                    // one of them: that many
    reg [1:0] place;
    always @* begin
        casez ({beyond, e[3:0]})
            5'd0:     {first, place} = {5'b10000, 2'd0};
            5'd1:     {first, place} = {5'b10000, 2'd1};
            5'd2:     {first, place} = {5'b10000, 2'd2};
            5'd3:     {first, place} = {5'b10000, 2'd3};
            5'd4:     {first, place} = {5'b01000, 2'd1};
            5'd5:     {first, place} = {5'b01000, 2'd2};
            5'd6:     {first, place} = {5'b01000, 2'd3};
            5'd7:     {first, place} = {5'b00100, 2'd1};
            5'd8:     {first, place} = {5'b00100, 2'd2};
            5'd9:     {first, place} = {5'b00100, 2'd3};
            5'd10:    {first, place} = {5'b00010, 2'd1};
            5'd11:    {first, place} = {5'b00010, 2'd2};
            5'd12:    {first, place} = {5'b00010, 2'd3};
            5'b1????: {first, place} = {5'b00001, 2'd0};
            default:  {first, place} = {5'b00001, 2'd0};
        endcase
    end

    // ---- 3-18: digits

    // The stages, from 4 on, in which the division pauses, and those at whose end the divisor changes. None of them is stage 3.
    reg [4:0] stands, changes;
    always @(posedge clk) begin
        stands  <= at[3] ? {first[4], first[4:1] | first[3:0]} : {1'b0, stands[4:1]};
        changes <= at[3] ? first : {1'b0, changes[4:1]};
    end
    wire still  = at[3] ? beyond : stands[0];
    wire change = ~at[3] & changes[0];

    reg  [28:0] divisor, grown, rest;   // 4 guard bits
    reg  [27:0] quotient;
    reg  [1:0]  digit_1, digit_2;       // the last two

    // Selects a digit of 2 or 3, or of 0 or 1. The differences with all multiples are computed in parallel, one carry
    // chain each. The difference with the triple has three terms, which a carry-save adder reduces to two.
    wire [31:0] less_1 = {1'b0, rest, 2'd0} - {3'd0, divisor};
    wire [31:0] less_2 = {1'b0, rest, 2'd0} - {2'd0, divisor, 1'b0};
    wire [31:0] minus_2d = ~{2'd0, divisor, 1'b0};
    wire [31:0] minus_d  = ~{3'd0, divisor};
    wire [31:0] partial  = {1'b0, rest, 2'd0} ^ minus_2d ^ minus_d;
    wire [31:0] carries  = ({1'b0, rest, 2'd0} & (minus_2d | minus_d)) | (minus_2d & minus_d);
    wire [31:0] less_3   = partial + {carries[30:0], 1'b1} + 32'd1;
    wire        high   = ~less_2[31];
    wire        low    = high ? ~less_3[31] : ~less_1[31];
    wire [28:0] next_high = less_3[31] ? less_2[28:0] : less_3[28:0];
    wire [28:0] next_low  = less_1[31] ? {rest[26:0], 2'd0} : less_1[28:0];

    // The divisor to be grows by the digits' multiples of the dividend.
    reg  [28:0] step;
    wire [5:0]  right  = {1'b0, e[3:0], 1'b0};
    wire [28:0] step_3 = |e[8:4] ? 29'd0 : {dividend, 4'd0} >> right;
    wire [28:0] next_grown = at[4] ? divisor + step : grown + (step & {29{digit_2[0]}}) + {step[27:0] & {28{digit_2[1]}}, 1'b0};

    reg  [9:0]  row;
    always @(posedge clk) begin
        if (at[2])       rest <= {1'b0, less ? twice[23:0] : once[23:0], 4'd0};
        else if (~still) rest <= high ? next_high : next_low;

        if (at[2])       divisor <= {1'b0, greater_2, 4'd0};
        else if (change) divisor <= next_grown;
        grown <= next_grown;
        step  <= at[3] ? step_3 : {2'd0, step[28:2]};

        digit_1 <= {high, low};
        digit_2 <= digit_1;
        if (change)      quotient <= 28'd0;
        else if (~still) quotient <= {quotient[25:0], high, low};

        if (change) begin
            row <= {10{first[4]}} & {place, quotient[7:1], quotient[0] | ~|place} |
                   {10{first[3]}} & {2'd0, place, quotient[5:0]} |
                   {10{first[2]}} & {4'd0, place, quotient[3:0]} |
                   {10{first[1]}} & {6'd0, place, quotient[1:0]};
        end
    end

    // The row stands from stage 9 at the latest: the block RAM's output has a register of its own before the sum.
    wire [30:0] table_angle;
    reg  [30:0] angle;
    takt_arctangent_table angles (.clk(clk), .row(row), .angle(table_angle));
    always @(posedge clk) angle <= table_angle;

    // ---- 18: state for the last stages

    wire        direct = ~steep & ~left;
    wire        tiny   = (e >= 9'd126); // the result may be subnormal
    wire [8:0]  places = ~direct ? e : tiny ? e - 9'd126 : 9'd0;
    reg         steep_19, left_19, sign_19, nan_19, zero_19, tiny_19, gone_19;
    reg  [4:0]  places_19;
    reg  [7:0]  field_19;               // of a result in [1/2, 1)
    always @(posedge clk) if (at[18]) begin
        steep_19  <= steep;
        left_19   <= left;
        sign_19   <= sign & ~nan;
        nan_19    <= nan;
        zero_19   <= direct & none;
        tiny_19  <= direct & tiny;
        gone_19   <= none | (|places[8:5]);
        places_19 <= places[4:0];
        field_19  <= direct ? 8'd126 - e[7:0] : 8'd126;
    end

    // ---- 19, 20: the angle, 30 bits after the point, to its place

    reg [31:0] sum, shifted, value;
    always @(posedge clk) begin
        sum     <= {1'b0, angle} + {2'd0, quotient, 2'd2};
        shifted <= gone_19 ? 32'd0 : sum >> places_19;
    end

    // ---- 21: from 0, pi/2 or pi, forward or back

    wire [31:0] axis = steep_19 ? {1'b0, HALF_TURN[31:1]} : left_19 ? HALF_TURN : 32'd0;
    wire        back = steep_19 ^ left_19;
    always @(posedge clk) value <= axis + (shifted ^ {32{back}}) + {31'd0, back};

    // ---- 22: rounded to nearest, by adding half a unit. A result that may be subnormal is in its place already

    wire        two     = value[31];
    wire        one     = value[30] | tiny_19;
    wire [7:0]  field   = tiny_19 ? {7'd0, value[30]} : two ? field_19 + 8'd2 : one ? field_19 + 8'd1 : field_19;
    wire [23:0] kept    = two ? value[30:7] : one ? value[29:6] : value[28:5];
    wire [30:0] rounded = {field, kept[23:1]} + {30'd0, kept[0]};
    always @(posedge clk) begin
        result <= nan_19 ? 32'h7fc00000 : {sign_19, rounded & {31{~zero_19}}};
        flags  <= {nan_19, 2'b00};
        if (~at[22]) {result, flags} <= 35'd0;
    end

    wire unused = &{1'b0, a_signaling, b_signaling, e_2[9], twice[24], value[4:0], less_1[30:29], less_2[30:29], less_3[30:29], carries[31]};

endmodule
