// SPDX-License-Identifier: MIT OR Apache-2.0
// A trip with the half bridges that it makes safe: carrier, pin, duties, enabling, clears and resets are arbitrary. `cargo evidence formal`
// proves the assertions.

module takt_tripped #(
    parameter FILTER = 3,
    parameter DEAD = 2,
    parameter TRIPPED = 1,
    parameter DIRECT = 0
) (
    input wire        clk, rst, clear, put, pin_in, enable, back,
    input wire [15:0] place,
    input wire [31:0] duty, stop, w_clear
);

    wire trip, off, high_a, low_a, high_b, low_b, high_c, low_c;
    takt_trip #(.FILTER(FILTER), .DIRECT(DIRECT)) source (
        .clk(clk), .rst(rst), .clear(clear), .take(1'b0), .put(put), .pin_in(pin_in), .w_clear(w_clear), .trip(trip), .off(off), .r_state(), .r_trips()
    );
    // Pins that are active low, the high ones, so that a polarity is part of what is proved.
    takt_pwm3 #(.HALF(20), .DEAD(DEAD), .INVERT_HIGH(1), .TRIPPED(TRIPPED)) bridges (
        .clk(clk), .rst(rst), .enable(enable), .trip(trip), .off(off), .place(place), .back(back), .put(put), .w_a(duty), .w_b(duty), .w_c(duty), .w_stop(stop),
        .pin_high_a(high_a), .pin_low_a(low_a), .pin_high_b(high_b), .pin_low_b(low_b), .pin_high_c(high_c), .pin_low_c(low_c)
    );

    wire [2:0] f_high = ~{high_c, high_b, high_a};
    wire [2:0] f_low  = {low_c, low_b, low_a};
    localparam [1:0] REST = TRIPPED;
    localparam [8:0] SAFE_AFTER = FILTER + 3;
    localparam [8:0] REST_AFTER = SAFE_AFTER + DEAD + 1;

    // A direct pin has been 1, and no trip has followed it yet.
    reg f_hit;
    always @(posedge clk) f_hit <= f_begun & DIRECT != 0 & (f_hit | pin_in) & ~trip & ~rst;

    // Cycles before this one for which the pin has stood, up to REST_AFTER.
    reg [8:0] f_stood;
    reg       f_begun = 1'b0;
    reg       f_reset;
    always @(posedge clk) begin
        f_begun   <= 1'b1;
        f_stood   <= ~pin_in | rst ? 9'd0 : f_stood == REST_AFTER ? f_stood : f_stood + 9'd1;
        f_reset   <= rst;
        if (~f_begun) f_stood <= 9'd0;
    end
    always @* begin
        assume (f_begun | rst);
        if (f_begun & ~rst) begin
            assert (~|(f_high & f_low));
            // Without a clock, no switch is on from a direct pin's edge until it has tripped.
            if ((f_hit | DIRECT != 0 & pin_in) & ~trip) assert (off & ~|f_high & ~|f_low);
            // n + 3 cycles after the pin's edge, with n for the filter, no switch is on that is not on at rest.
            if (f_stood >= SAFE_AFTER & ~f_reset) assert ((REST[1] | ~|f_high) & (REST[0] | ~|f_low));
            // After the dead time those are on that are on at rest.
            if (f_stood == REST_AFTER & ~f_reset) assert (f_high == {3{REST[1]}} & f_low == {3{REST[0]}});
        end
    end

endmodule
