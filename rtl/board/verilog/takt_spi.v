// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_spi: an SPI master for a converter: one frame at each start.
//
// Contract
//   A frame is BITS bits, the highest first, a bit in 2 * HALF cycles. POLARITY is the level of the clock at rest; data is sampled
//   at its first edge (PHASE 0) or its second. pin_select falls HALF cycles before the first bit and rises HALF cycles after the
//   last edge; a frame lasts HALF * (2 * BITS + 1) cycles. A start during a frame is not one, and lost goes up by one.
//   put: w_send is taken; start sends what was taken last, bits BITS - 1 to 0.
//   received is what the last whole frame brought (SIGNED: with its highest bit as sign), frames how many there were. received2 to
//   received8 are the same of the lines pin_in2 to pin_in8: converters that share clock and select.
//   take: registers r_… hold from the next cycle on what they are in this one.
//   rst: pins at rest, registers 0. A converter is not switched off by enable: its safe state is a value that is sent.

module takt_spi #(
    parameter HALF     = 4,   // 3 to 65535: pin_in is two cycles late
    parameter BITS     = 16,  // 1 to 32
    parameter POLARITY = 0,
    parameter PHASE    = 0,
    parameter SIGNED   = 0,
    parameter SEND     = 0    // sent until the first put
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        start,
    input  wire        take,
    input  wire        put,
    input  wire        pin_in,
    input  wire        pin_in2,
    input  wire        pin_in3,
    input  wire        pin_in4,
    input  wire        pin_in5,
    input  wire        pin_in6,
    input  wire        pin_in7,
    input  wire        pin_in8,
    input  wire [31:0] w_send,
    output reg         pin_clock,
    output reg         pin_out,
    output reg         pin_select,
    output reg  [31:0] r_received,
    output reg  [31:0] r_frames,
    output reg  [31:0] r_lost,
    output wire [31:0] r_received2,
    output wire [31:0] r_received3,
    output wire [31:0] r_received4,
    output wire [31:0] r_received5,
    output wire [31:0] r_received6,
    output wire [31:0] r_received7,
    output wire [31:0] r_received8
);

    localparam [15:0] LAST  = HALF - 1;
    localparam [6:0]  END  = 2 * BITS;  // the last half of a frame

    reg  [31:0] send, shift, received, frames, lost;
    reg  [15:0] wait_for;
    reg  [6:0]  half;      // 0: before the first bit
    reg         busy;
    (* ASYNC_REG = "TRUE", altera_attribute = "-name SYNCHRONIZER_IDENTIFICATION FORCED_IF_ASYNCHRONOUS" *)
    reg         s0, s1;

    wire        step    = busy & wait_for == LAST;
    // At the end of a half the clock goes to its active level (even ones) or back (odd ones); it stays at the end of the last.
    wire        active  = ~half[0];
    wire        samples = step & half != END & (active ^ (PHASE != 0));
    wire        moves   = step & half != END & (PHASE != 0 ? active : ~active & half != END - 7'd1);
    wire [31:0] first   = send << (32 - BITS);
    wire [31:0] extend  = {32{SIGNED != 0 & shift[BITS-1]}} << (BITS - 1) << 1;
    wire [31:0] mask    = ~(32'hffffffff << (BITS - 1) << 1);

    always @(posedge clk) begin
        {s1, s0} <= {s0, pin_in};
        if (put) send <= w_send;
        if (take) {r_received, r_frames, r_lost} <= {received, frames, lost};
        wait_for <= step | ~busy ? 16'd0 : wait_for + 16'd1;
        if (start & busy) lost <= lost + 32'd1;
        if (start & ~busy) begin
            busy       <= 1'b1;
            half       <= 7'd0;
            shift      <= first;
            pin_out    <= first[31];
            pin_select <= 1'b0;
        end
        if (step) begin
            half <= half + 7'd1;
            if (half != END) pin_clock <= active ^ (POLARITY != 0);
            if (half == END) begin
                busy       <= 1'b0;
                pin_select <= 1'b1;
                pin_out    <= 1'b0;
                received   <= (shift & mask) | extend;
                frames     <= frames + 32'd1;
            end
        end
        if (samples) shift <= {shift[30:0], s1};
        if (moves) pin_out <= shift[31];
        if (rst) begin
            busy <= 1'b0;
            send <= SEND;
            {pin_clock, pin_out, pin_select} <= {POLARITY != 0, 2'b01};
            {received, frames, lost, r_received, r_frames, r_lost} <= 192'd0;
        end
    end

    // The other lines only receive.
    wire [6:0]   others = {pin_in8, pin_in7, pin_in6, pin_in5, pin_in4, pin_in3, pin_in2};
    wire [223:0] taken;
    assign {r_received8, r_received7, r_received6, r_received5, r_received4, r_received3, r_received2} = taken;
    genvar line;
    generate
        for (line = 0; line < 7; line = line + 1) begin : g_line
            (* ASYNC_REG = "TRUE", altera_attribute = "-name SYNCHRONIZER_IDENTIFICATION FORCED_IF_ASYNCHRONOUS" *)
            reg         t0, t1;
            reg  [31:0] bits, value, held;
            wire [31:0] sign = {32{SIGNED != 0 & bits[BITS-1]}} << (BITS - 1) << 1;
            assign taken[32*line +: 32] = held;
            always @(posedge clk) begin
                {t1, t0} <= {t0, others[line]};
                if (samples) bits <= {bits[30:0], t1};
                if (step & half == END) value <= (bits & mask) | sign;
                if (take) held <= value;
                if (rst) {value, held} <= 64'd0;
            end
        end
    endgenerate

endmodule
