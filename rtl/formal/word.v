// SPDX-License-Identifier: MIT OR Apache-2.0
// A memory of the circuit reduced to one word, whose address is arbitrary and stays as it is (`core.py` drives `probe`): writes to other
// addresses have no effect, and what is read at another address is arbitrary.

(* techmap_celltype = "$mem_v2" *)
module takt_one_word (
    RD_CLK, RD_EN, RD_ARST, RD_SRST, RD_ADDR, RD_DATA, WR_CLK, WR_EN, WR_ADDR, WR_DATA
);
    parameter MEMID = "";
    parameter SIZE = 0, OFFSET = 0, ABITS = 1, WIDTH = 1, INIT = 0;
    parameter RD_PORTS = 1, RD_CLK_ENABLE = 0, RD_CLK_POLARITY = 0, RD_TRANSPARENCY_MASK = 0, RD_COLLISION_X_MASK = 0;
    parameter RD_WIDE_CONTINUATION = 0, RD_CE_OVER_SRST = 0, RD_ARST_VALUE = 0, RD_SRST_VALUE = 0, RD_INIT_VALUE = 0;
    parameter WR_PORTS = 1, WR_CLK_ENABLE = 0, WR_CLK_POLARITY = 0, WR_PRIORITY_MASK = 0, WR_WIDE_CONTINUATION = 0;

    input  [RD_PORTS-1:0]       RD_CLK, RD_EN, RD_ARST, RD_SRST;
    input  [RD_PORTS*ABITS-1:0] RD_ADDR;
    output [RD_PORTS*WIDTH-1:0] RD_DATA;
    input  [WR_PORTS-1:0]       WR_CLK;
    input  [WR_PORTS*WIDTH-1:0] WR_EN, WR_DATA;
    input  [WR_PORTS*ABITS-1:0] WR_ADDR;

    // Reads within the cycle, and one write: all that the core's memories have before yosys takes registers into them.
    wire _TECHMAP_FAIL_ = |RD_CLK_ENABLE | (WR_PORTS != 1) | (WR_CLK_ENABLE != 1) | (WR_CLK_POLARITY != 1);

    wire [ABITS-1:0]          \_TECHMAP_REPLACE_.probe ;
    wire [WIDTH-1:0]          \_TECHMAP_REPLACE_.word ;
    wire [RD_PORTS*WIDTH-1:0] elsewhere;  // nothing drives it
    wire [WIDTH-1:0] held = \_TECHMAP_REPLACE_.word ;
    wire [WIDTH-1:0] mask = WR_EN & {WIDTH{WR_ADDR == \_TECHMAP_REPLACE_.probe }};
    \$dff #(.WIDTH(WIDTH), .CLK_POLARITY(1'b1)) register (.CLK(WR_CLK), .D(mask & WR_DATA | ~mask & held), .Q(\_TECHMAP_REPLACE_.word ));

    genvar p;
    generate
        for (p = 0; p < RD_PORTS; p = p + 1) begin : g_read
            assign RD_DATA[p*WIDTH +: WIDTH] =
                RD_ADDR[p*ABITS +: ABITS] == \_TECHMAP_REPLACE_.probe ? held : elsewhere[p*WIDTH +: WIDTH];
        end
    endgenerate
endmodule
