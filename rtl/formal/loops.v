// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_loops_meaning: the sequencer beside the meaning of a program, executed one bundle after the other.
//
// The program is arbitrary: each bundle has a jump, a branch, a loop or neither, and its target. So are the operands
// and the cycles in which a bundle may issue. bad: a bundle issues that is not the next one, or a fault is reported
// without a cause, or missing.

module takt_loops_meaning #(
    parameter PROGRAM = 3
) (
    input  wire                              clk,
    input  wire                              rst,
    input  wire [(2 << PROGRAM)-1:0]         kinds,    // of each bundle: 0 none of them, 1 jump, 2 branch_zero, 3 loop
    input  wire [(PROGRAM << PROGRAM)-1:0]   targets,
    input  wire                              r_ready,
    input  wire                              i_ready,
    input  wire [31:0]                       x_operand,
    output wire                              bad,
    output wire                              ends      // the innermost of two loops ends: to show that this is reached
);

    wire issue, advance, flush, block, f_outside, fault;
    wire [PROGRAM-1:0] fetch;
    wire [15:0] i_address;

    // The program moves through the pipeline as in the core: its address, and whether it is outside of the program
    // memory.
    reg [PROGRAM-1:0] fetched, d_bundle, m_bundle, r_bundle, i_bundle;
    reg d_outside, m_outside, r_outside, i_outside;
    always @(posedge clk) begin
        if (flush | advance) fetched <= fetch;
        if (advance) begin
            {d_bundle, m_bundle, r_bundle, i_bundle} <= {fetched, d_bundle, m_bundle, r_bundle};
            {d_outside, m_outside, r_outside, i_outside} <= {f_outside, d_outside, m_outside, r_outside};
        end
    end
    wire [15:0] r_target = {{16-PROGRAM{1'b0}}, targets[PROGRAM*r_bundle +: PROGRAM]};
    wire [15:0] i_target = {{16-PROGRAM{1'b0}}, targets[PROGRAM*i_bundle +: PROGRAM]};
    wire [1:0]  i_kind   = kinds[2*i_bundle +: 2];

    takt_issue issuing (
        .clk(clk), .rst(rst), .flush(flush), .block(block), .r_ready(r_ready), .i_ready(i_ready),
        .r_illegal(r_outside), .i_illegal(i_outside), .m_valid(), .issue(issue), .advance(advance), .refused()
    );
    takt_sequencer #(.PROGRAM(PROGRAM), .STACK(2)) sequencer (
        .clk(clk), .rst(rst), .advance(advance), .issue(issue), .refused(1'b0), .i_illegal(3'd0),
        .i_jump(i_kind == 2'd1), .i_branch_zero(i_kind == 2'd2), .i_branch_nonzero(1'b0), .i_call(1'b0), .i_return(1'b0),
        .i_loop(i_kind == 2'd3), .i_publish(1'b0), .i_wait(1'b0), .i_halt(1'b0), .r_target(r_target), .i_target(i_target), .x_operand(x_operand),
        .x_address_fault(3'd0), .tick(1'b0), .flush(flush), .fetch(fetch), .f_outside(f_outside), .block(block),
        .i_address(i_address), .x_issued(), .x_address(), .waiting(), .open(), .ends(), .ended(), .published(), .missed(), .lost(),
        .deadline_missed(), .halted(), .fault(fault), .fault_kind(), .fault_slot(), .fault_address()
    );

    // The bundle in execute, and the active loops: start, end and iterations left of each.
    reg        x;
    reg [1:0]  x_kind;
    reg [15:0] x_address, x_target, expected;
    reg [2:0]  depth;
    reg [63:0] starts, lasts, lefts;
    reg        stopped, at_fault;
    wire [1:0]  top     = depth[1:0] - 2'd1;
    wire        within  = depth != 3'd0;
    wire [15:0] start   = starts[16*top +: 16];
    wire [15:0] last    = lasts[16*top +: 16];
    wire [15:0] left    = lefts[16*top +: 16];
    wire        is_end  = within & (x_address == last);
    wire        is_loop = x_kind == 2'd3;
    wire        wrong   = (is_end & (x_kind != 2'd0)) | (is_loop & (depth == 3'd4 | x_operand == 32'd0 | x_operand > 32'd65535))
        | (is_loop & within & last >= x_address & last < x_target);
    wire        more    = left != 16'd1;
    wire        jumps   = x_kind == 2'd1 | (x_kind == 2'd2 & x_operand == 32'd0);
    wire [15:0] after   = jumps ? x_target : is_end & more ? start : x_address + 16'd1;
    wire [15:0] next    = x ? after : expected;
    wire        takes   = issue & ~fault & ~stopped & ~(x & wrong);
    always @(posedge clk) begin
        x         <= takes;
        x_kind    <= i_kind;
        x_address <= i_address;
        x_target  <= i_target;
        expected  <= next;
        at_fault  <= x & wrong;
        if (x & wrong) stopped <= 1'b1;
        if (x & ~wrong & is_end) begin
            if (more) lefts[16*top +: 16] <= left - 16'd1;
            else depth <= depth - 3'd1;
        end
        if (x & ~wrong & is_loop) begin
            starts[16*depth[1:0] +: 16] <= x_address + 16'd1;
            lasts[16*depth[1:0] +: 16]  <= x_target - 16'd1;
            lefts[16*depth[1:0] +: 16]  <= x_operand[15:0];
            depth <= depth + 3'd1;
        end
        if (rst) begin
            {x, stopped, at_fault} <= 3'd0;
            depth    <= 3'd0;
            expected <= 16'd0;
        end
    end
    assign bad  = ~rst & ((takes & (i_address != next)) | (at_fault & ~fault) | (fault & ~at_fault & ~stopped));
    assign ends = ~rst & x & ~wrong & is_end & ~more & depth == 3'd2;

endmodule
