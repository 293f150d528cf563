// takt_double_buffer: the control of double buffers for latched ports: which of two places is written, which is read.
//
// The values are in a memory with two places for each port. A write goes to the back place; a flip exchanges front and back of the
// ports that were written. A port that was not written keeps its front place, and so its value.
//
// Contract
//   flip: what was written before this cycle is shown from this cycle on.
//   open: what is written in this cycle goes to the place that is shown.
//   drop: what was written before this cycle and is not shown, never is.
//   write, write_index: streams of writes; write_place: where each goes, in the same cycle.
//   read_index: readers; read_place: what is shown to each, in the same cycle.
//   PORTS: those with two places, from 0 on: a power of two, 2 or more. The others have place 0 alone; with 0, all.

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

            reg  [PORTS-1:0] shown;    // the place that is
            reg  [PORTS-1:0] changed;  // the other place has what is to be shown next
            wire [PORTS-1:0] now = flip ? shown ^ changed : shown;
            // No reset: which side a port is on does not matter, only that it is on one.
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
