-- SPDX-License-Identifier: GPL-3.0-or-later
-- Compares a datagram with the datagrams before and after it. Finds packet numbers that are missing, late or duplicated
-- (docs/reference/protocol.md, 4.5), the datagram that confirms a command, the time from the command, and the moment
-- when outputs became safe. A capture is analysed once, when it is read. notes(frame) returns the result for a frame.

local datagram = require("r4_datagram")

local M = {}

local window, far = 64, 65536
local most_sequences = 8 -- of one direction: programs that share a transport, answers to hosts without control

local links, notes, stops = {}, {}, {}

function M.reset()
  links, notes, stops = {}, {}, {}
end

function M.notes(frame)
  return notes[frame]
end

local function note(frame)
  local each = notes[frame]
  if not each then
    each = {}
    notes[frame] = each
  end
  return each
end

local function ahead(a, b) -- how far a is after b; negative: before b
  local difference = (a - b) % 4294967296
  return difference < 2147483648 and difference or difference - 4294967296
end

-- --- packet numbers

local function begin_sequence(sequences, pnum, frame)
  if #sequences == most_sequences then
    table.remove(sequences, 1)
  end
  sequences[#sequences + 1] = { newest = pnum, [pnum % window] = pnum, frames = { [pnum % window] = frame } }
end

local function took(sequence, pnum, frame)
  sequence[pnum % window], sequence.frames[pnum % window] = pnum, frame
end

-- The count of missing numbers before `pnum`, and the first such number. `beside`: numbers that are not missing (see
-- M.look()).
local function missing(sequence, pnum, step, beside)
  if step > window then
    return step - 1
  end
  local count, from = 0, nil
  for number = sequence.newest + 1, sequence.newest + step - 1 do
    local each = number % 4294967296
    if not beside[each] then
      count, from = count + 1, from or each
    end
  end
  return count, from
end

-- A number that continues no sequence begins a new sequence. `t`: a board's clock. If a datagram has a later `t` but an
-- earlier number, the board has a new host and counts from 1 again.
local function count(sequences, pnum, t, frame, beside, watcher)
  for index = #sequences, 1, -1 do
    local sequence = sequences[index]
    local step = ahead(pnum, sequence.newest)
    if step <= 0 and t and sequence.t and ahead(t, sequence.t) > 0 then
      table.remove(sequences, index)
      break
    elseif step > 0 and step <= far then
      local lost, from = missing(sequence, pnum, step, beside)
      sequence.watcher = sequence.watcher or watcher
      if lost > 0 and not sequence.watcher then
        note(frame).lost = lost
        note(frame).lost_from = from or (sequence.newest + 1) % 4294967296
      end
      sequence.newest, sequence.t = pnum, t
      return took(sequence, pnum, frame)
    elseif step <= 0 and step > -window then
      if sequence[pnum % window] == pnum then
        note(frame).copy_of = sequence.frames[pnum % window]
      else
        note(frame).late = -step
        took(sequence, pnum, frame)
      end
      return
    end
  end
  begin_sequence(sequences, pnum, frame)
  sequences[#sequences].watcher, sequences[#sequences].t = watcher, t
end

-- --- commands and their confirmations

local drives = { "DHB1A", "DHB1B", "DHB2A", "DHB2B" }
-- The state field that shows a command, and its values, for boards that send no CMD.
local shows = {
  O = function(v) return "OSMC" .. (v[3] or ""), (v[1] or "") .. "," .. (v[2] or "") end,
  D = function(v) return drives[tonumber(v[3])], (v[1] or "") .. "," .. (v[2] or "") end,
  S = function(v) return "SERVO" .. (v[2] or "") .. "POS", v[1] end,
  B = function(v) return "BLDC" .. (v[4] or ""), table.concat(v, ",", 1, math.min(#v, 3)) end,
}

local function answered(link, pnum, frame, time, by)
  local command = link.pending[pnum]
  if not command or command.answer then
    return
  end
  link.pending[pnum] = nil
  command.answer, command.by = frame, by
  local mine = note(frame)
  mine.answers = mine.answers or {}
  mine.answers[#mine.answers + 1] = { request = command.frame, took = time - command.time, by = by }
end

local function on_command(link, fields, frame, time)
  local pnum = fields.pnum
  local before = link.pending[pnum] or link.last[pnum % window]
  if before and before.pnum == pnum and time - before.time < 60 then
    if before.frame ~= frame then
      note(frame).repeats = before.frame
    end
    return
  end
  local command = { pnum = pnum, frame = frame, time = time, link = link }
  for _, each in ipairs(fields) do
    local show = shows[each.name]
    if show then
      local name, values = show(datagram.values_of(each))
      if name then
        command.shows = command.shows or {}
        command.shows[name] = values
      end
    end
  end
  link.pending[pnum], link.last[pnum % window] = command, command
  if command.shows then
    link.shown[#link.shown + 1] = command
    if #link.shown > window then
      table.remove(link.shown, 1)
    end
  end
  note(frame).command = command
end

-- For a board without CMD: the first state with the commanded values confirms a command.
local function look_for_values(link, fields, frame, time)
  for index = #link.shown, 1, -1 do
    local command, all = link.shown[index], true
    for name, values in pairs(command.shows) do
      local field = datagram.field(fields, name)
      all = all and field ~= nil and field.values == values
    end
    if all then
      answered(link, command.pnum, frame, time, "the state shows it")
    end
    if command.answer then
      table.remove(link.shown, index)
    end
  end
end

local function number_of(fields, name)
  local field = datagram.field(fields, name)
  return field and datagram.whole(field.values, 0, 4294967295)
end

local function on_board(link, bus, fields, frame, time)
  local cmd = number_of(fields, "CMD")
  if cmd then
    link.tells_cmd = true
    if link.pending[cmd] then
      answered(link, cmd, frame, time, "CMD")
    end
  elseif fields.kind == "state" and #link.shown > 0 and not link.tells_cmd then
    look_for_values(link, fields, frame, time)
  end
  if fields.kind == "refusal" then
    local values = datagram.values_of(fields[1])
    local pnum = datagram.whole(values[1] or "", 0, 4294967295)
    if pnum and (values[2] ~= "DUPLICATE" or not link.tells_cmd) then
      answered(link, pnum, frame, time, values[2] or "refusal")
    end
  elseif fields.kind == "identity" then
    local asked = number_of(fields, "ASKED")
    if asked then
      answered(link, asked, frame, time, "ASKED")
    end
  elseif fields.kind == "heartbeat" then
    local stop = number_of(fields, "STOP")
    local pressed = stop and stops[bus .. ":" .. stop]
    if pressed and not pressed.answer then
      link.pending[stop] = pressed
    end
    if stop then
      answered(link, stop, frame, time, "STOP")
    end
  end
  local safe = number_of(fields, "SAFE") or (fields.kind == "heartbeat" and 0 or nil)
  if safe and safe ~= link.safe then
    if safe ~= 0 or link.safe then
      note(frame).safe = safe
    end
    link.safe = safe
  end
end

-- Answers to a host without control are counted separately. While states are counted for a watcher, heartbeats have the
-- numbers of the host. So these datagrams get no notes, but their numbers do not count as missing. A watcher's numbers
-- never count as missing: a watcher is not heard while another program drives the board over a shared transport.
local answers = { refusal = true, identity = true }

-- Takes a valid datagram: `fields` with kind, from and pnum (or nil). `key`: of board and host; `bus`: of transport.
function M.look(key, bus, fields, frame, time)
  local link = links[key]
  if not link then
    link = { board = {}, host = {}, beside = {}, pending = {}, last = {}, shown = {} }
    links[key] = link
  end
  local pnum, watches = fields.pnum, fields.kind == "command" and datagram.field(fields, "W") ~= nil
  if pnum and fields.from and not (fields.kind == "heartbeat" and fields.from == "board" and pnum == 0) then
    local last = link.last[pnum % window]
    if fields.from == "board" and (answers[fields.kind] or (link.watched and fields.kind == "heartbeat")) then
      link.beside[pnum] = true
    elseif not (fields.kind == "command" and last and last.pnum == pnum) then
      local t = fields.from == "board" and number_of(fields, "T")
      count(link[fields.from], pnum, t or nil, frame, link.beside, watches)
    end
  end
  if fields.from == "board" then
    on_board(link, bus, fields, frame, time)
  elseif fields.kind == "command" then
    if watches then
      link.watched = true
    elseif pnum then
      on_command(link, fields, frame, time)
    end
  end
end

-- Takes the frame of an emergency stop with a number.
function M.look_at_stop(bus, number, frame, time)
  local key = bus .. ":" .. number
  local before = stops[key]
  if before then
    if before.frame ~= frame then
      note(frame).repeats = before.frame
    end
    return
  end
  stops[key] = { pnum = number, frame = frame, time = time, stop = true }
  note(frame).command = stops[key]
end

-- True for an unconfirmed command that the board could confirm. A board without CMD does not confirm a command that no
-- state field shows.
function M.is_open(command)
  return not command.answer and (command.stop or command.shows ~= nil or command.link.tells_cmd)
end

return M
