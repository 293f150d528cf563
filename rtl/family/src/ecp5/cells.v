// SPDX-License-Identifier: MIT OR Apache-2.0
// Cells of ECP5 for the simulation of a routed design, where yosys' library (share/lattice) has none or a black box: block RAM,
// multiplier, the memories' write port, clock buffer. Written after Lattice's memory and DSP guides (FPGA-TN-02204, -02205) and the
// mapping in yosys' brams_map_16kd.v and dsp_map_18x18.v. No timing: what a way takes is nextpnr's to say.

// A block RAM of 1024 words of 18 bits. Contract
//   A port of 18 bits or fewer has its word in its own pins; of one of 36 bits A's have the lower half. Writing is by bytes of 9 bits
//   in widths 18 and 36: the lowest bits of the address select them.
//   What is modelled: WRITEMODE, REGMODE, initial contents, synchronous reset of the outputs. Chip selects are not.
module DP16KD #(
    parameter DATA_WIDTH_A = 18, DATA_WIDTH_B = 18,
    parameter REGMODE_A = "NOREG", REGMODE_B = "NOREG", WRITEMODE_A = "NORMAL", WRITEMODE_B = "NORMAL",
    parameter RESETMODE = "SYNC", ASYNC_RESET_RELEASE = "SYNC", CSDECODE_A = "0b000", CSDECODE_B = "0b000", GSR = "ENABLED",
    parameter CLKAMUX = "CLKA", CLKBMUX = "CLKB", INITVAL_WID = 0, WID = 0, INIT_DATA = "STATIC",
    parameter [319:0] INITVAL_00 = 320'd0, INITVAL_01 = 320'd0, INITVAL_02 = 320'd0, INITVAL_03 = 320'd0,
    parameter [319:0] INITVAL_04 = 320'd0, INITVAL_05 = 320'd0, INITVAL_06 = 320'd0, INITVAL_07 = 320'd0,
    parameter [319:0] INITVAL_08 = 320'd0, INITVAL_09 = 320'd0, INITVAL_0A = 320'd0, INITVAL_0B = 320'd0,
    parameter [319:0] INITVAL_0C = 320'd0, INITVAL_0D = 320'd0, INITVAL_0E = 320'd0, INITVAL_0F = 320'd0,
    parameter [319:0] INITVAL_10 = 320'd0, INITVAL_11 = 320'd0, INITVAL_12 = 320'd0, INITVAL_13 = 320'd0,
    parameter [319:0] INITVAL_14 = 320'd0, INITVAL_15 = 320'd0, INITVAL_16 = 320'd0, INITVAL_17 = 320'd0,
    parameter [319:0] INITVAL_18 = 320'd0, INITVAL_19 = 320'd0, INITVAL_1A = 320'd0, INITVAL_1B = 320'd0,
    parameter [319:0] INITVAL_1C = 320'd0, INITVAL_1D = 320'd0, INITVAL_1E = 320'd0, INITVAL_1F = 320'd0,
    parameter [319:0] INITVAL_20 = 320'd0, INITVAL_21 = 320'd0, INITVAL_22 = 320'd0, INITVAL_23 = 320'd0,
    parameter [319:0] INITVAL_24 = 320'd0, INITVAL_25 = 320'd0, INITVAL_26 = 320'd0, INITVAL_27 = 320'd0,
    parameter [319:0] INITVAL_28 = 320'd0, INITVAL_29 = 320'd0, INITVAL_2A = 320'd0, INITVAL_2B = 320'd0,
    parameter [319:0] INITVAL_2C = 320'd0, INITVAL_2D = 320'd0, INITVAL_2E = 320'd0, INITVAL_2F = 320'd0,
    parameter [319:0] INITVAL_30 = 320'd0, INITVAL_31 = 320'd0, INITVAL_32 = 320'd0, INITVAL_33 = 320'd0,
    parameter [319:0] INITVAL_34 = 320'd0, INITVAL_35 = 320'd0, INITVAL_36 = 320'd0, INITVAL_37 = 320'd0,
    parameter [319:0] INITVAL_38 = 320'd0, INITVAL_39 = 320'd0, INITVAL_3A = 320'd0, INITVAL_3B = 320'd0,
    parameter [319:0] INITVAL_3C = 320'd0, INITVAL_3D = 320'd0, INITVAL_3E = 320'd0, INITVAL_3F = 320'd0
) (
    input  wire DIA17, DIA16, DIA15, DIA14, DIA13, DIA12, DIA11, DIA10, DIA9, DIA8, DIA7, DIA6, DIA5, DIA4, DIA3, DIA2, DIA1, DIA0,
    input  wire ADA13, ADA12, ADA11, ADA10, ADA9, ADA8, ADA7, ADA6, ADA5, ADA4, ADA3, ADA2, ADA1, ADA0,
    input  wire CEA, OCEA, CLKA, WEA, RSTA, CSA2, CSA1, CSA0,
    output wire DOA17, DOA16, DOA15, DOA14, DOA13, DOA12, DOA11, DOA10, DOA9, DOA8, DOA7, DOA6, DOA5, DOA4, DOA3, DOA2, DOA1, DOA0,
    input  wire DIB17, DIB16, DIB15, DIB14, DIB13, DIB12, DIB11, DIB10, DIB9, DIB8, DIB7, DIB6, DIB5, DIB4, DIB3, DIB2, DIB1, DIB0,
    input  wire ADB13, ADB12, ADB11, ADB10, ADB9, ADB8, ADB7, ADB6, ADB5, ADB4, ADB3, ADB2, ADB1, ADB0,
    input  wire CEB, OCEB, CLKB, WEB, RSTB, CSB2, CSB1, CSB0,
    output wire DOB17, DOB16, DOB15, DOB14, DOB13, DOB12, DOB11, DOB10, DOB9, DOB8, DOB7, DOB6, DOB5, DOB4, DOB3, DOB2, DOB1, DOB0
);

    reg [17:0] words [0:1023];
    integer i;
    initial begin
        for (i = 0; i < 16; i = i + 1) begin
            words[0 + i] = INITVAL_00[20 * i +: 18];
            words[16 + i] = INITVAL_01[20 * i +: 18];
            words[32 + i] = INITVAL_02[20 * i +: 18];
            words[48 + i] = INITVAL_03[20 * i +: 18];
            words[64 + i] = INITVAL_04[20 * i +: 18];
            words[80 + i] = INITVAL_05[20 * i +: 18];
            words[96 + i] = INITVAL_06[20 * i +: 18];
            words[112 + i] = INITVAL_07[20 * i +: 18];
            words[128 + i] = INITVAL_08[20 * i +: 18];
            words[144 + i] = INITVAL_09[20 * i +: 18];
            words[160 + i] = INITVAL_0A[20 * i +: 18];
            words[176 + i] = INITVAL_0B[20 * i +: 18];
            words[192 + i] = INITVAL_0C[20 * i +: 18];
            words[208 + i] = INITVAL_0D[20 * i +: 18];
            words[224 + i] = INITVAL_0E[20 * i +: 18];
            words[240 + i] = INITVAL_0F[20 * i +: 18];
            words[256 + i] = INITVAL_10[20 * i +: 18];
            words[272 + i] = INITVAL_11[20 * i +: 18];
            words[288 + i] = INITVAL_12[20 * i +: 18];
            words[304 + i] = INITVAL_13[20 * i +: 18];
            words[320 + i] = INITVAL_14[20 * i +: 18];
            words[336 + i] = INITVAL_15[20 * i +: 18];
            words[352 + i] = INITVAL_16[20 * i +: 18];
            words[368 + i] = INITVAL_17[20 * i +: 18];
            words[384 + i] = INITVAL_18[20 * i +: 18];
            words[400 + i] = INITVAL_19[20 * i +: 18];
            words[416 + i] = INITVAL_1A[20 * i +: 18];
            words[432 + i] = INITVAL_1B[20 * i +: 18];
            words[448 + i] = INITVAL_1C[20 * i +: 18];
            words[464 + i] = INITVAL_1D[20 * i +: 18];
            words[480 + i] = INITVAL_1E[20 * i +: 18];
            words[496 + i] = INITVAL_1F[20 * i +: 18];
            words[512 + i] = INITVAL_20[20 * i +: 18];
            words[528 + i] = INITVAL_21[20 * i +: 18];
            words[544 + i] = INITVAL_22[20 * i +: 18];
            words[560 + i] = INITVAL_23[20 * i +: 18];
            words[576 + i] = INITVAL_24[20 * i +: 18];
            words[592 + i] = INITVAL_25[20 * i +: 18];
            words[608 + i] = INITVAL_26[20 * i +: 18];
            words[624 + i] = INITVAL_27[20 * i +: 18];
            words[640 + i] = INITVAL_28[20 * i +: 18];
            words[656 + i] = INITVAL_29[20 * i +: 18];
            words[672 + i] = INITVAL_2A[20 * i +: 18];
            words[688 + i] = INITVAL_2B[20 * i +: 18];
            words[704 + i] = INITVAL_2C[20 * i +: 18];
            words[720 + i] = INITVAL_2D[20 * i +: 18];
            words[736 + i] = INITVAL_2E[20 * i +: 18];
            words[752 + i] = INITVAL_2F[20 * i +: 18];
            words[768 + i] = INITVAL_30[20 * i +: 18];
            words[784 + i] = INITVAL_31[20 * i +: 18];
            words[800 + i] = INITVAL_32[20 * i +: 18];
            words[816 + i] = INITVAL_33[20 * i +: 18];
            words[832 + i] = INITVAL_34[20 * i +: 18];
            words[848 + i] = INITVAL_35[20 * i +: 18];
            words[864 + i] = INITVAL_36[20 * i +: 18];
            words[880 + i] = INITVAL_37[20 * i +: 18];
            words[896 + i] = INITVAL_38[20 * i +: 18];
            words[912 + i] = INITVAL_39[20 * i +: 18];
            words[928 + i] = INITVAL_3A[20 * i +: 18];
            words[944 + i] = INITVAL_3B[20 * i +: 18];
            words[960 + i] = INITVAL_3C[20 * i +: 18];
            words[976 + i] = INITVAL_3D[20 * i +: 18];
            words[992 + i] = INITVAL_3E[20 * i +: 18];
            words[1008 + i] = INITVAL_3F[20 * i +: 18];
        end
    end

    wire [17:0] di_a = {DIA17, DIA16, DIA15, DIA14, DIA13, DIA12, DIA11, DIA10, DIA9, DIA8, DIA7, DIA6, DIA5, DIA4, DIA3, DIA2, DIA1, DIA0};
    wire [13:0] ad_a = {ADA13, ADA12, ADA11, ADA10, ADA9, ADA8, ADA7, ADA6, ADA5, ADA4, ADA3, ADA2, ADA1, ADA0};
    wire [17:0] di_b = {DIB17, DIB16, DIB15, DIB14, DIB13, DIB12, DIB11, DIB10, DIB9, DIB8, DIB7, DIB6, DIB5, DIB4, DIB3, DIB2, DIB1, DIB0};
    wire [13:0] ad_b = {ADB13, ADB12, ADB11, ADB10, ADB9, ADB8, ADB7, ADB6, ADB5, ADB4, ADB3, ADB2, ADB1, ADB0};

    // The word of 36 bits in which an address lies, and what of it a port of some width sees.
    function [35:0] seen(input integer width, input [13:0] at, input [35:0] pair);
        reg [17:0] word;
        reg [8:0]  byte9;
        begin
            word  = at[4] ? pair[35:18] : pair[17:0];
            byte9 = at[3] ? word[17:9] : word[8:0];
            case (width)
                36: seen = pair;
                18: seen = {18'd0, word};
                9: seen = {27'd0, byte9};
                4: seen = {32'd0, byte9[4 * at[2] +: 4]};
                2: seen = {34'd0, byte9[2 * at[2:1] +: 2]};
                default: seen = {35'd0, byte9[at[2:0]]};
            endcase
        end
    endfunction

    // The word after a write by a port of some width.
    function [35:0] put(input integer width, input [13:0] at, input [35:0] pair, input [35:0] value);
        integer b, base;
        begin
            put  = pair;
            base = 18 * at[4];
            case (width)
                36: for (b = 0; b < 4; b = b + 1) if (at[b]) put[9 * b +: 9] = value[9 * b +: 9];
                18: for (b = 0; b < 2; b = b + 1) if (at[b]) put[base + 9 * b +: 9] = value[9 * b +: 9];
                9: put[base + 9 * at[3] +: 9] = value[8:0];
                4: put[base + 9 * at[3] + 4 * at[2] +: 4] = value[3:0];
                2: put[base + 9 * at[3] + 2 * at[2:1] +: 2] = value[1:0];
                default: put[base + 9 * at[3] + at[2:0]] = value[0];
            endcase
        end
    endfunction

    reg  [35:0] read_a, late_a, read_b, late_b;
    initial {read_a, late_a, read_b, late_b} = 144'd0;
    wire [35:0] pair_a = {words[{ad_a[13:5], 1'b1}], words[{ad_a[13:5], 1'b0}]};
    wire [35:0] pair_b = {words[{ad_b[13:5], 1'b1}], words[{ad_b[13:5], 1'b0}]};
    wire [35:0] next_a = put(DATA_WIDTH_A, ad_a, pair_a, DATA_WIDTH_A == 36 ? {di_b, di_a} : {18'd0, di_a});
    wire [35:0] next_b = put(DATA_WIDTH_B, ad_b, pair_b, DATA_WIDTH_B == 36 ? {di_b, di_a} : {18'd0, di_b});

    always @(posedge CLKA) begin
        if (CEA) begin
            if (WEA) {words[{ad_a[13:5], 1'b1}], words[{ad_a[13:5], 1'b0}]} <= next_a;
            if (~WEA | WRITEMODE_A == "READBEFOREWRITE") read_a <= seen(DATA_WIDTH_A, ad_a, pair_a);
            else if (WRITEMODE_A == "WRITETHROUGH") read_a <= seen(DATA_WIDTH_A, ad_a, next_a);
        end
        if (OCEA) late_a <= read_a;
        if (RSTA) {read_a, late_a} <= 72'd0;
    end
    wire [35:0] out_a = REGMODE_A == "OUTREG" ? late_a : read_a;

    always @(posedge CLKB) begin
        if (CEB) begin
            if (WEB) {words[{ad_b[13:5], 1'b1}], words[{ad_b[13:5], 1'b0}]} <= next_b;
            if (~WEB | WRITEMODE_B == "READBEFOREWRITE") read_b <= seen(DATA_WIDTH_B, ad_b, pair_b);
            else if (WRITEMODE_B == "WRITETHROUGH") read_b <= seen(DATA_WIDTH_B, ad_b, next_b);
        end
        if (OCEB) late_b <= read_b;
        if (RSTB) {read_b, late_b} <= 72'd0;
    end
    wire [35:0] out_b = REGMODE_B == "OUTREG" ? late_b : read_b;

    assign {DOA17, DOA16, DOA15, DOA14, DOA13, DOA12, DOA11, DOA10, DOA9, DOA8, DOA7, DOA6, DOA5, DOA4, DOA3, DOA2, DOA1, DOA0} = DATA_WIDTH_B == 36 ? out_b[17:0] : out_a[17:0];
    assign {DOB17, DOB16, DOB15, DOB14, DOB13, DOB12, DOB11, DOB10, DOB9, DOB8, DOB7, DOB6, DOB5, DOB4, DOB3, DOB2, DOB1, DOB0} = DATA_WIDTH_B == 36 ? out_b[35:18] : out_b[17:0];

endmodule

// A multiplier with its input and output registers; its pipeline register and cascades are not modelled.
module MULT18X18D #(
    parameter REG_INPUTA_CLK = "NONE", REG_INPUTA_CE = "CE0", REG_INPUTA_RST = "RST0",
    parameter REG_INPUTB_CLK = "NONE", REG_INPUTB_CE = "CE0", REG_INPUTB_RST = "RST0",
    parameter REG_INPUTC_CLK = "NONE", REG_INPUTC_CE = "CE0", REG_INPUTC_RST = "RST0",
    parameter REG_PIPELINE_CLK = "NONE", REG_PIPELINE_CE = "CE0", REG_PIPELINE_RST = "RST0",
    parameter REG_OUTPUT_CLK = "NONE", REG_OUTPUT_CE = "CE0", REG_OUTPUT_RST = "RST0",
    parameter CLK0_DIV = "ENABLED", CLK1_DIV = "ENABLED", CLK2_DIV = "ENABLED", CLK3_DIV = "ENABLED", HIGHSPEED_CLK = "NONE",
    parameter GSR = "ENABLED", CAS_MATCH_REG = "FALSE", SOURCEB_MODE = "B_SHIFT", MULT_BYPASS = "DISABLED", RESETMODE = "SYNC"
) (
    input  wire A17, A16, A15, A14, A13, A12, A11, A10, A9, A8, A7, A6, A5, A4, A3, A2, A1, A0,
    input  wire B17, B16, B15, B14, B13, B12, B11, B10, B9, B8, B7, B6, B5, B4, B3, B2, B1, B0,
    input  wire C17, C16, C15, C14, C13, C12, C11, C10, C9, C8, C7, C6, C5, C4, C3, C2, C1, C0,
    input  wire SIGNEDA, SIGNEDB, SOURCEA, SOURCEB, CLK3, CLK2, CLK1, CLK0, CE3, CE2, CE1, CE0, RST3, RST2, RST1, RST0,
    output wire P35, P34, P33, P32, P31, P30, P29, P28, P27, P26, P25, P24, P23, P22, P21, P20, P19, P18, P17, P16, P15, P14, P13, P12, P11, P10, P9, P8, P7, P6, P5, P4, P3, P2, P1, P0
);

    wire [17:0] a = {A17, A16, A15, A14, A13, A12, A11, A10, A9, A8, A7, A6, A5, A4, A3, A2, A1, A0};
    wire [17:0] b = {B17, B16, B15, B14, B13, B12, B11, B10, B9, B8, B7, B6, B5, B4, B3, B2, B1, B0};
    reg  [17:0] held_a, held_b;
    reg  [35:0] held_p;
    initial {held_a, held_b, held_p} = 72'd0;
    wire [17:0] from_a = REG_INPUTA_CLK == "NONE" ? a : held_a;
    wire [17:0] from_b = REG_INPUTB_CLK == "NONE" ? b : held_b;
    wire signed [18:0] wide_a = {SIGNEDA & from_a[17], from_a};
    wire signed [18:0] wide_b = {SIGNEDB & from_b[17], from_b};
    wire signed [37:0] product = wide_a * wide_b;
    always @(posedge CLK0) if (CE0) begin
        held_a <= RST0 ? 18'd0 : a;
        held_b <= RST0 ? 18'd0 : b;
        held_p <= RST0 ? 36'd0 : product[35:0];
    end
    assign {P35, P34, P33, P32, P31, P30, P29, P28, P27, P26, P25, P24, P23, P22, P21, P20, P19, P18, P17, P16, P15, P14, P13, P12, P11, P10, P9, P8, P7, P6, P5, P4, P3, P2, P1, P0} =
        REG_OUTPUT_CLK == "NONE" ? product[35:0] : held_p;

    generate
        if (REG_PIPELINE_CLK != "NONE") takt_multiplier_has_no_pipeline_register unsupported ();
        if (REG_INPUTA_CLK != "NONE" & REG_INPUTA_CLK != "CLK0") takt_multiplier_has_another_clock unsupported ();
    endgenerate

endmodule

// The write port of a slice's memories: its outputs go to the cells that hold the bits. Which pin is which: nextpnr's cells.cc.
module TRELLIS_RAMW (
    input  wire A0, A1, B0, B1, C0, C1, D0, D1,
    output wire WDO0, WDO1, WDO2, WDO3, WADO0, WADO1, WADO2, WADO3
);
    assign {WDO3, WDO2, WDO1, WDO0}     = {B1, D1, A1, C1};
    assign {WADO3, WADO2, WADO1, WADO0} = {A0, C0, B0, D0};
endmodule

module DCCA (
    input  wire CLKI, CE,
    output wire CLKO
);
    assign CLKO = CLKI;
endmodule
