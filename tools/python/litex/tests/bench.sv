// SPDX-License-Identifier: MIT OR Apache-2.0
// Clock and console of the SoC: prints what the firmware writes to its UART, until it writes the character 4.
`timescale 1ns / 1ps

module bench;
    localparam LIMIT = 4000000;  // cycles

    reg        clk = 1'b0;
    wire       valid;
    wire [7:0] data;
    integer    cycles = 0;

    sim soc (
        .sys_clk(clk), .sim_trace(1'b0),
        .serial_source_valid(valid), .serial_source_ready(1'b1), .serial_source_data(data),
        .serial_sink_valid(1'b0), .serial_sink_ready(), .serial_sink_data(8'd0)
    );

    always #5 clk = ~clk;

    always @(posedge clk) begin
        cycles <= cycles + 1;
        if (valid) begin
            if (data == 8'd4) begin
                $write("cycles %0d\nend\n", cycles);
                $finish;
            end else $write("%c", data);
        end
        if (cycles == LIMIT) begin
            $write("the firmware does not end\n");
            $finish;
        end
    end
endmodule
