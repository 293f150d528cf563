// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_leading_zeros: leading-zero counter.
//
// Contract
//   zeros = 0 to 31 for x other than zero; 31 for x = 0, `none` then being 1. Combinational: four levels of logic.

module takt_leading_zeros (
    input  wire [31:0] x,
    output wire        none,
    output wire [4:0]  zeros
);

    // For groups of 4, 8, 16, 32 bits, the lowest group first: 1 if the group is all zeros, and the number of its leading zeros.
    wire [7:0]  none4;
    wire [3:0]  none8;
    wire [1:0]  none16;
    wire [15:0] zeros4;   // 8 x 2 bits
    wire [11:0] zeros8;   // 4 x 3 bits
    wire [7:0]  zeros16;  // 2 x 4 bits

    genvar i;
    generate
        for (i = 0; i < 8; i = i + 1) begin : g_4
            wire [3:0] group = x[4*i +: 4];
            assign none4[i] = ~|group;
            assign zeros4[2*i +: 2] = {~(group[3] | group[2]), ~(group[3] | (~group[2] & group[1]))};
        end
        for (i = 0; i < 4; i = i + 1) begin : g_8
            assign none8[i] = none4[2*i+1] & none4[2*i];
            assign zeros8[3*i +: 3] = {none4[2*i+1], none4[2*i+1] ? zeros4[4*i +: 2] : zeros4[4*i+2 +: 2]};
        end
        for (i = 0; i < 2; i = i + 1) begin : g_16
            assign none16[i] = none8[2*i+1] & none8[2*i];
            assign zeros16[4*i +: 4] = {none8[2*i+1], none8[2*i+1] ? zeros8[6*i +: 3] : zeros8[6*i+3 +: 3]};
        end
    endgenerate

    assign none  = none16[1] & none16[0];
    assign zeros = {none16[1], none16[1] ? zeros16[3:0] : zeros16[7:4]};

endmodule
