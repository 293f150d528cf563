// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_bank on Lattice ECP5: one DP16KD of 512 words of 36 bits with its output register, which yosys does not place there by
// itself: from there to the operand the way is as from a flip-flop, without it the block RAM's own delay takes most of a cycle.
//
// Same contract as ../core/takt_bank.v.

module takt_bank #(
    parameter INDEX = 8,  // bits of an index
    parameter WIDTH = 32  // at most 36
) (
    input  wire             clk,
    input  wire             write,
    input  wire [INDEX-1:0] write_index,
    input  wire [WIDTH-1:0] write_value,
    input  wire [INDEX-1:0] read_index,
    output wire [WIDTH-1:0] value
);

    generate
        if (INDEX <= 9) begin : g_block
            wire [8:0]  to   = {{9 - INDEX{1'b0}}, write_index};
            wire [8:0]  from = {{9 - INDEX{1'b0}}, read_index};
            wire [35:0] in;
            wire [35:0] out;
            assign value = out[WIDTH-1:0];
            assign in[WIDTH-1:0] = write_value;
            if (WIDTH < 36) assign in[35:WIDTH] = 0;

            // 36 bits wide, port A writes and port B reads; the upper half of a word goes in through port B's inputs and comes
            // out of port B's outputs.
            DP16KD #(
                .DATA_WIDTH_A(36), .DATA_WIDTH_B(36), .REGMODE_A("OUTREG"), .REGMODE_B("OUTREG"),
                .CLKAMUX("CLKA"), .CLKBMUX("CLKB"), .CSDECODE_A("0b000"), .CSDECODE_B("0b000"), .RESETMODE("SYNC"), .GSR("DISABLED")
            ) words (
                .CLKA(clk), .CEA(write), .WEA(1'b1), .OCEA(1'b1), .RSTA(1'b0), .CSA0(1'b0), .CSA1(1'b0), .CSA2(1'b0),
                .CLKB(clk), .CEB(1'b1), .WEB(1'b0), .OCEB(1'b1), .RSTB(1'b0), .CSB0(1'b0), .CSB1(1'b0), .CSB2(1'b0),
                .ADA0(1'b1), .ADA1(1'b1), .ADA2(1'b1), .ADA3(1'b1), .ADA4(1'b0), .ADA5(to[0]),
                .ADA6(to[1]), .ADA7(to[2]), .ADA8(to[3]), .ADA9(to[4]), .ADA10(to[5]), .ADA11(to[6]),
                .ADA12(to[7]), .ADA13(to[8]),
                .ADB0(1'b0), .ADB1(1'b0), .ADB2(1'b0), .ADB3(1'b0), .ADB4(1'b0), .ADB5(from[0]),
                .ADB6(from[1]), .ADB7(from[2]), .ADB8(from[3]), .ADB9(from[4]), .ADB10(from[5]), .ADB11(from[6]),
                .ADB12(from[7]), .ADB13(from[8]),
                .DIA0(in[0]), .DIA1(in[1]), .DIA2(in[2]), .DIA3(in[3]), .DIA4(in[4]), .DIA5(in[5]),
                .DIA6(in[6]), .DIA7(in[7]), .DIA8(in[8]), .DIA9(in[9]), .DIA10(in[10]), .DIA11(in[11]),
                .DIA12(in[12]), .DIA13(in[13]), .DIA14(in[14]), .DIA15(in[15]), .DIA16(in[16]), .DIA17(in[17]),
                .DIB0(in[18]), .DIB1(in[19]), .DIB2(in[20]), .DIB3(in[21]), .DIB4(in[22]), .DIB5(in[23]),
                .DIB6(in[24]), .DIB7(in[25]), .DIB8(in[26]), .DIB9(in[27]), .DIB10(in[28]), .DIB11(in[29]),
                .DIB12(in[30]), .DIB13(in[31]), .DIB14(in[32]), .DIB15(in[33]), .DIB16(in[34]), .DIB17(in[35]),
                .DOA0(out[0]), .DOA1(out[1]), .DOA2(out[2]), .DOA3(out[3]), .DOA4(out[4]), .DOA5(out[5]),
                .DOA6(out[6]), .DOA7(out[7]), .DOA8(out[8]), .DOA9(out[9]), .DOA10(out[10]), .DOA11(out[11]),
                .DOA12(out[12]), .DOA13(out[13]), .DOA14(out[14]), .DOA15(out[15]), .DOA16(out[16]), .DOA17(out[17]),
                .DOB0(out[18]), .DOB1(out[19]), .DOB2(out[20]), .DOB3(out[21]), .DOB4(out[22]), .DOB5(out[23]),
                .DOB6(out[24]), .DOB7(out[25]), .DOB8(out[26]), .DOB9(out[27]), .DOB10(out[28]), .DOB11(out[29]),
                .DOB12(out[30]), .DOB13(out[31]), .DOB14(out[32]), .DOB15(out[33]), .DOB16(out[34]), .DOB17(out[35])
            );
            wire unused = &{1'b0, out};
        end else begin : g_blocks
            (* no_rw_check *)
            reg [WIDTH-1:0] words [0:(1<<INDEX)-1];
            reg [WIDTH-1:0] read, late;
            always @(posedge clk) begin
                if (write) words[write_index] <= write_value;
                read <= words[read_index];
                late <= read;
            end
            assign value = late;
        end
    endgenerate

endmodule
