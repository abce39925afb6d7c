-- SPDX-License-Identifier: GPL-3.0-or-later
-- The fields of an R4 datagram: the state's in the order of the wire, with the units that r4 convert writes into CSV,
-- and the commands' values, named as in r4 send --help. tests/integration/test_wireshark.py compares both with r4.

-- What the values of a form are called ("": the field itself), their types in Wireshark, and their units.
local forms = {
  volts = { { "", "double", "V" } },
  flag = { { "", "uint8", "0/1" } },
  drive = { { "pwm", "uint16", "0-4095" }, { "direction", "uint8", "0/1" } },
  bldc = { { "speed", "uint16", "0-4095" }, { "direction", "uint8", "0/1" }, { "brake", "uint8", "0/1" } },
  steps = { { "", "int32", "steps" } },
  servo = { { "", "uint16", "us" } },
  counts = { { "", "int32", "counts" } },
  speed = { { "", "int32", "counts/s" } },
  distance = { { "", "uint16", "cm" } },
  relays = { { "", "uint8", "bits" } },
  reason = { { "", "uint32", "reason" } },
  pnum = { { "", "uint32", "PNum" } },
  datagrams = { { "", "uint32", "datagrams" } },
  commands = { { "", "uint32", "commands" } },
  periods = { { "", "uint32", "periods" } },
  reading = { { "t", "uint32", "ms" }, { "errors", "uint32", "transfers" }, { "bytes", "string", "hex" } },
  answer = { { "command", "uint32", "PNum" }, { "outcome", "uint8", "0-3" }, { "bytes", "string", "hex" } },
  bus = { { "outcome", "uint8", "0-3" }, { "errors", "uint32", "transfers" }, { "recoveries", "uint32", "times" } },
  received = { { "position", "uint32", "bytes" }, { "lost", "uint32", "bytes" }, { "bytes", "string", "hex" } },
  voltage = { { "", "uint16", "mV" } },
  fault = { { "chip", "uint8", "address" }, { "trouble", "uint8", "bits" } },
}

local state = {}
local function add(form, names)
  for name in names:gmatch("%S+") do
    state[#state + 1] = { name = name, form = form }
  end
end
local function numbered(form, pattern, first, last)
  for n = first, last do
    add(form, pattern:format(n))
  end
end

add("volts", "AIN24 AIN12 AIN5 AINDMH")
add("flag", "DMHSTA")
add("volts", "AINSTEER")
add("drive", "DHB1A OSMC1")
add("steps", "STEP1POS")
add("servo", "SERVO1POS")
add("volts", "AIN6")
add("drive", "DHB1B DHB2A DHB2B OSMC2 OSMC3 OSMC4")
numbered("steps", "STEP%dPOS", 2, 4)
numbered("servo", "SERVO%dPOS", 2, 16)
numbered("counts", "ENC%d", 1, 4)
numbered("distance", "US%d", 1, 4)
numbered("bldc", "BLDC%d", 1, 4)
add("relays", "RELAYS")
add("reason", "SAFE")
add("pnum", "CMD")
add("datagrams", "RXOK RXCRC RXLOST RXDUP")
add("commands", "RXREF")
add("periods", "LATE")
numbered("speed", "ENC%dHZ", 1, 4)
numbered("counts", "ENC%dIDX", 1, 4)
numbered("reading", "I2C%d", 1, 8)
add("answer", "I2CX")
add("bus", "I2CBUS")
numbered("received", "UART%d", 1, 2)
numbered("voltage", "DAC%d", 1, 2)
add("relays", "GPIO")
add("fault", "FAULT")

-- A command's values in their order. `last` takes all that are left, one by one; `maybe` may be left out.
local commands = {
  O = { title = "OSMC motor driver", { "pwm", "uint16" }, { "dir", "uint8" }, { "ch", "uint8" } },
  D = { title = "DHB12 motor driver", { "pwm", "uint16" }, { "dir", "uint8" }, { "ch", "uint8" } },
  S = { title = "servo pulse width", { "us", "uint16" }, { "ch", "uint8" } },
  R = { title = "relay", { "ch", "uint8" }, { "on", "switch" } },
  P = { title = "stepper target", { "pos", "int32" }, { "speed", "uint16", maybe = true }, { "ch", "uint8" } },
  Z = { title = "position to zero", { "ch", "uint8" } },
  B = { title = "brushless motor driver", { "speed", "uint16" }, { "dir", "uint8" }, { "brake", "uint8" },
    { "ch", "uint8" } },
  U = { title = "proximity threshold", { "cm", "uint16" }, { "ch", "uint8" } },
  E = { title = "emergency", { "word", "string" }, { "cause", "uint32", last = true } },
  F = { title = "state fields wanted", { "name", "string", last = true } },
  C = { title = "setting", { "key", "string" }, { "value", "string", last = true } },
  X = { title = "the user's devices", { "word", "string" }, { "value", "string", last = true } },
  Q = { title = "question", { "word", "string" } },
  W = { title = "watch", { "rate", "uint16" }, { "name", "string", last = true } },
  H = { title = "heartbeat", { "word", "string" } },
}

-- What else a board says, field by field.
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
