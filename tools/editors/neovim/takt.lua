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

-- Cycles beside the lines, where Neovim has no inlay hints of its own (before 0.10).
local space = vim.api.nvim_create_namespace('takt')
local function hint(buffer)
  if vim.lsp.inlay_hint or not vim.api.nvim_buf_is_loaded(buffer) then return end
  local document, count = vim.uri_from_bufnr(buffer), vim.api.nvim_buf_line_count(buffer)
  local whole = { start = { line = 0, character = 0 }, ['end'] = { line = count, character = 0 } }
  vim.lsp.buf_request(buffer, 'textDocument/inlayHint', { textDocument = { uri = document }, range = whole }, function(_, hints)
    if not vim.api.nvim_buf_is_loaded(buffer) then return end
    vim.api.nvim_buf_clear_namespace(buffer, space, 0, -1)
    local lines = {}
    for _, one in ipairs(hints or {}) do
      local parts = type(one.label) == 'table' and vim.tbl_map(function(part) return part.value end, one.label) or { one.label }
      lines[one.position.line] = (lines[one.position.line] or '') .. '  ' .. table.concat(parts)
    end
    for line, text in pairs(lines) do
      if line < vim.api.nvim_buf_line_count(buffer) then
        vim.api.nvim_buf_set_extmark(buffer, space, line, 0, { virt_text = { { text, 'Comment' } } })
      end
    end
  end)
end

-- Keys that Neovim has by itself from 0.11 on, and `gd`; a key with a mapping keeps it.
local keys = {
  { 'n', 'K', 'hover' }, { 'n', 'gd', 'definition' }, { 'n', 'grr', 'references' }, { 'n', 'grn', 'rename' },
  { 'n', 'gra', 'code_action' }, { 'n', 'gO', 'document_symbol' }, { 'i', '<C-s>', 'signature_help' },
}
local function map(buffer)
  vim.bo[buffer].omnifunc = 'v:lua.vim.lsp.omnifunc'
  for _, key in ipairs(keys) do
    local mode, lhs, name = key[1], key[2], key[3]
    if vim.fn.mapcheck(lhs, mode) == '' then
      vim.keymap.set(mode, lhs, vim.lsp.buf[name], { buffer = buffer, desc = 'Takt: ' .. name:gsub('_', ' ') })
    end
  end
end

-- Cycles of sections and blocks above their first lines, and the hints, whenever the text rests.
local function follow(_, buffer)
  map(buffer)
  vim.api.nvim_create_autocmd({ 'BufEnter', 'CursorHold', 'InsertLeave', 'BufWritePost' }, {
    buffer = buffer,
    callback = function()
      vim.lsp.codelens.refresh()
      hint(buffer)
    end,
  })
  -- The server reads the text first, a long one for seconds.
  for _, wait in ipairs({ 300, 1500, 5000 }) do
    vim.defer_fn(function()
      if not vim.api.nvim_buf_is_loaded(buffer) then return end
      vim.api.nvim_buf_call(buffer, vim.lsp.codelens.refresh)
      hint(buffer)
    end, wait)
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
      vim.lsp.start({ name = 'takt', cmd = command, root_dir = folder, on_attach = follow })
      if vim.lsp.inlay_hint then vim.lsp.inlay_hint.enable(true, { bufnr = event.buf }) end
    else
      -- Before 0.8: one server for all buffers.
      vim.g.takt_client = vim.g.takt_client
        or vim.lsp.start_client({ name = 'takt', cmd = command, root_dir = folder, on_attach = follow })
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
