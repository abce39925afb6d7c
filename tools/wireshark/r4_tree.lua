-- SPDX-License-Identifier: GPL-3.0-or-later
-- The fields of the protocol in Wireshark. Puts a datagram's fields into the tree.

local tables = require("r4_fields")
local datagram = require("r4_datagram")

local M = { list = {} }

local limits = {
  uint8 = { 0, 255 }, uint16 = { 0, 65535 }, uint32 = { 0, 4294967295 }, int32 = { -2147483648, 2147483647 },
}

local function proto_field(kind, filter, name, names)
  local field
  if kind == "double" or kind == "string" then
    field = ProtoField[kind](filter, name)
  elseif kind == "framenum" then
    field = ProtoField.framenum(filter, name, base.NONE, names)
  elseif kind == "time" then
    field = ProtoField.relative_time(filter, name)
  elseif kind == "hex" then
    field = ProtoField.uint32(filter, name, base.HEX, names)
  elseif kind == "switch" then
    field = ProtoField.uint8(filter, name, base.DEC, { [0] = "Off", [1] = "On" })
  else
    field = ProtoField[kind](filter, name, base.DEC, names)
  end
  M.list[#M.list + 1] = field
  return field
end
M.proto_field = proto_field

local frames = frametype
M.type = proto_field("string", "r4.type", "Type")
M.from = proto_field("string", "r4.from", "From")
M.text = proto_field("string", "r4.text", "Datagram")
M.pnum = proto_field("uint32", "r4.pnum", "PNum")
M.time = proto_field("uint64", "r4.t", "T (ms)")
M.other = proto_field("string", "r4.field", "Field")
M.crc = proto_field("hex", "r4.crc", "Checksum")
M.crc_expected = proto_field("hex", "r4.crc.expected", "Checksum that is right")
M.crc_status = proto_field("uint8", "r4.crc.status", "Checksum status",
  { [0] = "Bad", [1] = "Good", [2] = "Unverified" })
M.packed = proto_field("uint32", "r4.packed", "Packed form (bytes)")
M.lost = proto_field("uint32", "r4.lost", "Lost before this")
M.response_in = proto_field("framenum", "r4.response_in", "Confirmed in", frames.RESPONSE)
M.response_to = proto_field("framenum", "r4.response_to", "Confirms the command of", frames.REQUEST)
M.response_time = proto_field("time", "r4.response_time", "Time from the command")
M.response_by = proto_field("string", "r4.response_by", "Told by")
M.copy_of = proto_field("framenum", "r4.copy_of", "Sent before in", frames.DUP_ACK)

-- By name: the fields of the values, and for several values the field of the whole.
local known, commands = {}, {}

local function filter_of(name, value)
  return "r4." .. name:lower() .. (value ~= "" and "." .. value or "")
end

for _, entry in ipairs(tables.state) do
  local parts, whole = {}, nil
  local form = tables.forms[entry.form]
  for index, part in ipairs(form) do
    local title = (part[1] == "" and entry.name or entry.name .. " " .. part[1]) .. " (" .. part[3] .. ")"
    local names = entry.form == "reason" and tables.reasons or nil
    parts[index] = { field = proto_field(part[2], filter_of(entry.name, part[1]), title, names),
      kind = part[2] }
  end
  if #parts > 1 then
    whole = proto_field("string", filter_of(entry.name, ""), entry.name)
  end
  known[entry.name] = { whole = whole, parts = parts }
end

local function add_message(into, name, entry)
  local parts, whole = {}, nil
  for index, part in ipairs(entry) do
    local title = part[1] == "" and name or name .. " " .. part[1]
    parts[index] = { field = proto_field(part[2], filter_of(name, part[1]), title), kind = part[2], last = part.last,
      maybe = part.maybe }
  end
  if entry.title then
    whole = proto_field("string", filter_of(name, ""), ("%s (%s)"):format(name, entry.title))
  end
  into[name] = { whole = whole, parts = parts, short = { parts[1], parts[3] } }
end
for name, entry in pairs(tables.answers) do
  add_message(known, name, entry)
end
for name, entry in pairs(tables.commands) do
  add_message(commands, name, entry)
end

-- T has up to 64 bits, more than a Lua number holds exactly.
local function uint64(text)
  local digits = text:match("^0*(%d+)$")
  if not digits or #digits > 20 or (#digits == 20 and digits > "18446744073709551615") then
    return nil
  elseif #digits <= 9 then
    return UInt64(tonumber(digits))
  end
  local value = UInt64(0)
  for digit in digits:gmatch("%d") do
    value = value * UInt64(10) + UInt64(tonumber(digit))
  end
  return value
end

local switches = { on = 1, off = 0, ["1"] = 1, ["0"] = 0 }

local function value_of(part, text)
  local kind = part.kind
  if kind == "string" then
    return text
  elseif kind == "double" then
    return text:find("^%-?%d+%.?%d*$") and tonumber(text) or nil
  elseif kind == "switch" then
    return switches[text:lower()]
  elseif kind == "uint64" then
    return uint64(text)
  end
  return datagram.whole(text, limits[kind][1], limits[kind][2])
end

-- Puts the values of a field, which begin at `at`, into the tree. True if all values have the form.
local function add_values(tree, tvb, entry, text, at)
  local parts, good, index, from = entry.parts, true, 1, 1
  if parts[2] and parts[2].maybe and not text:find(",.*,") then
    parts = entry.short
  end
  while from do
    local part = parts[index]
    if not part then
      return false
    end
    local comma = text:find(",", from, true)
    local value_text = text:sub(from, comma and comma - 1)
    local value = value_of(part, value_text)
    if value == nil then
      good = false
    else
      tree:add(part.field, tvb(at + from - 1, #value_text), value)
    end
    from = comma and comma + 1
    index = part.last and index or index + 1
  end
  return good and (index > #parts or parts[index].last == true)
end

-- Puts a field into the tree; the datagram begins at `at`. False: values in another form; nil: an unknown field.
function M.add_field(tree, tvb, at, field, from_host)
  local range = tvb(at + field.first - 1, field.size)
  local name = field.name
  if name == "PNum" then
    local value = datagram.whole(field.values, 0, 4294967295)
    if value then
      tree:add(M.pnum, range, value)
    end
    return value ~= nil
  elseif name == "T" then
    local value = uint64(field.values)
    if value then
      tree:add(M.time, range, value)
    end
    return value ~= nil
  end
  local entry = ((from_host or name == "H") and commands[name]) or known[name]
  if not entry then
    tree:add(M.other, range, name .. ":" .. field.values)
    return nil
  end
  local values_at = at + field.first + #name
  if entry.whole then
    return add_values(tree:add(entry.whole, range, field.values), tvb, entry, field.values, values_at)
  end
  local part = entry.parts[1]
  local value = value_of(part, field.values)
  if value == nil then
    tree:add(M.other, range, name .. ":" .. field.values)
    return false
  end
  tree:add(part.field, range, value)
  return true
end

M.safe, M.stop_number = known.SAFE.parts[1].field, known.STOP.parts[1].field
return M
