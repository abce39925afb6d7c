-- SPDX-License-Identifier: GPL-3.0-or-later
-- Unpacks a datagram from the packed form (docs/reference/packed.md). The table of words belongs to its version.

local M = {}

local words, forms, allowed_names = {}, {}, "[!-+%-./0-9<-\\%]_-~]"
local count = 0
local function add(form, list)
  for word in list:gmatch("%S+") do
    words[count], forms[word] = word, forms[word] or form
    count = count + 1
  end
end
local function numbered(form, pattern, first, last)
  for n = first, last do
    add(form, pattern:format(n))
  end
end

add("hundredths", "AIN24 AIN12 AIN5 AINDMH")
add("flag", "DMHSTA")
add("hundredths", "AINSTEER")
add("drive", "DHB1A OSMC1")
add("steps", "STEP1POS")
add("short", "SERVO1POS")
add("hundredths", "AIN6")
add("drive", "DHB1B DHB2A DHB2B OSMC2 OSMC3 OSMC4")
numbered("steps", "STEP%dPOS", 2, 4)
numbered("short", "SERVO%dPOS", 2, 16)
numbered("steps", "ENC%d", 1, 4)
numbered("count", "US%d", 1, 4)
numbered("bldc", "BLDC%d", 1, 4)
add("count", "RELAYS")
add("flag", "SAFE")
add("count", "CMD RXOK RXCRC RXLOST RXDUP RXREF LATE PNum T")
add("text", "H O D S R E P Z B U F C Q N I A AN R4-ROS2 ROS2-R4 On Off STOP CLEAR DEFAULT ALL ID")
add("text", "rate heartbeat timeout recovery pack last rearm")
add("text", "UNKNOWN FORMAT RANGE CHANNEL STALE DUPLICATE BUSY AUTH R4 sim udp serial pty can FAULT")
numbered("steps", "ENC%dHZ", 1, 4)
numbered("steps", "ENC%dIDX", 1, 4)
numbered("bytes", "I2C%d", 1, 8)
add("bytes", "I2CX")
add("text", "I2CBUS X FULL")
numbered("bytes", "UART%d", 1, 2)
add("count", "DAC1 DAC2 GPIO")
add("session", "SID")
add("text", "LEAVE")

local given = { [2] = 10, [3] = 10, [4] = 0x38 } -- by layout: the number of names, from the first, that it implies
local sizes = { [0] = { 0, 0 }, { 4, 5 }, { 4, 8 }, { 5, 8 }, { 6, 8 }, { 4, 11 }, { 8, 8 }, { 8, 11 } }
local widths = { flag = 1, short = 3, hundredths = 3, drive = 4, bldc = 4 }
local text_digits = { a = ".", b = "-", c = "," }

-- Reads digits of a string. A missing digit is an error, which unpack() catches.
local Digits = {}
Digits.__index = Digits

function Digits:take(size)
  local last = self.at + size - 1
  if last > #self.digits then
    error("it ends too early", 0)
  end
  local taken = self.digits:sub(self.at, last)
  self.at = last + 1
  return taken
end

function Digits:number(size)
  return size == 0 and 0 or tonumber(self:take(size), 16)
end

function Digits:bytes(size, allowed)
  local digits = self:take(2 * size)
  local text = digits:gsub("..", function(pair) return string.char(tonumber(pair, 16)) end)
  if size == 0 or not text:find("^" .. allowed .. "+$") then
    error("a byte that the grammar forbids", 0)
  end
  return text
end

function Digits:word()
  return words[self:number(2)] or error("no such code", 0)
end

function Digits:name()
  if self.digits:sub(self.at, self.at) ~= "e" then
    local word = self:word()
    return word, forms[word]
  end
  local size = self:number(2) % 16
  if size == 15 then
    error("a name too long", 0)
  end
  return self:bytes(size, allowed_names), "text"
end

