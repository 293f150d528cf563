// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_shadow_memory: copies of a core's registers and data memory, which a host can read while the core runs.
//
// Contract
//   The copies take the core's writes, as its ports for verification report them, and its loaded values. The core's own memories
//   have no port to spare, and copies do not slow the core down.
//   at: the address of a register and of a data word. Two cycles later, register_value and data_value are what these hold. A register
//   that is in no slot's bank reads as 0; a data word beyond the copied ones, as one of these; what has not been written since power-up may read as anything.
//   still: the core issues nothing. settled: still has been high for so long that nothing is in flight any more.
//   last: the bundle that issued last.

module takt_shadow_memory #(
    parameter SLOTS   = 3,
    parameter BANKS   = 30'd0,  // of each slot, slot 0 lowest, 10 bits: the address of its bank's first register
    parameter INDICES = 12'd0,  // of each slot, 4 bits: how many bits an index into its bank has
    parameter DATA    = 10,     // bits of the address of a data word that has a copy
    parameter SETTLE  = 32      // cycles from an issue until all that it writes is in the copies
) (
    input  wire                clk,
    input  wire                load,
    input  wire [1:0]          load_space,
    input  wire [9:0]          load_address,
    input  wire [31:0]         load_value,
    input  wire                still,
    input  wire                issued,
    input  wire [15:0]         issued_address,
    input  wire                stored,
    input  wire [15:0]         stored_address,
    input  wire [31:0]         stored_value,
    input  wire [SLOTS-1:0]    retire,
    input  wire [10*SLOTS-1:0] retire_register,
    input  wire [32*SLOTS-1:0] retire_value,
    input  wire [13:0]         at,
    output reg                 settled,
    output reg  [15:0]         last,
    output reg  [31:0]         register_value,
    output reg  [31:0]         data_value
);

    localparam [7:0] LAST = SETTLE - 1;
    reg [7:0] quiet;
    always @(posedge clk) begin
        quiet   <= ~still ? 8'd0 : quiet + {7'd0, quiet != LAST};
        settled <= still & quiet == LAST;
        if (issued) last <= issued_address;
    end

    wire              loads = load & load_space == 2'd2;
    wire [SLOTS-1:0]    mine;   // the slot whose bank has the register that `at` named in the cycle before
    wire [32*SLOTS-1:0] held;
    genvar s;
    generate
        for (s = 0; s < SLOTS; s = s + 1) begin : g_slot
            localparam       INDEX = INDICES[4*s +: 4];
            localparam [9:0] BANK  = BANKS[10*s +: 10];
            wire [9:0] retired = retire_register[10*s +: 10];
            (* no_rw_check *)
            reg [31:0]      words [0:(1<<INDEX)-1];
            reg             write, here;
            reg [INDEX-1:0] index;
            reg [31:0]      value, read;
            always @(posedge clk) begin
                write <= retire[s] | (loads & load_address >> INDEX == BANK >> INDEX);
                index <= loads ? load_address[INDEX-1:0] : retired[INDEX-1:0];
                value <= loads ? load_value : retire_value[32*s +: 32];
                if (write) words[index] <= value;
                read  <= words[at[INDEX-1:0]];
                here  <= at[9:0] >> INDEX == BANK >> INDEX;
            end
            assign mine[s] = here;
            assign held[32*s +: 32] = read;
            wire unused = &{1'b0, retired};
        end
    endgenerate

    (* no_rw_check *)
    reg [31:0] words [0:(1<<DATA)-1];
    reg [31:0] read;
    integer    k;
    always @(posedge clk) begin
        if (stored & ~|(stored_address >> DATA)) words[stored_address[DATA-1:0]] <= stored_value;
        read       <= words[at[DATA-1:0]];
        data_value <= read;
        register_value <= 32'd0;
        for (k = 0; k < SLOTS; k = k + 1) if (mine[k]) register_value <= held[32*k +: 32];
    end

    wire unused = &{1'b0, at, stored_address};

endmodule
