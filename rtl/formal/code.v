// SPDX-License-Identifier: MIT OR Apache-2.0
// A word with its check bits, of which none, one or two bits are wrong, and what the modules of error correction make of it.

module takt_code #(
    parameter BITS = 32
) (
    input wire [BITS-1:0] data,
    input wire [5:0]      one,
    input wire [5:0]      other,
    input wire [1:0]      wrong
);

    localparam WORD = BITS + 7;

    wire [6:0]      check, syndrome, difference;
    integer         k;
    wire [15:0]     low;
    wire [7:0]      high;
    wire            one_wrong, two_wrong;
    wire [BITS-1:0] corrected;
    wire [WORD-1:0] flips = ({WORD{wrong >= 2'd1}} & ({{WORD-1{1'b0}}, 1'b1} << one)) ^
        ({WORD{wrong >= 2'd2}} & ({{WORD-1{1'b0}}, 1'b1} << other));
    wire [WORD-1:0] read = {check, data} ^ flips;

    takt_ecc_code #(.BITS(BITS)) encodes (.data(data), .given(7'd0), .check(check), .low(16'd0), .high(8'd0), .corrected());
    takt_ecc_code #(.BITS(BITS)) checks (.data(read[BITS-1:0]), .given(read[WORD-1:BITS]), .check(syndrome), .low(16'd0), .high(8'd0), .corrected());
    // The syndrome is that of the wrong bits alone, whatever the data is: with this, the assertions that follow have no word in them.
    takt_ecc_code #(.BITS(BITS)) of_flips (
        .data(flips[BITS-1:0]), .given(flips[WORD-1:BITS]), .check(difference), .low(16'd0), .high(8'd0), .corrected()
    );
    takt_ecc_place place (.syndrome(syndrome), .low(low), .high(high), .one_wrong(one_wrong), .two_wrong(two_wrong));
    takt_ecc_code #(.BITS(BITS), .CORRECTS(1)) corrects (
        .data(read[BITS-1:0]), .given(7'd0), .check(), .low(low), .high(high), .corrected(corrected)
    );

    always @* begin
        assume (one < WORD);
        assume (other < WORD);
        assume (one != other);
        assume (wrong != 2'd3);
        for (k = 0; k < 7; k = k + 1) assert (syndrome[k] == difference[k]);
        if (wrong != 2'd2) assert (corrected == data);
        assert (one_wrong == (wrong == 2'd1));
        assert (two_wrong == (wrong == 2'd2));
        if (data == 0) assert (check == 7'd0);
    end

endmodule
