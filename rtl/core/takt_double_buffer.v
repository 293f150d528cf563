// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_double_buffer: control of double buffers for latched ports: selects the buffer that is written, and the one that is read.
//
// The values are in a memory outside, with two buffers (places) for each port. A write goes to the back buffer. A flip exchanges
// front and back of those ports only that were written since the last one, so that the others keep their values.
//
// Contract
//   flip: values written before this cycle are visible from this cycle on.
//   open: values written in this cycle go to the front buffer, and so are visible at once.
//   drop: values written before this cycle that are not yet visible never become visible.
//   write, write_index: WRITES write ports; write_place: the buffer of each write, in the same cycle.
//   read_index: READS read ports; read_place: the front buffer of each, in the same cycle.
//   PORTS: the number of ports with two buffers, from port 0 on: a power of two, 2 or more. The others have buffer 0 only; if
//   PORTS is 0, all do.

module takt_double_buffer #(
    parameter PORTS  = 0,
    parameter INDEX  = 8,  // bits of an index
    parameter WRITES = 1,
    parameter READS  = 1
) (
    input  wire                    clk,
    input  wire                    flip,
    input  wire                    open,
    input  wire                    drop,
    input  wire [WRITES-1:0]       write,
    input  wire [WRITES*INDEX-1:0] write_index,
    output wire [WRITES-1:0]       write_place,
    input  wire [READS*INDEX-1:0]  read_index,
    output wire [READS-1:0]        read_place
);

    generate
        if (PORTS == 0) begin : g_direct
            assign write_place = {WRITES{1'b0}};
            assign read_place  = {READS{1'b0}};
            wire unused = &{1'b0, clk, flip, open, drop, write, write_index, read_index};
        end else begin : g_latched
            localparam BITS = $clog2(PORTS);

            reg  [PORTS-1:0] shown;    // the number of the front buffer
            reg  [PORTS-1:0] changed;  // the back buffer was written since the last flip
            wire [PORTS-1:0] now = flip ? shown ^ changed : shown;
            // No reset is needed: either buffer can be the front one, but its number must not be undefined in simulation.
            initial {shown, changed} = {2 * PORTS{1'b0}};

            reg  [PORTS-1:0]  touched;
            reg  [WRITES-1:0] to;
            reg  [READS-1:0]  from;
            reg  [INDEX-1:0]  index;
            integer           k;
            always @* begin
                touched = {PORTS{1'b0}};
                for (k = 0; k < WRITES; k = k + 1) begin
                    index = write_index[k*INDEX +: INDEX];
                    to[k] = (index >> BITS) == 0 & (now[index[BITS-1:0]] ^ ~open);
                    if (write[k] & ~open & (index >> BITS) == 0) touched[index[BITS-1:0]] = 1'b1;
                end
                for (k = 0; k < READS; k = k + 1) begin
                    index   = read_index[k*INDEX +: INDEX];
                    from[k] = (index >> BITS) == 0 & now[index[BITS-1:0]];
                end
            end
            assign write_place = to;
            assign read_place  = from;

            always @(posedge clk) begin
                shown   <= now;
                changed <= (changed & {PORTS{~flip & ~drop}}) | touched;
            end
        end
    endgenerate

endmodule
