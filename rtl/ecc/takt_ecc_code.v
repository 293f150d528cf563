// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_ecc_code: the code of memory words, which corrects one wrong bit and detects two (SECDED). No registers.
//
// Each data bit has a column, a number with three ones; a word's check bits are the XOR of the columns of its ones. As in M. Y. Hsiao,
// "A Class of Optimal Minimum Odd-weight-column SEC-DED Codes", IBM J. Res. Dev. 14 (1970), one wrong bit makes the syndrome odd, two make
// it even and not 0. No column has five ones, so that a bit is the wrong one where the syndrome has its column's three: a LUT4 for each bit.
// The word 0 has the check bits 0, so that cleared memories are valid.
//
// Contract
//   Without CORRECTS: check is the check bits of data, XOR given. With the check bits that were read beside data as given, it is the word's
//   syndrome. The other outputs are 0.
//   With CORRECTS: given is data's syndrome. wrong[0]: one bit is wrong, perhaps a check bit, and corrected is data without it. wrong[1]:
//   two are, and corrected is undefined. check is 0.

module takt_ecc_code #(
    parameter BITS     = 32,  // at most 35 with 7 check bits, 56 with 8
    parameter CHECK    = 7,   // check bits
    parameter CORRECTS = 0
) (
    input  wire [BITS-1:0]  data,
    input  wire [CHECK-1:0] given,
    output wire [CHECK-1:0] check,
    output wire [BITS-1:0]  corrected,
    output wire [1:0]       wrong
);

    // The columns: the numbers with three ones, in ascending order.
    function [CHECK*BITS-1:0] columns(input integer bits);
        integer value, k, found, count;
        begin
            columns = 0;
            count = 0;
            for (value = 0; value < 1 << CHECK; value = value + 1) begin
                found = 0;
                for (k = 0; k < CHECK; k = k + 1) if (value[k]) found = found + 1;
                if (count < bits && found == 3) begin
                    for (k = 0; k < CHECK; k = k + 1) columns[CHECK*count + k] = value[k];
                    count = count + 1;
                end
            end
        end
    endfunction

    localparam [CHECK*BITS-1:0] COLUMNS = columns(BITS);

    genvar i, k;
    generate
        if (CORRECTS == 0) begin : g_checks
            for (k = 0; k < CHECK; k = k + 1) begin : g_check
                wire [BITS-1:0] taken;
                for (i = 0; i < BITS; i = i + 1) begin : g_bit
                    assign taken[i] = data[i] & COLUMNS[CHECK*i + k];
                end
                assign check[k] = ^{taken, given[k]};
            end
            assign corrected = 0;
            assign wrong     = 0;
        end else begin : g_corrects
            for (i = 0; i < BITS; i = i + 1) begin : g_bit
                assign corrected[i] = data[i] ^ &(given | ~COLUMNS[CHECK*i +: CHECK]);
            end
            assign wrong = {|given & ~^given, ^given};
            assign check = 0;
        end
    endgenerate

endmodule
