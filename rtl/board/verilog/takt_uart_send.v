// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_uart_send: bytes onto a line, 8N1.
//
// Contract
//   A bit lasts DIVIDE cycles. start with data, while ready: the byte goes out; ready falls in the next cycle and rises when its stop
//   bit has lasted. At rest, and in reset, the line is 1.

module takt_uart_send #(
    parameter DIVIDE = 16  // 2 to 65535
) (
    input  wire       clk,
    input  wire       rst,
    input  wire       start,
    input  wire [7:0] data,
    output wire       ready,
    output wire       pin_send
);

    localparam [15:0] LAST = DIVIDE - 1;

    reg  [9:0]  shift;
    reg  [3:0]  bits;
    reg  [15:0] left;

    assign ready    = bits == 4'd0;
    assign pin_send = shift[0];

    always @(posedge clk) begin
        if (ready) begin
            left <= LAST;
            if (start) begin
                shift <= {1'b1, data, 1'b0};
                bits  <= 4'd10;
            end
        end else if (left != 16'd0) left <= left - 16'd1;
        else begin
            left  <= LAST;
            bits  <= bits - 4'd1;
            shift <= {1'b1, shift[9:1]};
        end
        if (rst) begin
            shift <= 10'h3ff;
            bits  <= 4'd0;
        end
    end

endmodule
