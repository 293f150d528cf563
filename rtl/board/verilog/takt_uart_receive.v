// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_uart_receive: bytes from a line, 8N1.
//
// Contract
//   A bit lasts DIVIDE cycles. valid is high for a cycle with the byte when its stop bit is seen, in the middle; broken, instead, if
//   that is 0. A start bit that is high again in its middle is a glitch.
//   rst: nothing is being received.

module takt_uart_receive #(
    parameter DIVIDE = 16  // 4 to 65535
) (
    input  wire       clk,
    input  wire       rst,
    input  wire       pin_receive,
    output reg        valid,
    output reg  [7:0] data,
    output reg        broken
);

    localparam [15:0] LAST   = DIVIDE - 1;
    localparam [15:0] MIDDLE = DIVIDE / 2 - 1;

    reg  [15:0] left;
    reg  [3:0]  bits;  // 0: none; 10 start, 9 to 2 data, 1 stop
    (* ASYNC_REG = "TRUE", altera_attribute = "-name SYNCHRONIZER_IDENTIFICATION FORCED_IF_ASYNCHRONOUS" *)
    reg         s0, s1;

    always @(posedge clk) begin
        {s1, s0} <= {s0, pin_receive};
        {valid, broken} <= 2'b00;
        if (bits == 4'd0) begin
            left <= MIDDLE;
            if (~s1) bits <= 4'd10;
        end else if (left != 16'd0) left <= left - 16'd1;
        else begin
            left <= LAST;
            bits <= bits == 4'd10 & s1 ? 4'd0 : bits - 4'd1;
            if (bits != 4'd1) data <= {s1, data[7:1]};
            else {valid, broken} <= {s1, ~s1};
        end
        if (rst) begin
            bits <= 4'd0;
            data <= 8'd0;
            {s0, s1} <= 2'b11;
            {valid, broken} <= 2'b00;
        end
    end

endmodule
