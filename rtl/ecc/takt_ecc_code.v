// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_ecc_code: the code of memory words, which corrects one wrong bit and detects two (SECDED), with 7 check bits. No registers.
//
// Each data bit has a column, a number of 7 bits; a word's check bits are the XOR of the columns of its ones. The columns have 3 or 5
// ones, as in M. Y. Hsiao, "A Class of Optimal Minimum Odd-weight-column SEC-DED Codes", IBM J. Res. Dev. 14 (1970): one wrong bit makes
// the syndrome odd, two make it even and not 0. The word 0 has the check bits 0, so that cleared memories are valid.
//
// Contract
//   check: the check bits of data, XOR given. With the check bits that were read beside data as given, it is the word's syndrome.
//   corrected: data without the wrong bit that low and high (takt_ecc_place) tell. With CORRECTS, this is what the module has; without, it
//   has check, and corrected is 0.

module takt_ecc_code #(
    parameter BITS     = 32,  // at most 56
    parameter CORRECTS = 0
) (
    input  wire [BITS-1:0] data,
    input  wire [6:0]      given,
    output wire [6:0]      check,
    input  wire [15:0]     low,
    input  wire [7:0]      high,
    output wire [BITS-1:0] corrected
);

    // The columns: the numbers with 3 ones in ascending order, then those with 5.
    function [7*BITS-1:0] columns(input integer bits);
        integer ones, value, k, found, count;
        begin
            columns = 0;
            count = 0;
            for (ones = 3; ones <= 5; ones = ones + 2) begin
                for (value = 0; value < 128; value = value + 1) begin
                    found = 0;
                    for (k = 0; k < 7; k = k + 1) if (value[k]) found = found + 1;
                    if (count < bits && found == ones) begin
                        for (k = 0; k < 7; k = k + 1) columns[7*count + k] = value[k];
                        count = count + 1;
                    end
                end
            end
        end
    endfunction

    localparam [7*BITS-1:0] COLUMNS = columns(BITS);

    genvar i, k;
    generate
        if (CORRECTS == 0) begin : g_checks
            for (k = 0; k < 7; k = k + 1) begin : g_check
                wire [BITS-1:0] taken;
                for (i = 0; i < BITS; i = i + 1) begin : g_bit
                    assign taken[i] = data[i] & COLUMNS[7*i + k];
                end
                assign check[k] = ^{taken, given[k]};
            end
            assign corrected = {BITS{1'b0}};
            wire unused = &{1'b0, low, high};
        end else begin : g_corrects
            for (i = 0; i < BITS; i = i + 1) begin : g_bit
                localparam [6:0] COLUMN = COLUMNS[7*i +: 7];
                assign corrected[i] = data[i] ^ (low[COLUMN[3:0]] & high[COLUMN[6:4]]);
            end
            assign check = 7'd0;
            wire unused = &{1'b0, low, high, given};
        end
    endgenerate

endmodule
