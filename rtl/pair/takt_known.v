// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_known: whether an output port of a core has a value of its program: until then its memory holds anything, and two cores that
// agree may show different values.
//
// Contract
//   write, index, number: as of takt_outputs. known is 1 with the value of the port `number`, READ_DELAY cycles later, if the port
//   has been written since the beginning of rst; if LATCHED, since before the last publish.

module takt_known #(
    parameter LATCHED = 0,
    parameter BANKS   = 1,
    parameter INDEX   = 5,  // bits of a port's number
    parameter READ_DELAY = 0
) (
    input  wire                   clk,
    input  wire                   rst,
    input  wire                   publish,
    input  wire [BANKS-1:0]       write,
    input  wire [BANKS*INDEX-1:0] index,
    input  wire [INDEX-1:0]       number,
    output wire                   known
);

    localparam PORTS = 1 << INDEX;

    reg  [PORTS-1:0] written, shown;
    reg              was_rst;
    initial was_rst = 1'b0;
    wire             opens = LATCHED == 0 | publish | was_rst;
    wire [PORTS-1:0] now   = opens ? written : shown;

    reg  [PORTS-1:0] writes;
    integer          b;
    always @* begin
        writes = {PORTS{1'b0}};
        for (b = 0; b < BANKS; b = b + 1) if (write[b]) writes[index[b*INDEX +: INDEX]] = 1'b1;
    end

    always @(posedge clk) begin
        was_rst <= rst;
        written <= (written & {PORTS{~rst | was_rst}}) | writes;
        shown   <= now;
    end

    generate
        if (READ_DELAY == 0) begin : g_at_once
            assign known = now[number];
        end else begin : g_later
            reg q;
            always @(posedge clk) q <= now[number];
            assign known = q;
        end
    endgenerate

endmodule
