// SPDX-License-Identifier: MIT OR Apache-2.0
// Cells of Gowin's families for the simulation of a routed design, where yosys' library (share/gowin) has black boxes: block RAM and
// multiplier. Written after Gowin's guides of memories and multipliers (UG285, UG287) and the mapping in yosys' brams_map.v and dsp_map.v.
// No timing: what a way takes is nextpnr's to say.

// A block RAM of 2048 words of 9 bits with one port to write and one to read. Contract
//   A port of 9, 18 or 36 bits has its word in its lowest pins. The address counts bits, so its 3, 4 or 5 lowest bits are none of a word;
//   of port A those of 18 and 36 bits say which bytes of 9 bits are written.
//   CEA writes; the word that CEB reads is there after the clock edge, and stays. RESETB makes it 0: at the edge, or, if RESET_MODE is
//   "ASYNC", at once. Reading what is written at the same edge gives the word before.
//   Not modelled: the output register (READ_MODE 1) and block selects.
module SDPX9B #(
    parameter READ_MODE = 0, BIT_WIDTH_0 = 36, BIT_WIDTH_1 = 36, BLK_SEL_0 = 0, BLK_SEL_1 = 0, RESET_MODE = "SYNC",
    parameter [287:0] INIT_RAM_00 = 288'd0, INIT_RAM_01 = 288'd0, INIT_RAM_02 = 288'd0, INIT_RAM_03 = 288'd0,
    parameter [287:0] INIT_RAM_04 = 288'd0, INIT_RAM_05 = 288'd0, INIT_RAM_06 = 288'd0, INIT_RAM_07 = 288'd0,
    parameter [287:0] INIT_RAM_08 = 288'd0, INIT_RAM_09 = 288'd0, INIT_RAM_0A = 288'd0, INIT_RAM_0B = 288'd0,
    parameter [287:0] INIT_RAM_0C = 288'd0, INIT_RAM_0D = 288'd0, INIT_RAM_0E = 288'd0, INIT_RAM_0F = 288'd0,
    parameter [287:0] INIT_RAM_10 = 288'd0, INIT_RAM_11 = 288'd0, INIT_RAM_12 = 288'd0, INIT_RAM_13 = 288'd0,
    parameter [287:0] INIT_RAM_14 = 288'd0, INIT_RAM_15 = 288'd0, INIT_RAM_16 = 288'd0, INIT_RAM_17 = 288'd0,
    parameter [287:0] INIT_RAM_18 = 288'd0, INIT_RAM_19 = 288'd0, INIT_RAM_1A = 288'd0, INIT_RAM_1B = 288'd0,
    parameter [287:0] INIT_RAM_1C = 288'd0, INIT_RAM_1D = 288'd0, INIT_RAM_1E = 288'd0, INIT_RAM_1F = 288'd0,
    parameter [287:0] INIT_RAM_20 = 288'd0, INIT_RAM_21 = 288'd0, INIT_RAM_22 = 288'd0, INIT_RAM_23 = 288'd0,
    parameter [287:0] INIT_RAM_24 = 288'd0, INIT_RAM_25 = 288'd0, INIT_RAM_26 = 288'd0, INIT_RAM_27 = 288'd0,
    parameter [287:0] INIT_RAM_28 = 288'd0, INIT_RAM_29 = 288'd0, INIT_RAM_2A = 288'd0, INIT_RAM_2B = 288'd0,
    parameter [287:0] INIT_RAM_2C = 288'd0, INIT_RAM_2D = 288'd0, INIT_RAM_2E = 288'd0, INIT_RAM_2F = 288'd0,
    parameter [287:0] INIT_RAM_30 = 288'd0, INIT_RAM_31 = 288'd0, INIT_RAM_32 = 288'd0, INIT_RAM_33 = 288'd0,
    parameter [287:0] INIT_RAM_34 = 288'd0, INIT_RAM_35 = 288'd0, INIT_RAM_36 = 288'd0, INIT_RAM_37 = 288'd0,
    parameter [287:0] INIT_RAM_38 = 288'd0, INIT_RAM_39 = 288'd0, INIT_RAM_3A = 288'd0, INIT_RAM_3B = 288'd0,
    parameter [287:0] INIT_RAM_3C = 288'd0, INIT_RAM_3D = 288'd0, INIT_RAM_3E = 288'd0, INIT_RAM_3F = 288'd0
) (
    input  wire        CLKA, CEA, CLKB, CEB, OCE, RESETA, RESETB,
    input  wire [13:0] ADA, ADB,
    input  wire [2:0]  BLKSELA, BLKSELB,
    input  wire [35:0] DI,
    output reg  [35:0] DO
);

    reg [8:0] words [0:2047];
    integer i;
    initial begin
        DO = 36'd0;
        for (i = 0; i < 32; i = i + 1) begin
            words[0 + i] = INIT_RAM_00[9 * i +: 9];
            words[32 + i] = INIT_RAM_01[9 * i +: 9];
            words[64 + i] = INIT_RAM_02[9 * i +: 9];
            words[96 + i] = INIT_RAM_03[9 * i +: 9];
            words[128 + i] = INIT_RAM_04[9 * i +: 9];
            words[160 + i] = INIT_RAM_05[9 * i +: 9];
            words[192 + i] = INIT_RAM_06[9 * i +: 9];
            words[224 + i] = INIT_RAM_07[9 * i +: 9];
            words[256 + i] = INIT_RAM_08[9 * i +: 9];
            words[288 + i] = INIT_RAM_09[9 * i +: 9];
            words[320 + i] = INIT_RAM_0A[9 * i +: 9];
            words[352 + i] = INIT_RAM_0B[9 * i +: 9];
            words[384 + i] = INIT_RAM_0C[9 * i +: 9];
            words[416 + i] = INIT_RAM_0D[9 * i +: 9];
            words[448 + i] = INIT_RAM_0E[9 * i +: 9];
            words[480 + i] = INIT_RAM_0F[9 * i +: 9];
            words[512 + i] = INIT_RAM_10[9 * i +: 9];
            words[544 + i] = INIT_RAM_11[9 * i +: 9];
            words[576 + i] = INIT_RAM_12[9 * i +: 9];
            words[608 + i] = INIT_RAM_13[9 * i +: 9];
            words[640 + i] = INIT_RAM_14[9 * i +: 9];
            words[672 + i] = INIT_RAM_15[9 * i +: 9];
            words[704 + i] = INIT_RAM_16[9 * i +: 9];
            words[736 + i] = INIT_RAM_17[9 * i +: 9];
            words[768 + i] = INIT_RAM_18[9 * i +: 9];
            words[800 + i] = INIT_RAM_19[9 * i +: 9];
            words[832 + i] = INIT_RAM_1A[9 * i +: 9];
            words[864 + i] = INIT_RAM_1B[9 * i +: 9];
            words[896 + i] = INIT_RAM_1C[9 * i +: 9];
            words[928 + i] = INIT_RAM_1D[9 * i +: 9];
            words[960 + i] = INIT_RAM_1E[9 * i +: 9];
            words[992 + i] = INIT_RAM_1F[9 * i +: 9];
            words[1024 + i] = INIT_RAM_20[9 * i +: 9];
            words[1056 + i] = INIT_RAM_21[9 * i +: 9];
            words[1088 + i] = INIT_RAM_22[9 * i +: 9];
            words[1120 + i] = INIT_RAM_23[9 * i +: 9];
            words[1152 + i] = INIT_RAM_24[9 * i +: 9];
            words[1184 + i] = INIT_RAM_25[9 * i +: 9];
            words[1216 + i] = INIT_RAM_26[9 * i +: 9];
            words[1248 + i] = INIT_RAM_27[9 * i +: 9];
            words[1280 + i] = INIT_RAM_28[9 * i +: 9];
            words[1312 + i] = INIT_RAM_29[9 * i +: 9];
            words[1344 + i] = INIT_RAM_2A[9 * i +: 9];
            words[1376 + i] = INIT_RAM_2B[9 * i +: 9];
            words[1408 + i] = INIT_RAM_2C[9 * i +: 9];
            words[1440 + i] = INIT_RAM_2D[9 * i +: 9];
            words[1472 + i] = INIT_RAM_2E[9 * i +: 9];
            words[1504 + i] = INIT_RAM_2F[9 * i +: 9];
            words[1536 + i] = INIT_RAM_30[9 * i +: 9];
            words[1568 + i] = INIT_RAM_31[9 * i +: 9];
            words[1600 + i] = INIT_RAM_32[9 * i +: 9];
            words[1632 + i] = INIT_RAM_33[9 * i +: 9];
            words[1664 + i] = INIT_RAM_34[9 * i +: 9];
            words[1696 + i] = INIT_RAM_35[9 * i +: 9];
            words[1728 + i] = INIT_RAM_36[9 * i +: 9];
            words[1760 + i] = INIT_RAM_37[9 * i +: 9];
            words[1792 + i] = INIT_RAM_38[9 * i +: 9];
            words[1824 + i] = INIT_RAM_39[9 * i +: 9];
            words[1856 + i] = INIT_RAM_3A[9 * i +: 9];
            words[1888 + i] = INIT_RAM_3B[9 * i +: 9];
            words[1920 + i] = INIT_RAM_3C[9 * i +: 9];
            words[1952 + i] = INIT_RAM_3D[9 * i +: 9];
            words[1984 + i] = INIT_RAM_3E[9 * i +: 9];
            words[2016 + i] = INIT_RAM_3F[9 * i +: 9];
        end
    end

    localparam UNITS_A = BIT_WIDTH_0 / 9, UNITS_B = BIT_WIDTH_1 / 9;
    // The first word of 9 bits that a port addresses.
    wire [10:0] first_a = ADA[13:3] & ~(UNITS_A - 11'd1), first_b = ADB[13:3] & ~(UNITS_B - 11'd1);
    wire [3:0]  bytes   = UNITS_A == 1 ? 4'b0001 : UNITS_A == 2 ? {2'b00, ADA[1:0]} : ADA[3:0];
    integer u;
    always @(posedge CLKA) if (CEA) for (u = 0; u < UNITS_A; u = u + 1) if (bytes[u]) words[first_a + u] <= DI[9*u +: 9];

    wire [35:0] read;
    genvar g;
    generate
        for (g = 0; g < 4; g = g + 1) begin : g_unit
            assign read[9*g +: 9] = g < UNITS_B ? words[first_b + g] : 9'd0;
        end
        if (RESET_MODE == "ASYNC") begin : g_reset
            always @(posedge CLKB or posedge RESETB) if (RESETB) DO <= 36'd0; else if (CEB) DO <= read;
        end else begin : g_reset
            always @(posedge CLKB) if (RESETB) DO <= 36'd0; else if (CEB) DO <= read;
        end
    endgenerate

    initial if (READ_MODE != 0) $display("SDPX9B: READ_MODE is not modelled");

endmodule

// A multiplier of 18 by 18 bits. ASIGN and BSIGN: the operand is signed. Not modelled: registers, and operands from a neighbour.
module MULT18X18 (
    input  wire [17:0] A, B,
    input  wire        ASIGN, BSIGN,
    output wire [35:0] DOUT
);

    assign DOUT = $signed({{18{ASIGN & A[17]}}, A}) * $signed({{18{BSIGN & B[17]}}, B});

endmodule
