// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_scope: records registers and input ports of a core, period by period, in block RAM, around a trigger; the core does not notice.
//
// Contract
//   A channel watches the register `select` names: the core's writes (retire, or load), or writes to an input port, if the address is
//   one of these. Restricted to a bundle, only that bundle's writes count. A channel has a value once it has seen one, or the
//   host has given it one (`value`, which has no effect afterwards); `restart` takes away all values.
//   A period ends with `ended` (those before the first core_tick end none). It gets the number of periods since core_rst. Input ports
//   are taken in the cycle after, registers when the core has waited for SETTLE cycles, or goes on before.
//   A period that ends less than CHANNELS + 8 cycles after another may change the input ports of that one's sample.
//   Every `every` periods, the first after arming included, the values are a sample, kept in a ring. A channel's `have` counts the last samples
//   in which it has a value.
//   Armed, the scope looks for its trigger in each period: events of the mask since arming (fault or halt, missed, tripped rises, drive
//   falls), a write of `now`, or the comparison, which counts only once `before` samples are kept. The trigger's sample is the first kept from
//   then on; `after` more follow, and the scope is done. A fault or halt that triggers, or comes after the trigger, gives a last sample SETTLE
//   cycles later, and ends it. core_rst ends it after the trigger, and drops the samples before.
//   Addresses: docs/protocol.md, from 40 (hexadecimal) on. read is the register at `address` a cycle before, sample the word at `at` two
//   cycles before: channels of a sample are neighbours.

