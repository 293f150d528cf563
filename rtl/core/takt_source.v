// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_source: one source operand of a slot, from match to the operand register: register banks, forwarding, hazard detection.
//
// Stages: match (m_), read (r_), issue (i_); operand is valid in the cycle after issue. In read, copies of the banks deliver the
// register; a bundle that waits there reads them again in every cycle. A bundle that waits in issue takes a result for its
// register from the bus.
//
// Contract
//   Ports not named here are those of takt_hazard. m_bank: one-hot, the slots' banks, then the inputs; all 0 if the operation has
//   no such operand, or if it is `zero`.
//   result: the slots' result buses. was_result: the same, delayed by one cycle.
//   input_write, _index, _value: a write to an input port, whose values are in a bank of their own. input_next_value: the value,
//   delayed by one cycle. Bundles that issue in the cycle after that or later read it. If LATCHED, an input port has two buffers:
//   input_write_place is the one written, m_place the one that the bundle in match reads; input_now: bundles read the written value
//   from now on.
//   ECC: words of the banks have a parity bit for each byte. scrubs: the copies read scrub_index, and nothing that the bundles in read and
//   issue take changes. copies: what the slots' copies delivered two cycles after; sound: with the parities that it should have.
//   wrong: in the last cycle, the word for the bundle in issue had not.
//   r_constant: a value in place of a source; 0 if there is a source. i_status, with i_reads_status: the same, a stage later.

