// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_in_flight: shift register of the results in flight to a slot's bank, ordered by the cycles left until writeback.
//
// Contract
//   Place j holds the result that is on the slot's bus j cycles from now: valid[j], the register's index, the bundle's address.
//   Results move down a place each cycle; the one in place 0 is written back. A result of latency L that issues now, insert[L],
//   is in place L - 1 in the next cycle. late: a result enters the last place from takt_long_latency.
//   cancel, which stays high after a fault, drops the results that issued in the last two cycles, and all later ones.
//   (Only a slot that does not host the unit at fault can have a result of latency 2 to cancel in place 0.)
//   writes: the result in place 0 is written back. It is valid[0], unless the result is cancelled in this very cycle.
//   load: in reset, the loader's write is in place 0 in the next cycle.

module takt_in_flight #(
    parameter DEPTH   = 10,  // places
    parameter INDEX   = 8,   // bits of a register's index
    parameter ADDRESS = 16   // bits of a bundle's address
) (
    input  wire                   clk,
    input  wire                   rst,
    input  wire                   cancel,
    input  wire                   load,
    input  wire [INDEX-1:0]       load_index,
    input  wire [DEPTH:1]         insert,
    input  wire [INDEX-1:0]       insert_index,
    input  wire [ADDRESS-1:0]     insert_address,
    input  wire                   late,
    input  wire [INDEX-1:0]       late_index,
    input  wire [ADDRESS-1:0]     late_address,
    output reg  [DEPTH-1:0]       valid,
    output reg  [DEPTH*INDEX-1:0] index,
    output wire                   writes,
    output wire [ADDRESS-1:0]     address    // of place 0
);

    reg [DEPTH*ADDRESS-1:0] addresses;
    reg [DEPTH-1:0]         fresh;      // the result issued in the last cycle; recent: in the one before
    reg [DEPTH-1:0]         recent;

    wire [DEPTH:0]               above         = {late, valid};
    wire [DEPTH:0]               above_fresh   = {1'b0, fresh};
    wire [DEPTH:0]               above_recent  = {1'b0, recent};
    wire [(DEPTH+1)*INDEX-1:0]   above_index   = {late_index, index};
    wire [(DEPTH+1)*ADDRESS-1:0] above_address = {late_address, addresses};

    assign address = addresses[ADDRESS-1:0];
    assign writes  = valid[0] & ~(recent[0] & cancel);

    integer j;
    always @(posedge clk) begin
        for (j = 0; j < DEPTH; j = j + 1) begin
            fresh[j]  <= insert[j+1];
            recent[j] <= above_fresh[j+1];
            valid[j]  <= (above[j+1] & ~((above_fresh[j+1] | above_recent[j+1]) & cancel)) | insert[j+1];
            index[j*INDEX +: INDEX] <= insert[j+1] ? insert_index : above_index[(j+1)*INDEX +: INDEX];
            addresses[j*ADDRESS +: ADDRESS] <= insert[j+1] ? insert_address : above_address[(j+1)*ADDRESS +: ADDRESS];
        end
        if (rst) begin
            fresh    <= {DEPTH{1'b0}};
            recent   <= {DEPTH{1'b0}};
            valid    <= {DEPTH{1'b0}};
            valid[0] <= load;
            index[INDEX-1:0] <= load_index;
        end
    end

endmodule
