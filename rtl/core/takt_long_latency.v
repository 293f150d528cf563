// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_long_latency: tracks the result of an iterative unit until it enters takt_in_flight, which is shorter than its latency.
//
// Contract
//   insert: an operation issues now. It is in at[1] in the next cycle, in at[2] in the one after, and so on. in_flight is set
//   until its result enters the last place of takt_in_flight; last is set in the cycle before that. busy: the unit does not
//   accept an operation in the next cycle, even if none issues now.
//   INTERVAL >= LATENCY - DEPTH is required, so that at most one operation is in flight here.
//   cancel, which stays high after a fault, drops an operation that issued in the last two cycles or later.
//   LATENCY - DEPTH >= 2 is required, so that no result has left for takt_in_flight when it is cancelled.

module takt_long_latency #(
    parameter LATENCY  = 18,
    parameter INTERVAL = 14,
    parameter DEPTH    = 10,  // places of takt_in_flight
    parameter INDEX    = 8,
    parameter ADDRESS  = 16
) (
    input  wire                   clk,
    input  wire                   rst,
    input  wire                   cancel,
    input  wire                   insert,
    input  wire [INDEX-1:0]       insert_index,
    input  wire [ADDRESS-1:0]     insert_address,
    output wire [LATENCY-DEPTH:1] at,
    output reg                    in_flight,
    output reg  [INDEX-1:0]       index,
    output reg  [ADDRESS-1:0]     address,
    output wire                   last,
    output wire                   busy
);

    localparam AGES = LATENCY - DEPTH > INTERVAL - 1 ? LATENCY - DEPTH : INTERVAL - 1;

    generate
        if (LATENCY < DEPTH + 2 || INTERVAL < LATENCY - DEPTH || INTERVAL < 3) begin : g_interval
            takt_late_has_an_interval_of_its_latency_beyond_the_places unsupported ();
        end
    endgenerate

    reg [AGES:1] age;
    reg          working;

    assign at   = age[LATENCY-DEPTH:1];
    assign last = age[LATENCY-DEPTH] & ~((LATENCY - DEPTH == 2) & cancel);
    assign busy = working & ~age[INTERVAL-1];

    always @(posedge clk) begin
        age      <= {age[AGES-1:3], age[2] & ~cancel, age[1] & ~cancel, insert};
        working  <= insert | busy;
        in_flight <= insert | (in_flight & ~age[LATENCY-DEPTH]);
        if (insert) begin
            index   <= insert_index;
            address <= insert_address;
        end
        if (rst) begin
            age      <= {AGES{1'b0}};
            working  <= 1'b0;
            in_flight <= 1'b0;
        end
    end

endmodule
