// SPDX-License-Identifier: MIT OR Apache-2.0
// CV32E40P with its floating-point unit and a memory that answers in the next cycle, 128 KiB for code and data.
//
// A store to 0x40000000 is a mark, one to 0x40000004 a result: the driver sees both.
module others (
    input  logic        clk,
    input  logic        resetn,
    output logic        marked,
    output logic        shown,
    output logic [31:0] value
);
  logic [31:0] memory[32768] ;
  logic fetch, fetched, access, accessed, we;
  logic [3:0] be;
  logic [31:0] fetch_address, instruction, address, written, read;

  cv32e40p_top #(
      .FPU(1),
      .FPU_ADDMUL_LAT(`ADDMUL),
      .FPU_OTHERS_LAT(`OTHERS)
  ) core (
      .clk_i(clk), .rst_ni(resetn), .pulp_clock_en_i(1'b1), .scan_cg_en_i(1'b1),
      .boot_addr_i(32'h0), .mtvec_addr_i(32'h0), .dm_halt_addr_i(32'h0), .hart_id_i(32'h0), .dm_exception_addr_i(32'h0),
      .instr_req_o(fetch), .instr_gnt_i(fetch), .instr_rvalid_i(fetched), .instr_addr_o(fetch_address), .instr_rdata_i(instruction),
      .data_req_o(access), .data_gnt_i(access), .data_rvalid_i(accessed), .data_we_o(we), .data_be_o(be),
      .data_addr_o(address), .data_wdata_o(written), .data_rdata_i(read),
      .irq_i(32'h0), .irq_ack_o(), .irq_id_o(), .debug_req_i(1'b0), .debug_havereset_o(), .debug_running_o(), .debug_halted_o(),
      .fetch_enable_i(1'b1), .core_sleep_o()
  );

  initial $readmemh("program.hex", memory);

  always_ff @(posedge clk) begin
    fetched <= fetch && resetn;
    accessed <= access && resetn;
    instruction <= memory[fetch_address[16:2]];
    read <= memory[address[16:2]];
    for (int i = 0; i < 4; i++)
      if (access && we && !address[30] && be[i]) memory[address[16:2]][8*i+:8] <= written[8*i+:8];
    marked <= access && we && address == 32'h40000000;
    shown <= access && we && address == 32'h40000004;
    value <= written;
  end
endmodule
