-- Takt in Neovim: ~/.config/nvim/plugin/takt.lua
local options = vim.g.takt_lsp_arguments or {}

-- Sources of Takt are those called *.tks, and those called *.s that have a directive which GNU's assembler does not know.
local own = vim.regex([[^\s*\.\(period\|once\|schedule\|ports\|input\|output\|state\|rep\|endfor\)\>]])
vim.api.nvim_create_autocmd({ 'BufRead', 'BufNewFile' }, {
  pattern = { '*.tks', '*.s' },
  callback = function(event)
    local is_own = vim.endswith(event.match, '.tks')
    for _, line in ipairs(is_own and {} or vim.api.nvim_buf_get_lines(event.buf, 0, 1000, false)) do
      is_own = is_own or own:match_str(line) ~= nil
    end
    if is_own then vim.bo[event.buf].filetype = 'takt' end
  end,
})

-- Colours and folds by tree-sitter, if its parser is installed (docs/editors.md).
local function colour(buffer)
  if #vim.api.nvim_get_runtime_file('parser/takt.so', false) == 0 then return end
  if vim.treesitter.start then
    vim.treesitter.start(buffer, 'takt')
  else
    -- Before 0.8.
    vim.treesitter.highlighter.new(vim.treesitter.get_parser(buffer, 'takt'))
  end
  if vim.treesitter.foldexpr then
    vim.wo.foldmethod, vim.wo.foldexpr, vim.wo.foldlevel = 'expr', 'v:lua.vim.treesitter.foldexpr()', 99
  end
end

vim.api.nvim_create_autocmd('FileType', {
  pattern = 'takt',
  callback = function(event)
    colour(event.buf)
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
