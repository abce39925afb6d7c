-- SPDX-License-Identifier: GPL-3.0-or-later
-- ISO-TP (ISO 15765-2) as R4 uses it (docs/reference/can.md): joins frames of one id, once, when a capture is read.

local M = {}

local patience = 0.1 -- N_Cr, in seconds
local longest = 1024

local receivers, frames = {}, {}

function M.reset()
  receivers, frames = {}, {}
end

local function whole_frame(kind, payload, size)
  return { kind = kind, payload = payload, size = size }
end

local function single(data)
  local size, from = data:byte(1) % 16, 2
  if size == 0 and #data > 8 then
    size, from = data:byte(2), 3
  end
  if size == 0 or from + size - 1 > #data then
    return { kind = "single", failed = "a single frame of an impossible length" }
  end
  return whole_frame("single", data:sub(from, from + size - 1), size)
end

local function lost(receiver, why)
  local part = receiver.part
  receiver.part = nil
  return part and ("the message of frame %d is lost: %s"):format(part.frames[1], why) or nil
end

local function first(receiver, data, number, time)
  local size = #data >= 2 and data:byte(1) % 16 * 256 + data:byte(2) or 0
  if #data < 8 or size <= #data - 2 or size > longest then
    return { kind = "first", size = size, failed = "a first frame of an impossible length" }
  end
  receiver.part = { size = size, have = #data - 2, next = 1, full = #data, time = time, frames = { number },
    pieces = { data:sub(3) } }
  return { kind = "first", size = size, first = number }
end

local function consecutive(receiver, data, number, time)
  local sequence, part = data:byte(1) % 16, receiver.part
  local info = { kind = "consecutive", sequence = sequence }
  if not part then
    info.orphan = true
    return info
  elseif time - part.time > patience then
    info.failed = lost(receiver, "no consecutive frame in time (N_Cr)")
    return info
  elseif sequence ~= part.next then
    info.failed = lost(receiver, "wrong sequence number")
    return info
  end
  local wanted = math.min(part.size - part.have, part.full - 1)
  if #data - 1 < wanted or #data > part.full then
    info.failed = "a consecutive frame of an impossible length, which is passed over"
    return info
  end
  info.first = part.frames[1]
  part.frames[#part.frames + 1] = number
  part.pieces[#part.pieces + 1] = data:sub(2, wanted + 1)
  part.have, part.next, part.time = part.have + wanted, (part.next + 1) % 16, time
  if part.have == part.size then
    info.payload, info.frames, info.size = table.concat(part.pieces), part.frames, part.size
    for _, each in ipairs(part.frames) do
      if frames[each] then
        frames[each].joined_in = number
      end
    end
    receiver.part = nil
  end
  return info
end

local function flow_control(data)
  if #data < 3 then
    return { kind = "flow", failed = "flow control of less than 3 bytes" }
  end
  return { kind = "flow", flow = data:byte(1) % 16, block = data:byte(2), gap = data:byte(3) }
end

-- Describes frame `number` of a capture, with `data`: a table with `kind` ("single", "first", "consecutive", "flow" or
-- nil), `payload` if the datagram is complete, its `frames`, and `failed`. `key`: bus and id. `visited`: true if the
-- frame was read before.
function M.look(key, data, number, time, visited)
  if visited and frames[number] then
    return frames[number]
  end
  local receiver = receivers[key]
  if not receiver then
    receiver = {}
    receivers[key] = receiver
  end
  local info
  local kind = #data > 0 and math.floor(data:byte(1) / 16) or -1
  if kind == 0 or kind == 1 then
    local before = lost(receiver, "interrupted by another transfer")
    info = kind == 0 and single(data) or first(receiver, data, number, time)
    info.failed = info.failed or before
  elseif kind == 2 then
    info = consecutive(receiver, data, number, time)
  elseif kind == 3 then
    info = flow_control(data)
  else
    info = { failed = #data == 0 and "an empty frame" or "no kind of ISO-TP frame" }
  end
  frames[number] = info
  return info
end

return M
