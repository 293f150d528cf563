// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_hall: three Hall sensors of a motor: the sector of its angle, counted, and the time from sector to sector.
//
// Contract
//   sector is 0 to 5 for 100, 110, 010, 011, 001, 101 of (a, b, c), as they follow each other while a leads b by a third of a turn, and
//   b leads c. 000 and 111 are forbidden: fault is 1 then, and sector stays.
//   count goes up or down by one when the next sector comes, or the one before, and wraps at 32 bits. errors counts other changes: to a
//   sector beyond these, and to a forbidden state.
//   time is the cycles between the last two changes of the sector, or those since the last one if they are more; it stays at 2^31 - 1.
//   Pins pass through takt_filter with HOLD = FILTER. An edge of a pin in cycle t is in the registers in t + 3 + FILTER.
//   take: registers r_… hold from the next cycle on what they are in this one.
//   rst: count and errors are 0, time is at its end, and the first state counts as no change.

module takt_hall #(
    parameter FILTER = 3  // 1 to 256
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        take,
    input  wire        pin_a,
    input  wire        pin_b,
    input  wire        pin_c,
    output reg  [31:0] r_sector,
    output reg  [31:0] r_fault,
    output reg  [31:0] r_count,
    output reg  [31:0] r_time,
    output reg  [31:0] r_errors
);

    localparam [30:0] END = 31'h7fffffff;

    wire a, b, c;
    takt_filter #(.HOLD(FILTER), .BITS(8)) filter_a (.clk(clk), .rst(rst), .pin(pin_a), .level(a));
    takt_filter #(.HOLD(FILTER), .BITS(8)) filter_b (.clk(clk), .rst(rst), .pin(pin_b), .level(b));
    takt_filter #(.HOLD(FILTER), .BITS(8)) filter_c (.clk(clk), .rst(rst), .pin(pin_c), .level(c));

    wire        none = (a == b) & (b == c);
    wire [2:0]  now  = a ? (c ? 3'd5 : b ? 3'd1 : 3'd0) : b ? (c ? 3'd3 : 3'd2) : 3'd4;
    reg  [2:0]  sector;
    reg         fault, known;
    reg  [30:0] since, last;
    reg  [31:0] count, errors;

    wire        moves = known & ~none & now != sector;
    wire        up    = now == (sector == 3'd5 ? 3'd0 : sector + 3'd1);
    wire        down  = sector == (now == 3'd5 ? 3'd0 : now + 3'd1);

    always @(posedge clk) begin
        fault <= none;
        if (~none) {known, sector} <= {1'b1, now};
        if (moves & up) count <= count + 32'd1;
        if (moves & down) count <= count - 32'd1;
        if ((moves & ~up & ~down) | (none & ~fault)) errors <= errors + 32'd1;
        since <= moves ? 31'd1 : since == END ? END : since + 31'd1;
        if (moves) last <= since;
        if (take) begin
            {r_sector, r_fault, r_count, r_errors} <= {29'd0, sector, 31'd0, fault, count, errors};
            r_time <= {1'b0, since > last ? since : last};
        end
        if (rst) begin
            {known, sector, fault, since, last} <= {4'd0, none, END, END};
            {count, errors, r_sector, r_fault, r_count, r_errors} <= 192'd0;
            r_time <= {1'b0, END};
        end
    end

endmodule
