// SPDX-License-Identifier: MIT OR Apache-2.0
    // ---- properties, added by `cargo evidence formal` to takt_trip

    reg f_begun = 1'b0;
    reg f_was, f_asked, f_cleared, f_reset;
    always @(posedge clk) begin
        f_begun   <= 1'b1;
        f_was     <= trip;
        f_asked   <= asks;
        f_cleared <= clear | (put & |w_clear);
        f_reset   <= rst;
    end
    always @* if (f_begun & ~rst & ~f_reset) begin
        // Held until it is cleared, and the pin does not ask.
        if (f_was & ~trip) assert (f_cleared & ~f_asked);
        if (asks) assert (trip);
    end
