// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_exchange: sequencer that copies peripherals' registers into input ports at the tick, and output ports into registers at the
// program's `wait`; for a core without links.
//
// Contract
//   tick: while the program waits and nothing is under way, a period begins: take is high in the same cycle, so that all peripherals
//   hold what they had; their values go to the input ports, one in a cycle, then the core gets its tick. Otherwise missed is high for
//   a cycle, and the period that runs goes on undisturbed.
//   When the program waits again, output ports are read, one in a cycle, and put is high for a cycle once all have been: all
//   peripherals change together.
//   idle: nothing is under way. A tick in cycle t is the core's in t + INPUTS + 5.
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
    output wire       take,
    output reg        missed,
    output wire       idle,
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

    reg  [2:0] state;   // 0 rest, 1 inputs, 2 before the tick, 3 the tick, 4 begins, 5 runs, 6 outputs, 7 drain
    reg  [3:0] rest;
    reg  [31:0] elapsed;

    assign idle = state == 3'd0 & waiting;
    assign take = tick & idle & ~rst;

    always @(posedge clk) begin
        missed      <= tick & ~idle & ~rst;
        input_write <= state == 3'd1 & number != LAST_INPUT;
        core_tick   <= state == 3'd3;
        put         <= 1'b0;
        rest        <= rest + 4'd1;
        case (state)
            3'd0: begin
                number <= 8'd0;
                if (take) state <= 3'd1;
            end
            3'd1: begin
                rest <= 4'd0;
                if (number == LAST_INPUT) state <= 3'd2;
                else number <= number + 8'd1;
            end
            3'd2: if (rest == 4'd1) state <= 3'd3;
            3'd3: begin
                rest  <= 4'd0;
                state <= 3'd4;
            end
            // The core sees its tick two cycles later; until then it still waits.
            3'd4: if (rest == 4'd4) state <= 3'd5;
            3'd5: begin
                number <= 8'd0;
                if (waiting) state <= 3'd6;
            end
            3'd6: begin
                rest <= 4'd0;
                if (number == LAST_OUTPUT) state <= 3'd7;
                else number <= number + 8'd1;
            end
            default: if (rest == 4'd8) begin
                put   <= 1'b1;
                state <= 3'd0;
            end
        endcase
        reads   <= state == 3'd6 & number != LAST_OUTPUT;
        elapsed <= take ? 32'd1 : elapsed + 32'd1;
        if (put) begin
            periods <= periods + 32'd1;
            cycles  <= elapsed;
            if (elapsed > most_cycles) most_cycles <= elapsed;
        end
        if (rst) begin
            state <= 3'd0;
            {periods, cycles, most_cycles} <= 96'd0;
            {missed, input_write, core_tick, put, reads} <= 5'd0;
        end
    end

endmodule
