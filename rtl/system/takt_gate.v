// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_gate: fixed-priority arbiter before a core's input pins, with a mailbox for each value (docs/system.md, The gate).
//
// Contract
//   arrives, values: for each mailbox, a value that arrives in cycle a. It waits from a + 1 on. In each cycle, the lowest mailbox with
//   a waiting value is served: its value is on the pins. A value that arrives while an older one waits replaces it.
//   NUMBERS: the number of each mailbox's input port, INDEX bits each.

module takt_gate #(
    parameter MAILBOXES = 1,
    parameter INDEX = 8,
    parameter [MAILBOXES*INDEX-1:0] NUMBERS = 0
) (
    input  wire                    clk,
    input  wire                    rst,
    input  wire [MAILBOXES-1:0]    arrives,
    input  wire [32*MAILBOXES-1:0] values,
    output reg                     input_write,
    output reg  [INDEX-1:0]        input_index,
    output reg  [31:0]             input_value
);

    // The arbitration is before the registers, the multiplexer of the values behind them.
    reg  [MAILBOXES-1:0]    waits, goes;
    reg  [32*MAILBOXES-1:0] held;
    wire [MAILBOXES-1:0]    next = (arrives | (waits & ~goes)) & {MAILBOXES{~rst}};

    integer i;
    always @* begin
        input_index = {INDEX{1'b0}};
        input_value = 32'd0;
        for (i = 0; i < MAILBOXES; i = i + 1) begin
            input_index = input_index | (NUMBERS[INDEX*i +: INDEX] & {INDEX{goes[i]}});
            input_value = input_value | (held[32*i +: 32] & {32{goes[i]}});
        end
    end

    integer k;
    always @(posedge clk) begin
        waits       <= next;
        goes        <= next & (~next + 1'b1);
        input_write <= |next;
        for (k = 0; k < MAILBOXES; k = k + 1) if (arrives[k]) held[32*k +: 32] <= values[32*k +: 32];
    end

endmodule
