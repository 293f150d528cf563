// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_loops: the loops under way: where each starts and ends, and the iterations that are left.
//
// Fetch runs ahead of issue. The iterations left are those that issue has counted (left), less those begun by bundles that have been
// fetched and have not issued (begun). A flush squashes these bundles. Level 0 is the outermost loop.
//
// Contract
//   push: a `loop` is in execute. x_start is the address after its own, x_target that after its body, x_count its count.
//   again: the bundle at fetched is the last one of the innermost loop, and iterations are left: start is the next address.
//   take: the bundle in issue issues. i_ends: it is the last one of the innermost loop.
//   i_short: a `loop` in issue has a body that fetch may have passed before the push, or that ends where it is or before: the
//   bundle after it has to be fetched again.
//   full: there is no level for another loop. cuts: the innermost loop would end in the body of the one pushed. A push in spite of
//   either is a fault, and leaves the levels meaningless.

module takt_loops #(
    parameter LOOPS  = 4,
    parameter REFILL = 6
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        advance,
    input  wire        flush,
    input  wire [15:0] fetched,
    output wire        again,
    output wire [15:0] start,
    input  wire [15:0] r_address,
    input  wire [15:0] r_target,
    input  wire        take,
    output reg         i_short,
    output reg         i_ends,
    input  wire        push,
    input  wire [15:0] x_address,
    input  wire [15:0] x_start,
    input  wire [15:0] x_target,
    input  wire [15:0] x_count,
    output wire        full,
    output wire        cuts
);

    localparam [15:0]      SHORT = REFILL + 1;
    localparam [LOOPS-1:0] FIRST = 1;

    generate
        if (LOOPS < 1 || LOOPS > 8) begin : g_loops
            takt_loops_has_loops_1_to_8 unsupported ();
        end
    endgenerate

    // Levels in use, which are the lowest ones, and of these the highest: as of issue (used, top) and as of fetch (ahead, ahead_top).
    // around: the level below top. next: the level that a push takes.
    reg  [LOOPS-1:0] used, ahead;
    wire [LOOPS-1:0] top       = used & ~(used >> 1);
    wire [LOOPS-1:0] around    = top >> 1;
    wire [LOOPS-1:0] ahead_top = ahead & ~(ahead >> 1);
    wire [LOOPS-1:0] next      = ((used << 1) | FIRST) & ~used;
    assign full = used[LOOPS-1];

    // What fetch has decided on a bundle goes with it.
    reg d_ends, d_again, m_ends, m_again, r_ends, r_again, i_again;

    wire [LOOPS-1:0]    f_ends, f_more;
    wire [16*LOOPS-1:0] starts, lasts;
    assign again = |(f_ends & f_more);

    wire [15:0] x_last = x_target - 16'd1;

    genvar k;
    generate
        for (k = 0; k < LOOPS; k = k + 1) begin : g_level
            reg  [15:0] first, last, left;
            reg  [2:0]  begun;  // 4 at most: from decode to issue
            wire [3:0]  with_this = {1'b0, begun} + 4'd1;
            wire        begins = advance & f_ends[k] & f_more[k];
            wire        counts = take & i_again & top[k];
            assign f_ends[k] = ahead_top[k] & (fetched == last);
            assign f_more[k] = left != {12'd0, with_this};
            assign starts[16*k +: 16] = first & {16{ahead_top[k]}};
            assign lasts[16*k +: 16]  = last & {16{around[k]}};
            always @(posedge clk) begin
                if (counts) left <= left - 16'd1;
                if (flush) begun <= 3'd0;
                else if (begins != counts) begun <= begins ? with_this[2:0] : begun - 3'd1;
                if (push & next[k]) begin
                    first <= x_start;
                    last  <= x_last;
                    left  <= x_count;
                    begun <= 3'd0;
                end
            end
        end
    endgenerate

    // The start of the innermost loop as of fetch; the last bundle of that around the innermost one as of issue.
    reg [15:0] chosen_start, around_last;
    integer j;
    always @* begin
        chosen_start = 16'd0;
        around_last  = 16'd0;
        for (j = 0; j < LOOPS; j = j + 1) begin
            chosen_start = chosen_start | starts[16*j +: 16];
            around_last  = around_last | lasts[16*j +: 16];
        end
    end
    assign start = chosen_start;

    reg [15:0] innermost_last;
    assign cuts = used[0] & (innermost_last >= x_address) & (innermost_last < x_target);

    always @(posedge clk) begin
        if (advance) begin
            {d_ends, d_again} <= {|f_ends, again};
            {m_ends, m_again} <= {d_ends, d_again};
            {r_ends, r_again} <= {m_ends, m_again};
            {i_ends, i_again} <= {r_ends, r_again};
            i_short <= r_target < r_address + SHORT;
        end
        if (take & i_ends & ~i_again) begin
            used           <= used >> 1;
            innermost_last <= around_last;
        end
        if (flush) ahead <= used;
        else if (advance & (|f_ends) & ~again) ahead <= ahead >> 1;
        if (push) begin
            used           <= used | next;
            ahead          <= used | next;
            innermost_last <= x_last;
        end
        if (rst) begin
            used  <= 0;
            ahead <= 0;
        end
    end

endmodule
