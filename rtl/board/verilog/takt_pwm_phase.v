// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_pwm_phase: a half bridge of takt_pwm3: the edges of a pulse on a carrier, dead time, and least time of a switch.
//
// Contract
//   The pulse is `on` cycles of a carrier's period, about its peak: (on + 1) / 2 before it, on / 2 behind it. on is duty + HALF if
//   SIGNED, else duty; beyond 0 and 2 * HALF it stays there; below LEAST = DEAD + the larger of MINIMUM and 1 it is 0, and within
//   LEAST of 2 * HALF it is 2 * HALF.
//   put: w_duty is taken. loads: what was taken at least two cycles before acts from the next cycle on, so with loads at 1 a duty acts
//   two cycles after its put. Before the peak a pulse can only begin, behind it only end: of a new duty whose edge is past, this edge
//   comes at once, and if this half's edge has been given out, the new duty acts in the next half.
//   runs: the switches follow the pulse; otherwise they are at rest: 2'b00 both off, 2'b01 low on, 2'b10 high on. A switch goes off a
//   cycle later, the other one goes on when both have been off for DEAD cycles. While runs is 1, a switch that is on stays on for
//   MINIMUM cycles.
//   off: both are off, without a clock.
//   rst: both are off, and the duty is 0.

module takt_pwm_phase #(
    parameter HALF    = 1250,  // 1 to 65535; at least LEAST
    parameter DEAD    = 0,     // 0 to 1023
    parameter MINIMUM = 0,     // 0 to 1023
    parameter SIGNED  = 0
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        put,
    input  wire [31:0] w_duty,
    input  wire        loads,
    input  wire [15:0] place,
    input  wire        back,
    input  wire        runs,
    input  wire [1:0]  rest,
    input  wire        off,
    output wire        high,
    output wire        low
);

    localparam [16:0] MOST   = 2 * HALF;
    localparam [16:0] ZERO   = SIGNED != 0 ? HALF : 0;
    localparam [16:0] LEAST  = DEAD + (MINIMUM > 1 ? MINIMUM : 1);
    localparam [16:0] ALMOST = MOST - LEAST;
    localparam [15:0] FIRST  = HALF;
    localparam [9:0]  LATE   = DEAD;
    localparam [9:0]  STAYS  = MINIMUM;

    // ---- the pulse

    wire signed [33:0] wanted = $signed({{2{w_duty[31]}}, w_duty}) + $signed({17'd0, ZERO});
    wire        is_none = wanted[33] | wanted[32:0] < {16'd0, LEAST};
    wire        is_all  = wanted[32:0] > {16'd0, ALMOST};
    reg  [16:0] on;
    reg  [15:0] rises, falls;  // places of the edges; HALF: in this half there is none
    reg         was;

    wire        first = place == 16'd0;
    wire        pulse = back ? (first | was) & place < falls : (~first & was) | place >= rises;

    always @(posedge clk) begin
        if (put) on <= is_none ? 17'd0 : is_all ? MOST : wanted[16:0];
        if (loads) begin
            rises <= FIRST - (on[16:1] + {15'd0, on[0]});
            falls <= on[16:1];
        end
        was <= pulse;
        if (rst) begin
            on    <= ZERO;
            rises <= FIRST - (ZERO[16:1] + {15'd0, ZERO[0]});
            falls <= ZERO[16:1];
        end
    end

    // ---- the switches

    reg  [1:0]  switches;      // high, low
    reg  [9:0]  since;         // cycles for which they have been as they are; stops at the last
    initial switches = 2'b00;  // off before the first clock edge, too
    assign {high, low} = switches;

    wire [1:0]  target = runs ? {pulse, ~pulse} : rest;
    wire        stays  = runs & since < STAYS;

    always @(posedge clk or posedge off)
        if (off) begin
            switches <= 2'b00;
            since    <= 10'd1;
        end else begin
            since <= &since ? since : since + 10'd1;
            if (switches == 2'b00 ? since >= LATE & target != 2'b00 : target != switches & ~stays) begin
                switches <= switches == 2'b00 | DEAD == 0 ? target : 2'b00;
                since    <= 10'd1;
            end
            if (rst) begin
                switches <= 2'b00;
                since    <= 10'd1;
            end
        end

endmodule
