// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_sinc3: a filter of third order for the bits of a delta-sigma modulator, and a faster one for overcurrent.
//
// Contract
//   A bit is 1 or -1: pin_data before a rise of the modulator's clock. The modulator samples at a rise, and gives the bit until the next.
//   CLOCK 0: the clock is pin_clock, with a period of 2 * HALF cycles; pin_data is taken two cycles before the rise. CLOCK 1: it is pin_clock_in,
//   whose halves last two cycles or more; pin_data is taken a cycle before the rise.
//   value is the sum of 3 * OSR - 2 bits with the weights of three moving averages of OSR, -OSR^3 to OSR^3, exactly. The middle of its
//   window is (3 * OSR - 1) / 2 periods of the clock before the rise with which the last bit is taken; value is new 6 cycles after
//   this rise (CLOCK 1: 8). Until the first start there is one each OSR bits, from the fourth on. start: the clock begins a period in the next
//   cycle, and windows are counted anew from the first rise then on; from now on, value takes only the one that comes after 3 * OSR
//   more bits. Starts that come every whole number of OSR periods disturb nothing; another one discards the windows under way.
//   values counts the values, and wraps.
//   trip, r_state, r_trips, clear, w_clear: of takt_trip without filter, which sees whether the sum over 3 * FAST - 2 bits is LIMIT or more,
//   or -LIMIT or less; every FAST bits, from the fourth such window on. trip is 1 from the 8th cycle after the rise of the window's last
//   bit on (CLOCK 1: 10th). LIMIT 0: never.
//   take: registers r_… hold from the next cycle on what they are in this one.
//   rst: registers are 0, nothing is held, and no start was.

