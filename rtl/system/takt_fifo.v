// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_fifo: FIFO queue between two cores (docs/system.md, FIFO). The queue itself is on the receiver's side.
//
// Contract
//   write, value: the sender's ports, in the cycle of writeback. push in cycle s adds an entry in e = s + LENGTH, with the values
//   written last, in s or before. HOST: the entry is value, in the cycle of push.
//   pop in cycle e removes the head. If both come in one cycle, the pop is first. A push into a full queue is refused, a pop from an
//   empty one has no effect; these set the sticky overflow and underflow.
//   In e + 1: another, if the head has changed in e; changed, if there was a push or a pop in e, accepted or not; head and status,
//   after e. head means nothing while the queue is empty. told and the ports after it: changed and the status, LENGTH cycles later,
//   for the sender.
//   pushed, popped, refused, missed: the events of cycle e, in e.

module takt_fifo #(
    parameter FIELDS = 1,
    parameter DEPTH  = 2,
    parameter COUNT  = 2,    // bits of the number of entries, DEPTH included
    parameter LENGTH = 0,
    parameter HOST   = 0,
    parameter [32*FIELDS-1:0] INITIAL = 0
) (
    input  wire                 clk,
    input  wire                 rst,
    input  wire [FIELDS-1:0]    write,
    input  wire [32*FIELDS-1:0] value,
    input  wire                 push,
    input  wire                 pop,
    output wire [32*FIELDS-1:0] head,
    output reg                  another,
    output reg                  changed,
    output wire                 empty,
    output wire                 full,
    output reg  [COUNT-1:0]     count,
    output reg                  overflow,
    output reg                  underflow,
    output wire                 told,
    output wire                 told_empty,
    output wire                 told_full,
    output wire [COUNT-1:0]     told_count,
    output wire                 told_overflow,
    output wire                 told_underflow,
    output wire                 pushed,
    output wire                 popped,
    output wire                 refused,
    output wire                 missed
);

    localparam WIDTH   = 32 * FIELDS;
    localparam ADDRESS = DEPTH > 1 ? $clog2(DEPTH) : 1;
    localparam LAST    = DEPTH - 1;
    localparam [COUNT-1:0] MOST = DEPTH, ONE = 1, NONE = 0;

    // ---- the sender's side

    wire [WIDTH-1:0] sent, entry;
    wire             put;
    genvar f;
    generate
        if (HOST) begin : g_host
            assign sent = value;
            wire unused = &{1'b0, write};
        end else begin : g_core
            reg [WIDTH-1:0] working;
            always @(posedge clk) working <= rst ? INITIAL : sent;
            for (f = 0; f < FIELDS; f = f + 1) begin : g_field
                assign sent[32*f +: 32] = write[f] ? value[32*f +: 32] : working[32*f +: 32];
            end
        end
    endgenerate
    takt_delay #(.LENGTH(LENGTH), .WIDTH(WIDTH)) way (
        .clk(clk), .in_valid(push), .in(sent), .out_valid(put), .out(entry)
    );

    // ---- the queue

    reg  [ADDRESS-1:0] first, free;
    assign empty   = count == NONE;
    assign full    = count == MOST;
    assign popped  = pop & ~empty;
    assign missed  = pop & empty;
    assign pushed  = put & (~full | popped);
    assign refused = put & full & ~popped;
    wire [ADDRESS-1:0] second = first == LAST[ADDRESS-1:0] ? {ADDRESS{1'b0}} : first + 1'b1;
    wire [ADDRESS-1:0] next   = popped ? second : first;

    generate
        if (DEPTH <= 32) begin : g_logic
            // The memory is read after the address register: otherwise pop would be on the path to every bit of it.
            reg [WIDTH-1:0] words [0:DEPTH-1];
            always @(posedge clk) if (pushed) words[free] <= entry;
            assign head = words[first];
        end else begin : g_block
            (* no_rw_check *)
            reg [WIDTH-1:0] words [0:DEPTH-1];
            reg [WIDTH-1:0] read, latest;
            reg             is_latest;
            always @(posedge clk) begin
                if (pushed) words[free] <= entry;
                read      <= words[next];
                latest    <= entry;
                is_latest <= pushed & free == next;
            end
            // An entry that becomes the head at once is forwarded, since it is not in the memory yet.
            assign head = is_latest ? latest : read;
        end
    endgenerate

    always @(posedge clk) begin
        first     <= next;
        if (pushed) free <= free == LAST[ADDRESS-1:0] ? {ADDRESS{1'b0}} : free + 1'b1;
        count     <= count + {{COUNT-1{1'b0}}, pushed} - {{COUNT-1{1'b0}}, popped};
        overflow  <= overflow | refused;
        underflow <= underflow | missed;
        another   <= (popped & count != ONE) | (pushed & (empty | (popped & count == ONE)));
        changed   <= put | pop;
        if (rst) begin
            {first, free}         <= {2 * ADDRESS{1'b0}};
            count                 <= NONE;
            {overflow, underflow} <= 2'b00;
            {another, changed}    <= 2'b00;
        end
    end

    // ---- back to the sender

    takt_delay #(.LENGTH(LENGTH), .WIDTH(COUNT + 4)) back (
        .clk(clk), .in_valid(changed), .in({empty, full, count, overflow, underflow}),
        .out_valid(told), .out({told_empty, told_full, told_count, told_overflow, told_underflow})
    );

endmodule
