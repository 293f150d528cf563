// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_ecc_program: takt_program with a code that corrects one wrong bit of a word (takt_ecc_code). The port that writes is the
// scrubber's, too.
//
// Contract
//   Ports not named here are those of takt_program. word is the word that was read before the last advance, corrected: it is in the decode
//   stage, as the register behind takt_program; one_wrong and two_wrong tell of wrong bits in it.
//   scrub_address: the address that the port reads in cycles without write, when it has stayed for three cycles: scrubbed is the
//   corrected word, scrub_one_wrong and scrub_two_wrong tell of wrong bits.

module takt_ecc_program #(
    parameter DEPTH   = 1024,
    parameter ADDRESS = 10,   // bits of an address
    parameter LOW     = 0
) (
    input  wire               clk,
    input  wire               write,
    input  wire [ADDRESS-1:0] write_address,
    input  wire [47:0]        write_word,
    input  wire               read,
    input  wire [ADDRESS-1:0] read_address,
    input  wire               advance,
    output wire [47:0]        word,
    output wire               one_wrong,
    output wire               two_wrong,
    input  wire [ADDRESS-1:0] scrub_address,
    output wire [47:0]        scrubbed,
    output wire               scrub_one_wrong,
    output wire               scrub_two_wrong
);

    localparam BITS = 48 - LOW;

    (* no_rw_check *)
    reg [BITS+6:0] words [0:DEPTH-1];
    reg [BITS+6:0] kept, seen;
    integer        i;
    initial for (i = 0; i < DEPTH; i = i + 1) words[i] = 0;  // a valid word

    wire               legal   = ~|(write_word & ((48'd1 << LOW) - 48'd1));
    wire [BITS-1:0]    stored  = write_word[47:LOW] & {BITS{legal}};
    wire [ADDRESS-1:0] address = write ? write_address : scrub_address;
    wire [6:0]         stored_check, kept_syndrome, next_syndrome, unused_check1, unused_check2;
    wire [BITS-1:0]    unused_corrected1, unused_corrected2, unused_corrected3;

    always @(posedge clk) begin
        if (write) words[address] <= {stored_check, stored};
        else seen <= words[address];
        if (read) kept <= words[read_address];
    end

    takt_ecc_code #(.BITS(BITS)) encodes (
        .data(stored), .given(7'd0), .check(stored_check), .low(16'd0), .high(8'd0), .corrected(unused_corrected1)
    );
    // The way from the block RAM takes half a cycle: the word is corrected in the decode stage. `checks` stays apart, so that synthesis,
    // which does not count that half, gives it the least depth.
    reg  [BITS-1:0] raw;
    reg  [6:0]      syndrome;
    wire [BITS-1:0] decoded;
    wire [15:0]     low, scrub_low;
    wire [7:0]      high, scrub_high;
    always @(posedge clk) begin
        if (advance) begin
            raw      <= kept[BITS-1:0];
            syndrome <= kept_syndrome;
        end
    end
    (* keep_hierarchy = "yes" *)
    takt_ecc_code #(.BITS(BITS)) checks (
        .data(kept[BITS-1:0]), .given(kept[BITS+6:BITS]), .check(kept_syndrome), .low(16'd0), .high(8'd0), .corrected(unused_corrected2)
    );
    takt_ecc_place place (
        .syndrome(syndrome), .low(low), .high(high), .one_wrong(one_wrong), .two_wrong(two_wrong)
    );
    takt_ecc_code #(.BITS(BITS), .CORRECTS(1)) corrects (
        .data(raw), .given(7'd0), .check(unused_check1), .low(low), .high(high), .corrected(decoded)
    );

    reg  [6:0]      seen_syndrome;
    wire [BITS-1:0] repaired;
    always @(posedge clk) seen_syndrome <= next_syndrome;
    takt_ecc_place scrub_place (
        .syndrome(seen_syndrome), .low(scrub_low), .high(scrub_high), .one_wrong(scrub_one_wrong), .two_wrong(scrub_two_wrong)
    );
    takt_ecc_code #(.BITS(BITS)) scrubs (
        .data(seen[BITS-1:0]), .given(seen[BITS+6:BITS]), .check(next_syndrome), .low(16'd0), .high(8'd0), .corrected(unused_corrected3)
    );
    takt_ecc_code #(.BITS(BITS), .CORRECTS(1)) repairs (
        .data(seen[BITS-1:0]), .given(7'd0), .check(unused_check2), .low(scrub_low), .high(scrub_high), .corrected(repaired)
    );

    generate
        if (LOW == 0) begin : g_all
            assign {word, scrubbed} = {decoded, repaired};
        end else begin : g_high
            assign {word, scrubbed} = {decoded, {LOW{1'b0}}, repaired, {LOW{1'b0}}};
        end
    endgenerate

endmodule
