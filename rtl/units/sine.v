// takt_sine: the sine of a binary32 number of radians, in fixed point, on two multipliers.
//
// Contract
//   An operation whose operand stands on the inputs in one cycle, with in_valid, has its result and flags on the outputs,
//   with out_valid, LATENCY - 1 cycles later. The next may follow INTERVAL cycles after it, no sooner. No reset: after
//   LATENCY cycles without in_valid nothing is left of what was before.
//   flags = {invalid, divide by zero, overflow}. The meaning, bit for bit, is isa/src/fp/sin.rs: at most 0.517 ulp off for
//   magnitudes up to 402.12384, invalid and 7fc00000 beyond.
//
//@ op - fsin
//
// Method (sin.rs gives reasons and widths): y = |x| 2/pi with 60 bits after the point; the quadrant is its integer part,
// u its fraction or, in odd quadrants, the complement. A piecewise quadratic P(u) = c0 - h (|c1| + |c2| h) approximates
// sin(pi/2 u)/u, h being the place in the segment, and the result is u P(u).
//
// Schedule: at[k] = 1 in stage k of an operation, whose operand stands on the inputs in stage 0.
//   0-3    into the multipliers: the significand, in halves, and the digits of 2/pi, 18 bits each, from the least on
//   2-5    their sum, digit by digit: y. With the last the table is read
//   7      into the multipliers: h c2
//   7-11   u normalised
//   9      the slope d = |c1| + |c2| h; into the multipliers, with h, in two passes (9, 10)
//   11-12  P; into the multipliers, with n = u normalised, in two passes (12, 13)
//   14-15  n P
//   16     rounded into the outputs
// So the multipliers take operands at the end of stages 0-3, 7, 9, 10, 12, 13, and two operations never meet there if they
// are 14 cycles apart. Whatever else holds a value does so until the next operation writes it, 14 cycles later.

