-- Neovim's own client, run against `takt lsp`: writes its findings to the file $OUT as JSON.
local takt, file, out = vim.env.TAKT, vim.env.FILE, vim.env.OUT
local found = {}
-- Line and column of the first occurrence of a text, from 0.
local function place(buffer, text, after)
  for index, line in ipairs(vim.api.nvim_buf_get_lines(buffer, 0, -1, false)) do
    local start = line:find(text, 1, true)
    if start and index > (after or 0) then return index - 1, start - 1 end
  end
  error('there is no ' .. text)
end
local function go(buffer, text)
  local line, column = place(buffer, text)
  vim.api.nvim_win_set_cursor(0, { line + 1, column })
end
local function run()
  vim.cmd('edit ' .. file)
  local buffer = vim.api.nvim_get_current_buf()
  local id = vim.lsp.start_client({
    name = 'takt',
    cmd = { takt, 'lsp', '--deadline', '100us' },
    root_dir = vim.fn.fnamemodify(file, ':h'),
  })
  vim.lsp.buf_attach_client(buffer, id)
  local ready = vim.wait(20000, function()
    local client = vim.lsp.get_client_by_id(id)
    return client and client.initialized
  end, 20)
  assert(ready, 'the server does not answer')
  local function ask(method, params)
    local answers = assert(vim.lsp.buf_request_sync(buffer, method, params, 20000))
    local answer = answers[id]
    return answer.error and { error = answer.error } or answer.result
  end
  local function at(text)
    go(buffer, text)
    return vim.lsp.util.make_position_params(0, 'utf-16')
  end
  local document = { textDocument = vim.lsp.util.make_text_document_params() }

  found.hover = ask('textDocument/hover', at('fmul    zz')).contents.value
  -- A mistake while typing, and the assembler's quick fix.
  local line, column = place(buffer, 'fmul    zz')
  vim.api.nvim_buf_set_text(buffer, line, column, line, column + 4, { 'fmull' })
  assert(vim.wait(20000, function() return #vim.diagnostic.get(buffer) > 0 end, 20), 'no diagnostic')
  local diagnostic = vim.diagnostic.get(buffer)[1]
  found.diagnostic = { line = diagnostic.lnum, column = diagnostic.col, code = diagnostic.code, message = diagnostic.message }
  local range = { start = { line = line, character = column }, ['end'] = { line = line, character = column } }
  local actions = ask('textDocument/codeAction', {
    textDocument = document.textDocument, range = range, context = { diagnostics = {} },
  })
  found.fix = actions[1].title
  vim.lsp.util.apply_workspace_edit(actions[1].edit, 'utf-16')
  assert(vim.wait(20000, function() return #vim.diagnostic.get(buffer) == 0 end, 20), 'the diagnostic stays')
  found.fixed = vim.api.nvim_buf_get_lines(buffer, line, line + 1, false)[1]

  found.definition = vim.fn.fnamemodify(vim.uri_to_fname(ask('textDocument/definition', at('count{i}'))[1].uri), ':t')
  found.symbols = #ask('textDocument/documentSymbol', document)
  found.folds = #ask('textDocument/foldingRange', document)

  -- Cycles arrive after scheduling.
  assert(vim.wait(60000, function()
    local lenses = ask('textDocument/codeLens', document)
    found.lenses = vim.tbl_map(function(lens) return lens.command.title end, lenses)
    return #lenses > 0
  end, 200), 'no cycles')
  local hints = ask('textDocument/inlayHint', {
    textDocument = document.textDocument,
    range = { start = { line = 0, character = 0 }, ['end'] = { line = 10000, character = 0 } },
  })
  found.hints = #hints
  found.hint = vim.tbl_filter(function(hint) return hint.position.line == line end, hints)[1].label

  -- With Neovim's own commands: across a repetition, and across an included file.
  for text, name in pairs({ ['p{i} c{i} dn{i}:int'] = 'pos{i}', ['ms*c^2'] = 'slider' }) do
    go(buffer, text)
    vim.lsp.buf.rename(name)
    assert(vim.wait(20000, function()
      return vim.fn.search(name, 'nw') > 0
    end, 20), 'no rename to ' .. name)
  end
  assert(vim.wait(20000, function() return #vim.diagnostic.get(buffer) == 0 end, 20))
  found.refused = ask('textDocument/rename', vim.tbl_extend('force', at('c{i}, n{i}'), { newName = 'pos{i}' })).error.message

  vim.api.nvim_buf_set_text(buffer, line, 0, line, column, { '\t' })
  vim.lsp.buf.formatting_sync(nil, 20000)
  found.formatted = vim.api.nvim_buf_get_lines(buffer, line, line + 1, false)[1]
  vim.cmd('silent wall')
  found.changed = {}
  for _, name in ipairs(vim.api.nvim_list_bufs()) do
    table.insert(found.changed, vim.fn.fnamemodify(vim.api.nvim_buf_get_name(name), ':t'))
  end
  vim.lsp.stop_client(id)
  found.stopped = vim.wait(20000, function() return vim.lsp.client_is_stopped(id) end, 20)
end
local ok, problem = pcall(run)
if not ok then found.problem = tostring(problem) end
vim.fn.writefile({ vim.fn.json_encode(found) }, out)
vim.cmd('qall!')
