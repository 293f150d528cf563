// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_issue: pipeline control: advances bundles through decode, match, read and issue, and decides when they issue.
//
// Contract
//   The fetch delivers a bundle to decode in the second cycle after flush, and from then on in every cycle with advance.
//   r_ready: the bundle in read meets all rules in the next cycle, if the one in issue issues now. i_ready: the bundle in issue
//   meets all rules in the next cycle, if it does not issue now. r_illegal, i_illegal: the bundle is illegal and cannot issue.
//   issue: the bundle in issue issues in this cycle. advance: it issues, or the stage is empty; all stages advance.
//   refused: the next bundle to issue is illegal.
//   block: nothing may issue in the next cycle.

module takt_issue (
    input  wire clk,
    input  wire rst,
    input  wire flush,
    input  wire block,
    input  wire r_ready,
    input  wire i_ready,
    input  wire r_illegal,
    input  wire i_illegal,
    output reg  m_valid,
    output reg  issue,
    output reg  advance,
    output reg  refused
);

    reg f_valid, d_valid, r_valid, i_valid;

    wire next_valid   = ~flush & (advance ? r_valid : i_valid);
    wire next_illegal = advance ? r_illegal : i_illegal;
    wire next_ready   = (advance ? r_ready : i_ready) & ~block;

    always @(posedge clk) begin
        issue   <= next_valid & next_ready & ~next_illegal;
        advance <= ~next_valid | (next_ready & ~next_illegal);
        refused <= next_valid & next_illegal & ~block;
        i_valid <= next_valid;
        if (advance) begin
            d_valid <= f_valid;
            m_valid <= d_valid;
            r_valid <= m_valid;
        end
        if (flush) begin
            f_valid <= 1'b1;
            d_valid <= 1'b0;
            m_valid <= 1'b0;
            r_valid <= 1'b0;
        end
        if (rst) begin
            f_valid <= 1'b0;
            d_valid <= 1'b0;
            m_valid <= 1'b0;
            r_valid <= 1'b0;
            i_valid <= 1'b0;
            issue   <= 1'b0;
            advance <= 1'b1;
            refused <= 1'b0;
        end
    end

endmodule
