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
    parameter PROGRAM = 10,  // bits of an address of the program memory, less than 16
    parameter LOOPS   = 4,
    parameter REFILL  = 6
) (
    input  wire               clk,
    input  wire               rst,
    input  wire               advance,
    input  wire               flush,
    input  wire [PROGRAM-1:0] fetched,
    output wire               again,
    output wire [PROGRAM-1:0] start,
    input  wire [15:0]        r_address,
    input  wire [15:0]        r_target,
    input  wire               take,
    output reg                i_short,
    output reg                i_ends,
    input  wire               push,
    input  wire [15:0]        x_address,
    input  wire [PROGRAM-1:0] x_start,
    input  wire [15:0]        x_target,
    input  wire [15:0]        x_count,
    output wire               full,
    output wire               cuts
);

    localparam [15:0]      SHORT = REFILL + 1;
    localparam [LOOPS-1:0] FIRST = 1;

    generate
        if (LOOPS < 1 || LOOPS > 8) begin : g_loops
            takt_loops_has_loops_1_to_8 unsupported ();
        end
    endgenerate

    // Levels in use, which are the lowest ones, and the highest of them: as of issue (used, top) and as of fetch
    // (ahead, ahead_top). next: the level that a push takes.
    reg  [LOOPS-1:0] used, ahead;
    wire [LOOPS-1:0] top       = used & ~(used >> 1);
    wire [LOOPS-1:0] ahead_top = ahead & ~(ahead >> 1);
    wire [LOOPS-1:0] next      = ((used << 1) | FIRST) & ~used;
    assign full = used[LOOPS-1];

    // The last bundle of the innermost loop, as of issue and as of fetch. Fetch looks at addresses of the program
    // memory only: a bundle outside is illegal. armed: there is such a loop. Its first bundle as of fetch, and whether
    // it has an iteration left to begin, are registered beside the levels, since they are on the path to the program
    // memory's next address.
    reg [15:0]        innermost_last;
    reg [PROGRAM-1:0] ahead_last, ahead_first;
    reg               armed, ahead_more;
    assign cuts = used[0] & (innermost_last >= x_address) & (innermost_last < x_target);
    wire   ends = armed & (fetched == ahead_last);

    // Decisions of fetch accompany their bundle to issue.
    reg d_ends, d_again, m_ends, m_again, r_ends, r_again, i_again;

    // For each level, more: an iteration is left to begin if no begun one is unknown to issue, as for a loop around a
    // pushed one; more_then: an iteration is left after another has begun.
    wire [LOOPS-1:0]         more, more_then;
    wire [PROGRAM*LOOPS-1:0] starts;
    wire [16*LOOPS-1:0]      lasts;
    wire [15:0]              x_last = x_target - 16'd1;
    assign again = ends & ahead_more;
    assign start = ahead_first;

    genvar k;
    generate
        for (k = 0; k < LOOPS; k = k + 1) begin : g_level
            reg  [PROGRAM-1:0] first;
            reg  [15:0] last, left;
            reg         few;    // left is below 16; a cycle late, when more are left than can have begun
            reg  [2:0]  begun;  // with the one that begins next: 1 to 5
            wire        begins = advance & again & ahead_top[k];
            wire        counts = take & i_again & top[k];
            assign more[k]      = ~few | (left[3:0] != 4'd1);
            assign more_then[k] = ~few | (left[3:0] != {1'b0, begun} + 4'd1);
            assign starts[PROGRAM*k +: PROGRAM] = first;
            assign lasts[16*k +: 16] = last;
            always @(posedge clk) begin
                if (counts) left <= left - 16'd1;
                few <= ~|left[15:4];
                if (flush) begun <= 3'd1;
                else if (begins != counts) begun <= begins ? begun + 3'd1 : begun - 3'd1;
                if (push & next[k]) begin
                    first <= x_start;
                    last  <= x_last;
                    left  <= x_count;
                    few   <= ~|x_count[15:4];
                    begun <= 3'd1;
                end
            end
        end
    endgenerate

    // First and last bundle of the loop around the innermost as of fetch; last bundle of the loop around the innermost
    // as of issue; first bundle of the innermost as of issue.
    reg [PROGRAM-1:0] first_around, first_issued;
    reg [15:0]        ahead_around, around;
    integer j;
    always @* begin
        first_around = {PROGRAM{1'b0}};
        first_issued = {PROGRAM{1'b0}};
        ahead_around = 16'd0;
        around       = 16'd0;
        for (j = 0; j < LOOPS; j = j + 1) begin
            if (top[j]) first_issued = first_issued | starts[PROGRAM*j +: PROGRAM];
            if (j + 1 < LOOPS) begin
                if (ahead_top[(j+1)%LOOPS]) ahead_around = ahead_around | lasts[16*j +: 16];
                if (ahead_top[(j+1)%LOOPS]) first_around = first_around | starts[PROGRAM*j +: PROGRAM];
                if (top[(j+1)%LOOPS])       around       = around | lasts[16*j +: 16];
            end
        end
    end

    always @(posedge clk) begin
        if (advance) begin
            {d_ends, d_again} <= {ends, again};
            {m_ends, m_again} <= {d_ends, d_again};
            {r_ends, r_again} <= {m_ends, m_again};
            {i_ends, i_again} <= {r_ends, r_again};
            i_short <= r_target < r_address + SHORT;
        end
        if (take & i_ends & ~i_again) begin
            used           <= used >> 1;
            innermost_last <= around;
        end
        if (flush) begin
            ahead       <= used;
            ahead_first <= first_issued;
            ahead_last  <= innermost_last[PROGRAM-1:0];
            ahead_more  <= |(top & more);
            armed       <= used[0] & ~|(innermost_last >> PROGRAM);
        end else if (advance & ends & ~again) begin
            ahead       <= ahead >> 1;
            ahead_first <= first_around;
            ahead_last  <= ahead_around[PROGRAM-1:0];
            ahead_more  <= |((ahead_top >> 1) & more);
            armed       <= ~ahead_top[0] & ~|(ahead_around >> PROGRAM);
        end else if (advance & again) begin
            ahead_more <= |(ahead_top & more_then);
        end
        if (push) begin
            used           <= used | next;
            innermost_last <= x_last;
            ahead          <= used | next;
            ahead_first    <= x_start;
            ahead_last     <= x_last[PROGRAM-1:0];
            ahead_more     <= x_count != 16'd1;
            armed          <= ~|(x_last >> PROGRAM);
        end
        if (rst) begin
            used  <= 0;
            ahead <= 0;
            armed <= 1'b0;
        end
    end

endmodule
