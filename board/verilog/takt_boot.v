// takt_boot: what a program needs at its start, in block RAM, and what writes it into the core.
//
// Contract
//   The memory holds records {space, slot, address, value}, as the core's loader takes them; space 3 is an input port. Its contents
//   at power-up are those of the file IMAGE. count of them are valid.
//   boot: high for a cycle starts it, at any time: reset is high from the next cycle on, until program and data memory have been
//   written with zeros, input ports too, and all records have been written, and 128 cycles longer. A boot during a boot begins it again.
//   The host writes a record in parts of 32 bits; the part 2 completes it: 0 low and 1 high bits of the value, 2 place = {slot,
//   space, address}. part_read: of the record `at`, a cycle after it stands.

module takt_boot #(
    parameter IMAGE   = "image.hex",
    parameter BITS    = 11,   // of a record's number
    parameter SLOTS   = 3,
    parameter CODE    = 10,   // bits of a bundle's address
    parameter DATA    = 10,   // bits of a data word's address
    parameter INPUTS  = 8     // bits of an input port's number; the last is not one
) (
    input  wire            clk,
    input  wire            rst,
    input  wire            boot,
    input  wire [BITS:0]   count,
    output reg             reset,
    output wire            load,
    output wire [1:0]      load_space,
    output wire [2:0]      load_slot,
    output wire [15:0]     load_address,
    output wire [47:0]     load_value,
    output wire            input_write,
    // The host's side.
    input  wire            write,
    input  wire [1:0]      part,
    input  wire [BITS-1:0] at,
    input  wire [31:0]     value,
    output reg  [31:0]     part_read
);

    reg  [68:0] records [0:(1<<BITS)-1];
    initial $readmemh(IMAGE, records);

    reg  [68:0]     record;
    reg  [31:0]     low;
    reg  [15:0]     high;
    reg  [BITS:0]   next;
    reg  [15:0]     clears;     // program words of each slot, then data, then input ports
    reg  [2:0]      slot;
    reg  [6:0]      settles;
    reg  [1:0]      state;      // 0: at rest, 1: zeros, 2: records, 3: settles
    reg             valid, clearing, clears_data, clears_input;
    reg  [15:0]     cleared;
    reg  [2:0]      cleared_slot;

    wire [BITS-1:0] read_at = state == 2'd0 ? at : next[BITS-1:0];
    localparam [15:0] LAST_CODE = (1 << CODE) - 1;
    localparam [15:0] LAST_DATA = (1 << DATA) - 1;
    localparam [15:0] LAST_PORT = (1 << INPUTS) - 2;
    // Beyond the slots of program memory.
    localparam [2:0]  DATA_SLOT = SLOTS, PORT_SLOT = SLOTS + 1;
    wire [15:0] last_clear = slot == PORT_SLOT ? LAST_PORT : slot == DATA_SLOT ? LAST_DATA : LAST_CODE;

    always @(posedge clk) begin
        record <= records[read_at];
        if (write & part == 2'd0) low <= value;
        if (write & part == 2'd1) high <= value[15:0];
    end
    always @(posedge clk) begin
        if (write & part == 2'd2 & state == 2'd0) records[at] <= {value[20:0], high, low};
    end

    always @* begin
        case (part)
            2'd0: part_read = record[31:0];
            2'd1: part_read = {16'd0, record[47:32]};
            2'd2: part_read = {11'd0, record[68:48]};
            default: part_read = 32'd0;
        endcase
    end

    assign load         = clearing | (valid & record[65:64] != 2'd3);
    assign input_write  = clears_input | (valid & record[65:64] == 2'd3);
    assign load_space   = clearing ? {1'b0, clears_data} : record[65:64];
    assign load_slot    = clearing ? cleared_slot : record[68:66];
    assign load_address = clearing | clears_input ? cleared : record[63:48];
    assign load_value   = clearing | clears_input ? 48'd0 : record[47:0];

    always @(posedge clk) begin
        valid        <= state == 2'd2 & next != count;
        clearing     <= state == 2'd1 & slot != PORT_SLOT;
        clears_input <= state == 2'd1 & slot == PORT_SLOT;
        clears_data  <= slot == DATA_SLOT;
        cleared      <= clears;
        cleared_slot <= slot == DATA_SLOT ? 3'd0 : slot;
        case (state)
            2'd1: begin
                clears <= clears + 16'd1;
                if (clears == last_clear) begin
                    clears <= 16'd0;
                    slot   <= slot + 3'd1;
                    if (slot == PORT_SLOT) state <= 2'd2;
                end
            end
            2'd2: begin
                if (next == count) state <= 2'd3;
                else next <= next + 1'b1;
            end
            2'd3: begin
                settles <= settles + 7'd1;
                if (&settles) begin
                    state <= 2'd0;
                    reset <= 1'b0;
                end
            end
            default: ;
        endcase
        if (boot | rst) begin
            state   <= 2'd1;
            reset   <= 1'b1;
            next    <= 0;
            clears  <= 16'd0;
            slot    <= 3'd0;
            settles <= 7'd0;
        end
    end

endmodule
