// takt_long_latency: tracks the one result of an iterative unit, which takes longer than the slot's pipelined units.
//
// Contract
//   An operation that issues now, insert, is in at[1] in the next cycle, in at[2] in the one after, and so on; in flight until
//   its result passes on to takt_in_flight's last place: last, in the cycle before. busy: the unit would not accept an
//   operation in the next cycle even if none issues now.
//   Requires INTERVAL >= LATENCY - DEPTH, so that one operation at a time is in flight here.
//   cancel, which stays high after a fault: an operation issued in the last two cycles, or later, is dropped.
//   Requires LATENCY - DEPTH >= 2: none is cancelled that has passed on.

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
