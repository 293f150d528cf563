-- Takt in Neovim: ~/.config/nvim/plugin/takt.lua
local options = vim.g.takt_lsp_arguments or {}

vim.api.nvim_create_autocmd({ 'BufRead', 'BufNewFile' }, {
  pattern = '*.s',
  callback = function(event) vim.bo[event.buf].filetype = 'takt' end,
})

vim.api.nvim_create_autocmd('FileType', {
  pattern = 'takt',
  callback = function(event)
    vim.bo[event.buf].commentstring = '; %s'
    local folder = vim.fn.fnamemodify(vim.api.nvim_buf_get_name(event.buf), ':p:h')
    local command = vim.list_extend({ 'takt', 'lsp' }, options)
    if vim.lsp.start then
      vim.lsp.start({ name = 'takt', cmd = command, root_dir = folder })
      if vim.lsp.inlay_hint then vim.lsp.inlay_hint.enable(true, { bufnr = event.buf }) end
    else
      -- Before 0.8: one server for all buffers.
      vim.g.takt_client = vim.g.takt_client
        or vim.lsp.start_client({ name = 'takt', cmd = command, root_dir = folder })
      vim.lsp.buf_attach_client(event.buf, vim.g.takt_client)
    end
  end,
})

-- The debugger, if nvim-dap is there.
local has_dap, dap = pcall(require, 'dap')
if has_dap then
  dap.adapters.takt = { type = 'executable', command = 'takt', args = { 'dap' } }
  dap.configurations.takt = {
    { type = 'takt', request = 'launch', name = 'this file', program = '${file}' },
    { type = 'takt', request = 'launch', name = 'closed loop', track = true },
  }
end
