// SPDX-License-Identifier: MIT OR Apache-2.0
// takt_bridge: the host's requests, over a UART, in frames with a checksum: docs/protocol.md.
//
// Contract
//   A frame that comes in whole, with the right checksum, is a request: so many reads or writes of words, at an address and those that
//   follow. All are made, without a pause, or none. It is answered when they are done. Other frames are dropped and counted in errors;
//   a gap of 20 bytes within a frame ends it.
//   Before a write, each of its addresses stands for a few cycles: if writable is 0 for one of them CHECK cycles later, nothing is
//   written (status 1).
//   A write with the number of the request before gets that request's answer and is not repeated.
//   Bus: address and bus_value, or bus_write, stand for a cycle; the value read is on bus_read READ cycles later. Accesses to addresses
//   1000 to 3fff and from 8000 on (hexadecimal) wait for grant, which may depend on address, but not longer than 2^PATIENCE cycles:
//   then they are refused (status 2).
//   due, high for a cycle: the word at periods_at is sent, and then `stream` words (1 to 15) from stream_at on, unless the bridge is busy:
//   then lost goes up by one. heard: high for a cycle at each request.

module takt_bridge #(
    parameter DIVIDE   = 434,
    parameter PATIENCE = 22
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        pin_receive,
    output wire        pin_send,
    output reg  [15:0] address,
    output reg         bus_write,
    output reg  [31:0] bus_value,
    input  wire [31:0] bus_read,
    input  wire        writable,
    input  wire        grant,
    input  wire        due,
    input  wire [15:0] periods_at,
    input  wire [15:0] stream_at,
    input  wire [3:0]  stream,
    output reg         heard,
    output reg  [31:0] errors,
    output reg  [31:0] lost
);

    localparam [2:0] READ = 3'd4, CHECK = 3'd2;
    localparam [7:0] REQUEST = 8'ha5, ANSWER = 8'h5a, STREAM = 8'h3c;

    // CRC-16/CCITT-FALSE of one byte more.
    function [15:0] crc(input [15:0] prior, input [7:0] data);
        integer i;
        begin
            crc = prior ^ {data, 8'd0};
            for (i = 0; i < 8; i = i + 1) crc = crc[15] ? {crc[14:0], 1'b0} ^ 16'h1021 : {crc[14:0], 1'b0};
        end
    endfunction

    // ---- what comes

    wire       comes, broken;
    wire [7:0] byte_in;
    takt_uart_receive #(.DIVIDE(DIVIDE)) receive (
        .clk(clk), .rst(rst), .pin_receive(pin_receive), .valid(comes), .data(byte_in), .broken(broken)
    );

    reg  [31:0] in_words [0:15];
    reg  [3:0]  part;        // 0 begin, 1 number, 2 command, 3 count, 4 and 5 address, 6 data, 7 and 8 checksum
    reg  [7:0]  request, command;
    reg  [4:0]  count;
    reg  [6:0]  bytes;
    reg  [15:0] at, sum;
    reg  [23:0] word;
    reg  [7:0]  sum_low;
    reg         whole;       // a request is there
    reg  [15:0] gap;
    reg  [7:0]  gaps;
    wire [6:0]  last_byte = {count, 2'b00} - 7'd1;
    wire        has_data  = command == 8'd2;
    localparam [15:0] BIT_TIME = DIVIDE;

    wire        takes = ~whole;  // one request at a time
    reg         answered;

    always @(posedge clk) begin
        // In bit times.
        if (comes | part == 4'd0) {gap, gaps} <= 24'd0;
        else if (gap == BIT_TIME) begin
            gap  <= 16'd0;
            gaps <= gaps + 8'd1;
        end else gap <= gap + 16'd1;

        if (answered) whole <= 1'b0;
        if (comes) begin
            sum <= part == 4'd0 ? 16'hffff : crc(sum, byte_in);
            case (part)
                4'd0: if (byte_in == REQUEST & takes) part <= 4'd1;
                4'd1: begin
                    request <= byte_in;
                    part     <= 4'd2;
                end
                4'd2: begin
                    command <= byte_in;
                    part    <= 4'd3;
                end
                4'd3: begin
                    count <= byte_in[4:0];
                    part  <= byte_in == 8'd0 | byte_in > 8'd16 | command == 8'd0 | command > 8'd2 ? 4'd0 : 4'd4;
                    if (byte_in == 8'd0 | byte_in > 8'd16 | command == 8'd0 | command > 8'd2) errors <= errors + 32'd1;
                end
                4'd4: begin
                    at[7:0] <= byte_in;
                    part    <= 4'd5;
                end
                4'd5: begin
                    at[15:8] <= byte_in;
                    bytes    <= 7'd0;
                    part     <= has_data ? 4'd6 : 4'd7;
                end
                4'd6: begin
                    word  <= {byte_in, word[23:8]};
                    bytes <= bytes + 7'd1;
                    if (bytes == last_byte) part <= 4'd7;
                end
                4'd7: begin
                    sum_low <= byte_in;
                    sum     <= sum;
                    part    <= 4'd8;
                end
                default: begin
                    part <= 4'd0;
                    if ({byte_in, sum_low} == sum) whole <= 1'b1;
                    else errors <= errors + 32'd1;
                end
            endcase
        end else if (part != 4'd0 & (broken | gaps == 8'd200)) begin
            part   <= 4'd0;
            errors <= errors + 32'd1;
        end
        if (rst) begin
            part   <= 4'd0;
            whole  <= 1'b0;
            errors <= 32'd0;
        end
    end
    always @(posedge clk) if (comes & part == 4'd6 & bytes[1:0] == 2'd3) in_words[bytes[5:2]] <= {byte_in, word};

    // ---- actions

    reg  [31:0] out_words [0:15];
    reg  [2:0]  state;       // 0 rest, 1 waits for grant, 2 writes, 3 reads, 4 sends, 5 checks addresses
    reg  [4:0]  i, words;
    reg  [2:0]  cycles;
    reg  [PATIENCE-1:0] patience;
    reg  [7:0]  status, last_status, last_sequence, kind, number, stream_number;
    reg         known, streams;
    wire        port   = at[15:12] != 4'd0 & at[15:14] != 2'd1;
    wire        repeats = has_data & known & request == last_sequence;
    reg         sends;
    wire        sent;

    always @(posedge clk) begin
        heard     <= 1'b0;
        answered  <= 1'b0;
        bus_write <= 1'b0;
        sends     <= 1'b0;
        cycles    <= cycles + 3'd1;
        if (due & (state != 3'd0 | whole)) lost <= lost + 32'd1;
        case (state)
            3'd0: begin
                i        <= 5'd0;
                cycles   <= 3'd0;
                patience <= 0;
                status   <= 8'd0;
                streams  <= 1'b0;
                kind     <= ANSWER;
                number   <= request;
                words    <= has_data ? 5'd0 : count;
                if (whole & ~answered) begin
                    address <= at;
                    heard <= 1'b1;
                    state <= repeats ? 3'd4 : has_data ? 3'd5 : 3'd1;
                    sends <= repeats;
                    known <= 1'b1;
                    last_sequence <= request;
                    if (repeats) status <= last_status;
                    else last_status <= 8'd0;
                end else if (due) begin
                    address       <= periods_at;
                    streams       <= 1'b1;
                    kind          <= STREAM;
                    number        <= stream_number;
                    stream_number <= stream_number + 8'd1;
                    words         <= {1'b0, stream} + 5'd1;
                    state         <= 3'd3;
                end
            end
            3'd1: begin
                cycles   <= 3'd0;
                patience <= patience + 1'b1;
                if (grant | ~port) state <= has_data ? 3'd2 : 3'd3;
                else if (&patience) begin
                    {status, last_status} <= {2{8'd2}};
                    words  <= 5'd0;
                    sends  <= 1'b1;
                    state  <= 3'd4;
                end
            end
            3'd2: begin
                // A word in two cycles.
                bus_value <= in_words[i[3:0]];
                bus_write <= cycles[0];
                if (bus_write) address <= address + 16'd1;
                if (cycles[0]) i <= i + 5'd1;
                if (i == count) begin
                    bus_write <= 1'b0;
                    sends     <= 1'b1;
                    state     <= 3'd4;
                end
            end
            3'd3: if (cycles == READ) begin
                cycles  <= 3'd0;
                address <= streams & i == 5'd0 ? stream_at : address + 16'd1;
                i       <= i + 5'd1;
                if (i + 5'd1 == words) begin
                    sends <= 1'b1;
                    state <= 3'd4;
                end
            end
            3'd5: if (cycles == CHECK) begin
                cycles  <= 3'd0;
                address <= address + 16'd1;
                i       <= i + 5'd1;
                if (~writable) begin
                    {status, last_status} <= {2{8'd1}};
                    sends <= 1'b1;
                    state <= 3'd4;
                end else if (i + 5'd1 == count) begin
                    address <= at;
                    i       <= 5'd0;
                    state   <= 3'd1;
                end
            end
            default: if (sent) begin
                answered <= ~streams;
                state    <= 3'd0;
            end
        endcase
        if (rst) begin
            state <= 3'd0;
            {known, streams, bus_write, sends, heard, answered} <= 6'd0;
            lost          <= 32'd0;
            stream_number <= 8'd0;
        end
    end
    always @(posedge clk) if (state == 3'd3 & cycles == READ) out_words[i[3:0]] <= bus_read;

    // ---- what goes

    reg  [3:0]  place;       // 0 rest, 1 kind, 2 number, 3 status, 4 count, 5 data, 6 and 7 checksum, 8 the end
    reg  [6:0]  out_byte;
    reg  [15:0] out_sum;
    reg  [7:0]  byte_out;
    reg  [31:0] out_word;
    reg         go;
    wire        ready;
    takt_uart_send #(.DIVIDE(DIVIDE)) send (
        .clk(clk), .rst(rst), .start(go), .data(byte_out), .ready(ready), .pin_send(pin_send)
    );
    assign sent = place == 4'd8 & ready & ~go;

    always @(posedge clk) begin
        go       <= 1'b0;
        out_word <= out_words[out_byte[5:2]];
        if (place == 4'd0) begin
            out_byte <= 7'd0;
            if (sends) place <= 4'd1;
        end else if (sent) place <= 4'd0;
        else if (ready & ~go & place != 4'd8) begin
            go <= 1'b1;
            case (place)
                4'd1: byte_out <= kind;
                4'd2: byte_out <= number;
                4'd3: byte_out <= status;
                4'd4: byte_out <= {3'd0, words};
                4'd5: byte_out <= out_word[8*out_byte[1:0] +: 8];
                4'd6: byte_out <= out_sum[7:0];
                default: byte_out <= out_sum[15:8];
            endcase
            if (place == 4'd5) out_byte <= out_byte + 7'd1;
            if (place == 4'd4) place <= words == 5'd0 ? 4'd6 : 4'd5;
            else if (place != 4'd5 | out_byte == {words, 2'b00} - 7'd1) place <= place + 4'd1;
        end
        if (go & place < 4'd7) out_sum <= place == 4'd2 ? 16'hffff : crc(out_sum, byte_out);
        if (rst) begin
            place <= 4'd0;
            go    <= 1'b0;
        end
    end

    wire unused = &{1'b0, i[4]};

endmodule
