// takt_loader: every core's program and first values, in a memory whose contents at power-up are the file IMAGE, and what writes
// them into the cores in reset.
//
// Contract
//   rst: synchronous. Then reset is high until the cores' program and data memories have been written with zeros, all RECORDS have
//   been written, and SETTLE cycles longer.
//   A record is {core, space, slot, address, value}, as the core's loader takes them (docs/hardware.md); space 3 is an input port.

module takt_loader #(
    parameter IMAGE   = "image.hex",
    parameter RECORDS = 1,
    parameter CORES   = 1,
    parameter SLOTS   = 1,     // of the core with the most
    parameter CODE    = 10,    // bits of a bundle's address, at most
    parameter DATA    = 10,    // bits of a data word's address, at most
    parameter SETTLE  = 128
) (
    input  wire             clk,
    input  wire             rst,
    output reg              reset,
    output wire [CORES-1:0] load,
    output wire [1:0]       load_space,
    output wire [2:0]       load_slot,
    output wire [15:0]      load_address,
    output wire [47:0]      load_value,
    output wire [CORES-1:0] load_input
);

    localparam BITS = RECORDS > 1 ? $clog2(RECORDS) : 1;
    localparam LAST_RECORD = RECORDS - 1;
    localparam [15:0] LAST_CODE = (1 << CODE) - 1, LAST_DATA = (1 << DATA) - 1, LAST_SETTLE = SETTLE - 1;
    localparam [2:0]  DATA_SLOT = SLOTS;   // beyond the slots of program memory

    reg [72:0]     records [0:RECORDS-1];
    initial $readmemh(IMAGE, records);

    // 0: zeros, 1: records, 2: settles.
    reg [1:0]      state;
    reg [15:0]     address;
    reg [2:0]      slot;
    reg [BITS-1:0] next;
    reg [72:0]     record;
    reg            clears, valid;
    reg [15:0]     cleared;
    reg [2:0]      cleared_slot;

    wire       clears_data = cleared_slot == DATA_SLOT;
    wire       is_input    = record[68:67] == 2'd3;
    genvar c;
    generate
        for (c = 0; c < CORES; c = c + 1) begin : g_core
            wire own = valid & record[72:69] == c[3:0];
            assign load[c]       = clears | (own & ~is_input);
            assign load_input[c] = own & is_input;
        end
    endgenerate
    assign load_space   = clears ? {1'b0, clears_data} : record[68:67];
    assign load_slot    = clears ? cleared_slot & {3{~clears_data}} : record[66:64];
    assign load_address = clears ? cleared : record[63:48];
    assign load_value   = clears ? 48'd0 : record[47:0];

    always @(posedge clk) begin
        record       <= records[next];
        valid        <= state == 2'd1;
        clears       <= state == 2'd0;
        cleared      <= address;
        cleared_slot <= slot;
        address      <= address + 16'd1;
        case (state)
            2'd0: if (address == (slot == DATA_SLOT ? LAST_DATA : LAST_CODE)) begin
                address <= 16'd0;
                slot    <= slot + 3'd1;
                if (slot == DATA_SLOT) state <= 2'd1;
            end
            2'd1: begin
                next <= next + 1'b1;
                if (next == LAST_RECORD[BITS-1:0]) begin
                    address <= 16'd0;
                    state   <= 2'd2;
                end
            end
            default: if (address == LAST_SETTLE) reset <= 1'b0;
        endcase
        if (rst) begin
            state   <= 2'd0;
            address <= 16'd0;
            slot    <= 3'd0;
            next    <= {BITS{1'b0}};
            valid   <= 1'b0;
            clears  <= 1'b0;
            reset   <= 1'b1;
        end
    end

endmodule
