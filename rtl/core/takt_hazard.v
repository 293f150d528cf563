// takt_hazard: hazard detection and forwarding select for one register address of a bundle.
//
// The address accompanies its bundle through three stages: match (m_), read (r_), issue (i_). In match it is compared with all
// results in flight and with the destinations of the two bundles ahead. From then on it is compared with place 2 of
// takt_in_flight only, because every result passes there. A register has at most one result pending (rule 3 of docs/timing.md),
// so a few bits of state are enough.
//
// Contract
//   advance: the bundles move on by a stage at the end of this cycle (the one in issue issues, or there is none).
//   r_waits: a bundle that moves from read to issue at the end of this cycle cannot issue in the next one.
//   i_waits: a bundle that stays in issue cannot issue in the next cycle.
//   r_copy[s]: the bank's copy shows the register in this cycle.
//   r_past[s]: the result was on slot s's bus in the last cycle, and the bank's copy does not show it in this one.
//   next_now[s], next_past[s]: for the bundle that will be in issue in the next cycle: it will be on the bus then; it is on the
//   bus in this cycle, with the bundle still in read.
//   r_taken: next_now or next_past of the next cycle is set if the bundle in read moves to issue. i_taken: likewise if the bundle
//   in issue stays there.
//   No latency is less than 2.

module takt_hazard #(
    parameter SLOTS = 3,   // slots whose banks the address can be in
    parameter DEPTH = 10,  // places of takt_in_flight, at least 4
    parameter LATE  = 1,   // units with takt_long_latency, at most, of a slot
    parameter INDEX = 8
) (
    input  wire                         clk,
    input  wire                         advance,
    input  wire [SLOTS-1:0]             m_bank,    // one-hot; none: no register that could be pending
    input  wire [INDEX-1:0]             m_index,
    input  wire [SLOTS-1:0]             r_bank,
    input  wire [INDEX-1:0]             r_index,
    input  wire [SLOTS-1:0]             i_bank,
    input  wire [INDEX-1:0]             i_index,
    // For each slot: results in flight, and what the bundles in read and issue will write: early with a latency of 2.
    input  wire [SLOTS*DEPTH-1:0]       in_flight,
    input  wire [SLOTS*DEPTH*INDEX-1:0] in_flight_index,
    input  wire [SLOTS*LATE-1:0]        late,
    input  wire [SLOTS*LATE*INDEX-1:0]  late_index,
    input  wire [SLOTS-1:0]             r_writes,
    input  wire [SLOTS-1:0]             r_early,
    input  wire [SLOTS*INDEX-1:0]       r_dest,
    input  wire [SLOTS-1:0]             i_writes,
    input  wire [SLOTS-1:0]             i_early,
    input  wire [SLOTS*INDEX-1:0]       i_dest,
    output wire                         r_waits,
    output wire                         i_waits,
    output reg  [SLOTS-1:0]             r_copy,
    output reg  [SLOTS-1:0]             r_past,
    output wire                         r_taken,
    output wire                         i_taken,
    output wire [SLOTS-1:0]             next_now,
    output wire [SLOTS-1:0]             next_past
);

    // Comparisons with all that is in flight; m_at[j] for place j, m_near and m_far for place 3 and beyond. These two are the
    // widest: they are registered apart, and for all slots, of which the address's bank chooses when it is in read.
    localparam MIDDLE = DEPTH < 9 ? DEPTH : 9;
    wire [SLOTS-1:0] m_at0, m_at1, m_at2, m_near, m_far, m_on_read, m_on_issue, r_at2, i_at2;

    genvar s, j;
    generate
        for (s = 0; s < SLOTS; s = s + 1) begin : g_slot
            wire [DEPTH-1:0] hit;
            wire [LATE-1:0]  late_hit;
            for (j = 0; j < DEPTH; j = j + 1) begin : g_place
                assign hit[j] = in_flight[s*DEPTH+j] & (in_flight_index[(s*DEPTH+j)*INDEX +: INDEX] == m_index);
            end
            for (j = 0; j < LATE; j = j + 1) begin : g_late
                assign late_hit[j] = late[s*LATE+j] & (late_index[(s*LATE+j)*INDEX +: INDEX] == m_index);
            end
            wire [INDEX-1:0] index2 = in_flight_index[(s*DEPTH+2)*INDEX +: INDEX];
            assign m_at0[s]      = m_bank[s] & hit[0];
            assign m_at1[s]      = m_bank[s] & hit[1];
            assign m_at2[s]      = m_bank[s] & hit[2];
            assign m_near[s]     = |hit[MIDDLE-1:3];
            assign m_far[s]      = (|(hit >> MIDDLE)) | (|late_hit);
            assign m_on_read[s]  = m_bank[s] & r_writes[s] & (r_dest[s*INDEX +: INDEX] == m_index);
            assign m_on_issue[s] = m_bank[s] & i_writes[s] & (i_dest[s*INDEX +: INDEX] == m_index);
            assign r_at2[s]      = r_bank[s] & in_flight[s*DEPTH+2] & (index2 == r_index);
            assign i_at2[s]      = i_bank[s] & in_flight[s*DEPTH+2] & (index2 == i_index);
        end
    endgenerate

    // In read: the result is in place 2 or beyond (r_later), in place 1, in place 0; or the bundle in issue computes it.
    reg [SLOTS-1:0] r_near, r_far;
    reg r_from_issue, r_on_issue, r_on_issue_early, r_on_issue_late, r_at1, r_at0;
    // In issue: likewise.
    reg i_later, i_at1;

    wire r_later = (|(r_bank & (r_near | r_far))) | r_from_issue;
    assign r_waits   = r_later | r_on_issue;
    assign i_waits   = i_later;
    assign r_taken   = r_at1 | r_at0;
    assign i_taken   = i_at1;
    assign next_now  = advance ? r_bank & {SLOTS{r_at1}} : i_bank & {SLOTS{i_at1}};
    assign next_past = r_bank & {SLOTS{advance & r_at0}};

    always @(posedge clk) begin
        if (advance) begin
            r_near           <= m_near;
            r_far            <= m_far;
            r_from_issue     <= |(m_on_issue & ~i_early);
            r_at1            <= |(m_at2 | (m_on_issue & i_early));
            r_at0            <= |m_at1;
            r_past           <= m_at0;
            r_copy           <= m_bank & ~m_at0;
            r_on_issue       <= |m_on_read;
            r_on_issue_early <= |(m_on_read & r_early);
            r_on_issue_late  <= |(m_on_read & ~r_early);
            i_later          <= (r_later & ~(|r_at2)) | r_on_issue_late;
            i_at1            <= (|r_at2) | r_on_issue_early;
        end else begin
            r_near       <= r_near & ~{SLOTS{|r_at2}};
            r_far        <= r_far & ~{SLOTS{|r_at2}};
            r_from_issue <= r_from_issue & ~(|r_at2);
            r_at1        <= |r_at2;
            r_at0        <= r_at1;
            r_past       <= r_bank & {SLOTS{r_at0}};
            r_copy       <= r_bank & {SLOTS{~r_at0}};
            i_later      <= i_later & ~(|i_at2);
            i_at1        <= |i_at2;
        end
    end

endmodule
