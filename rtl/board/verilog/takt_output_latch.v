// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_output_latch: holds a core's outputs from its `publish` or `wait` on, so that all peripherals take them together, and counts its
// periods; for a core whose outputs come over links.
//
// Contract
//   begins: high for a cycle when a base tick begins a period of the core; tick: when the core is given it. published: two cycles after
//   a `publish` or a `wait`; ended: after a `wait`. Those before the first tick belong to no period.
//   After the first published of a period, and DELAY cycles, `values`, 32 bits each, are kept, scaled one by one (takt_scale: FLOATS and
//   EXPONENTS have a bit and 10 bits for each), and put is high for a cycle once `held` has them all. nan: one was no number.
//   idle: the core waits and nothing is under way. periods: ended since reset; cycles: of the last, from begins to put; most_cycles:
//   the most.
//   Vectors have an element more than OUTPUTS, the highest, so that there is always one.

module takt_output_latch #(
    parameter OUTPUTS = 0,
    parameter DELAY   = 1,
    parameter [OUTPUTS:0] FLOATS = 0,
    parameter [10*OUTPUTS+9:0] EXPONENTS = 0,
    parameter FTOI    = 1
) (
    input  wire        clk,
    input  wire        rst,       // of the cores
    input  wire        begins,
    input  wire        tick,
    input  wire        published,
    input  wire        ended,
    input  wire        waiting,
    input  wire [32*OUTPUTS+31:0] values,
    output reg  [32*OUTPUTS+31:0] held,
    output reg         put,
    output wire        nan,
    output wire        idle,
    output reg  [31:0] periods,
    output reg  [31:0] cycles,
    output reg  [31:0] most_cycles
);

    localparam [7:0]  LAST  = OUTPUTS;
    localparam [15:0] DELAYS = DELAY;

    // ---- when a period begins and ends

    reg         begun, busy, late, ready;
    reg         handed;       // published in this period
    reg  [2:0]  leaves;       // cycles in which the core still waits after its tick
    reg  [31:0] elapsed, since, span;
    wire        done = ended & begun;
    wire        hands = published & begun & ~handed;

    always @(posedge clk) begin
        begun   <= begun | tick;
        // `since` counts the later of two periods that are under way.
        since   <= begins ? 32'd1 : since + 32'd1;
        elapsed <= begins & (~busy | (done & ~late)) ? 32'd1 : done & late ? since + 32'd1 : elapsed + 32'd1;
        handed  <= (handed | hands) & ~done;
        if (hands) span <= elapsed;
        case ({begins, done})
            2'b10: {busy, late} <= {1'b1, busy};
            2'b01: {busy, late} <= {late, 1'b0};
            default: ;
        endcase
        if (begins) leaves <= 3'd7;
        else if (begun & leaves != 3'd0 & ~ready) leaves <= leaves - 3'd1;
        ready <= begins | (ready & ~tick);
        if (rst) begin
            {begun, busy, late, ready, handed} <= 5'd0;
            leaves <= 3'd0;
        end
    end

    // ---- outputs

    reg  [1:0]  state;        // 0 rest, 1 the links' values come, 2 they are scaled, 3 the last ones
    reg         again;
    reg  [15:0] rest;
    reg  [7:0]  number, which1, which2, which3, which4;
    reg         reads1, reads2, reads3, reads4;
    reg  [31:0] value1;
    wire [31:0] result;

    // From begins to put; from `hands` to put it is always the same.
    wire [31:0] ends = span + {16'd0, DELAYS} + {24'd0, LAST} + 32'd7;

    assign idle = waiting & state == 2'd0 & ~again & leaves == 3'd0 & ~ready;

    generate
        if (FLOATS != 0) begin : g_scale
            takt_scale #(.FTOI(FTOI)) scale (
                .clk(clk), .valid(reads1), .is_float(FLOATS[which1]), .exponent(EXPONENTS[10*which1 +: 10]), .value(value1),
                .result(result), .nan(nan)
            );
        end else begin : g_plain
            reg [31:0] value2, value3, value4;
            always @(posedge clk) {value4, value3, value2} <= {value3, value2, value1};
            assign {nan, result} = {1'b0, value4};
        end
    endgenerate

    always @(posedge clk) begin
        put  <= 1'b0;
        rest <= rest + 16'd1;
        {which4, which3, which2, which1} <= {which3, which2, which1, number};
        {reads4, reads3, reads2, reads1} <= {reads3, reads2, reads1, state == 2'd2 & number != LAST};
        value1 <= held[32*number +: 32];
        if (reads4) held[32*which4 +: 32] <= result;
        if (hands & state != 2'd0) again <= 1'b1;
        case (state)
            2'd0: begin
                rest <= 16'd1;
                if (hands | again) begin
                    again <= 1'b0;
                    state <= 2'd1;
                end
            end
            2'd1: if (rest >= DELAYS) begin
                held   <= values;
                number <= 8'd0;
                state  <= 2'd2;
            end
            2'd2: begin
                rest <= 16'd1;
                if (number == LAST) state <= 2'd3;
                else number <= number + 8'd1;
            end
            default: if (rest == 16'd5) begin
                put     <= 1'b1;
                state   <= 2'd0;
                periods <= periods + 32'd1;
                cycles  <= ends;
                if (ends > most_cycles) most_cycles <= ends;
            end
        endcase
        if (rst) begin
            {state, again, put} <= 4'd0;
            {reads4, reads3, reads2, reads1} <= 4'd0;
            {periods, cycles, most_cycles} <= 96'd0;
        end
    end
endmodule