module takt_sinc3 #(
    parameter HALF  = 3,   // 2 to 255
    parameter CLOCK = 0,
    parameter OSR   = 64,  // 8 to 256
    parameter FAST  = 16,  // 8 to 32
    parameter LIMIT = 0    // 0 to 32768
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        clear,
    input  wire        start,
    input  wire        take,
    input  wire        put,
    input  wire        pin_data,
    input  wire        pin_clock_in,
    input  wire [31:0] w_clear,
    output reg         pin_clock,
    output wire        trip,
    output reg  [31:0] r_value,
    output reg  [31:0] r_values,
    output wire [31:0] r_state,
    output wire [31:0] r_trips
);

    // Two's complement from -OSR^3 to OSR^3, and at least from -FAST^3 to FAST^3; sums wrap, and differences are right again.
    localparam W = OSR <= 32 ? 17 : OSR <= 64 ? 20 : OSR <= 128 ? 23 : 26;
    localparam [8:0]  WHOLE  = 2 * HALF - 1;
    localparam [8:0]  HIGH   = HALF;
    localparam [7:0]  LAST   = OSR - 1;
    localparam [4:0]  SOON   = FAST - 1;
    localparam signed [16:0] BOUND = LIMIT;

    // ---- the clock, and the bits

    reg  [8:0]  place;  // of the clock's period; at 0 it rises
    (* ASYNC_REG = "TRUE", altera_attribute = "-name SYNCHRONIZER_IDENTIFICATION FORCED_IF_ASYNCHRONOUS" *)
    reg         c0, c1, d0, d1;
    reg         c2, d2;
    wire [8:0]  next  = start | place == WHOLE ? 9'd0 : place + 9'd1;
    wire        rises = CLOCK != 0 ? c1 & ~c2 : place == 9'd0;
    wire        one   = CLOCK != 0 ? d2 : d1;

    always @(posedge clk) begin
        place     <= next;
        pin_clock <= next < HIGH;
        {c2, c1, c0} <= {c1, c0, pin_clock_in};
        {d2, d1, d0} <= {d1, d0, pin_data};
        if (rst) {place, pin_clock} <= 10'd0;
    end

    // ---- three sums, each a cycle after the one before

    reg  [1:0]   sums;  // which sum is due
    reg  [W-1:0] sum1, sum2, sum3;

    always @(posedge clk) begin
        sums <= {sums[0], rises};
        if (rises) sum1 <= sum1 + {{(W-1){~one}}, 1'b1};
        if (sums[0]) sum2 <= sum2 + sum1;
        if (sums[1]) sum3 <= sum3 + sum2;
        if (rst) begin
            sums <= 2'd0;
            {sum1, sum2, sum3} <= {(3*W){1'b0}};
        end
    end

    // ---- the windows' ends: a mark goes in with each that begins one to be kept, and comes out three ends later

    reg  [7:0] bits;
    reg  [4:0] few;
    reg        first, started;     // the next bit is the last before a window; a start has been
    reg  [2:0] ends, anew, soon;   // with the sums
    reg  [2:0] marks;
    reg  [2:0] fresh;              // the same of the fast filter
    wire       is_end = first | bits == LAST;

    always @(posedge clk) begin
        if (rises) bits <= is_end ? 8'd0 : bits + 8'd1;
        if (rises) few <= few == SOON ? 5'd0 : few + 5'd1;
        first   <= start | (first & ~rises);
        started <= started | start;
        ends    <= {ends[1:0], rises & is_end};
        anew    <= {anew[1:0], rises & first & bits != LAST};
        soon    <= {soon[1:0], rises & few == SOON};
        if (rst) begin
            {bits, few, first, started} <= 15'd0;
            {ends, anew, soon} <= 9'd0;
        end
    end

    reg        keeps;              // of the end that is due, with anew
    reg  [1:0] kept;
    always @(posedge clk) {keeps, kept} <= {kept, first | ~started};

    // ---- three differences, each a cycle after the one before

    reg  [W-1:0]  before1, before2, before3, difference1, difference2;
    reg  [16:0]   fast1, fast2, fast3, quick1, quick2;
    reg  [1:0]    differences, quicks;
    reg  [1:0]    is_kept;         // with the differences
    reg           is_fresh, over;
    reg  [31:0]   value, values;
    wire [W-1:0]  whole  = difference2 - before3;
    wire signed [16:0] quick = quick2 - fast3;

    always @(posedge clk) begin
        differences <= {differences[0], ends[2]};
        is_kept     <= {is_kept[0], marks[2] & ~anew[2]};
        if (ends[2]) begin
            marks       <= anew[2] ? 3'b001 : {marks[1:0], keeps};
            difference1 <= sum3 - before1;
            before1     <= sum3;
        end
        if (differences[0]) begin
            difference2 <= difference1 - before2;
            before2     <= difference1;
        end
        if (differences[1]) begin
            before3 <= difference2;
            if (is_kept[1]) begin
                value  <= {{(32-W){whole[W-1]}}, whole};
                values <= values + 32'd1;
            end
        end
        quicks <= {quicks[0], soon[2]};
        if (soon[2]) begin
            fresh    <= {fresh[1:0], 1'b1};
            is_fresh <= fresh[2];
            quick1   <= sum3[16:0] - fast1;
            fast1    <= sum3[16:0];
        end
        if (quicks[0]) begin
            quick2 <= quick1 - fast2;
            fast2  <= quick1;
        end
        if (quicks[1]) begin
            fast3 <= quick2;
            over  <= LIMIT != 0 & is_fresh & (quick >= BOUND | quick <= -BOUND);
        end
        if (take) {r_value, r_values} <= {value, values};
        if (rst) begin
            {marks, fresh, differences, quicks, over} <= 11'd0;
            {value, values, r_value, r_values} <= 128'd0;
        end
    end

    takt_trip #(.FILTER(0)) overcurrent (
        .clk(clk), .rst(rst), .clear(clear), .take(take), .put(put), .pin_in(over), .w_clear(w_clear),
        .trip(trip), .off(), .r_state(r_state), .r_trips(r_trips)
    );

endmodule
