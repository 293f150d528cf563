// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_ecc_scrub: reads all memories of a core while it waits for its tick, address by address, and has wrong words repaired.
//
// It begins when the core has waited for 63 cycles: by then no result is in flight, and nothing reads or writes. A step holds
// the address for eight cycles, in which the checks settle. Then the loader writes the words that are wrong, one in each cycle.
// A tick ends the step, which begins again in the next wait.
//
// Contract
//   tick: as the core's port, a cycle before the core sees it: reads is 0 when it does.
//   reads: the memories are read at address. wrong[k]: memory k's word at address, read before, can be repaired; lost: one cannot.
//   repair: one-hot, the memory whose word the loader's registers take at the end of this cycle.
//   failed: a word is lost.

module takt_ecc_scrub #(
    parameter ADDRESS  = 10,  // bits of the largest memory's addresses
    parameter MEMORIES = 3
) (
    input  wire                clk,
    input  wire                rst,
    input  wire                waiting,
    input  wire                tick,
    input  wire [MEMORIES-1:0] wrong,
    input  wire                lost,
    output reg                 reads,
    output reg  [ADDRESS-1:0]  address,
    output wire [MEMORIES-1:0] repair,
    output reg                 failed
);

    localparam [ADDRESS-1:0]  NEXT = 1;
    localparam [MEMORIES-1:0] ONE  = 1;

    wire                quiet = waiting & ~tick & ~rst;
    reg  [5:0]          idle;
    reg  [2:0]          phase;
    reg                 repairs;
    reg  [MEMORIES-1:0] pending;

    assign repair = pending & (~pending + ONE) & {MEMORIES{reads & quiet}};
    wire   last   = repairs & ~|(pending & ~repair);

    always @(posedge clk) begin
        idle    <= quiet ? idle + {5'd0, ~&idle} : 6'd0;
        reads   <= quiet & (&idle);
        phase   <= reads & ~repairs ? phase + 3'd1 : 3'd0;
        repairs <= reads & quiet & (repairs ? ~last : &phase);
        pending <= repairs ? pending & ~repair : wrong & {MEMORIES{&phase}};
        failed  <= reads & quiet & (&phase) & lost;
        if (reads & quiet & last) address <= address + NEXT;
        if (rst) address <= {ADDRESS{1'b0}};
    end

endmodule
