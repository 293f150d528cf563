// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_snapshot: link that publishes several values atomically (docs/system.md, Snapshot).
//
// Contract
//   write, value: the sender's ports, in the cycle of writeback. shown: the set published last; published is high in the first
//   cycle of a new one. The receiver takes the whole set in one cycle, so that it never sees a part of a new one.
//   Published with the sender's outputs: publish is the sender's `published`, two cycles after the `publish` or `wait` of cycle c; the
//   set is shown from c + 3 + LENGTH on.
//   STROBE: publish is the write to the strobe's port, in its writeback c; the set, values of that cycle included, is shown from
//   c + 3 + LENGTH on.
//   HOST: publish and all values come from the host, in one cycle h; they are shown from h + 1 + LENGTH on.

module takt_snapshot #(
    parameter FIELDS  = 1,
    parameter LENGTH  = 0,
    parameter STROBE  = 0,
    parameter HOST    = 0,
    parameter [32*FIELDS-1:0] INITIAL = 0
) (
    input  wire                 clk,
    input  wire                 rst,
    input  wire [FIELDS-1:0]    write,
    input  wire [32*FIELDS-1:0] value,
    input  wire                 publish,
    output reg                  published,
    output reg  [32*FIELDS-1:0] shown
);

    // A publication takes the fields as they were before the cycle of publish. With a strobe, delayed by one cycle more, this includes
    // writes of the strobe's own cycle.
    localparam VALUES    = STROBE ? LENGTH + 1 : LENGTH;
    localparam PUBLISHES = STROBE ? LENGTH + 2 : LENGTH;

    wire [FIELDS-1:0]    arrives;
    wire [32*FIELDS-1:0] arrived;
    wire                 publishes;
    reg  [32*FIELDS-1:0] working;

    genvar f;
    generate
        for (f = 0; f < FIELDS; f = f + 1) begin : g_field
            takt_delay #(.LENGTH(VALUES), .WIDTH(32)) way (
                .clk(clk), .in_valid(HOST ? publish : write[f]), .in(value[32*f +: 32]),
                .out_valid(arrives[f]), .out(arrived[32*f +: 32])
            );
            always @(posedge clk) begin
                if (rst) working[32*f +: 32] <= INITIAL[32*f +: 32];
                else if (arrives[f]) working[32*f +: 32] <= arrived[32*f +: 32];
            end
        end
        if (HOST) begin : g_host
            wire unused = &{1'b0, write, working};
        end
    endgenerate

    wire nothing;
    takt_delay #(.LENGTH(PUBLISHES), .WIDTH(1)) way (
        .clk(clk), .in_valid(publish), .in(1'b0), .out_valid(publishes), .out(nothing)
    );
    wire unused = &{1'b0, nothing};

    always @(posedge clk) begin
        published <= publishes & ~rst;
        if (rst) shown <= INITIAL;
        else if (publishes) shown <= HOST ? arrived : working;
    end

endmodule
