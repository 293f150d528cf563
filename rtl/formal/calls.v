// SPDX-License-Identifier: MIT OR Apache-2.0
    // ---- properties, added by `cargo evidence formal` to takt_sequencer

    // The active calls, as the program means them. For an arbitrary one, f_level, the address after its `call`.
    (* anyconst *) reg [LEVEL-1:0] f_level;
    reg [LEVEL:0] f_depth;
    reg [15:0]    f_address, f_after;
    // The bundle in execute calls, or returns. The previous one returned to f_level, found no room or no call, or may
    // have another fault.
    reg           f_call, f_return, f_returned, f_full, f_empty, f_besides, f_stopped;
    reg           f_begun = 1'b0;
    wire          f_runs = f_begun & ~f_stopped & ~fault & ~rst;
    wire [7:0]    f_others =
        {i_jump, i_branch_zero, i_branch_nonzero, i_loop, i_publish, i_wait, i_halt, i_call & i_return};
    always @(posedge clk) begin
        f_begun    <= 1'b1;
        f_address  <= i_address;
        f_call     <= issue & i_call;
        f_return   <= issue & i_return;
        f_returned <= f_runs & f_return & f_depth == {1'b0, f_level} + 1'b1;
        f_full     <= f_runs & f_call & f_depth == STACK;
        f_empty    <= f_runs & f_return & f_depth == 0;
        f_besides  <= x_nested | (|x_address_fault) | x_refused;
        if (f_runs & f_call) begin
            f_depth <= f_depth + 1'b1;
            if (f_depth == {1'b0, f_level}) f_after <= f_address + 16'd1;
        end
        if (f_runs & f_return) f_depth <= f_depth - 1'b1;
        if (fault) f_stopped <= 1'b1;
        if (rst) {f_depth, f_call, f_return, f_returned, f_full, f_empty, f_stopped} <= 0;
    end
    always @* begin
        assume (f_begun | rst);
        // At most one operation of a bundle redirects.
        assume (~((i_call | i_return) & (|f_others)));
        if (f_begun & ~f_stopped & ~rst) begin
            // A return goes to the bundle after its call. Only a call without room and a return without a call are
            // faults.
            if (f_returned & ~fault) assert (flush & fetch == f_after[PROGRAM-1:0]);
            if (f_full | f_empty) assert (fault);
            if (f_full & ~f_besides) assert (fault_kind == 3'd3);
            if (f_empty & ~f_besides) assert (fault_kind == 3'd4);
            if (fault & fault_kind == 3'd3) assert (f_full);
            if (fault & fault_kind == 3'd4) assert (f_empty);
        end
        // Strengthens the induction: the registers hold the active calls.
        if (f_runs) begin
            assert (x_call == f_call & x_return == f_return & x_address == f_address);
            assert (f_depth <= STACK & entries == f_depth & top == f_depth[LEVEL-1:0] - 1'b1);
            if ({1'b0, f_level} < f_depth) assert (stack[f_level] == f_after);
        end
    end

