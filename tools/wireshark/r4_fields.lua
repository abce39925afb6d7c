-- SPDX-License-Identifier: GPL-3.0-or-later
-- The state fields of an R4 datagram, in the order of the datagram, with the units of r4 convert's CSV. Also the values
-- of the commands, named as in r4 send --help. Both come from r4_board.def, in the same folder.
-- tests/integration/test_wireshark.py compares them with r4.

-- The types in Wireshark of a form's values (FieldForm), and of a command's value (ValueRole).
local types = {
  volts = { "double" }, handle = { "uint8" }, drive = { "uint16", "uint8" }, bldc = { "uint16", "uint8", "uint8" },
  servo = { "uint16" }, u8 = { "uint8" }, u16 = { "uint16" }, i32 = { "int32" }, u32 = { "uint32" },
  reason = { "uint32" }, fault = { "uint8", "uint8" }, reading = { "uint32", "uint32", "string" },
  answer = { "uint32", "uint8", "string" }, bus = { "uint8", "uint32", "uint32" },
  uart = { "uint32", "uint32", "string" },
}
local roles = {
  channel = "uint8", value = "uint16", speed = "uint16", direction = "uint8", on = "uint8", on_off = "switch",
  text = "string", text2 = "string", list = "string",
}

local folder = debug.getinfo(1, "S").source:match("^@(.*[/\\])") or ""
local file = assert(io.open(folder .. "r4_board.def"))
local text = file:read("*a")
file:close()

-- The arguments of each row, by the name of its macro; strings without their quotes.
local rows = {}
for macro, list in text:gmatch("\nR4_([%u_]+)(%b())") do
  local row, argument, depth, quoted = {}, "", 0, false
  for c in list:sub(2, -2):gmatch(".") do
    quoted = (c == '"') ~= quoted
    depth = depth + ((quoted or not c:find("[({]")) and 0 or 1) - ((quoted or not c:find("[)}]")) and 0 or 1)
    if c == "," and depth == 0 and not quoted then
      row[#row + 1], argument = argument, ""
    elseif depth > 0 or quoted or not c:find('[%s"]') then
      argument = argument .. (c == '"' and depth == 0 and "" or c)
    end
  end
  row[#row + 1] = argument
  rows[macro] = rows[macro] or {}
  table.insert(rows[macro], row)
end

-- The form of a kind: the names of its values ("": the field itself), their types and their units.
local state, forms = {}, {}
for _, row in ipairs(rows.STATE_FIELD) do
  state[#state + 1] = { name = row[2], form = row[3] }
end
for _, row in ipairs(rows.FIELD_KIND) do
  local form = {}
  for i, type in ipairs(types[row[2]]) do
    local name, unit = row[4 + i]:match('"(.*)", "(.*)"')
    form[i] = { name, type, unit }
  end
  forms[row[1]] = form
end

-- A command's values in their order. `last`: repeated for all remaining values. `maybe`: may be omitted. A letter that
-- needs a word has the words of all its kinds.
local commands = {
  E = { title = "emergency", { "word", "string" }, { "cause", "uint32", last = true } },
  X = { title = "the user's devices", { "word", "string" }, { "value", "string", last = true } },
  Q = { title = "question", { "word", "string" } },
  H = { title = "heartbeat", { "word", "string" } },
}
local values = {}
for _, row in ipairs(rows.COMMAND_VALUE) do
  local last = row[2] == "text2" or row[2] == "list" or nil
  values[row[1]] = { row[5]:match("%w+"):lower(), row[3]:find("^-") and "int32" or roles[row[2]], last = last }
end
for _, row in ipairs(rows.OPTIONAL_VALUE) do
  local last = row[2] == "list" or nil
  values[row[1]] = { row[6]:match("%w+"):lower(), roles[row[2]], last = last, maybe = not last or nil }
end
for _, row in ipairs(rows.COMMAND) do
  local letter = row[2]:sub(2, 2)
  if not commands[letter] then
    local command = { title = row[8] }
    for value in row[6]:gmatch("V::([%w_]+)") do
      command[#command + 1] = values[value]
    end
    commands[letter] = command
  end
end

local answers = {
  N = { title = "refusal", { "pnum", "uint32" }, { "code", "string" } },
  I = { title = "identity", { "kind", "string" }, { "firmware", "string" }, { "id", "string" },
    { "capabilities", "string", last = true } },
  A = { title = "signature", { "key", "uint8" }, { "counter", "uint64" }, { "t", "uint32" }, { "tag", "string" } },
  NAME = { { "", "string" } },
  BUSY = { { "", "uint8" } },
  ASKED = { { "", "uint32" } },
  CAUSE = { { "", "uint32" } },
  STOP = { { "", "uint32" } },
  AN = { { "", "string" } },
  SESSION = { { "", "uint32" } },
  SID = { { "", "string" } },
  AT = { { "", "uint8" } },
  LEASE = { { "", "uint32" } },
}

local reasons = {
  [0] = "none", [1] = "link", [2] = "stop", [3] = "handle", [4] = "proximity", [5] = "watchdog", [6] = "fault",
}

return { forms = forms, state = state, commands = commands, answers = answers, reasons = reasons }