module takt_sine #(
    parameter LATENCY  = 18,
    parameter INTERVAL = 14
) (
    input  wire        clk,
    input  wire        in_valid,
    input  wire [31:0] a,
    output reg         out_valid,
    output reg  [31:0] result,
    output reg  [2:0]  flags
);

    generate
        if (LATENCY != 18 || INTERVAL < 14) begin : g_latency
            takt_sine_has_latency_18_and_interval_14 unsupported ();
        end
    endgenerate

    localparam [71:0] TWO_OVER_PI = 72'ha2f9836e4e441529fc;     // 72 bits after the point
    localparam [30:0] LIMIT       = 31'h43c90fda;               // largest accepted magnitude
    localparam [7:0]  IDENTITY    = 8'd115;                     // exponent field, below which the sine is its argument

    wire [16:0] at;
    reg  [16:1] at_later;
    assign at = {at_later, in_valid};
    always @(posedge clk) begin
        at_later  <= at[15:0];
        out_valid <= at[16];
    end

    wire [35:0] p0, p1;         // the multipliers' products, two stages after their operands

    // ---- 0-3: the significand times 2/pi

    // The constant, aligned to the exponent: shifted right by 135, the exponent field of the largest magnitudes, less the
    // exponent field, modulo 32. Written so that each bit is a table of its own.
    wire [4:0]  alignment = {a[27] ^ a[26], a[26], ~a[25:23]};
    localparam [103:0] PADDED = {32'd0, TWO_OVER_PI};
    wire [71:0] aligned;
    generate
        genvar i;
        for (i = 0; i < 72; i = i + 1) begin : g_aligned
            localparam [31:0] BITS = PADDED[i +: 32];
            assign aligned[i] = BITS[alignment];
        end
    endgenerate

    reg  [35:0] digits;         // the last two
    always @(posedge clk) digits <= at[0] ? aligned[71:36] : {18'd0, digits[35:18]};

    // ---- 2-5: the sum; the digits that the next ones do not change leave it

    // Where three operands overlap they are made two first.
    wire [29:0] carried  = at[2] ? 30'd0 : {5'd0, sum[42:18]};
    wire [17:0] parity   = carried[29:12] ^ p1[29:12] ^ p0[17:0];
    wire [17:0] majority = (carried[29:12] & p1[29:12]) | (carried[29:12] & p0[17:0]) | (p1[29:12] & p0[17:0]);
    wire [42:0] next_sum = {1'b0, p0[29:18], parity, carried[11:0]} + {12'd0, majority, 1'b0, p1[11:0]};
    reg  [42:0] sum;            // less than 2^24 2^18, and what the digit before leaves; with the last digit, y from 2^-33 on
    reg  [26:0] y_low;          // y's bits from 2^-34 to 2^-60
    always @(posedge clk) if (|at[5:2]) begin
        sum   <= next_sum;
        y_low <= {sum[17:0], y_low[26:18]};
    end

    wire        odd      = sum[33];
    wire        negative = sum[34];
    wire [59:0] u        = {sum[32:0], y_low} ^ {60{odd}};
    wire [17:0] h_high   = {~u[51], u[50:34]};      // less half the range of 24 bits: in two's complement
    wire [5:0]  h_low    = u[33:28];

    wire [31:0] value;
    wire [35:0] slopes;
    takt_sine_table coefficients (
        .clk(clk),
        .enable(at[5]),
        .row(next_sum[33:25]),
        .value(value),
        .slopes(slopes)
    );

    wire [13:0] c2 = slopes[13:0];      // magnitude, 14 bits after the point
    reg  [31:0] c0;                     // less 1, 32 bits after the point
    reg  [21:0] c1;                     // magnitude, 22 bits after the point
    always @(posedge clk) if (at[6]) begin
        c0 <= value;
        c1 <= slopes[35:14];
    end

    // ---- 7-11: u normalised, to 33 bits; a cosine, at most, has 28 zeros

    reg [47:0] n_7;
    reg [39:0] n_8;
    reg [35:0] n_9;
    reg [33:0] n_10;
    reg [14:0] n_low;
    reg [4:0]  zeros;
    wire [32:0] n = n_10[33] ? n_10[33:1] : n_10[32:0];
    always @(posedge clk) begin
        if (at[7]) begin
            n_7      <= |u[59:44] ? u[59:12] : {u[43:0], 4'd0};
            zeros[4] <= ~|u[59:44];
        end
        if (at[8]) begin
            n_8      <= |n_7[47:40] ? n_7[47:8] : n_7[39:0];
            zeros[3] <= ~|n_7[47:40];
        end
        if (at[9]) begin
            n_9      <= |n_8[39:36] ? n_8[39:4] : n_8[35:0];
            zeros[2] <= ~|n_8[39:36];
        end
        if (at[10]) begin
            n_10     <= |n_9[35:34] ? n_9[35:2] : n_9[33:0];
            zeros[1] <= ~|n_9[35:34];
        end
        if (at[11]) begin
            n_low    <= n[14:0];
            zeros[0] <= ~n_10[33];
        end
    end

    // ---- 9: the slope, 24 bits after the point; it is positive

    wire [23:0] d = {c1, 2'd0} + {{4{p0[35]}}, p0[35:16]};

    // ---- 11, 12: P, 32 bits after the point; what is taken away is rounded down, so that 2^18 - 1 comes on top

    wire [41:0] most = {p0, 6'd0} + {18'd0, p1[23:0]};
    reg  [50:0] p_part;
    always @(posedge clk) if (at[11]) p_part <= {1'b1, c0, 18'h3ffff} - {{9{most[41]}}, most};

    wire [50:0] p = p_part - {{27{p0[23]}}, p0[23:0]};

    // ---- the multipliers; h, in the first's a, is the only signed operand

    // An operand is registered a stage before it goes in, except what is computed only then: the argument's in stage 0, d in 9,
    // P in 12.
    reg [17:0] next_a0, next_b0, next_a1, next_b1;
    always @(posedge clk) begin
        if (at[0])  next_a0 <= {6'd0, 1'b1, a[22:12]};
        if (at[6])  next_a0 <= h_high;
        if (at[12]) next_a0 <= {3'd0, n_low};

        if (at[0])  next_a1 <= {6'd0, a[11:0]};
        if (at[6])  next_a1 <= {12'd0, h_low};

        next_b0 <= digits[17:0];
        if (at[0])  next_b0 <= aligned[35:18];
        if (at[9])  next_b0 <= {12'd0, d[5:0]};
        if (at[11]) next_b0 <= n[32:15];
        if (at[12]) next_b0 <= p[50:33];
        if (at[6])  next_b0 <= {4'd0, c2};      // last, for it comes late

        next_b1 <= digits[17:0];
        if (at[0])  next_b1 <= aligned[35:18];
        if (at[11]) next_b1 <= n[32:15];
    end

    takt_product #(.SIGNED_A(1), .INPUT_REGS(1)) product_0 (
        .clk(clk),
        .a(at[12] ? {3'd0, p[32:18]} : at[0] ? {6'd0, 1'b1, a[22:12]} : next_a0),
        .b(at[9] ? d[23:6] : at[0] ? aligned[17:0] : next_b0),
        .p(p0)
    );
    takt_product #(.INPUT_REGS(1)) product_1 (
        .clk(clk),
        .a(at[12] ? p[50:33] : at[0] ? {6'd0, a[11:0]} : next_a1),
        .b(at[9] ? d[23:6] : at[0] ? aligned[17:0] : next_b1),
        .p(p1)
    );

    // ---- 14, 15: n P in [1, pi), 49 bits after the point

    reg [50:0] r_part, r;
    always @(posedge clk) begin
        if (at[14]) r_part <= {p1, 15'd0} + {18'd0, p0[32:0]};
        if (at[15]) r      <= r_part + {18'd0, p0[32:0]};
    end

    // ---- 16: rounded to nearest, by adding half a unit; sign and special values

    reg [31:0] x_1;
    always @(posedge clk) if (at[0]) x_1 <= a;

    // It waits from stage 8 on, for then the next one comes.
    reg        refused, quiet, identity;
    reg [31:0] x_8;
    always @(posedge clk) if (at[8]) begin
        refused  <= x_1[30:0] > LIMIT;
        quiet    <= &x_1[30:22];
        identity <= x_1[30:23] < IDENTITY;
        x_8      <= x_1;
    end

    // Less one for the leading bit, which the fraction lacks.
    wire [7:0]  exponent = 8'd126 + {7'd0, r[50]} - {3'd0, zeros};
    wire [30:0] rounded  = {exponent, r[50] ? r[49:27] : r[48:26]} + {30'd0, r[50] ? r[26] : r[25]};
    always @(posedge clk) begin
        result <= identity ? x_8 : {x_8[31] ^ negative, rounded};
        flags  <= 3'b000;
        if (refused) begin
            result <= 32'h7fc00000;
            flags  <= {~quiet, 2'b00};
        end
    end

    wire unused = &{1'b0, sum[42:35], p[17:0], r[24:0]};

endmodule
