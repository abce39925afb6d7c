-- SPDX-License-Identifier: GPL-3.0-or-later
-- R4 for Wireshark: shows the datagrams of R4 boards and their hosts on UDP, on SocketCAN, and in recordings from
-- r4 convert. Installation and use: docs/how-to/wireshark.md. Fields: docs/reference/protocol.md and can.md.

-- Wireshark may find this file in the personal folder and in the package's folder. Only the first file is used.
if package.loaded.r4_dissector then
  return
end
package.loaded.r4_dissector = true

local datagram = require("r4_datagram")
local packed = require("r4_packed")
local isotp = require("r4_isotp")
local link = require("r4_link")
local tree_of = require("r4_tree")
local tables = require("r4_fields")

local r4 = Proto("r4", "R4 robot control board")

local field = tree_of.proto_field
local can_kind = field("string", "r4.can.kind", "Frame")
local can_node = field("uint8", "r4.can.node", "Node")
local isotp_size = field("uint32", "r4.isotp.size", "ISO-TP message (bytes)")
local isotp_sequence = field("uint8", "r4.isotp.sequence", "Sequence number")
local isotp_flow = field("uint8", "r4.isotp.flow", "Flow control", { [0] = "go on", [1] = "wait", [2] = "too long" })
local isotp_block = field("uint8", "r4.isotp.block", "Block size")
local isotp_gap = field("uint8", "r4.isotp.stmin", "STmin")
local isotp_first = field("framenum", "r4.isotp.first", "Begins in")
local isotp_joined = field("framenum", "r4.isotp.joined_in", "Joined in")
local isotp_frame = field("framenum", "r4.isotp.frame", "Frame of the message")
r4.fields = tree_of.list

