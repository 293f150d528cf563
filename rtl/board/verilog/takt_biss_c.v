// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_biss_c: a master for one absolute encoder with BiSS C, unidirectional: one frame at each start.
//
// Contract
//   pin_ma rests at 1. It falls in the cycle after start, and at this instant the encoder holds its position. From then on it is a clock of
//   2 * HALF cycles. Its second rise asks for the acknowledge: pin_slo goes to 0. delay is the cycles between both at the pins: a bit of
//   the line begins this long after a rise, and is taken in its middle. After the acknowledge, which may take several bits, come the start
//   bit, 1, the CDS bit, which is not used, BITS bits of the position, the highest first, error and warning, 0 if they are reported, and
//   the inverted CRC of these, of six bits, with the polynomial x^6 + x + 1.
//   Of a frame with a right CRC, position has bits TURN - 1 to 0, turns the bits above, error and warning are 1 if they are reported,
//   and frames goes up by one; with a wrong CRC errors does. silent counts frames that have no acknowledge, or no start bit WAIT bits
//   after the second rise, or whose pin_slo was 0 before. The registers are new at the earliest 2 * HALF * (BITS + 12) + 3 cycles, at
//   the latest HALF * (2 * (WAIT + BITS) + 21) + 1 cycles after the first fall.
//   Then pin_ma stays at 1, or rises at the end of its half, and TIMEOUT cycles later the next frame may start. A start before that is
//   dropped, and lost goes up by one.
//   take: registers r_… hold from the next cycle on what they are in this one.
//   rst: pin_ma is at 1, registers are 0, and the timeout begins.

