// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_exchange: sequencer that copies peripherals' registers into input ports at the tick, and output ports into registers when the
// program publishes them; for a core without links.
//
// Contract
//   tick: while the program waits and nothing is under way, a period begins: take is high in the same cycle, so that all peripherals
//   hold what they had; their values go to the input ports, one in a cycle, then the core gets its tick. Otherwise missed is high for
//   a cycle, and the period that runs goes on undisturbed.
//   published: high for a cycle, two cycles after a `publish` or a `wait`; waiting is high from two cycles after a `wait` on. At the
//   period's first, output ports are read, one in a cycle, and put is high for a cycle once all have been: all peripherals change
//   together.
//   runs_on: that has happened, and the program does not wait yet.
//   idle: nothing is under way. A tick in cycle t is the core's in t + INPUTS + 2.
//   periods: ended since reset; cycles: of the last, from take to put; most_cycles: the most.
//   number counts inputs and outputs; the ports behind each number are the instance's business: index and value of input number n
//   must stand a cycle after `number` is n, likewise write[n] takes read values.

module takt_exchange #(
    parameter INPUTS  = 1,
    parameter OUTPUTS = 1
) (
    input  wire       clk,
    input  wire       rst,       // of the core
    input  wire       tick,
    input  wire       waiting,
    input  wire       published,
    output wire       take,
    output reg        missed,
    output wire       idle,
    output wire       runs_on,
    output reg  [7:0] number,
    output reg        input_write,
    output reg        core_tick,
    output reg        reads,     // in the cycle in which `number` names an output
    output reg        put,
    output reg [31:0] periods,
    output reg [31:0] cycles,
    output reg [31:0] most_cycles
);

    localparam [7:0] LAST_INPUT  = INPUTS;
    localparam [7:0] LAST_OUTPUT = OUTPUTS;

    reg  [2:0] state;   // 0 rest, 1 inputs, 2 begins, 3 runs, 4 outputs, 5 drain
    reg  [1:0] rest;
    reg        begun;      // a period has begun since reset
    reg        handed;     // published in this period, or before the first
    reg  [31:0] elapsed;

    assign idle    = state == 3'd0 & waiting;
    assign runs_on = state == 3'd0 & ~waiting & begun;
    assign take    = tick & idle & ~rst;

    always @(posedge clk) begin
        missed      <= tick & ~idle & ~rst;
        input_write <= state == 3'd1 & number != LAST_INPUT;
        // A bundle of the period reads the last input three cycles after its write, at the earliest (INPUT_DELAY).
        core_tick   <= state == 3'd1 & number == LAST_INPUT;
        put         <= 1'b0;
        rest        <= rest + 2'd1;
        begun       <= begun | take;
        handed      <= (published | handed) & ~take;
        case (state)
            3'd0: begin
                number <= 8'd0;
                if (take) state <= 3'd1;
            end
            3'd1: begin
                rest <= 2'd0;
                if (number == LAST_INPUT) state <= 3'd2;
                else number <= number + 8'd1;
            end
            // The core sees its tick a cycle after the pin, and still waits then.
            3'd2: if (rest == 2'd1) state <= 3'd3;
            3'd3: begin
                number <= 8'd0;
                if (waiting | published | handed) state <= 3'd4;
            end
            3'd4: begin
                rest <= 2'd0;
                if (number == LAST_OUTPUT) state <= 3'd5;
                else number <= number + 8'd1;
            end
            // The last output is read, rounded and in its register in the cycle of put.
            default: if (rest == 2'd3) begin
                put   <= 1'b1;
                state <= 3'd0;
            end
        endcase
        reads   <= state == 3'd4 & number != LAST_OUTPUT;
        elapsed <= take ? 32'd1 : elapsed + 32'd1;
        if (put) begin
            periods <= periods + 32'd1;
            cycles  <= elapsed;
            if (elapsed > most_cycles) most_cycles <= elapsed;
        end
        if (rst) begin
            state <= 3'd0;
            {periods, cycles, most_cycles} <= 96'd0;
            {missed, input_write, core_tick, put, reads, begun, handed} <= 7'd0;
        end
    end

endmodule
