-- SPDX-License-Identifier: GPL-3.0-or-later
-- The grammar of a datagram and its checksum (docs/reference/protocol.md, section 1). Pure Lua, 5.2 to 5.4.

local floor, byte, find = math.floor, string.byte, string.find
-- Lua 5.3 and later have operators instead of bit32, which Lua 5.2 cannot parse.
local bxor = bit32 and bit32.bxor or load("return function(a, b) return a ~ b end")()
local bxor4 = bit32 and bit32.bxor or load("return function(a, b, c, d) return a ~ b ~ c ~ d end")()

local M = { longest = 1024 }

-- CRC-32 four bytes at a time: table k has the effect of a byte with k more bytes after it. Tables for two bytes at
-- once are slower, because they do not fit a processor's first cache.
local t0, t1, t2, t3 = {}, {}, {}, {}
for i = 0, 255 do
  local crc = i
  for _ = 1, 8 do
    local odd = crc % 2
    crc = (crc - odd) / 2
    if odd == 1 then
      crc = bxor(floor(crc), 0xEDB88320)
    end
  end
  t0[i] = floor(crc)
end
local function one_more(crc)
  return bxor(t0[crc % 256], floor(crc / 256))
end
for i = 0, 255 do
  t1[i] = one_more(t0[i])
  t2[i] = one_more(t1[i])
  t3[i] = one_more(t2[i])
end

-- The checksum of the first `size` bytes of `text`.
function M.crc32(text, size)
  local crc, at = 4294967295, 1
  while at + 3 <= size do
    local a, b, c, d = byte(text, at, at + 3)
    crc = bxor(crc, a + b * 256 + c * 65536 + d * 16777216)
    local b0 = crc % 256
    crc = (crc - b0) / 256
    local b1 = crc % 256
    crc = (crc - b1) / 256
    local b2 = crc % 256
    crc = bxor4(t3[b0], t2[b1], t1[b2], t0[(crc - b2) / 256])
    at = at + 4
  end
  while at <= size do
    crc = bxor(t0[bxor(crc % 256, byte(text, at))], floor(crc / 256))
    at = at + 1
  end
  return 4294967295 - crc
end

local field = "^([!-+%-./0-9<-\\%]_-~]+):([ -:<-\\%]_-~]*);"

-- The fields of `text` (name, values, position), the position of the trailer, the found and the expected checksum, and
-- an `error` with its position `at`.
function M.read(text)
  local result = {}
  local caret = find(text, "^", 1, true)
  if not caret then
    result.error, result.at = "no ^ ends the fields", #text
  else
    local _, stop, digits = find(text, "^%^0x(%x+)%^[\r\n]*", caret)
    if not stop or #digits > 8 then
      result.error, result.at = "the checksum is not ^0x, up to 8 hexadecimal digits, ^", caret
    else
      result.found = tonumber(digits, 16)
      result.expected = M.crc32(text, caret)
      result.trailer, result.trailer_size = caret, #digits + 4
      if stop ~= #text then
        result.error, result.at = "bytes behind the checksum", stop + 1
      end
    end
  end
  if #text > M.longest + 2 then
    result.error, result.at = "longer than " .. M.longest .. " bytes", M.longest
  end
  local at, fields = 1, (caret or #text + 1)
  while at < fields do
    local first, last, name, values = find(text, field, at)
    if not first then
      result.error, result.at = "a field is not name:values;", at
      break
    end
    result[#result + 1] = { name = name, values = values, first = first, size = last - first + 1 }
    at = last + 1
  end
  if #result == 0 and not result.error then
    result.error, result.at = "no fields", 1
  end
  return result
end

-- The last field with that name, or nil. Searches backwards, because the wanted fields are near the end.
function M.field(fields, name)
  for index = #fields, 1, -1 do
    if fields[index].name == name then
      return fields[index]
    end
  end
  return nil
end

-- A whole number from `lowest` to `highest`, else nil.
function M.whole(text, lowest, highest)
  if not find(text, "^%-?%d+$") then
    return nil
  end
  local number = tonumber(text)
  return number and number >= lowest and number <= highest and number or nil
end

local function values_of(field_)
  local values = {}
  for value in (field_.values .. ","):gmatch("([^,]*),") do
    values[#values + 1] = value
  end
  return values
end
M.values_of = values_of

-- The kind of the datagram, and its sender: "board", "host" or nil.
function M.kind(fields)
  local first = fields[1]
  if first.name == "H" then
    if first.values == "R4-ROS2" then
      return "heartbeat", "board"
    end
    return "heartbeat", "host"
  elseif first.name == "N" then
    return "refusal", "board"
  elseif first.name == "I" then
    return "identity", "board"
  end
  for index = 1, #fields do
    local name = fields[index].name
    if #name == 1 and find(name, "^[^%AAINT]$") then
      return "command", "host"
    end
  end
  if #first.name > 1 and first.name ~= "PNum" then
    return "state", "board"
  end
  return "other", nil
end

return M
