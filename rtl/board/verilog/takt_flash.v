// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_flash: images in a SPI flash: plays the newest valid one after a reset, and carries the host's commands to the flash.
//
// Contract
//   Pins: SPI mode 0; a bit lasts 2·HALF cycles; select is low for the length of a command.
//   An image (docs/protocol.md) begins with MAGIC, CIRCUIT, its number and a count of entries, at most ROOM; it ends with a CRC-32 that makes
//   the checksum of all its words 0. After rst the flash is woken, and the images at FIRST and SECOND are read to their ends. The valid one
//   with the later number is read again: each of its entries is a write on the bus, and last comes one to CONTROL that starts the program.
//   An image that fails in the second reading starts nothing; then the other is played, if it is valid. Without a valid image, CONTROL is
//   written with DEFAULT. plays is high until then: the bus is this module's. ready: the memories behind the bus can be written.
//   The host's side, address within a block of 32: words 0 to 15 are a buffer. A write to word 16 sends its bytes 7:0 last bytes of the
//   buffer, lowest byte of a word first, and then receives bytes 15:8 into the buffer from its beginning on; 64 of each at most. busy is
//   high until that is done; writes are to wait for it.

module takt_flash #(
    parameter         HALF    = 4,
    parameter [31:0]  CIRCUIT = 0,
    parameter [31:0]  ROOM    = 6144,
    parameter [23:0]  FIRST   = 24'h100000,
    parameter [23:0]  SECOND  = 24'h110000,
    parameter [15:0]  CONTROL = 16'd1,
    parameter [31:0]  DEFAULT = 0,
    parameter         WAKES   = 4096   // cycles from the flash's waking to the first command
) (
    input  wire        clk,
    input  wire        rst,
    output reg         pin_select,
    output reg         pin_clock,
    output wire        pin_out,
    input  wire        pin_in,
    input  wire        ready,
    output reg         plays,
    output reg         play_write,
    output reg  [15:0] play_address,
    output reg  [31:0] play_value,
    // The host's side.
    input  wire        write,
    input  wire [4:0]  address,
    input  wire [31:0] value,
    output reg  [31:0] read,
    output wire        busy
);

    localparam [31:0] MAGIC = 32'h544b4631;
    localparam [31:0] START = 32'd5;   // run, enable
    localparam [7:0]  LAST_HALF = HALF - 1;
    localparam [15:0] LAST_WAKE = WAKES - 1;

    // CRC-32/MPEG-2 of one bit more.
    function [31:0] crc(input [31:0] prior, input data);
        crc = {prior[30:0], 1'b0} ^ (prior[31] ^ data ? 32'h04c11db7 : 32'd0);
    endfunction

    // ---- bytes: byte_starts shifts byte_out out, and byte_in has what came when byte_ends is high

    reg        byte_starts, byte_ends, moves, sampled;
    reg  [7:0] shift, half;
    reg  [2:0] bits;
    wire [7:0] byte_out;
    wire [7:0] byte_in = shift;
    wire       comes   = moves & half == LAST_HALF & pin_clock;   // a bit has come
    assign pin_out = shift[7];
    always @(posedge clk) begin
        sampled   <= pin_in;
        byte_ends <= 1'b0;
        half      <= half == LAST_HALF | ~moves ? 8'd0 : half + 8'd1;
        if (byte_starts) begin
            moves <= 1'b1;
            shift <= byte_out;
            bits  <= 3'd7;
        end else if (moves & half == LAST_HALF) begin
            pin_clock <= ~pin_clock;
            if (pin_clock) begin
                shift <= {shift[6:0], sampled};
                bits  <= bits - 3'd1;
                if (bits == 3'd0) {moves, byte_ends} <= 2'b01;
            end
        end
        if (rst) begin
            {moves, byte_ends, pin_clock} <= 3'd0;
            half <= 8'd0;
        end
    end

    // ---- the host's buffer

    reg  [31:0] buffer [0:15];
    reg  [6:0]  sends, receives;    // bytes left
    reg  [5:0]  place;              // of the next byte received
    reg  [23:0] gathered;
    reg         host_runs;
    wire [5:0]  send_at = 6'd0 - sends[5:0];
    wire [31:0] send_word = buffer[send_at[5:2]];
    wire        stores  = host_runs & byte_ends & sends == 7'd0;
    wire        is_last = receives == 7'd1;
    wire [31:0] came    = place[1:0] == 2'd0 ? {24'd0, byte_in} : place[1:0] == 2'd1 ? {16'd0, byte_in, gathered[23:16]}
        : place[1:0] == 2'd2 ? {8'd0, byte_in, gathered[23:8]} : {byte_in, gathered};
    wire        fills   = stores & (is_last | place[1:0] == 2'd3);
    wire        to_host = write & ~address[4] & ~busy;
    always @(posedge clk) begin
        if (stores) gathered <= {byte_in, gathered[23:8]};
        if (to_host | fills) buffer[to_host ? address[3:0] : place[5:2]] <= to_host ? value : came;
    end

    // ---- commands: playing, then the host's

    localparam [2:0] WAKE = 3'd0, WAIT = 3'd1, COMMAND = 3'd2, WORDS = 3'd3, CHOOSE = 3'd4, FINISH = 3'd5, HOST = 3'd6;
    reg  [2:0]  state;
    reg  [15:0] pause;
    reg  [1:0]  step;               // byte of a command, or of a word
    reg         slot, replays;      // the image that is read, and whether its entries are written
    reg  [1:0]  valid, failed;
    reg  [31:0] first_number, second_number;
    reg  [31:0] sum, left;          // left: words
    reg  [23:0] word;
    reg  [2:0]  index;              // of the word: 0 to 3, then 4 for an address and 5 for a value
    reg         wrong, at_end;
    reg  [1:0]  running;
    wire [23:0] base   = slot ? SECOND : FIRST;
    wire [31:0] ahead  = second_number - first_number;
    wire [7:0]  reads  = step == 2'd0 ? 8'h03 : step == 2'd1 ? base[23:16] : step == 2'd2 ? base[15:8] : base[7:0];
    assign byte_out = state == WAKE ? 8'hab : state == COMMAND ? reads : state == HOST & sends != 7'd0 ? send_word[8*send_at[1:0] +: 8] : 8'd0;
    assign busy = plays | host_runs;
    wire [31:0] whole = {word, byte_in};

    always @(posedge clk) begin
        byte_starts <= 1'b0;
        play_write  <= 1'b0;
        if (state == WORDS & comes) sum <= crc(sum, sampled);
        case (state)
            // Releases the flash from deep power-down, where a configuration may have left it.
            WAKE: begin
                pin_select  <= 1'b0;
                byte_starts <= pin_select;
                if (byte_ends) begin
                    pin_select <= 1'b1;
                    pause      <= 16'd0;
                    state      <= WAIT;
                end
            end
            WAIT: begin
                pause <= pause + 16'd1;
                if (pause == LAST_WAKE & ready) begin
                    state       <= COMMAND;
                    pin_select  <= 1'b0;
                    byte_starts <= 1'b1;
                    step        <= 2'd0;
                    sum         <= 32'hffffffff;
                end else if (pause == LAST_WAKE) pause <= pause;
            end
            COMMAND: if (byte_ends) begin
                byte_starts <= 1'b1;
                step        <= step + 2'd1;
                if (step == 2'd3) begin
                    state  <= WORDS;
                    index  <= 3'd0;
                    left   <= 32'd5;
                    {wrong, at_end} <= 2'd0;
                end
            end
            WORDS: begin
                if (byte_ends) begin
                    step <= step + 2'd1;
                    word <= whole[23:0];
                    if (step == 2'd3) begin
                        left   <= left - 32'd1;
                        at_end <= left == 32'd1;
                        index  <= index == 3'd5 ? 3'd4 : index + 3'd1;
                        case (index)
                            3'd0: wrong <= whole != MAGIC;
                            3'd1: wrong <= wrong | whole != CIRCUIT;
                            3'd2: if (slot) second_number <= whole; else first_number <= whole;
                            3'd3: begin
                                wrong <= wrong | whole > ROOM;
                                left  <= {whole[30:0], 1'b0} + 32'd1;
                            end
                            3'd4: play_address <= whole[15:0];
                            default: begin
                                play_value <= whole;
                                play_write <= replays;
                            end
                        endcase
                    end
                    if (step != 2'd3 | left != 32'd1) byte_starts <= 1'b1;
                end
                // The first word of a wrong image is not followed by others, nor a count that is too large.
                if (~byte_ends & ~moves & ~byte_starts | wrong) begin
                    if (at_end | wrong) begin
                        pin_select  <= 1'b1;
                        byte_starts <= 1'b0;
                        pause       <= 16'd0;
                        state       <= CHOOSE;
                        if (~replays) valid[slot] <= ~wrong & sum == 32'd0;
                        else if (wrong | sum != 32'd0) failed[slot] <= 1'b1;
                        else running <= {slot, ~slot};
                    end
                end
            end
            CHOOSE: begin
                // A byte that was being read comes to its end; select is high for a while.
                pause <= pause + 16'd1;
                if (pause[7:0] == 8'hff & ~moves) begin
                    {pause, step} <= 18'd0;
                    if (~replays & ~slot) begin
                        slot  <= 1'b1;
                        state <= WAIT;
                        pause <= LAST_WAKE;
                    end else if (running != 2'd0 | (valid & ~failed) == 2'd0) state <= FINISH;
                    else begin
                        replays <= 1'b1;
                        slot    <= (valid & ~failed) == 2'd2 | ((valid & ~failed) == 2'd3 & ~ahead[31]);
                        state   <= WAIT;
                        pause   <= LAST_WAKE;
                    end
                end
            end
            // After a failure the memories are those of no image: nothing starts.
            FINISH: begin
                play_address <= CONTROL;
                play_value   <= running != 2'd0 ? START : failed != 2'd0 ? 32'd0 : DEFAULT;
                play_write   <= plays & ~play_write;
                if (play_write) begin
                    plays <= 1'b0;
                    state <= HOST;
                end
            end
            default: begin
                if (write & address == 5'd16 & ~busy) begin
                    sends     <= value[6:0];
                    receives  <= value[14:8];
                    place     <= 6'd0;
                    host_runs <= value[6:0] != 7'd0;
                    pin_select  <= value[6:0] == 7'd0;
                    byte_starts <= value[6:0] != 7'd0;
                end
                if (host_runs & byte_ends) begin
                    if (sends != 7'd0) sends <= sends - 7'd1;
                    else begin
                        receives <= receives - 7'd1;
                        place    <= place + 6'd1;
                    end
                    if (sends + receives == 7'd1) {pin_select, host_runs} <= 2'b10;
                    else byte_starts <= 1'b1;
                end
            end
        endcase
        if (rst) begin
            state       <= WAKE;
            pin_select  <= 1'b1;
            byte_starts <= 1'b0;
            {slot, replays, running, host_runs, play_write} <= 6'd0;
            valid       <= 2'd0;
            failed      <= 2'd0;
            {step, wrong, at_end} <= 4'd0;
            plays <= 1'b1;
        end
    end

    always @(posedge clk) begin
        case (address)
            5'd16: read <= {24'd0, failed, valid, running, plays, busy};
            5'd17: read <= {SECOND[23:8], FIRST[23:8]};
            5'd18: read <= ROOM;
            default: read <= buffer[address[3:0]];
        endcase
    end

    wire unused = &{1'b0, ahead[30:0]};

endmodule
