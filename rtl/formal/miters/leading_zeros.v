// SPDX-License-Identifier: MIT OR Apache-2.0
// The leading zeros of a significand, counted in the plainest way.

module leading_zeros (
    input      [23:0] x,
    output reg [4:0]  zeros
);

    integer i;
    always @* begin
        zeros = 5'd24;
        for (i = 0; i < 24; i = i + 1) begin
            if (x[i]) zeros = 23 - i;
        end
    end

endmodule
