// SPDX-License-Identifier: MIT OR Apache-2.0
// A word with its check bits, of which none, one or two bits are wrong, and what the modules of error correction make of it.

module takt_code #(
    parameter BITS  = 32,
    parameter CHECK = 7
) (
    input wire [BITS-1:0] data,
    input wire [5:0]      one,
    input wire [5:0]      other,
    input wire [1:0]      wrong
);

    localparam WORD = BITS + CHECK;

    wire [CHECK-1:0] check, syndrome, difference;
    integer          k;
    wire [1:0]       told;
    wire [BITS-1:0]  corrected;
    wire [WORD-1:0] flips = ({WORD{wrong >= 2'd1}} & ({{WORD-1{1'b0}}, 1'b1} << one)) ^
        ({WORD{wrong >= 2'd2}} & ({{WORD-1{1'b0}}, 1'b1} << other));
    wire [WORD-1:0] read = {check, data} ^ flips;

    takt_ecc_code #(.BITS(BITS), .CHECK(CHECK)) encodes (.data(data), .given({CHECK{1'b0}}), .check(check), .corrected(), .wrong());
    takt_ecc_code #(.BITS(BITS), .CHECK(CHECK)) checks (
        .data(read[BITS-1:0]), .given(read[WORD-1:BITS]), .check(syndrome), .corrected(), .wrong()
    );
    // The syndrome is that of the wrong bits alone, whatever the data is: with this, the assertions that follow have no word in them.
    takt_ecc_code #(.BITS(BITS), .CHECK(CHECK)) of_flips (
        .data(flips[BITS-1:0]), .given(flips[WORD-1:BITS]), .check(difference), .corrected(), .wrong()
    );
    takt_ecc_code #(.BITS(BITS), .CHECK(CHECK), .CORRECTS(1)) corrects (
        .data(read[BITS-1:0]), .given(syndrome), .check(), .corrected(corrected), .wrong(told)
    );

    always @* begin
        assume (one < WORD);
        assume (other < WORD);
        assume (one != other);
        assume (wrong != 2'd3);
        for (k = 0; k < CHECK; k = k + 1) assert (syndrome[k] == difference[k]);
        if (wrong != 2'd2) assert (corrected == data);
        assert (told == wrong);
        if (data == 0) assert (check == 0);
    end

endmodule
