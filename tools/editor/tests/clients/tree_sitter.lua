-- Neovim's tree-sitter on standard input and output: for each request its answer, both led by a line with their length.
-- A request is a source; the answer is `ok` or where the first mistake is. An empty request asks for the tree's look: the
-- captures and folds of the source that follows.
local parser, queries = vim.env.PARSER, vim.env.QUERIES
vim.treesitter.require_language('takt', parser)

local function text_of(name)
  local file = assert(io.open(queries .. '/' .. name))
  local text = file:read('*a')
  file:close()
  return text
end

local function mistake(node)
  if node:type() == 'ERROR' or node:missing() then
    local row, column = node:start()
    return ('%d:%d'):format(row + 1, column + 1)
  end
  for child in node:iter_children() do
    if child:has_error() or child:missing() then return mistake(child) end
  end
end

local function parse(text)
  return vim.treesitter.get_string_parser(text, 'takt'):parse()[1]:root()
end

local function look(text)
  local root, lines = parse(text), {}
  for _, name in ipairs({ 'highlights.scm', 'folds.scm' }) do
    local query = vim.treesitter.parse_query('takt', text_of(name))
    for id, node in query:iter_captures(root, text, 0, -1) do
      local row, column, last = node:range()
      local shown = vim.treesitter.get_node_text(node, text):match('^[^\n]*')
      table.insert(lines, ('%d:%d-%d @%s %s'):format(row + 1, column + 1, last + 1, query.captures[id], shown))
    end
  end
  return table.concat(lines, '\n')
end

local function read()
  local length = io.read('*l')
  return length and (tonumber(length) == 0 and '' or assert(io.read(tonumber(length))))
end

local function run()
  for text in read do
    local answer
    if text == '' then
      answer = look(read())
    else
      local root = parse(text)
      answer = root:has_error() and (mistake(root) or 'somewhere') or 'ok'
    end
    io.write(#answer, '\n', answer)
    io.flush()
  end
end

local ok, error = pcall(run)
if not ok then
  io.stderr:write(error, '\n')
  vim.cmd('cquit 1')
end
vim.cmd('qall!')
