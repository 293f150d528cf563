// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_pwm: a half bridge: centred pulses, a complementary pin, dead time.
//
// Contract
//   A period is 2 * HALF cycles; the pulse lies about its middle and is `on` cycles long: duty + HALF if SIGNED (so 0 is one half),
//   else duty; beyond 0 and 2 * HALF it stays there.
//   put: w_duty is taken, and used from the next period on.
//   pin_high follows the pulse, pin_low its complement; each rises DEAD cycles late and falls at once, so that between them both
//   are 0 for DEAD cycles. A pulse not longer than DEAD is not seen.
//   enable: while it is 0, and in reset, both pins are 0 from the next cycle on, duty is 0 (SIGNED: one half), and the period stands
//   at its beginning.

module takt_pwm #(
    parameter HALF   = 1250,  // 1 to 65535
    parameter DEAD   = 0,     // 0 to 255
    parameter SIGNED = 1
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        enable,
    input  wire        put,
    input  wire [31:0] w_duty,
    output reg         pin_high,
    output reg         pin_low
);

    localparam [16:0] MOST  = 2 * HALF;
    localparam [16:0] ZERO  = SIGNED != 0 ? HALF : 0;
    localparam [15:0] TOP   = HALF - 1;
    localparam [15:0] FIRST = HALF;
    localparam [7:0]  LATE  = DEAD;

    initial {pin_high, pin_low} = 2'b00;  // off before the first clock edge, too

    // on, with saturation; 33 bits so that nothing wraps.
    wire signed [33:0] wanted = $signed({{2{w_duty[31]}}, w_duty}) + $signed({17'd0, ZERO});
    reg  [16:0] next, on;
    reg  [15:0] place;  // 0 to HALF - 1, then back
    reg         back;
    reg  [7:0]  since_rise, since_fall;

    wire [15:0] to_middle = FIRST - place;  // HALF to 1
    wire [15:0] first_half = on[16:1] + {15'd0, on[0]};
    wire        pulse      = to_middle <= (back ? on[16:1] : first_half);
    wire        safe       = rst | ~enable;

    always @(posedge clk) begin
        if (put) next <= wanted[33] ? 17'd0 : wanted[32:0] > {16'd0, MOST} ? MOST : wanted[16:0];
        if (back ? place == 16'd0 : place == TOP) back <= ~back;
        else place <= back ? place - 16'd1 : place + 16'd1;
        if (back & place == 16'd0) on <= next;

        // Cycles for which the pulse has stood, up to DEAD.
        since_rise <= ~pulse ? 8'd0 : since_rise == LATE ? since_rise : since_rise + 8'd1;
        since_fall <= pulse ? 8'd0 : since_fall == LATE ? since_fall : since_fall + 8'd1;
        pin_high   <= pulse & since_rise == LATE;
        pin_low    <= ~pulse & since_fall == LATE;
        if (safe) begin
            {pin_high, pin_low, back} <= 3'd0;
            {since_rise, since_fall} <= 16'd0;
            place <= 16'd0;
            next  <= ZERO;
            on    <= ZERO;
        end
    end

endmodule
