// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_pwm3: three half bridges on a carrier, with complementary pins and dead time.
//
// Contract
//   place, back: of a takt_carrier with the same HALF. Each phase: see takt_pwm_phase; all take a duty, and load it, together.
//   UPDATE says when duties load: 0 in every cycle, 1 so that they act from a valley on, 2 from a peak on, 3 from either on.
//   The switches follow their pulses from the first valley on with enable at 1, trip at 0, and 0 in w_stop as last put, as long as this is
//   so. Before, and from the cycle after on, they are at rest: TRIPPED while trip is 1, else SAFE: 0 both off, 1 the low ones on, 2 the high ones on.
//   Pins are 1 while their switch is on, or, with INVERT_HIGH or INVERT_LOW, 0.
//   off: all switches are off, without a clock; trip is 1 before it ends.
//   rst: all switches are off.

module takt_pwm3 #(
    parameter HALF        = 1250,
    parameter DEAD        = 0,
    parameter MINIMUM     = 0,
    parameter UPDATE      = 0,
    parameter SIGNED      = 0,
    parameter INVERT_HIGH = 0,
    parameter INVERT_LOW  = 0,
    parameter SAFE        = 0,
    parameter TRIPPED     = 0
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        enable,
    input  wire        trip,
    input  wire        off,
    input  wire [15:0] place,
    input  wire        back,
    input  wire        put,
    input  wire [31:0] w_a,
    input  wire [31:0] w_b,
    input  wire [31:0] w_c,
    input  wire [31:0] w_stop,
    output wire        pin_high_a,
    output wire        pin_low_a,
    output wire        pin_high_b,
    output wire        pin_low_b,
    output wire        pin_high_c,
    output wire        pin_low_c
);

    localparam [15:0] TOP   = HALF - 1;
    localparam [1:0]  WHEN  = UPDATE;
    localparam [1:0]  REST  = SAFE;
    localparam [1:0]  BREAK = TRIPPED;

    reg        begun, stopped;
    wire       last  = place == TOP;
    wire       may   = enable & ~trip & ~stopped;
    wire       loads = WHEN == 2'd0 | (last & (back ? WHEN[0] : WHEN[1]));
    wire       runs  = begun & may;
    wire [1:0] rest  = trip ? BREAK : REST;
    wire [2:0] high, low;

    always @(posedge clk) begin
        begun <= may & (begun | (last & back));
        if (put) stopped <= |w_stop;
        if (rst) {begun, stopped} <= 2'b00;
    end

    takt_pwm_phase #(.HALF(HALF), .DEAD(DEAD), .MINIMUM(MINIMUM), .SIGNED(SIGNED)) phase_a (
        .clk(clk), .rst(rst), .put(put), .w_duty(w_a), .loads(loads), .place(place), .back(back), .runs(runs), .rest(rest), .off(off),
        .high(high[0]), .low(low[0])
    );
    takt_pwm_phase #(.HALF(HALF), .DEAD(DEAD), .MINIMUM(MINIMUM), .SIGNED(SIGNED)) phase_b (
        .clk(clk), .rst(rst), .put(put), .w_duty(w_b), .loads(loads), .place(place), .back(back), .runs(runs), .rest(rest), .off(off),
        .high(high[1]), .low(low[1])
    );
    takt_pwm_phase #(.HALF(HALF), .DEAD(DEAD), .MINIMUM(MINIMUM), .SIGNED(SIGNED)) phase_c (
        .clk(clk), .rst(rst), .put(put), .w_duty(w_c), .loads(loads), .place(place), .back(back), .runs(runs), .rest(rest), .off(off),
        .high(high[2]), .low(low[2])
    );
    assign {pin_high_c, pin_high_b, pin_high_a} = high ^ {3{INVERT_HIGH != 0}};
    assign {pin_low_c, pin_low_b, pin_low_a}    = low ^ {3{INVERT_LOW != 0}};

endmodule
