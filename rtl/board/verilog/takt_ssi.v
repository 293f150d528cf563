// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_ssi: a master for an absolute encoder with a synchronous serial interface (SSI): one frame at each start.
//
// Contract
//   pin_clock rests at 1. It falls in the cycle after start, and at this instant the encoder holds its position. A bit takes 2 * HALF cycles,
//   the highest bit first: the clock rises HALF cycles after its fall, whereupon the encoder gives the bit, and HALF cycles later the bit
//   is taken, as it was on pin_data two cycles before. Behind BITS bits the clock stays at 1; with DOUBLE the encoder gives a 0 then, and
//   the same bits again, 2 * BITS + 1 in all. Then PAUSE cycles are left to the encoder's monoflop. A start during frame or pause is
//   dropped, and lost goes up by one.
//   GRAY: the bits are Gray code.
//   position is what the last valid frame brought, bits TURN - 1 to 0, turns the bits above; they are new 2 * HALF cycles for each bit
//   after the clock's first fall. frames counts valid frames, errors the others: pin_data was 0 two cycles before start, or the frame's
//   two parts differ, or are not 0 between.
//   take: registers r_… hold from the next cycle on what they are in this one.
//   rst: the clock is at 1, registers are 0, and a pause begins.

module takt_ssi #(
    parameter HALF   = 30,   // 3 to 65535: pin_data is two cycles late
    parameter BITS   = 13,   // 8 to 36
    parameter TURN   = 24,   // 5 to 32
    parameter GRAY   = 0,
    parameter DOUBLE = 0,
    parameter PAUSE  = 1500  // 1 to 2^20
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        start,
    input  wire        take,
    input  wire        pin_data,
    output reg         pin_clock,
    output reg  [31:0] r_position,
    output reg  [31:0] r_turns,
    output reg  [31:0] r_frames,
    output reg  [31:0] r_lost,
    output reg  [31:0] r_errors
);

    localparam [19:0] LAST    = HALF - 1;
    localparam [19:0] REST    = PAUSE - 1;
    localparam [6:0]  BETWEEN = BITS;
    localparam [6:0]  END     = DOUBLE != 0 ? 2 * BITS : BITS - 1;

    reg  [BITS-1:0] word;
    reg  [19:0]     since;
    reg  [6:0]      number;  // of the bit
    reg             busy, rests, bad, above;
    (* ASYNC_REG = "TRUE", altera_attribute = "-name SYNCHRONIZER_IDENTIFICATION FORCED_IF_ASYNCHRONOUS" *)
    reg             s0, s1;
    reg  [31:0]     position, turns, frames, lost, errors;

    wire        ends    = rests & since == REST;
    wire        step    = busy & ~rests & since == LAST;
    wire        samples = step & pin_clock;
    wire        between = DOUBLE != 0 & number == BETWEEN;
    wire        value   = s1 ^ (GRAY != 0 & above);
    // In the second part the first one leaves the word again.
    wire        differs = DOUBLE != 0 & (between ? s1 : number > BETWEEN & value != word[BITS-1]);
    wire [TURN+31:0] whole = {{(TURN+32-BITS){1'b0}}, word[BITS-2:0], value};
    wire [31:0] mask    = ~(32'hffffffff << (TURN - 1) << 1);

    always @(posedge clk) begin
        {s1, s0} <= {s0, pin_data};
        if (take) {r_position, r_turns, r_frames, r_lost, r_errors} <= {position, turns, frames, lost, errors};
        since <= step | ends | ~busy ? 20'd0 : since + 20'd1;
        if (ends) busy <= 1'b0;
        if (start & busy) lost <= lost + 32'd1;
        if (start & ~busy) begin
            {busy, rests, above} <= 3'b100;
            number    <= 7'd0;
            bad       <= ~s1;
            pin_clock <= 1'b0;
        end
        if (step) pin_clock <= ~pin_clock | number == END;
        if (samples) begin
            if (~between) word <= whole[BITS-1:0];
            above  <= value & ~between;
            bad    <= bad | differs;
            number <= number + 7'd1;
        end
        if (samples & number == END) begin
            rests <= 1'b1;
            if (bad | differs) errors <= errors + 32'd1;
            else begin
                position <= whole[31:0] & mask;
                turns    <= whole[TURN+:32];
                frames   <= frames + 32'd1;
            end
        end
        if (rst) begin
            {busy, rests, pin_clock} <= 3'b111;
            since <= 20'd0;
            {position, turns, frames, lost, errors, r_position, r_turns, r_frames, r_lost, r_errors} <= 320'd0;
        end
    end

endmodule