module takt_biss_c #(
    parameter HALF    = 4,    // 2 to 65535
    parameter BITS    = 18,   // 12 to 36
    parameter TURN    = 24,   // 5 to 32
    parameter WAIT    = 32,   // 2 to 255
    parameter TIMEOUT = 1200  // 1 to 2^20
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        start,
    input  wire        take,
    input  wire        pin_slo,
    output reg         pin_ma,
    output reg  [31:0] r_position,
    output reg  [31:0] r_turns,
    output reg  [31:0] r_error,
    output reg  [31:0] r_warning,
    output reg  [31:0] r_frames,
    output reg  [31:0] r_lost,
    output reg  [31:0] r_errors,
    output reg  [31:0] r_silent,
    output reg  [31:0] r_delay
);

    localparam [1:0]  REST  = 2'd0;  // until the encoder's timeout has passed, and then until a start
    localparam [1:0]  ASKS  = 2'd1;  // until the acknowledge
    localparam [1:0]  WAITS = 2'd2;  // until the start bit
    localparam [1:0]  READS = 2'd3;
    localparam [15:0] LAST  = HALF - 1;
    localparam [16:0] WHOLE = 2 * HALF - 1;
    localparam [16:0] FIRST = HALF;  // the middle of the acknowledge is HALF cycles behind its edge
    localparam [7:0]  MOST  = WAIT;
    localparam [5:0]  DATA  = BITS;
    localparam [5:0]  END   = BITS + 8;
    localparam [19:0] QUIET = TIMEOUT;

    reg  [1:0]  state;
    (* ASYNC_REG = "TRUE", altera_attribute = "-name SYNCHRONIZER_IDENTIFICATION FORCED_IF_ASYNCHRONOUS" *)
    reg         s0, s1;
    reg  [19:0] quiet;       // cycles of pin_ma at 1 at rest
    reg  [15:0] in_half;
    reg  [1:0]  rises;       // of pin_ma, up to 2
    reg  [7:0]  waited;      // bits since the second
    reg  [31:0] late;        // cycles since the second
    reg  [16:0] until_next;  // cycles to the middle of the next bit
    reg  [5:0]  number;      // of the bit behind the start bit; 0 is CDS
    reg  [BITS+1:0] word;
    reg  [5:0]  crc;
    reg  [31:0] delay_now;
    reg  [31:0] position, turns, error, warning, frames, lost, errors, silent, delay;

    wire        runs    = state != REST;
    wire        ready   = ~runs & quiet == QUIET;
    wire        toggles = in_half == LAST;
    wire        asked   = rises == 2'd2;
    wire        samples = (state == WAITS | state == READS) & until_next == 17'd0;
    wire        begins  = state == WAITS & samples & s1;
    wire        over    = (state == ASKS | state == WAITS) & asked & waited == MOST & ~begins;
    // pin_slo is two cycles late: a 0 earlier is no answer.
    wire        answers = state == ASKS & ~s1 & asked & late >= 32'd2;
    wire        wrong   = state == ASKS & ~s1 & ~answers;
    wire        is_crc  = number > DATA + 6'd2;
    wire        in_crc  = crc[5] ^ s1 ^ is_crc;
    wire [5:0]  next    = {crc[4:0], 1'b0} ^ (in_crc ? 6'h03 : 6'h00);
    wire        ends    = state == READS & samples & number == END;
    wire [TURN+31:0] whole = {{(TURN+32-BITS){1'b0}}, word[BITS+1:2]};
    wire [31:0] mask    = ~(32'hffffffff << (TURN - 1) << 1);

    always @(posedge clk) begin
        {s1, s0} <= {s0, pin_slo};
        if (take) begin
            {r_position, r_turns, r_error, r_warning} <= {position, turns, error, warning};
            {r_frames, r_lost, r_errors, r_silent, r_delay} <= {frames, lost, errors, silent, delay};
        end
        // The clock falls only in a frame, and rises in any case.
        in_half <= toggles | (~runs & pin_ma) ? 16'd0 : in_half + 16'd1;
        if (toggles & (runs | ~pin_ma)) pin_ma <= ~pin_ma;
        quiet <= runs | ~pin_ma ? 20'd0 : quiet == QUIET ? quiet : quiet + 20'd1;
        if (toggles & ~pin_ma & ~asked) rises <= rises + 2'd1;
        late <= asked ? late + 32'd1 : 32'd0;
        if (asked & toggles & ~pin_ma) waited <= waited + 8'd1;
        until_next <= answers ? FIRST - 17'd1 : until_next == 17'd0 ? WHOLE : until_next - 17'd1;
        if (answers) begin
            state     <= WAITS;
            delay_now <= late - 32'd2;
        end
        if (begins) begin
            state  <= READS;
            number <= 6'd0;
            crc    <= 6'd0;
        end
        if (state == READS & samples) begin
            number <= number + 6'd1;
            if (number != 6'd0) crc <= next;
            if (number != 6'd0 & ~is_crc) word <= {word[BITS:0], s1};
        end
        if (ends) begin
            state <= REST;
            if (next != 6'd0) errors <= errors + 32'd1;
            else begin
                position <= whole[31:0] & mask;
                turns    <= whole[TURN+:32];
                error    <= {31'd0, ~word[1]};
                warning  <= {31'd0, ~word[0]};
                delay    <= delay_now;
                frames   <= frames + 32'd1;
            end
        end
        if (over | wrong) begin
            state  <= REST;
            silent <= silent + 32'd1;
        end
        if (start & ~ready) lost <= lost + 32'd1;
        if (start & ready) begin
            if (s1) begin
                {state, pin_ma} <= {ASKS, 1'b0};
                {in_half, rises, waited} <= 26'd0;
            end else silent <= silent + 32'd1;
        end
        if (rst) begin
            {state, pin_ma} <= {REST, 1'b1};
            {in_half, quiet} <= 36'd0;
            {position, turns, error, warning, frames, lost, errors, silent, delay} <= 288'd0;
            {r_position, r_turns, r_error, r_warning, r_frames, r_lost, r_errors, r_silent, r_delay} <= 288'd0;
        end
    end

endmodule
