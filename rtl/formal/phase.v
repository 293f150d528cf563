// SPDX-License-Identifier: MIT OR Apache-2.0
    // ---- properties, added by `cargo evidence formal` to takt_pwm_phase

    // Cycles, of those before this one, for which each switch has been off, and this one on; they stop at their most. Carrier, duties,
    // trips, enabling and resets are arbitrary.
    reg [10:0] f_high_off, f_low_off, f_high_on, f_low_on;
    reg        f_begun = 1'b0;
    reg        f_was_high, f_was_low, f_ran, f_reset;
    reg [1:0]  f_rest;
    wire [10:0] f_most = 11'd1024;
    always @(posedge clk) begin
        f_begun    <= 1'b1;
        f_high_off <= high ? 11'd0 : f_high_off == f_most ? f_most : f_high_off + 11'd1;
        f_low_off  <= low ? 11'd0 : f_low_off == f_most ? f_most : f_low_off + 11'd1;
        f_high_on  <= ~high ? 11'd0 : f_high_on == f_most ? f_most : f_high_on + 11'd1;
        f_low_on   <= ~low ? 11'd0 : f_low_on == f_most ? f_most : f_low_on + 11'd1;
        f_was_high <= high;
        f_was_low  <= low;
        f_ran      <= runs;
        f_reset    <= rst;
        f_rest     <= rest;
        if (~f_begun) {f_high_off, f_low_off, f_high_on, f_low_on} <= 44'd0;
    end
    always @* begin
        assume (f_begun | rst);
        assume (rest != 2'b11);
        if (f_begun) begin
            // Without a clock, both are off.
            if (off) assert (~high & ~low);
            // Never both.
            assert (~(high & low));
            // Dead time: a switch goes on after the other has been off for DEAD cycles.
            if (high & ~f_was_high) assert (f_low_off >= DEAD);
            if (low & ~f_was_low) assert (f_high_off >= DEAD);
            // Without drive, and tripped, a switch that is not on at rest is off a cycle later; after a reset both are.
            if (f_reset) assert (~high & ~low);
            if (~f_reset & ~f_ran & ~f_rest[1]) assert (~high);
            if (~f_reset & ~f_ran & ~f_rest[0]) assert (~low);
            // While it runs, and is not taken off without a clock, a switch stays on for MINIMUM cycles.
            if (f_ran & ~f_reset & ~off & f_was_high & ~high) assert (f_high_on >= MINIMUM);
            if (f_ran & ~f_reset & ~off & f_was_low & ~low) assert (f_low_on >= MINIMUM);
            // Within a half the pulse changes in one direction.
            if (~first & back) assert (~pulse | was);
            if (~first & ~back) assert (pulse | ~was);
            // Strengthens the induction.
            assert (since >= 10'd1 & switches != 2'b11);
            if (high) assert (f_high_on >= {1'b0, since} - 11'd1 & f_low_off >= {1'b0, since} - 11'd1);
            if (low) assert (f_low_on >= {1'b0, since} - 11'd1 & f_high_off >= {1'b0, since} - 11'd1);
            if (~high & ~low) assert (f_high_off >= {1'b0, since} - 11'd1 & f_low_off >= {1'b0, since} - 11'd1);
            assert (f_high_off <= f_most & f_low_off <= f_most & f_high_on <= f_most & f_low_on <= f_most);
        end
    end
