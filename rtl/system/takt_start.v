// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_start: generator of base ticks, which starts them once every core waits or has halted (docs/system.md, One time).
//
// Contract
//   waiting, halted: of each core. Let W be the last cycle in which a core issued its first `wait`, or halted; both are visible two
//   cycles later. The first base tick B is in the first cycle from W + 4 + LEAD on that is a multiple of TICK, cycle 0 being the first
//   after reset. If all cores have halted, no base tick comes.
//   starts: high in cycle B - LEAD. due: high LEAD cycles before every base tick. Values that the host writes in that cycle are read by
//   the periods that begin at the base tick.

module takt_start #(
    parameter CORES = 1,
    parameter TICK  = 2,
    parameter LEAD  = 6,
    parameter BITS  = 1     // of TICK - 1
) (
    input  wire             clk,
    input  wire             rst,
    input  wire [CORES-1:0] waiting,
    input  wire [CORES-1:0] halted,
    output wire             starts,
    output wire             due,
    output reg              started
);

    // Countdown to the next cycle that is LEAD before a multiple of TICK.
    localparam FIRST = (TICK - LEAD % TICK) % TICK;
    localparam LAST  = TICK - 1;
    reg [BITS-1:0]  left;
    reg [CORES-1:0] waited;
    reg             ready, may;   // two and three cycles after W + 1

    assign due    = may & left == {BITS{1'b0}};
    assign starts = due & ~started;

    always @(posedge clk) begin
        left    <= left == {BITS{1'b0}} ? LAST[BITS-1:0] : left - 1'b1;
        waited  <= waited | waiting;
        ready   <= ready | (&(waited | waiting | halted) & |(waited | waiting));
        may     <= ready;
        started <= started | starts;
        if (rst) begin
            left    <= FIRST[BITS-1:0];
            waited  <= {CORES{1'b0}};
            ready   <= 1'b0;
            may     <= 1'b0;
            started <= 1'b0;
        end
    end

endmodule