function Digits:text()
  local parts = {}
  while true do
    local digit = self:take(1)
    if digit == "d" then
      return table.concat(parts)
    elseif digit == "e" then
      parts[#parts + 1] = self:bytes(self:number(1), "[ -+%--:<-\\%]_-~]")
    elseif digit == "f" then
      parts[#parts + 1] = self:word()
    else
      parts[#parts + 1] = text_digits[digit] or digit
    end
  end
end

local function plain(number)
  return ("%.0f"):format(number)
end

-- The decimal digits of up to 14 hexadecimal digits, which may not fit a double. `halved`: half the number, rounded up.
local function decimal(hex, halved)
  if #hex <= 13 then
    local number = hex == "" and 0 or tonumber(hex, 16)
    return plain(halved and math.ceil(number / 2) or number)
  end
  local low, high = 0, 0 -- digits of base 10^9
  for digit in hex:gmatch(".") do
    low = low * 16 + tonumber(digit, 16)
    high = high * 16 + math.floor(low / 1e9)
    low = low % 1e9
  end
  if halved then
    low = math.ceil((high % 2 * 1e9 + low) / 2)
    high = math.floor(high / 2) + math.floor(low / 1e9)
    low = low % 1e9
  end
  return ("%.0f%09.0f"):format(high, low)
end

function Digits:count()
  local size = self:number(1)
  if size == 15 then
    error("a count too long", 0)
  end
  return self:take(size)
end

function Digits:value(form)
  if form == "text" then
    return self:text()
  elseif self.digits:sub(self.at, self.at) == "f" then
    self:take(1)
    return self:text()
  elseif form == "count" or form == "steps" then
    local number = self:count()
    if form == "count" then
      return decimal(number)
    end
    return (number:find("[13579bdf]$") and "-" or "") .. decimal(number, true)
  end
  if form == "bytes" then
    local first, second = decimal(self:count()), decimal(self:count())
    local size = self:number(2)
    if size > 64 then
      error("a reading too long", 0)
    end
    return ("%s,%s,x%s"):format(first, second, self:take(2 * size))
  end
  if form == "session" then
    if self:take(1) ~= "0" then
      error("a session id of another form", 0)
    end
    return self:take(16)
  end
  local number = self:number(widths[form])
  if form == "hundredths" then
    return ("%d.%02d"):format(math.floor(number / 100), number % 100)
  elseif form == "drive" then
    return ("%d,%d"):format(math.floor(number / 2), number % 2)
  elseif form == "bldc" then
    return ("%d,%d,%d"):format(math.floor(number / 4), math.floor(number / 2) % 2, number % 2)
  end
  return plain(number)
end

local function unpack_or_fail(packed)
  if #packed < 5 or #packed > 1024 then
    error("the length", 0)
  end
  local head = packed:byte(1)
  local layout, size = math.floor(head / 8) % 8, head % 8
  if math.floor(head / 64) ~= 2 then
    error("the version", 0)
  elseif (layout == 0 or layout == 7) and size ~= 0 then
    error("sizes without numbers", 0)
  end
  local hex = packed:sub(2, -5):gsub(".", function(each) return ("%02x"):format(each:byte()) end)
  local digits = setmetatable({ digits = hex, at = 1 }, Digits)
  local pnum = digits:number(layout == 7 and 8 or sizes[size][1])
  local time = digits:number(sizes[size][2])
  local session = layout >= 6 and digits:take(16)
  local fields = {}
  local function field(name, value)
    fields[#fields + 1] = name .. ":" .. value .. ";"
  end
  local function numbers()
    if session then
      field("SID", session)
    end
    field("PNum", plain(pnum))
    if layout ~= 7 then
      field("T", plain(time))
    end
  end
  if layout == 5 or layout == 6 then
    field("H", layout == 5 and "R4-ROS2" or "ROS2-R4")
    numbers()
  end
  for code = 0, (given[layout] or 0) - 1 do
    field(words[code], digits:value(forms[words[code]]))
  end
  if layout == 3 then
    field("SAFE", digits:value("flag"))
    field("CMD", digits:value("count"))
  end
  while #digits.digits - digits.at + 1 >= 2 do
    local name, form = digits:name()
    field(name, digits:value(form))
  end
  if digits.at == #digits.digits and digits.digits:sub(-1) ~= "f" then
    error("what fills the last byte", 0)
  end
  if layout ~= 0 and layout ~= 5 and layout ~= 6 then
    numbers()
  end
  if #fields == 0 then
    error("no fields", 0)
  end
  local a, b, c, d = packed:byte(-4, -1)
  return table.concat(fields) .. ("^0x%x^"):format(((a * 256 + b) * 256 + c) * 256 + d)
end

-- The datagram, or nil and the problem.
function M.unpack(packed)
  local ok, result = pcall(unpack_or_fail, packed)
  if ok then
    return result
  end
  return nil, result
end

return M
