// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_interlock: safety interlock: enables the outputs of a core's peripherals until something trips it.
//
// Contract
//   drive is 1 from the first published outputs on, while enable is 1, until something trips it: a fault or halt of the program, an
//   output that is no number (nan), DEADLINES missed deadlines one after the other, HOST periods without a request of the host (0: any
//   number), stop, a second core that does something else (differs), a wrong word in a memory (upset),
//   or a reset of the core.
//   cause says what did, until the next reset of the core: bit 0 fault, 1 halt, 2 deadline, 3 host, 4 stop, 5 an output that is
//   no number, 7 differs, 8 upset; 6 is 0.
//   missed, done, heard: high for a cycle each. misses counts missed deadlines since reset.

module takt_interlock #(
    parameter DEADLINES = 1,
    parameter HOST      = 0
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        enable,
    input  wire        fault,
    input  wire        halted,
    input  wire        missed,
    input  wire        done,
    input  wire        ticks,
    input  wire        heard,
    input  wire        stop,
    input  wire        nan,
    input  wire        differs,
    input  wire        upset,
    output reg         drive,
    output wire [8:0]  cause,
    output reg  [31:0] misses
);

    // Both counters are as wide as their limits.
    localparam ROW   = $clog2(DEADLINES + 1);
    localparam QUIETS = $clog2(HOST + 2);
    localparam [ROW-1:0]    MOST  = DEADLINES, ONE_MORE = 1;
    localparam [QUIETS-1:0] QUIET = HOST, ONE_LONGER = 1;

    initial drive = 1'b0;  // safe before the first clock edge, too

    reg  [ROW-1:0]    row;
    reg  [QUIETS-1:0] silence;
    reg         published;
    wire [ROW-1:0] in_row = row + ONE_MORE;
    wire        late  = missed & in_row == MOST;
    wire        alone = HOST != 0 & silence == QUIET & ~heard;
    wire [7:0]  now   = {upset, differs, nan, stop, alone, late, halted, fault};
    reg  [7:0]  was;
    assign cause = {was[7:6], 1'b0, was[5:0]};

    always @(posedge clk) begin
        if (missed) begin
            row    <= in_row;
            misses <= misses + 32'd1;
        end
        if (done) begin
            row       <= 0;
            published <= 1'b1;
        end
        if (heard) silence <= 0;
        else if (ticks & silence != QUIET) silence <= silence + ONE_LONGER;
        was   <= was | now;
        drive <= enable & published & ~|was & ~|now;
        if (rst) begin
            {drive, published, was} <= 10'd0;
            row     <= 0;
            silence <= 0;
            misses <= 32'd0;
        end
    end

endmodule
