// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_filter: a pin from outside, in step with the clock and without pulses that are too short.
//
// Contract
//   level follows pin once pin has been different for HOLD cycles on end, two cycles later (the synchroniser): a change of the pin
//   before the edge of cycle t is on level in cycle t + 2 + HOLD. A shorter pulse leaves no trace.
//   rst: level is what the pin was two cycles before.

module takt_filter #(
    parameter HOLD = 1,  // cycles, 1 to 2^BITS
    parameter BITS = 8
) (
    input  wire clk,
    input  wire rst,
    input  wire pin,
    output reg  level
);

    // Vendors' tools place the synchroniser's registers side by side, and do not retime or merge them.
    (* ASYNC_REG = "TRUE", altera_attribute = "-name SYNCHRONIZER_IDENTIFICATION FORCED_IF_ASYNCHRONOUS" *)
    reg            s0, s1;
    reg [BITS-1:0] held;
    localparam     LAST = HOLD - 1;

    always @(posedge clk) begin
        s0 <= pin;
        s1 <= s0;
        if (rst | s1 == level) held <= {BITS{1'b0}};
        else if (held == LAST[BITS-1:0]) held <= {BITS{1'b0}};
        else held <= held + {{(BITS-1){1'b0}}, 1'b1};
        if (rst | held == LAST[BITS-1:0]) level <= s1;
    end

endmodule
