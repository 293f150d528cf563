// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_trip: a pin that takes outputs to their safe level, without the core, until somebody clears it.
//
// Contract
//   The pin (INVERT: its complement) asks for a trip once it has been 1 for FILTER cycles on end (0: at once), and does so until it has
//   been 0 as long. trip is 1 from then on: of an edge of the pin before the edge of cycle t, from cycle t + 2 + FILTER on, and what
//   takes trip is safe in t + 3 + FILTER.
//   DIRECT: off is 1 from the pin's edge on, without a clock, until trip is 1; takt_pwm3 clears its switches by it. A pulse of the pin
//   trips however short it is, and the pin asks until it has been 0 for five cycles.
//   trip stays 1 until the pin no longer asks and, at the same time or later, clear is 1 or w_clear is put with a value other than 0.
//   state: bit 0 trip, bit 1 the pin asks. trips counts the times that trip rose, and wraps.
//   take: registers r_… hold from the next cycle on what they are in this one.
//   rst: nothing is held, and the registers are 0.

module takt_trip #(
    parameter FILTER = 3,  // 0 to 255
    parameter INVERT = 0,
    parameter DIRECT = 0   // takes no FILTER
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        clear,
    input  wire        take,
    input  wire        put,
    input  wire        pin_in,
    input  wire [31:0] w_clear,
    output wire        trip,
    output wire        off,
    output reg  [31:0] r_state,
    output reg  [31:0] r_trips
);

    wire pin = pin_in ^ (INVERT != 0);
    wire asks, at_once;
    reg  held, was;
    generate
        if (DIRECT != 0) begin : g_direct
            // The pin sets three flip-flops, which the clock clears one after the other: the last one is 1 until trip is.
            (* ASYNC_REG = "TRUE", altera_attribute = "-name SYNCHRONIZER_IDENTIFICATION FORCED_IF_ASYNCHRONOUS" *)
            reg p0, p1, p2, s0, s1;
            always @(posedge clk or posedge pin)
                if (pin) {p2, p1, p0} <= 3'b111;
                else {p2, p1, p0} <= {p1, p0, 1'b0};
            always @(posedge clk) {s1, s0} <= {s0, p2};
            assign asks    = s1;
            assign at_once = p2;
        end else if (FILTER == 0) begin : g_synchroniser
            (* ASYNC_REG = "TRUE", altera_attribute = "-name SYNCHRONIZER_IDENTIFICATION FORCED_IF_ASYNCHRONOUS" *)
            reg s0, s1;
            always @(posedge clk) {s1, s0} <= {s0, pin};
            assign asks    = s1;
            assign at_once = 1'b0;
        end else begin : g_filter
            takt_filter #(.HOLD(FILTER), .BITS(8)) filter (.clk(clk), .rst(rst), .pin(pin), .level(asks));
            assign at_once = 1'b0;
        end
    endgenerate

    reg [31:0] trips;
    assign trip = asks | held;
    assign off  = at_once & ~held;

    always @(posedge clk) begin
        was <= trip;
        if (asks) held <= 1'b1;
        else if (clear | (put & |w_clear)) held <= 1'b0;
        if (trip & ~was) trips <= trips + 32'd1;
        if (take) {r_state, r_trips} <= {30'd0, asks, trip, trips};
        if (rst) {held, was, trips, r_state, r_trips} <= 98'd0;
    end

endmodule