module takt_scope #(
    parameter SLOTS    = 3,
    parameter CHANNELS = 4,      // a power of two, 8 at most
    parameter DEPTH    = 8,      // bits of a sample's place in the ring, 15 at most
    parameter INPUTS   = 10'd768, // address of the first input port
    parameter PORTS    = 8,      // bits of a port's number
    parameter CORE     = 0,
    parameter BUNDLES  = 1,      // retire_address is connected
    parameter SETTLE   = 40
) (
    input  wire                clk,
    input  wire                rst,
    input  wire                core_rst,
    input  wire                restart,
    input  wire                load,
    input  wire [1:0]          load_space,
    input  wire [9:0]          load_address,
    input  wire [31:0]         load_value,
    input  wire                core_tick,
    input  wire                ended,
    input  wire                waiting,
    input  wire                stopped,
    input  wire                missed,
    input  wire                tripped,
    input  wire                drive,
    input  wire [SLOTS-1:0]    retire,
    input  wire [10*SLOTS-1:0] retire_register,
    input  wire [16*SLOTS-1:0] retire_address,
    input  wire [32*SLOTS-1:0] retire_value,
    input  wire                in_write,
    input  wire [PORTS-1:0]    in_index,
    input  wire [31:0]         in_value,
    input  wire                bus_write,
    input  wire [5:0]          address,
    input  wire [31:0]         bus_value,
    input  wire [16:0]         at,
    output reg  [31:0]         read,
    output reg  [31:0]         sample
);

    localparam INDEX = CHANNELS > 4 ? 3 : CHANNELS > 2 ? 2 : CHANNELS > 1 ? 1 : 0;
    localparam [2:0]  LAST = CHANNELS - 1;
    localparam [7:0]  REST = SETTLE;
    localparam [9:0]  FIRST = INPUTS;
    localparam [31:0] IS = (BUNDLES << 28) | (CORE << 24) | (CHANNELS << 16) | (1 << DEPTH);

    // ---- the host's registers

    reg  [11:0] every, phase;
    reg  [15:0] leading, trailing;
    reg  [2:0]  mode, tests;
    reg  [1:0]  ty;
    reg  [3:0]  mask;
    reg  [31:0] level;
    wire        own    = bus_write & ~address[5];
    wire        acts   = own & address[4:0] == 5'd1;
    wire        arms   = acts & bus_value[0];
    always @(posedge clk) begin
        if (own) case (address[4:0])
            5'd2: every <= bus_value[11:0];
            5'd3: {trailing, leading} <= bus_value;
            5'd4: {mask, ty, tests, mode} <= {bus_value[19:16], bus_value[9:8], bus_value[6:4], bus_value[2:0]};
            5'd5: level <= bus_value;
            default: ;
        endcase
        if (rst) {mask, mode, every} <= {4'd0, 3'd0, 12'd1};
    end

    // ---- what the core writes, a cycle later

    wire                loads = load & load_space == 2'd2;
    reg  [SLOTS-1:0]    wrote;
    reg  [10*SLOTS-1:0] wrote_register;
    reg  [16*SLOTS-1:0] wrote_address;
    reg  [32*SLOTS-1:0] wrote_value;
    reg                 came, loaded;   // an input port's value; a register's, or the former: never both
    reg  [9:0]          came_register;
    reg  [31:0]         came_value;
    always @(posedge clk) begin
        wrote           <= retire;
        wrote_register  <= retire_register;
        wrote_address   <= retire_address;
        wrote_value     <= retire_value;
        came            <= in_write | loads;
        loaded          <= loads;
        came_register   <= loads ? load_address : FIRST | {{(10-PORTS){1'b0}}, in_index};
        came_value      <= loads ? load_value : in_value;
    end

    // ---- channels

    wire        samples_inputs;  // in the cycle after a period's end
    wire        samples;         // all others
    wire        stops;           // samples, because the core has stopped
    wire        keeps_one, clears;
    wire [CHANNELS-1:0]    holds;
    wire [CHANNELS+7:0]    all_hold = {8'd0, holds};
    wire [32*CHANNELS-1:0] held;
    wire [32*CHANNELS-1:0] shown;  // by the host
    genvar c;
    generate
        for (c = 0; c < CHANNELS; c = c + 1) begin : g_channel
            localparam [2:0] NUMBER = c;
            reg  [9:0]  register;
            reg  [13:0] bundle;
            reg         restricts, valid, held_valid;
            reg  [31:0] value, kept;
            reg  [15:0] have;
            reg         match;
            reg  [31:0] matched;
            wire        mine     = bus_write & address[5] & address[4:2] == NUMBER;
            wire        is_input = register >> PORTS == FIRST >> PORTS;
            integer     s;
            always @* begin
                match   = 1'b0;
                matched = 32'd0;
                for (s = 0; s < SLOTS; s = s + 1)
                    if (wrote[s] & wrote_register[10*s +: 10] == register
                        & (~restricts | wrote_address[16*s +: 16] == {2'd0, bundle})) begin
                        match   = 1'b1;
                        matched = matched | wrote_value[32*s +: 32];
                    end
                if (came & came_register == register & ~(loaded & restricts)) begin
                    match   = 1'b1;
                    matched = matched | came_value;
                end
            end
            always @(posedge clk) begin
                if (match) begin
                    value <= matched;
                    valid <= 1'b1;
                end else if (mine & address[1:0] == 2'd1 & ~valid) begin
                    value <= bus_value;
                    valid <= 1'b1;
                end
                if (mine & address[1:0] == 2'd0) begin
                    {restricts, bundle, register} <= {bus_value[30], bus_value[29:16], bus_value[9:0]};
                    valid <= 1'b0;
                end
                if (restart) valid <= 1'b0;
                if (is_input & ~stops ? samples_inputs : samples) begin
                    kept       <= value;
                    held_valid <= valid;
                end
                if (keeps_one) have <= held_valid & ~&have ? have + 16'd1 : have;
                if (clears) have <= 16'd0;
                if (rst) valid <= 1'b0;
            end
            assign holds[c] = held_valid;
            assign held[32*c +: 32] = kept;
            assign shown[32*c +: 32] = address[4:2] != NUMBER | address[0] ? 32'd0
                : address[1] ? {16'd0, have} : {1'b0, restricts, bundle, 6'd0, register};
        end
    endgenerate

    // ---- the end of a period, and a core that stops

    localparam [1:0] REST_STATE = 2'd0, ARMED = 2'd1, AFTER = 2'd2, DONE = 2'd3;
    reg  [1:0]  state;
    reg         begun, ends, pending, was_stopped, stopping;
    reg  [7:0]  rest;
    reg  [31:0] periods;
    reg         walks, kept_walk, stop_walk;
    reg         busy1, busy2, busy3, decides;
    reg  [3:0]  events;
    reg         forced;
    wire        busy = walks | busy1 | busy2 | busy3 | decides;
    wire        records = state == ARMED | state == AFTER;
    assign samples_inputs = ends;
    assign stops   = stopping & ~pending & ~busy & rest == REST;
    wire   shows   = state == AFTER | (state == ARMED & (mask[0] | |events | forced));
    wire   regular = pending & ~busy & ~ends & (rest == REST | ~waiting);
    assign samples = regular | stops;
    always @(posedge clk) begin
        begun       <= begun | core_tick;
        ends        <= ended & begun;
        was_stopped <= stopped;
        if (ended & begun) begin
            periods <= periods + 32'd1;
            pending <= 1'b1;
        end else if (regular) pending <= 1'b0;
        if (stopped & ~was_stopped) stopping <= 1'b1;
        else if (stops) stopping <= 1'b0;
        rest <= (ended & begun) | (stopped & ~was_stopped) ? 8'd0 : rest + {7'd0, rest != REST};
        if (core_rst | rst) begin
            {begun, ends, pending, was_stopped, stopping} <= 5'd0;
            periods <= 32'd0;
        end
    end

    // ---- a walk over the channels: into the ring, and past the comparison

    reg  [2:0]       number, number1;
    reg              writes1, last1;
    reg  [31:0]      word1, tested;
    reg              tested_holds, tests_it;
    reg  [DEPTH-1:0] place;
    wire [2:0]       next = number;
    (* no_rw_check *)
    reg  [31:0]      ring [0:(1<<(DEPTH+INDEX))-1];
    wire [DEPTH+2:0] to = {place, 3'd0} >> (3 - INDEX) | {{DEPTH{1'b0}}, number1};
    reg  [31:0]      fetched;
    reg  [31:0]      word;
    integer          w;
    always @* begin
        word = 32'd0;
        for (w = 0; w < CHANNELS; w = w + 1) word = word | (number == w[2:0] ? held[32*w +: 32] : 32'd0);
    end
    always @(posedge clk) begin
        if (samples & (regular | shows)) begin
            walks     <= 1'b1;
            number    <= 3'd0;
            kept_walk <= records & (stops | phase == 12'd0);
            stop_walk <= stops;
        end else if (walks) begin
            number <= next + 3'd1;
            if (number == LAST) walks <= 1'b0;
        end
        busy1    <= walks;
        number1  <= number;
        writes1  <= walks & kept_walk;
        last1    <= walks & number == LAST;
        word1    <= word;
        tests_it <= walks & number == tests;
        if (tests_it) begin
            tested       <= word1;
            tested_holds <= all_hold[{1'b0, tests}];
        end
        if (writes1) ring[to[DEPTH+INDEX-1:0]] <= word1;
        fetched <= ring[at[DEPTH+INDEX-1:0]];
        sample  <= fetched;
        if (core_rst | rst | arms) {walks, busy1, writes1, last1} <= 4'd0;
    end

    // Keys: integers without sign, in the order of the values. -0 is 0.
    wire        is_float = ty == 2'd0;
    wire        nan      = is_float & &tested[30:23] & |tested[22:0];
    wire [31:0] zero     = is_float & tested[30:0] == 31'd0 ? 32'd0 : tested;
    reg  [31:0] key, prior;
    reg         ordered, known, above, equal, same, prior_known, prior_ordered, prior_above;
    reg         met;
    always @* begin
        case (mode)
            3'd1: met = ordered & above;
            3'd2: met = ordered & ~above;
            3'd3: met = ordered & above & prior_ordered & ~prior_above;
            3'd4: met = ordered & ~above & prior_ordered & prior_above;
            3'd5: met = ordered & equal;
            3'd6: met = known & prior_known & ~same;
            default: met = 1'b0;
        endcase
    end

    // ---- the trigger

    reg  [15:0]      count, remaining;
    reg              wants;
    reg  [5:0]       causes;
    reg  [DEPTH-1:0] trigger_place;
    reg  [31:0]      trigger_period, last_period;
    reg              was_tripped, drove, stop_sample;
    wire [3:0]       happened = {drove & ~drive, tripped & ~was_tripped, missed, 1'b0};
    wire [3:0]       seen     = events | {3'd0, stop_walk & mask[0]};
    wire             compared = met & count >= leading;
    wire             hit      = |seen | forced | compared;
    wire [31:0]      walked   = periods + {31'd0, stop_walk};
    wire             decided  = decides & records & ~arms & ~core_rst;
    assign keeps_one = decided & kept_walk;
    assign clears    = arms | (core_rst & state == ARMED);
    always @(posedge clk) begin
        busy2   <= last1;
        busy3   <= busy2;
        decides <= busy3;
        key     <= ty == 2'd2 ? tested : is_float & zero[31] ? ~zero : {~zero[31], zero[30:0]};
        ordered <= tested_holds & ~nan;
        known   <= tested_holds;
        above   <= key >= level;
        equal   <= key == level;
        same    <= key == prior;
        {was_tripped, drove} <= {tripped, drive};
        if (state == ARMED) events <= events | (happened & mask);
        if (decided) begin
            {prior, prior_known, prior_ordered, prior_above} <= {key, known, ordered, above};
            if (~stop_walk) phase <= phase == 12'd0 ? (every == 12'd0 ? 12'd0 : every - 12'd1) : phase - 12'd1;
            if (kept_walk) begin
                place       <= place + 1'b1;
                count       <= count + {15'd0, ~&count};
                last_period <= walked;
                stop_sample <= stop_walk;
            end
            if (state == ARMED & hit) begin
                causes         <= {compared, forced, seen};
                trigger_period <= walked;
                state          <= AFTER;
                wants          <= 1'b1;
            end
            if ((state == ARMED & hit) | wants) begin
                if (kept_walk) begin
                    trigger_place <= place;
                    remaining     <= trailing;
                    wants         <= 1'b0;
                    if (trailing == 16'd0) state <= DONE;
                end
            end else if (state == AFTER & kept_walk) begin
                remaining <= remaining - 16'd1;
                if (remaining == 16'd1) state <= DONE;
            end
            if (stop_walk) state <= DONE;
        end
        if (acts & bus_value[1]) forced <= 1'b1;
        if (acts & bus_value[2] & records) state <= DONE;
        if (core_rst & state == AFTER) state <= DONE;
        if (arms) begin
            state  <= ARMED;
            causes <= 6'd0;
            {events, forced} <= {4'd0, bus_value[1]};
            {wants, stop_sample} <= 2'd0;
        end
        if (clears) begin
            count <= 16'd0;
            phase <= 12'd0;
            {prior_known, prior_ordered} <= 2'd0;
        end
        if (core_rst | rst | arms) {busy2, busy3, decides} <= 3'd0;
        if (rst) begin
            state <= REST_STATE;
            place <= {DEPTH{1'b0}};
            {causes, count, phase, events, forced, wants, stop_sample} <= 41'd0;
        end
    end

    // ---- read data

    reg  [31:0] channel;
    integer     r;
    always @* begin
        channel = 32'd0;
        for (r = 0; r < CHANNELS; r = r + 1) channel = channel | shown[32*r +: 32];
    end
    always @(posedge clk) begin
        if (address[5]) read <= channel;
        else case (address[4:0])
            5'd0: read <= IS;
            5'd1: read <= {4'd0, phase, 6'd0, causes, 1'b0, stop_sample, state};
            5'd2: read <= {20'd0, every};
            5'd3: read <= {trailing, leading};
            5'd4: read <= {12'd0, mask, 6'd0, ty, 1'b0, tests, 1'b0, mode};
            5'd5: read <= level;
            5'd6: read <= {{(16-DEPTH){1'b0}}, trigger_place, {(16-DEPTH){1'b0}}, place};
            5'd7: read <= {16'd0, count};
            5'd8: read <= trigger_period;
            5'd9: read <= last_period;
            default: read <= 32'd0;
        endcase
    end

    wire unused = &{1'b0, at, to, address, retire_address};

endmodule
