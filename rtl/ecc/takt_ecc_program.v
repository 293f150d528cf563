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

    localparam BITS  = 48 - LOW;
    localparam CHECK = 8;

    (* no_rw_check *)
    reg [CHECK+BITS-1:0] words [0:DEPTH-1];
    reg [CHECK+BITS-1:0] kept, seen;
    integer              i;
    initial for (i = 0; i < DEPTH; i = i + 1) words[i] = 0;  // a valid word

    wire               legal   = ~|(write_word & ((48'd1 << LOW) - 48'd1));
    wire [BITS-1:0]    stored  = write_word[47:LOW] & {BITS{legal}};
    wire [ADDRESS-1:0] address = write ? write_address : scrub_address;
    wire [CHECK-1:0]   stored_check, kept_syndrome, next_syndrome, unused_check1, unused_check2;
    wire [BITS+1:0]    unused1, unused2, unused3;

    always @(posedge clk) begin
        if (write) words[address] <= {stored_check, stored};
        else seen <= words[address];
        if (read) kept <= words[read_address];
    end

    takt_ecc_code #(.BITS(BITS), .CHECK(CHECK)) encodes (
        .data(stored), .given({CHECK{1'b0}}), .check(stored_check), .corrected(unused1[BITS+1:2]), .wrong(unused1[1:0])
    );
    // The way from the block RAM takes half a cycle: the word is corrected in the decode stage. `checks` stays apart, so that synthesis,
    // which does not count that half, gives it the least depth.
    reg  [BITS-1:0]  raw;
    reg  [CHECK-1:0] syndrome;
    wire [BITS-1:0]  decoded;
    always @(posedge clk) begin
        if (advance) begin
            raw      <= kept[BITS-1:0];
            syndrome <= kept_syndrome;
        end
    end
    (* keep_hierarchy = "yes" *)
    takt_ecc_code #(.BITS(BITS), .CHECK(CHECK)) checks (
        .data(kept[BITS-1:0]), .given(kept[BITS +: CHECK]), .check(kept_syndrome), .corrected(unused2[BITS+1:2]), .wrong(unused2[1:0])
    );
    takt_ecc_code #(.BITS(BITS), .CHECK(CHECK), .CORRECTS(1)) corrects (
        .data(raw), .given(syndrome), .check(unused_check1), .corrected(decoded), .wrong({two_wrong, one_wrong})
    );

    reg  [CHECK-1:0] seen_syndrome;
    wire [BITS-1:0]  repaired;
    always @(posedge clk) seen_syndrome <= next_syndrome;
    takt_ecc_code #(.BITS(BITS), .CHECK(CHECK)) scrubs (
        .data(seen[BITS-1:0]), .given(seen[BITS +: CHECK]), .check(next_syndrome), .corrected(unused3[BITS+1:2]), .wrong(unused3[1:0])
    );
    takt_ecc_code #(.BITS(BITS), .CHECK(CHECK), .CORRECTS(1)) repairs (
        .data(seen[BITS-1:0]), .given(seen_syndrome), .check(unused_check2), .corrected(repaired),
        .wrong({scrub_two_wrong, scrub_one_wrong})
    );

    generate
        if (LOW == 0) begin : g_all
            assign {word, scrubbed} = {decoded, repaired};
        end else begin : g_high
            assign {word, scrubbed} = {decoded, {LOW{1'b0}}, repaired, {LOW{1'b0}}};
        end
    endgenerate

endmodule
