// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_sequencer: next-address logic: branches, calls, loops, the tick, halts and faults.
//
// The bundle that issued in the last cycle is in the execute stage (x_). A redirecting operation is resolved there; in the next
// cycle, the address of its target goes to the program memory.
//
// Contract
//   A bundle's address moves with it: fetched, then d_ decode, m_ match, r_ read, i_ issue, x_ execute.
//   flush: the bundles fetched after the redirecting one are squashed, and fetch is the target's address. Without flush, fetch
//   is the address after the last one fetched, or the start of the loop that ends with it (takt_loops).
//   fault: the bundle that issued two cycles ago was at fault. Neither it nor any bundle issued since takes effect.
//   block: nothing issues in the next cycle.
//   Reset acts as a jump to 0 in the cycle before cycle 0.
//   open: the program waits, and there is no tick in this cycle. ends: a `wait` issued in the last cycle. ended: a `wait` issued
//   two cycles ago, and no fault cancelled it. published: the same of a `publish` or a `wait`.
//   tick acts in the cycle in which it is high; in the same cycle, missed reports a missed deadline, lost a lost tick.
//   fault and fault_* are valid from the second cycle after that of the fault on. Without a fault, fault_* mean nothing.
//   fault_kind: 1 illegal word, 2 data address, 3 return stack full, 4 return stack empty, 5 loops too deep, 6 loop count, 7 loop
//   nesting.

