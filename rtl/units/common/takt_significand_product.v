// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_significand_product: multiplier of two significands of 24 bits.
//
// Contract
//   p = a * b of the cycle before: the partial products are registered, their sum is combinational. There is no reset. With SMALL,
//   the sum needs two thirds of the logic, and more time.
//
// Since 24 = 6 + 18 bits, there are three products of 18 x 18 bits, and one of the upper 6 bits, which is computed in logic: a
// multiplier block would be wasted on it.

module takt_significand_product #(
    parameter SMALL = 0
) (
    input  wire        clk,
    input  wire [23:0] a,
    input  wire [23:0] b,
    output wire [47:0] p
);

    wire [35:0] low_low, high_low, low_high;
    takt_product u_low_low (.clk(clk), .a(a[17:0]), .b(b[17:0]), .p(low_low));
    takt_product u_high_low (.clk(clk), .a({12'd0, a[23:18]}), .b(b[17:0]), .p(high_low));
    takt_product u_low_high (.clk(clk), .a(a[17:0]), .b({12'd0, b[23:18]}), .p(low_high));

    // The product of the upper 5 bits of the fractions, row by row, and the terms of the leading ones. These arrive late (a
    // subnormal number has none), so that the two are summed behind the register.
    wire [4:0]  x = a[22:18];
    wire [4:0]  y = b[22:18];
    wire [9:0]  fractions =
        ({5'd0, x & {5{y[0]}}} + {4'd0, x & {5{y[1]}}, 1'd0}) +
        ({3'd0, x & {5{y[2]}}, 2'd0} + {2'd0, x & {5{y[3]}}, 3'd0}) + {1'd0, x & {5{y[4]}}, 4'd0};
    wire [6:0]  ones = {2'd0, x & {5{b[23]}}} + {1'd0, a[23] & b[23], y & {5{a[23]}}};

    reg  [9:0]  fractions1;
    reg  [6:0]  ones1;

    always @(posedge clk) begin
        fractions1 <= fractions;
        ones1      <= ones;
    end

    // The low 18 bits of the sum equal the low bits of low_low.
    wire [29:0] upper;
    wire        unused_high = |{high_low[35:24], low_high[35:24]};  // zero: 6 x 18 bits

    // From a sum of all four terms, synthesis would make carry-save adders in logic and one carry chain; a term that is kept has
    // a carry chain of its own.
    generate
        if (SMALL != 0) begin : g_small
            (* keep *) wire [24:0] middle;
            (* keep *) wire [11:0] highest;
            assign middle  = {1'd0, high_low[23:0]} + {1'd0, low_high[23:0]};
            assign highest = {2'd0, fractions1} + {ones1, 5'd0};
            assign upper = {highest, low_low[35:18]} + {5'd0, middle};
        end else begin : g_fast
            assign upper =
                {2'd0, fractions1, low_low[35:18]} + {ones1, 23'd0} + ({6'd0, high_low[23:0]} + {6'd0, low_high[23:0]});
        end
    endgenerate

    assign p = {upper, low_low[17:0]};

endmodule