module takt_source #(
    parameter SLOTS = 3,
    parameter DEPTH = 10,
    parameter LATE  = 1,
    parameter INDEX = 8,
    parameter LATCHED = 0,
    parameter INPUTS  = 8,  // bits of an input port's number
    parameter ECC     = 0   // 0 or 1
) (
    input  wire                         clk,
    input  wire                         advance,
    input  wire [SLOTS:0]               m_bank,
    input  wire [INDEX-1:0]             m_index,
    input  wire                         m_place,
    input  wire [SLOTS*DEPTH-1:0]       in_flight,
    input  wire [SLOTS*DEPTH*INDEX-1:0] in_flight_index,
    input  wire [SLOTS-1:0]             writes,          // takt_in_flight's
    input  wire [SLOTS*LATE-1:0]        late,
    input  wire [SLOTS*LATE*INDEX-1:0]  late_index,
    input  wire [SLOTS-1:0]             r_writes,
    input  wire [SLOTS-1:0]             r_early,
    input  wire [SLOTS*INDEX-1:0]       r_dest,
    input  wire [SLOTS-1:0]             i_writes,
    input  wire [SLOTS-1:0]             i_early,
    input  wire [SLOTS*INDEX-1:0]       i_dest,
    input  wire [SLOTS*32-1:0]          result,
    input  wire [SLOTS*32-1:0]          was_result,
    input  wire                         input_write,
    input  wire                         input_write_place,
    input  wire                         input_now,
    input  wire [INDEX-1:0]             input_write_index,
    input  wire [31:0]                  input_write_value,
    input  wire [31:0]                  input_next_value,
    input  wire [31:0]                  r_constant,
    input  wire                         scrubs,
    input  wire [INDEX-1:0]             scrub_index,
    output wire [SLOTS*32-1:0]          copies,
    output wire [SLOTS-1:0]             sound,
    output wire                         wrong,
    input  wire                         i_reads_status,
    input  wire [31:0]                  i_status,
    output wire                         r_waits,
    output wire                         i_waits,
    output reg  [31:0]                  operand
);

    reg [SLOTS:0]   r_bank, i_bank;
    reg [INDEX-1:0] r_index, i_index;
    always @(posedge clk) begin
        if (advance) begin
            r_bank  <= m_bank;
            r_index <= m_index;
            i_bank  <= r_bank;
            i_index <= r_index;
        end
    end

    wire [SLOTS-1:0] r_copy, r_past, next_now, next_past;
    wire r_taken, i_taken;
    takt_hazard #(.SLOTS(SLOTS), .DEPTH(DEPTH), .LATE(LATE), .INDEX(INDEX)) hazard (
        .clk(clk), .advance(advance),
        .m_bank(m_bank[SLOTS-1:0]), .m_index(m_index), .r_bank(r_bank[SLOTS-1:0]), .r_index(r_index),
        .i_bank(i_bank[SLOTS-1:0]), .i_index(i_index),
        .in_flight(in_flight), .in_flight_index(in_flight_index), .late(late), .late_index(late_index),
        .r_writes(r_writes), .r_early(r_early), .r_dest(r_dest), .i_writes(i_writes), .i_early(i_early), .i_dest(i_dest),
        .r_waits(r_waits), .i_waits(i_waits), .r_copy(r_copy), .r_past(r_past), .r_taken(r_taken), .i_taken(i_taken), .next_now(next_now), .next_past(next_past)
    );

    // ---- read: the bank's copy, or a value too recent to be in it

    // input_next_value is for the bundle in read (r_is_next), in issue (i_is_next).
    reg  r_is_next, i_is_next;
    wire r_is_written = r_bank[SLOTS] & (r_index == input_write_index);
    always @(posedge clk) begin
        r_is_next <= input_now & (advance ? m_bank[SLOTS] & (m_index == input_write_index) : r_is_written);
        i_is_next <= input_now & (advance ? r_is_written : i_bank[SLOTS] & (i_index == input_write_index));
    end
    wire next_input = advance ? r_is_next : i_is_next;
    wire next_fresh = advance & ~r_taken & ~r_is_next;  // the bundle that enters issue takes the value that was read as its operand

    wire [INDEX-1:0]  next_index = advance ? m_index : r_index;
    wire [SLOTS:0]    next_copy  = {r_bank[SLOTS], r_copy} & {(SLOTS + 1){next_fresh}};
    wire [32*SLOTS+31:0] copy;   // of the bundle that was in read in the last cycle
    reg  [SLOTS:0]       shown;  // selects the copy that is its operand: masks the copies, which are the block RAMs' output registers
    always @(posedge clk) shown <= next_copy;

    // A copy's words: the value, and above it with ECC a parity for each byte.
    localparam WIDTH = ECC == 0 ? 32 : 36;
    wire [INDEX-1:0]           read_index;
    wire [WIDTH*SLOTS-1:0]     to_write;
    wire [WIDTH-1:0]           input_to_write;
    wire [WIDTH*SLOTS+WIDTH-1:0] delivered;

    genvar s;
    generate
        if (ECC == 0) begin : g_values
            assign read_index     = next_index;
            assign to_write       = result;
            assign input_to_write = input_write_value;
            assign copy           = delivered;
            assign sound          = {SLOTS{1'b1}};
            assign wrong          = 1'b0;
            wire unused_scrub = &{1'b0, scrubs, scrub_index};
        end else begin : g_parities
            assign read_index     = scrubs ? scrub_index : next_index;
            assign input_to_write = {^input_write_value[31:24], ^input_write_value[23:16], ^input_write_value[15:8], ^input_write_value[7:0],
                input_write_value};
            wire [SLOTS:0] intact;
            for (s = 0; s <= SLOTS; s = s + 1) begin : g_word
                wire [31:0] word = delivered[WIDTH*s +: 32];
                assign copy[32*s +: 32] = word;
                assign intact[s] = delivered[WIDTH*s+32 +: 4] == {^word[31:24], ^word[23:16], ^word[15:8], ^word[7:0]};
                if (s < SLOTS) begin : g_result
                    wire [31:0] value = result[32*s +: 32];
                    assign to_write[WIDTH*s +: WIDTH] = {^value[31:24], ^value[23:16], ^value[15:8], ^value[7:0], value};
                end
            end
            reg shown_wrong;
            always @(posedge clk) shown_wrong <= |(shown & ~intact);
            assign sound = intact[SLOTS-1:0];
            assign wrong = shown_wrong;
        end
        if (LATCHED == 0) begin : g_inputs
            takt_bank #(.INDEX(INDEX), .WIDTH(WIDTH)) inputs (
                .clk(clk), .write(input_write), .write_index(input_write_index), .write_value(input_to_write),
                .read_index(read_index), .value(delivered[WIDTH*SLOTS +: WIDTH])
            );
            wire unused = &{1'b0, m_place, input_write_place};
        end else begin : g_latched_inputs
            reg r_place;
            always @(posedge clk) if (advance) r_place <= m_place;
            takt_bank #(.INDEX(INPUTS + 1), .WIDTH(WIDTH)) inputs (
                .clk(clk), .write(input_write), .write_index({input_write_place, input_write_index[INPUTS-1:0]}), .write_value(input_to_write),
                .read_index({advance ? m_place : r_place, next_index[INPUTS-1:0]}), .value(delivered[WIDTH*SLOTS +: WIDTH])
            );
        end
        for (s = 0; s < SLOTS; s = s + 1) begin : g_slot
            takt_bank #(.INDEX(INDEX), .WIDTH(WIDTH)) bank (
                .clk(clk), .write(writes[s]), .write_index(in_flight_index[s*DEPTH*INDEX +: INDEX]),
                .write_value(to_write[WIDTH*s +: WIDTH]), .read_index(read_index), .value(delivered[WIDTH*s +: WIDTH])
            );
        end
    endgenerate

    assign copies = copy[32*SLOTS-1:0];

    wire [31:0] r_recent;
    takt_onehot_mux #(.VALUES(SLOTS + 1), .AHEAD(0)) choice_recent (
        .clk(clk), .choose({next_input, r_past & {SLOTS{~next_input}}}), .values({input_next_value, was_result}), .value(r_recent)
    );

    // ---- issue: the operand is the value read, or one forwarded from a bus, or unchanged

    wire [31:0] bus;
    takt_onehot_mux #(.VALUES(2 * SLOTS), .AHEAD(1)) choice_bus (
        .clk(clk), .choose({next_now, next_past}), .values({result, was_result}), .value(bus)
    );

    reg [31:0] recent, value;
    reg        i_stays;
    integer    k;
    always @* begin
        value = bus | recent | i_status;
        for (k = 0; k <= SLOTS; k = k + 1) value = value | (copy[32*k +: 32] & {32{shown[k]}});
    end

    always @(posedge clk) begin
        i_stays <= ~advance & ~i_taken & ~i_is_next;
        recent  <= r_recent | (r_constant & {32{~next_input}});
        if (~next_fresh & ~next_input) recent <= 32'd0;
        if (~i_stays | i_reads_status) operand <= value;
    end

endmodule