module takt_sequencer #(
    parameter PROGRAM = 10,  // bits of an address of the program memory, at most 16
    parameter STACK   = 16,  // entries of the return stack, a power of two
    parameter LOOPS   = 4,   // inside one another, at most; 0: there is no `loop`
    parameter REFILL  = 6,
    parameter RESOLVE = 2,
    parameter SLOT    = 2,   // its number
    parameter SLOTS   = 3
) (
    input  wire             clk,
    input  wire             rst,
    input  wire             advance,
    input  wire             issue,
    input  wire             refused,
    input  wire [SLOTS-1:0] i_illegal,
    // The redirecting operation of the bundle in issue, and its target, which is known in read.
    input  wire             i_jump,
    input  wire             i_branch_zero,
    input  wire             i_branch_nonzero,
    input  wire             i_call,
    input  wire             i_return,
    input  wire             i_loop,
    input  wire             i_publish,
    input  wire             i_wait,
    input  wire             i_halt,
    input  wire [15:0]      r_target,
    input  wire [15:0]      i_target,
    input  wire [31:0]      x_operand,
    input  wire [SLOTS-1:0] x_address_fault,  // of the load or store of a slot
    input  wire             tick,
    output reg              flush,
    output wire [PROGRAM-1:0] fetch,
    output wire             f_outside,     // the address lies outside the program memory
    output wire             block,
    output reg  [15:0]      i_address,
    output reg              x_issued,
    output reg  [15:0]      x_address,
    output reg              waiting,
    output wire             open,
    output wire             ends,
    output wire             ended,
    output wire             published,
    output wire             missed,
    output wire             lost,
    output reg              deadline_missed,
    output reg              halted,
    output reg              fault,
    output reg  [2:0]       fault_kind,
    output reg  [2:0]       fault_slot,
    output reg  [15:0]      fault_address
);

    localparam [2:0] OWN_SLOT    = SLOT;
    localparam [SLOTS-1:0] EARLIER = (1 << SLOT) - 1;  // the slots before its own
    localparam [SLOTS-1:0] OTHERS  = ~(1 << SLOT);
    localparam LEVEL = $clog2(STACK);
    localparam [LEVEL:0]   ENTRY = 1;
    localparam [LEVEL-1:0] BELOW = 1;

    generate
        if (REFILL != 6 || RESOLVE != 2) begin : g_refill
            takt_sequencer_has_refill_6_and_resolve_2 unsupported ();
        end
        if (STACK < 2 || STACK > 64 || STACK != 1 << LEVEL) begin : g_stack
            takt_sequencer_has_stack_2_to_64 unsupported ();
        end
    endgenerate

    // ---- execute

    reg        x_if_zero, x_if_nonzero;  // it redirects if its operand is 0, if it is not
    reg        x_call, x_return, x_loop, x_publish, x_wait, x_halt, x_refused;
    reg        x_nested;  // an operation that redirects ends a loop
    reg [15:0] x_target;
    reg [2:0]  x_illegal_slot;

    reg [15:0]      stack [0:STACK-1];
    reg [LEVEL:0]   entries;
    reg [LEVEL-1:0] top;  // entries - 1

    wire stack_full  = x_call & entries[LEVEL];
    wire stack_empty = x_return & ~|entries;

    reg  [15:0] fetched;  // the address of the word on the program memory's output
    reg  [15:0] d_address, m_address, r_address;
    reg  [15:0] target;
    wire [15:0] next_fetch = fetched + 16'd1;
    wire        again;  // the last bundle of a loop was fetched, and the next one is its first
    wire [PROGRAM-1:0] loop_start;
    wire [15:0] chosen     = flush ? target : again ? {{16-PROGRAM{1'b0}}, loop_start} : next_fetch;
    assign fetch     = chosen[PROGRAM-1:0];
    assign f_outside = |(fetched >> PROGRAM);

    wire take = issue & ~fault;
    wire i_short, i_ends, loops_full, loops_cut;
    wire always_redirects = i_jump | i_call | i_return | i_wait | (i_loop & i_short);
    wire redirects = always_redirects | i_branch_zero | i_branch_nonzero | i_halt;
    wire [15:0] x_next = x_address + 16'd1;
    integer s;
    always @(posedge clk) begin
        if (flush | advance) fetched <= chosen;
        if (advance) begin
            d_address <= fetched;
            m_address <= d_address;
            r_address <= m_address;
            i_address <= r_address;
        end
        flush        <= x_operand == 32'd0 ? x_if_zero : x_if_nonzero;
        target       <= x_return ? stack[top] : x_loop ? x_next : x_target;
        x_address    <= i_address;
        x_target     <= i_target;
        x_issued     <= take;
        x_if_zero    <= take & (always_redirects | i_branch_zero);
        x_if_nonzero <= take & (always_redirects | i_branch_nonzero);
        x_call       <= take & i_call;
        x_return     <= take & i_return;
        x_loop       <= take & i_loop;
        x_publish    <= take & i_publish & ~i_ends;
        x_wait       <= take & i_wait & ~i_ends;
        x_halt       <= take & i_halt & ~i_ends;
        x_nested     <= take & i_ends & (redirects | i_loop | i_publish);
        x_refused    <= refused;
        for (s = SLOTS - 1; s >= 0; s = s - 1) if (i_illegal[s]) x_illegal_slot <= s[2:0];
        if (x_call) begin
            stack[entries[LEVEL-1:0]] <= x_next;
            entries <= entries + ENTRY;
            top     <= top + BELOW;
        end
        if (x_return) begin
            entries <= entries - ENTRY;
            top     <= top - BELOW;
        end
        if (rst) begin
            {x_call, x_return, x_loop, x_publish, x_wait, x_halt, x_nested, x_refused, x_issued} <= 9'd0;
            {flush, x_if_zero, x_if_nonzero} <= 3'b011;
            x_target <= 16'd0;
            entries  <= 0;
            top      <= {LEVEL{1'b1}};
        end
    end

    // ---- loops

    generate
        if (LOOPS > 0) begin : g_loops
            takt_loops #(
                .PROGRAM(PROGRAM),
                .LOOPS(LOOPS),
                .REFILL(REFILL)
            ) loops (
                .clk(clk),
                .rst(rst),
                .advance(advance),
                .flush(flush),
                .fetched(fetched[PROGRAM-1:0]),
                .again(again),
                .start(loop_start),
                .r_address(r_address),
                .r_target(r_target),
                .take(take),
                .i_short(i_short),
                .i_ends(i_ends),
                .push(x_loop),
                .x_address(x_address),
                .x_start(x_next[PROGRAM-1:0]),
                .x_target(x_target),
                .x_count(x_operand[15:0]),
                .full(loops_full),
                .cuts(loops_cut)
            );
        end else begin : g_no_loops
            assign {again, i_short, i_ends, loops_full, loops_cut} = 5'd0;
            assign loop_start = {PROGRAM{1'b0}};
            wire unused = &{1'b0, r_target};
        end
    endgenerate

    wire loop_full  = x_loop & loops_full;
    wire loop_count = x_loop & ((|x_operand[31:16]) | (x_operand == 32'd0));
    wire loop_cuts  = x_loop & loops_cut;

    wire own_fault = x_nested | stack_full | stack_empty | loop_full | loop_count | loop_cuts;

    // ---- the data memory's faults: a bundle's fault is that of its first slot at fault

    wire any_address   = |x_address_fault;
    wire address_first = |(x_address_fault & EARLIER) | (any_address & ~own_fault);
    reg  [2:0] address_slot;
    integer t;
    always @* begin
        address_slot = 3'd0;
        for (t = SLOTS - 1; t >= 0; t = t - 1) if (x_address_fault[t]) address_slot = t[2:0];
    end

    // ---- the tick

    reg  remembered;
    wire waits = waiting | (x_wait & ~remembered & ~fault);
    wire still = remembered & ~x_wait;  // is remembered when the tick comes

    assign missed = tick & ~waits & ~still;
    assign lost   = tick & ~waits & still;
    wire wait_next = waits & ~tick;
    assign open = wait_next;
    assign ends = x_wait & ~fault;
    reg was_wait, was_publish;
    always @(posedge clk) begin
        was_wait    <= ends & ~rst;
        was_publish <= x_publish & ~fault & ~rst;
    end
    assign ended     = was_wait & ~fault;
    assign published = (was_wait | was_publish) & ~fault;

    always @(posedge clk) begin
        waiting    <= wait_next & ~(x_wait & (|(x_address_fault & OTHERS)));  // a load at fault may stand beside it
        remembered <= still | missed;
        if (missed) deadline_missed <= 1'b1;
        if (rst) begin
            waiting         <= 1'b0;
            remembered      <= 1'b0;
            deadline_missed <= 1'b0;
        end
    end

    // ---- stops

    assign block = (issue & redirects) | x_if_zero | x_if_nonzero | wait_next | x_halt | halted | refused | x_refused | fault;

    always @(posedge clk) begin
        if (x_halt & ~fault & ~any_address) halted <= 1'b1;  // a load at fault may stand beside it
        // fault_* follow the bundle in execute in every cycle and freeze at a fault, so that they do not depend on its detection, which
        // would lengthen the path.
        if (~fault) begin
            fault      <= x_refused | any_address | own_fault;
            fault_kind <= x_refused ? 3'd1 : address_first ? 3'd2 : x_nested ? 3'd7 : stack_full ? 3'd3 : stack_empty ? 3'd4 :
                loop_full ? 3'd5 : loop_count ? 3'd6 : 3'd7;
            fault_slot <= x_refused ? x_illegal_slot : address_first ? address_slot : OWN_SLOT;
            fault_address <= x_address;
        end
        if (rst) begin
            halted <= 1'b0;
            fault  <= 1'b0;
        end
    end

endmodule
