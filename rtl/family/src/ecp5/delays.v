// SPDX-License-Identifier: MIT OR Apache-2.0
// These are the delays of an ECP5's multipliers and block RAMs, of which yosys' own library says nothing: its mapping of logic (abc9)
// would take both for as fast as a flip-flop, and lay ways of several tables in front of a multiplier that needs a third of the cycle.
//
// Picoseconds, those of nextpnr's model at speed grade 8, beyond what a flip-flop takes: 395 from the clock to its output, 232 before the
// clock. Modules and parameters replace those of the library, of the same names; ports that no circuit of Takt connects are left out.

(* blackbox *)
module MULT18X18D (
    input  CLK0, CLK1, CLK2, CLK3, CE0, CE1, CE2, CE3, RST0, RST1, RST2, RST3, SIGNEDA, SIGNEDB, SOURCEA, SOURCEB,
    input
           A0, A1, A2, A3, A4, A5, A6, A7, A8, A9, A10, A11, A12, A13, A14, A15, A16, A17, B0, B1, B2, B3, B4, B5, B6, B7, B8,
           B9, B10, B11, B12, B13, B14, B15, B16, B17,
    output
           P0, P1, P2, P3, P4, P5, P6, P7, P8, P9, P10, P11, P12, P13, P14, P15, P16, P17, P18, P19, P20, P21, P22, P23, P24,
           P25, P26, P27, P28, P29, P30, P31, P32, P33, P34, P35
);

    parameter
        REG_INPUTA_CLK = "NONE", REG_INPUTA_CE = "", REG_INPUTA_RST = "", REG_INPUTB_CLK = "NONE", REG_INPUTB_CE = "",
        REG_INPUTB_RST = "", REG_INPUTC_CLK = "NONE", REG_PIPELINE_CLK = "NONE", REG_PIPELINE_CE = "", REG_PIPELINE_RST = "",
        REG_OUTPUT_CLK = "NONE", REG_OUTPUT_CE = "", REG_OUTPUT_RST = "", SOURCEB_MODE = "", MULT_BYPASS = "", RESETMODE = "",
        GSR = "";

    generate
        if (REG_INPUTA_CLK == "NONE") begin : g_direct
            specify
                $setup(A0, posedge CLK0, 2400); $setup(A1, posedge CLK0, 2400); $setup(A2, posedge CLK0, 2400);
                $setup(A3, posedge CLK0, 2400); $setup(A4, posedge CLK0, 2400); $setup(A5, posedge CLK0, 2400);
                $setup(A6, posedge CLK0, 2400); $setup(A7, posedge CLK0, 2400); $setup(A8, posedge CLK0, 2400);
                $setup(A9, posedge CLK0, 2400); $setup(A10, posedge CLK0, 2400); $setup(A11, posedge CLK0, 2400);
                $setup(A12, posedge CLK0, 2400); $setup(A13, posedge CLK0, 2400); $setup(A14, posedge CLK0, 2400);
                $setup(A15, posedge CLK0, 2400); $setup(A16, posedge CLK0, 2400); $setup(A17, posedge CLK0, 2400);
                $setup(B0, posedge CLK0, 2400); $setup(B1, posedge CLK0, 2400); $setup(B2, posedge CLK0, 2400);
                $setup(B3, posedge CLK0, 2400); $setup(B4, posedge CLK0, 2400); $setup(B5, posedge CLK0, 2400);
                $setup(B6, posedge CLK0, 2400); $setup(B7, posedge CLK0, 2400); $setup(B8, posedge CLK0, 2400);
                $setup(B9, posedge CLK0, 2400); $setup(B10, posedge CLK0, 2400); $setup(B11, posedge CLK0, 2400);
                $setup(B12, posedge CLK0, 2400); $setup(B13, posedge CLK0, 2400); $setup(B14, posedge CLK0, 2400);
                $setup(B15, posedge CLK0, 2400); $setup(B16, posedge CLK0, 2400); $setup(B17, posedge CLK0, 2400);
            endspecify
        end
        if (REG_OUTPUT_CLK == "NONE") begin : g_product
            specify
                (posedge CLK0 => (P0 : 1'bx)) = 2650; (posedge CLK0 => (P1 : 1'bx)) = 2650;
                (posedge CLK0 => (P2 : 1'bx)) = 2650; (posedge CLK0 => (P3 : 1'bx)) = 2650;
                (posedge CLK0 => (P4 : 1'bx)) = 2650; (posedge CLK0 => (P5 : 1'bx)) = 2650;
                (posedge CLK0 => (P6 : 1'bx)) = 2650; (posedge CLK0 => (P7 : 1'bx)) = 2650;
                (posedge CLK0 => (P8 : 1'bx)) = 2650; (posedge CLK0 => (P9 : 1'bx)) = 2650;
                (posedge CLK0 => (P10 : 1'bx)) = 2650; (posedge CLK0 => (P11 : 1'bx)) = 2650;
                (posedge CLK0 => (P12 : 1'bx)) = 2650; (posedge CLK0 => (P13 : 1'bx)) = 2650;
                (posedge CLK0 => (P14 : 1'bx)) = 2650; (posedge CLK0 => (P15 : 1'bx)) = 2650;
                (posedge CLK0 => (P16 : 1'bx)) = 2650; (posedge CLK0 => (P17 : 1'bx)) = 2650;
                (posedge CLK0 => (P18 : 1'bx)) = 2650; (posedge CLK0 => (P19 : 1'bx)) = 2650;
                (posedge CLK0 => (P20 : 1'bx)) = 2650; (posedge CLK0 => (P21 : 1'bx)) = 2650;
                (posedge CLK0 => (P22 : 1'bx)) = 2650; (posedge CLK0 => (P23 : 1'bx)) = 2650;
                (posedge CLK0 => (P24 : 1'bx)) = 2650; (posedge CLK0 => (P25 : 1'bx)) = 2650;
                (posedge CLK0 => (P26 : 1'bx)) = 2650; (posedge CLK0 => (P27 : 1'bx)) = 2650;
                (posedge CLK0 => (P28 : 1'bx)) = 2650; (posedge CLK0 => (P29 : 1'bx)) = 2650;
                (posedge CLK0 => (P30 : 1'bx)) = 2650; (posedge CLK0 => (P31 : 1'bx)) = 2650;
                (posedge CLK0 => (P32 : 1'bx)) = 2650; (posedge CLK0 => (P33 : 1'bx)) = 2650;
                (posedge CLK0 => (P34 : 1'bx)) = 2650; (posedge CLK0 => (P35 : 1'bx)) = 2650;
            endspecify
        end
        if (REG_OUTPUT_CLK != "NONE") begin : g_register
            specify
                (posedge CLK0 => (P0 : 1'bx)) = 180; (posedge CLK0 => (P1 : 1'bx)) = 180; (posedge CLK0 => (P2 : 1'bx)) = 180;
                (posedge CLK0 => (P3 : 1'bx)) = 180; (posedge CLK0 => (P4 : 1'bx)) = 180; (posedge CLK0 => (P5 : 1'bx)) = 180;
                (posedge CLK0 => (P6 : 1'bx)) = 180; (posedge CLK0 => (P7 : 1'bx)) = 180; (posedge CLK0 => (P8 : 1'bx)) = 180;
                (posedge CLK0 => (P9 : 1'bx)) = 180; (posedge CLK0 => (P10 : 1'bx)) = 180;
                (posedge CLK0 => (P11 : 1'bx)) = 180; (posedge CLK0 => (P12 : 1'bx)) = 180;
                (posedge CLK0 => (P13 : 1'bx)) = 180; (posedge CLK0 => (P14 : 1'bx)) = 180;
                (posedge CLK0 => (P15 : 1'bx)) = 180; (posedge CLK0 => (P16 : 1'bx)) = 180;
                (posedge CLK0 => (P17 : 1'bx)) = 180; (posedge CLK0 => (P18 : 1'bx)) = 180;
                (posedge CLK0 => (P19 : 1'bx)) = 180; (posedge CLK0 => (P20 : 1'bx)) = 180;
                (posedge CLK0 => (P21 : 1'bx)) = 180; (posedge CLK0 => (P22 : 1'bx)) = 180;
                (posedge CLK0 => (P23 : 1'bx)) = 180; (posedge CLK0 => (P24 : 1'bx)) = 180;
                (posedge CLK0 => (P25 : 1'bx)) = 180; (posedge CLK0 => (P26 : 1'bx)) = 180;
                (posedge CLK0 => (P27 : 1'bx)) = 180; (posedge CLK0 => (P28 : 1'bx)) = 180;
                (posedge CLK0 => (P29 : 1'bx)) = 180; (posedge CLK0 => (P30 : 1'bx)) = 180;
                (posedge CLK0 => (P31 : 1'bx)) = 180; (posedge CLK0 => (P32 : 1'bx)) = 180;
                (posedge CLK0 => (P33 : 1'bx)) = 180; (posedge CLK0 => (P34 : 1'bx)) = 180;
                (posedge CLK0 => (P35 : 1'bx)) = 180;
            endspecify
        end
    endgenerate

endmodule

(* blackbox *)
module DP16KD (
    input  CLKA, CEA, WEA, OCEA, RSTA, CLKB, CEB, WEB, OCEB, RSTB,
    input
           DIA0, DIA1, DIA2, DIA3, DIA4, DIA5, DIA6, DIA7, DIA8, DIA9, DIA10, DIA11, DIA12, DIA13, DIA14, DIA15, DIA16, DIA17,
           DIB0, DIB1, DIB2, DIB3, DIB4, DIB5, DIB6, DIB7, DIB8, DIB9, DIB10, DIB11, DIB12, DIB13, DIB14, DIB15, DIB16, DIB17,
           ADA0, ADA1, ADA2, ADA3, ADA4, ADA5, ADA6, ADA7, ADA8, ADA9, ADA10, ADA11, ADA12, ADA13, ADB0, ADB1, ADB2, ADB3, ADB4,
           ADB5, ADB6, ADB7, ADB8, ADB9, ADB10, ADB11, ADB12, ADB13, CSA0, CSA1, CSA2, CSB0, CSB1, CSB2,
    output
           DOA0, DOA1, DOA2, DOA3, DOA4, DOA5, DOA6, DOA7, DOA8, DOA9, DOA10, DOA11, DOA12, DOA13, DOA14, DOA15, DOA16, DOA17,
           DOB0, DOB1, DOB2, DOB3, DOB4, DOB5, DOB6, DOB7, DOB8, DOB9, DOB10, DOB11, DOB12, DOB13, DOB14, DOB15, DOB16, DOB17
);

    parameter
        DATA_WIDTH_A = 0, DATA_WIDTH_B = 0, REGMODE_A = "", REGMODE_B = "", CLKAMUX = "", CLKBMUX = "", CSDECODE_A = "",
        CSDECODE_B = "", WRITEMODE_A = "", WRITEMODE_B = "", WEAMUX = "", WEBMUX = "", CEAMUX = "", CEBMUX = "", OCEAMUX = "",
        OCEBMUX = "", RSTAMUX = "", RSTBMUX = "", RESETMODE = "", ASYNC_RESET_RELEASE = "", GSR = "", WID = 0, INIT_DATA = "",
        INITVAL_00 = 0, INITVAL_01 = 0, INITVAL_02 = 0, INITVAL_03 = 0, INITVAL_04 = 0, INITVAL_05 = 0, INITVAL_06 = 0,
        INITVAL_07 = 0, INITVAL_08 = 0, INITVAL_09 = 0, INITVAL_0A = 0, INITVAL_0B = 0, INITVAL_0C = 0, INITVAL_0D = 0,
        INITVAL_0E = 0, INITVAL_0F = 0, INITVAL_10 = 0, INITVAL_11 = 0, INITVAL_12 = 0, INITVAL_13 = 0, INITVAL_14 = 0,
        INITVAL_15 = 0, INITVAL_16 = 0, INITVAL_17 = 0, INITVAL_18 = 0, INITVAL_19 = 0, INITVAL_1A = 0, INITVAL_1B = 0,
        INITVAL_1C = 0, INITVAL_1D = 0, INITVAL_1E = 0, INITVAL_1F = 0, INITVAL_20 = 0, INITVAL_21 = 0, INITVAL_22 = 0,
        INITVAL_23 = 0, INITVAL_24 = 0, INITVAL_25 = 0, INITVAL_26 = 0, INITVAL_27 = 0, INITVAL_28 = 0, INITVAL_29 = 0,
        INITVAL_2A = 0, INITVAL_2B = 0, INITVAL_2C = 0, INITVAL_2D = 0, INITVAL_2E = 0, INITVAL_2F = 0, INITVAL_30 = 0,
        INITVAL_31 = 0, INITVAL_32 = 0, INITVAL_33 = 0, INITVAL_34 = 0, INITVAL_35 = 0, INITVAL_36 = 0, INITVAL_37 = 0,
        INITVAL_38 = 0, INITVAL_39 = 0, INITVAL_3A = 0, INITVAL_3B = 0, INITVAL_3C = 0, INITVAL_3D = 0, INITVAL_3E = 0,
        INITVAL_3F = 0;

    generate
        if (REGMODE_A == "OUTREG") begin : g_register_a
            specify
                (posedge CLKA => (DOA0 : 1'bx)) = 330; (posedge CLKA => (DOA1 : 1'bx)) = 330;
                (posedge CLKA => (DOA2 : 1'bx)) = 330; (posedge CLKA => (DOA3 : 1'bx)) = 330;
                (posedge CLKA => (DOA4 : 1'bx)) = 330; (posedge CLKA => (DOA5 : 1'bx)) = 330;
                (posedge CLKA => (DOA6 : 1'bx)) = 330; (posedge CLKA => (DOA7 : 1'bx)) = 330;
                (posedge CLKA => (DOA8 : 1'bx)) = 330; (posedge CLKA => (DOA9 : 1'bx)) = 330;
                (posedge CLKA => (DOA10 : 1'bx)) = 330; (posedge CLKA => (DOA11 : 1'bx)) = 330;
                (posedge CLKA => (DOA12 : 1'bx)) = 330; (posedge CLKA => (DOA13 : 1'bx)) = 330;
                (posedge CLKA => (DOA14 : 1'bx)) = 330; (posedge CLKA => (DOA15 : 1'bx)) = 330;
                (posedge CLKA => (DOA16 : 1'bx)) = 330; (posedge CLKA => (DOA17 : 1'bx)) = 330;
            endspecify
        end
        if (REGMODE_A != "OUTREG") begin : g_word_a
            specify
                (posedge CLKA => (DOA0 : 1'bx)) = 3860; (posedge CLKA => (DOA1 : 1'bx)) = 3860;
                (posedge CLKA => (DOA2 : 1'bx)) = 3860; (posedge CLKA => (DOA3 : 1'bx)) = 3860;
                (posedge CLKA => (DOA4 : 1'bx)) = 3860; (posedge CLKA => (DOA5 : 1'bx)) = 3860;
                (posedge CLKA => (DOA6 : 1'bx)) = 3860; (posedge CLKA => (DOA7 : 1'bx)) = 3860;
                (posedge CLKA => (DOA8 : 1'bx)) = 3860; (posedge CLKA => (DOA9 : 1'bx)) = 3860;
                (posedge CLKA => (DOA10 : 1'bx)) = 3860; (posedge CLKA => (DOA11 : 1'bx)) = 3860;
                (posedge CLKA => (DOA12 : 1'bx)) = 3860; (posedge CLKA => (DOA13 : 1'bx)) = 3860;
                (posedge CLKA => (DOA14 : 1'bx)) = 3860; (posedge CLKA => (DOA15 : 1'bx)) = 3860;
                (posedge CLKA => (DOA16 : 1'bx)) = 3860; (posedge CLKA => (DOA17 : 1'bx)) = 3860;
            endspecify
        end
        if (REGMODE_B == "OUTREG") begin : g_register_b
            specify
                (posedge CLKB => (DOB0 : 1'bx)) = 330; (posedge CLKB => (DOB1 : 1'bx)) = 330;
                (posedge CLKB => (DOB2 : 1'bx)) = 330; (posedge CLKB => (DOB3 : 1'bx)) = 330;
                (posedge CLKB => (DOB4 : 1'bx)) = 330; (posedge CLKB => (DOB5 : 1'bx)) = 330;
                (posedge CLKB => (DOB6 : 1'bx)) = 330; (posedge CLKB => (DOB7 : 1'bx)) = 330;
                (posedge CLKB => (DOB8 : 1'bx)) = 330; (posedge CLKB => (DOB9 : 1'bx)) = 330;
                (posedge CLKB => (DOB10 : 1'bx)) = 330; (posedge CLKB => (DOB11 : 1'bx)) = 330;
                (posedge CLKB => (DOB12 : 1'bx)) = 330; (posedge CLKB => (DOB13 : 1'bx)) = 330;
                (posedge CLKB => (DOB14 : 1'bx)) = 330; (posedge CLKB => (DOB15 : 1'bx)) = 330;
                (posedge CLKB => (DOB16 : 1'bx)) = 330; (posedge CLKB => (DOB17 : 1'bx)) = 330;
            endspecify
        end
        if (REGMODE_B != "OUTREG") begin : g_word_b
            specify
                (posedge CLKB => (DOB0 : 1'bx)) = 3860; (posedge CLKB => (DOB1 : 1'bx)) = 3860;
                (posedge CLKB => (DOB2 : 1'bx)) = 3860; (posedge CLKB => (DOB3 : 1'bx)) = 3860;
                (posedge CLKB => (DOB4 : 1'bx)) = 3860; (posedge CLKB => (DOB5 : 1'bx)) = 3860;
                (posedge CLKB => (DOB6 : 1'bx)) = 3860; (posedge CLKB => (DOB7 : 1'bx)) = 3860;
                (posedge CLKB => (DOB8 : 1'bx)) = 3860; (posedge CLKB => (DOB9 : 1'bx)) = 3860;
                (posedge CLKB => (DOB10 : 1'bx)) = 3860; (posedge CLKB => (DOB11 : 1'bx)) = 3860;
                (posedge CLKB => (DOB12 : 1'bx)) = 3860; (posedge CLKB => (DOB13 : 1'bx)) = 3860;
                (posedge CLKB => (DOB14 : 1'bx)) = 3860; (posedge CLKB => (DOB15 : 1'bx)) = 3860;
                (posedge CLKB => (DOB16 : 1'bx)) = 3860; (posedge CLKB => (DOB17 : 1'bx)) = 3860;
            endspecify
        end
    endgenerate

endmodule