local group, severity = expert.group, expert.severity
local experts = {
  crc = ProtoExpert.new("r4.expert.crc", "The checksum is wrong", group.CHECKSUM, severity.ERROR),
  malformed = ProtoExpert.new("r4.expert.malformed", "No datagram", group.MALFORMED, severity.ERROR),
  values = ProtoExpert.new("r4.expert.values", "Values that are none of the field's", group.PROTOCOL, severity.WARN),
  packed = ProtoExpert.new("r4.expert.packed", "No packed form", group.MALFORMED, severity.ERROR),
  lost = ProtoExpert.new("r4.expert.lost", "Packet numbers are missing", group.SEQUENCE, severity.WARN),
  late = ProtoExpert.new("r4.expert.late", "Overtaken by a newer datagram", group.SEQUENCE, severity.NOTE),
  copy = ProtoExpert.new("r4.expert.duplicate", "This packet number came before", group.SEQUENCE, severity.NOTE),
  repeats = ProtoExpert.new("r4.expert.repeated", "A command is sent again", group.SEQUENCE, severity.NOTE),
  unanswered = ProtoExpert.new("r4.expert.unanswered", "Nothing confirms this command", group.RESPONSE_CODE,
    severity.WARN),
  refused = ProtoExpert.new("r4.expert.refused", "The board refuses a command", group.RESPONSE_CODE, severity.WARN),
  safe = ProtoExpert.new("r4.expert.safe", "The outputs become safe, or leave it", group.RESPONSE_CODE, severity.NOTE),
  isotp = ProtoExpert.new("r4.expert.isotp", "An ISO-TP transfer has failed", group.REASSEMBLE, severity.WARN),
}
local list = {}
for _, each in pairs(experts) do
  list[#list + 1] = each
end
r4.experts = list

local can_id = Field.new("can.id")
local can_extended = Field.new("can.flags.xtd")
local can_remote = Field.new("can.flags.rtr")
local interface_id = Field.new("frame.interface_id")

function r4.init()
  isotp.reset()
  link.reset()
end

-- --- notes on a datagram, in addition to its fields

local function show_command(item, command, visited)
  if command.answer then
    item:add(tree_of.response_in, command.answer):set_generated()
  elseif visited and link.is_open(command) then
    item:add_proto_expert_info(experts.unanswered, "Nothing confirms this command")
  end
end

local function show_answers(item, answers)
  for _, each in ipairs(answers) do
    local us = math.floor(each.took * 1e6 + 0.5)
    local seconds = math.floor(us / 1e6)
    item:add(tree_of.response_to, each.request):set_generated()
    item:add(tree_of.response_time, NSTime(seconds, (us - seconds * 1e6) * 1000)):set_generated()
    item:add(tree_of.response_by, each.by):set_generated()
  end
end

local function show_notes(item, frame, visited)
  local notes = link.notes(frame)
  if not notes then
    return
  end
  if notes.lost then
    item:add(tree_of.lost, notes.lost):set_generated()
    item:add_proto_expert_info(experts.lost, notes.lost == 1 and ("PNum %.0f is missing"):format(notes.lost_from) or
      ("%.0f PNum are missing, from %.0f on"):format(notes.lost, notes.lost_from))
  end
  if notes.late then
    item:add_proto_expert_info(experts.late, ("%d newer ones came before"):format(notes.late))
  end
  if notes.copy_of then
    item:add(tree_of.copy_of, notes.copy_of):set_generated()
    item:add_proto_expert_info(experts.copy)
  end
  if notes.repeats then
    item:add(tree_of.copy_of, notes.repeats):set_generated()
    item:add_proto_expert_info(experts.repeats)
  end
  if notes.safe then
    item:add_proto_expert_info(experts.safe, notes.safe == 0 and "The outputs are released" or
      "The outputs are safe: " .. (tables.reasons[notes.safe] or "fault"))
  end
  if notes.command then
    show_command(item, notes.command, visited)
  end
  if notes.answers then
    show_answers(item, notes.answers)
  end
end

local function show_checksum(item, tvb, at, read)
  if not read.trailer then
    return
  end
  local range = tvb(at + read.trailer - 1, read.trailer_size)
  item:add(tree_of.crc, range, read.found)
  local right = read.found == read.expected
  item:add(tree_of.crc_status, range, right and 1 or 0):set_generated()
  if not right then
    item:add(tree_of.crc_expected, range, read.expected):set_generated()
    item:add_proto_expert_info(experts.crc,
      ("The checksum is wrong: 0x%x, and 0x%x is right; nobody uses this datagram"):format(read.found, read.expected))
  end
end

-- The fields for the list of packets, shortened.
local function summary(text, read)
  local shown = text:sub(1, (read.trailer or #text + 1) - 1)
  if read.error then
    shown = shown:gsub("[^ -~]", ".")
  end
  if #shown > 160 then
    shown = shown:sub(1, 157) .. "..."
  end
  return shown
end

-- `text`: the datagram, all of `tvb`. `where`: the keys of its link and its bus, and the size in packed form.
local function show_datagram(text, tvb, pinfo, tree, where)
  local read = datagram.read(text)
  local kind, from = "damaged", nil
  if read[1] then
    kind, from = datagram.kind(read)
    from = from or where.from
  end
  local item = tree:add(r4, tvb(), "R4 datagram: " .. (from and from .. ", " or "") .. kind)
  local good = not read.error and read.found == read.expected
  if good then
    read.kind, read.from = kind, from
    local pnum = datagram.field(read, "PNum")
    read.pnum = pnum and datagram.whole(pnum.values, 0, 4294967295)
    if not pinfo.visited then
      link.look(where.link, where.bus, read, pinfo.number, pinfo.rel_ts)
    end
  end
  item:add(tree_of.type, kind):set_generated()
  if from then
    item:add(tree_of.from, from):set_generated()
  end
  if where.packed then
    item:add(tree_of.packed, where.packed):set_generated()
  end
  for index = 1, #read do
    if tree_of.add_field(item, tvb, 0, read[index], from == "host") == false then
      item:add_proto_expert_info(experts.values, ("%s has values that are none of its form"):format(read[index].name))
    end
  end
  show_checksum(item, tvb, 0, read)
  if read.error then
    item:add_proto_expert_info(experts.malformed, ("No datagram: byte %d: %s"):format(read.at, read.error))
  end
  if good then
    show_notes(item, pinfo.number, pinfo.visited)
    if kind == "refusal" then
      item:add_proto_expert_info(experts.refused, "The board refuses a command: " .. read[1].values)
    end
  end
  pinfo.cols.protocol = "R4"
  pinfo.cols.info = (from and from .. ": " or "") .. summary(text, read) ..
    (good and "" or read.error and "  [no datagram]" or "  [wrong checksum]")
end

-- --- UDP

local function on_udp(text, tvb, pinfo, tree)
  local src, dst = tostring(pinfo.src) .. ":" .. pinfo.src_port, tostring(pinfo.dst) .. ":" .. pinfo.dst_port
  -- Both directions have the same key.
  local where = { link = src < dst and src .. "|" .. dst or dst .. "|" .. src, bus = "udp" }
  if pinfo.src_port == 2018 then
    where.from = "board"
  elseif pinfo.dst_port == 2018 then
    where.from = "host"
  end
  show_datagram(text, tvb, pinfo, tree, where)
end

-- --- CAN

local lanes = {
  [0x180] = { "host", "to board %d" }, [0x200] = { "board", "answer of board %d" },
  [0x400] = { "board", "telemetry of board %d" },
}

local function bus_of()
  local id = interface_id()
  return id and "can" .. tostring(id.value) or "can"
end

local function raw_frame(tvb, pinfo, tree, kind, text)
  local item = tree:add(r4, tvb(), "R4 frame: " .. text)
  item:add(tree_of.type, kind):set_generated()
  pinfo.cols.protocol = "R4"
  pinfo.cols.info = text
  return item
end

local function on_stop(tvb, pinfo, tree, number)
  local item = raw_frame(tvb, pinfo, tree, "emergency_stop",
    "host: emergency stop of every board" .. (number and (", number %d"):format(number) or ""))
  item:add(tree_of.from, "host"):set_generated()
  if number then
    item:add(tree_of.stop_number, number):set_generated()
    if not pinfo.visited then
      link.look_at_stop(bus_of(), number, pinfo.number, pinfo.rel_ts)
    end
    show_notes(item, pinfo.number, pinfo.visited)
  end
end

local function on_went_safe(tvb, pinfo, tree, node)
  local reason = tvb:len() > 0 and tvb(0, 1):uint() or nil
  local item = raw_frame(tvb, pinfo, tree, "went_safe", ("board: board %d went safe: %s"):format(node,
    reason and (tables.reasons[reason] or "fault") or "no reason told"))
  item:add(tree_of.from, "board"):set_generated()
  item:add(can_node, node):set_generated()
  if reason then
    item:add(tree_of.safe, tvb(0, 1), reason)
  end
end

local function frame_text(info)
  if info.kind == "first" then
    return ("first frame of %d bytes"):format(info.size)
  elseif info.kind == "consecutive" then
    return ("consecutive frame %d"):format(info.sequence)
  elseif info.kind == "flow" and info.flow then
    return "flow control: " .. (({ [0] = "go on", "wait", "too long" })[info.flow] or "reserved")
  end
  return (info.kind or "unknown") .. " frame"
end

local function show_isotp(item, info)
  item:add(can_kind, frame_text(info)):set_generated()
  if info.sequence then
    item:add(isotp_sequence, info.sequence):set_generated()
  end
  if info.flow then
    item:add(isotp_flow, info.flow):set_generated()
    item:add(isotp_block, info.block):set_generated()
    item:add(isotp_gap, info.gap):set_generated()
  end
  if info.size then
    item:add(isotp_size, info.size):set_generated()
  end
  if info.frames then
    for _, each in ipairs(info.frames) do
      item:add(isotp_frame, each):set_generated()
    end
  elseif info.first then
    item:add(isotp_first, info.first):set_generated()
    if info.joined_in then
      item:add(isotp_joined, info.joined_in):set_generated()
    end
  end
  if info.failed then
    item:add_proto_expert_info(experts.isotp, "ISO-TP: " .. info.failed)
  end
end

local function bytes_as_tvb(bytes, title)
  return ByteArray.new(bytes, true):tvb(title)
end

local function show_message(info, pinfo, tree, item, where)
  local text = info.payload
  if text:byte(1) >= 0x80 then
    local plain, why = packed.unpack(text)
    if not plain then
      item:add_proto_expert_info(experts.packed, "No packed form: " .. why)
      pinfo.cols.info:append("  [no packed form: " .. why .. "]")
      return
    end
    where.packed, text = #text, plain
  end
  show_datagram(text, bytes_as_tvb(text, where.packed and "Unpacked datagram" or "Datagram"), pinfo, tree, where)
end

local function on_lane(tvb, pinfo, tree, id, node, lane)
  local data, bus = tvb:len() > 0 and tvb:raw() or "", bus_of()
  local info = isotp.look(bus .. ":" .. id, data, pinfo.number, pinfo.rel_ts, pinfo.visited)
  local title = lane[2]:format(node)
  local item = tree:add(r4, tvb(), "R4 on CAN, " .. title)
  item:add(can_node, node):set_generated()
  show_isotp(item, info)
  pinfo.cols.protocol = "R4"
  pinfo.cols.info = ("%s: %s, %s%s"):format(lane[1], title, frame_text(info),
    info.failed and "  [" .. info.failed .. "]" or "")
  if info.payload then
    show_message(info, pinfo, tree, item, { link = bus .. ":" .. node, bus = bus, from = lane[1] })
  end
end

-- True if the frame belongs to R4.
local function on_can(tvb, pinfo, tree)
  local id, extended, remote = can_id(), can_extended(), can_remote()
  if not id or (remote and remote.value) then
    return false
  end
  id = id.value
  if extended and extended.value then
    if math.floor(id / 0x40000) ~= 0x010 then
      return false
    end
    on_stop(tvb, pinfo, tree, id % 0x40000)
    return true
  end
  local node = id % 32
  local base_id = id - node
  if id == 0x010 then
    on_stop(tvb, pinfo, tree, nil)
  elseif base_id == 0x020 then
    on_went_safe(tvb, pinfo, tree, node)
  elseif base_id == 0x600 then
    raw_frame(tvb, pinfo, tree, "watch", ("watcher: asks board %d for states"):format(node)):add(can_node, node)
      :set_generated()
  elseif lanes[base_id] then
    on_lane(tvb, pinfo, tree, id, node, lanes[base_id])
  else
    return false
  end
  return true
end

-- --- registration

function r4.dissector(tvb, pinfo, tree)
  local size = tvb:len()
  if size > 0 then
    on_udp(tvb:raw(), tvb, pinfo, tree)
  end
  return size
end

-- Other ports: true for a datagram with a right checksum.
local function is_datagram(tvb, pinfo, tree)
  local size = tvb:len()
  if size < 8 or size > datagram.longest + 2 then
    return false
  end
  local text = tvb:raw()
  if not text:find("%^0x%x%x?%x?%x?%x?%x?%x?%x?%^[\r\n]*$", -13) then
    return false
  end
  local read = datagram.read(text)
  if read.error or read.found ~= read.expected then
    return false
  end
  on_udp(text, tvb, pinfo, tree)
  return true
end

local ports = DissectorTable.get("udp.port")
ports:add(2018, r4)
ports:add(2390, r4)
r4:register_heuristic("udp", is_datagram)
r4:register_heuristic("can", on_can)
