// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_hazard: hazard detection and forwarding select for one register address (a source or the destination) of a bundle.
//
// The address moves with its bundle through three stages: match (m_), read (r_), issue (i_). In match it is compared with all
// results in flight and with the destinations of the two bundles ahead. In read and issue it is compared with place 2 of
// takt_in_flight only, because every result passes that place. A few bits of state are enough, since a register has at most one
// result pending (rule 3 of docs/timing.md).
//
// Contract
//   advance: all bundles move to the next stage at the end of this cycle (the bundle in issue issues, or the stage is empty).
//   r_waits: the bundle in read, if it moves to issue at the end of this cycle, cannot issue in the next one.
//   i_waits: the bundle in issue, if it stays there, cannot issue in the next cycle.
//   r_copy[s]: the word read from the copy of bank s, for the bundle in read, is the register's current value.
//   r_past[s]: the result was on slot s's bus in the last cycle, too late for that word.
//   next_now[s], next_past[s]: forwarding select for the bundle that will be in issue in the next cycle. next_now: its result
//   will be on the bus in that cycle. next_past: the result is on the bus in this cycle, while the bundle is still in read.
//   r_taken: if the bundle in read moves to issue, its operand is forwarded (next_now or next_past will be set). i_taken: the
//   same for the bundle in issue, if it stays there.
//   Latencies must be 2 or more.

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

    // Comparisons with all results in flight: m_atJ for place J, m_near and m_far for places from 3 on. The last two have the widest
    // logic. Therefore they are registered separately and for every slot; that any of them is set is found in read.
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
            assign m_near[s]     = m_bank[s] & (|hit[MIDDLE-1:3]);
            assign m_far[s]      = m_bank[s] & ((|(hit >> MIDDLE)) | (|late_hit));
            assign m_on_read[s]  = m_bank[s] & r_writes[s] & (r_dest[s*INDEX +: INDEX] == m_index);
            assign m_on_issue[s] = m_bank[s] & i_writes[s] & (i_dest[s*INDEX +: INDEX] == m_index);
            assign r_at2[s]      = r_bank[s] & in_flight[s*DEPTH+2] & (index2 == r_index);
            assign i_at2[s]      = i_bank[s] & in_flight[s*DEPTH+2] & (index2 == i_index);
        end
    endgenerate

    // State of the address in read: its result is in place 2 or beyond (r_later), in place 1 (r_at1), in place 0 (r_at0), or will be
    // computed by the bundle now in issue (r_on_issue).
    reg [SLOTS-1:0] r_near, r_far;
    reg r_from_issue, r_on_issue, r_on_issue_early, r_on_issue_late, r_at1, r_at0;
    // State of the address in issue: its result is in place 2 or beyond (i_later), or in place 1 (i_at1).
    reg i_later, i_at1;

    wire r_later = (|r_near) | (|r_far) | r_from_issue;
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
