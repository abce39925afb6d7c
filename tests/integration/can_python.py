# SPDX-License-Identifier: GPL-3.0-or-later
"""A host and a board on a CAN bus, frame by frame on python-can.

A second implementation, written from docs/reference/protocol.md, docs/reference/can.md and
docs/reference/packed.md, without code of r4. No function sleeps: each function waits for frames until a deadline.
"""
import random
import threading
import time
import zlib

import can

import packed_form

N_BS_S, N_CR_S = 0.020, 0.100
EMERGENCY_STOP, WENT_SAFE, TO_BOARD, REPLIES, TELEMETRY = 0x010, 0x020, 0x180, 0x200, 0x400
FD_SIZES = (*range(9), 12, 16, 20, 24, 32, 48, 64)
# Refusals that end a command. DUPLICATE does not end a command. A real host also compares SESSION (protocol.md, rule 13).
CODES = 'UNKNOWN FORMAT RANGE CHANNEL STALE SAFE BUSY AUTH'.split()
STATE_PERIOD_S, HEARTBEAT_S, HOST_HEARTBEAT_S, RETRY_S = 0.05, 0.5, 0.1, 0.05


# --- datagrams (protocol.md, 1)

def datagram(fields, pnum, time_ms, session=None):
    named = f'SID:{session};' if session else ''
    text = f'{fields};{named}PNum:{pnum};T:{time_ms};^'
    return f'{text}0x{zlib.crc32(text.encode()):x}^'


def heartbeat(fields, pnum, time_ms, safe=''):
    text = f'{fields};PNum:{pnum};T:{time_ms};{safe}^'
    return f'{text}0x{zlib.crc32(text.encode()):x}^'


def read(text):
    """Returns the fields by name, or None if the checksum is wrong."""
    body, _, checksum = text[:-1].rpartition('^0x')
    if zlib.crc32((body + '^').encode()) != int(checksum, 16):
        return None
    return dict(field.split(':', 1) for field in body[:-1].split(';'))


# --- ISO-TP (can.md)

class Receiver:
    """Joins the frames of one id. `answer` sends flow control. If `answer` is None, the receiver only listens."""

    def __init__(self, answer=None, block_size=0, stmin=0):
        self.answer, self.block_size, self.stmin = answer, block_size, stmin
        self.message, self.size, self.serial, self.last, self.block = None, 0, 0, 0.0, 0
        self.failed = self.answered = 0

    def on_frame(self, data, now):
        """Returns the message that the frame completes, or None."""
        kind = data[0] >> 4 if data else 15
        if kind == 0:
            size, start = (data[0] & 15, 1) if len(data) <= 8 else (data[1], 2)
            return bytes(data[start:start + size]) if 0 < size <= len(data) - start else None
        if kind == 1 and len(data) >= 8:
            self.failed += self.message is not None
            self.size = (data[0] & 15) << 8 | data[1]
            self.message, self.serial, self.last, self.block = bytearray(data[2:]), 1, now, 0
            self._flow_control()
        elif kind == 2 and self.message is not None:
            if data[0] & 15 != self.serial or now - self.last > N_CR_S:
                self.message = None
                self.failed += 1
                return None
            self.message += data[1:]
            self.serial, self.last, self.block = (self.serial + 1) & 15, now, self.block + 1
            if len(self.message) >= self.size:
                whole, self.message = bytes(self.message[:self.size]), None
                return whole
            if self.block == self.block_size:
                self.block = 0
                self._flow_control()
        return None

    def _flow_control(self):
        if self.answer:
            self.answered += 1
            self.answer(bytes([0x30, self.block_size, self.stmin]))
            self.last = time.time()  # the same clock as the times of the frames


class Peer:
    """One end of a bus, which sends and receives frames. `on_message` gets each whole message."""

    def __init__(self, interface, own_id, other_id, ids, fd=False):
        self.fd, self.own_id, self.other_id = fd, own_id, other_id
        filters = [{'can_id': each, 'can_mask': 0x7FF, 'extended': False} for each in ids]
        filters.append({'can_id': EMERGENCY_STOP << 18, 'can_mask': 0x7FF << 18, 'extended': True})
        if isinstance(interface, can.BusABC):
            self.bus = interface
            self.bus.set_filters(filters)
        else:
            self.bus = can.Bus(interface='socketcan', channel=interface, fd=True, can_filters=filters)
        self.receivers = {}
        self.flow_control = None  # the newest flow control, while a sender waits for it
        self.failed_sends = 0

    def close(self):
        self.bus.shutdown()

    def send_frame(self, identifier, data, raw=False):
        fd = self.fd and not raw
        size = next(each for each in FD_SIZES if each >= len(data))
        self.bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, is_fd=fd, bitrate_switch=fd,
                                  data=bytes(data).ljust(size, b'\xcc')))

    def send_message(self, identifier, message, flow_control=True):
        """Sends a whole message, and handles frames that arrive meanwhile. False if no receiver accepts the message."""
        longest = 64 if self.fd else 8
        if len(message) <= 7:
            self.send_frame(identifier, bytes([len(message)]) + message)
            return True
        if self.fd and len(message) <= 62:
            self.send_frame(identifier, bytes([0, len(message)]) + message)
            return True
        self.flow_control = None
        self.send_frame(identifier, bytes([0x10 | len(message) >> 8, len(message) & 255]) + message[:longest - 2])
        rest, serial, block, gap = message[longest - 2:], 1, 0, 0.0
        waiting = flow_control
        while rest:
            if waiting:
                if not self._await_flow_control():
                    self.failed_sends += 1
                    return False
                _, block, stmin = self.flow_control[:3]
                gap = stmin / 1e3 if stmin < 0x80 else (stmin & 15) / 1e4 if 0xF1 <= stmin <= 0xF9 else 0.127
                self.flow_control, waiting = None, False
            self.send_frame(identifier, bytes([0x20 | serial]) + rest[:longest - 1])
            rest, serial = rest[longest - 1:], (serial + 1) & 15
            if rest and gap:
                self.take_frames_until(time.monotonic() + gap, lambda: False)
            if block:
                block -= 1
                waiting = block == 0
        return True

    def _await_flow_control(self):
        for _ in range(10):
            self.take_frames_until(time.monotonic() + N_BS_S, lambda: self.flow_control)
            if not self.flow_control or self.flow_control[0] == 0x30:
                break
            if self.flow_control[0] != 0x31:
                return False
            self.flow_control = None
        return bool(self.flow_control)

    def take_frames_until(self, deadline, done):
        while not done():
            left = deadline - time.monotonic()
            frame = self.bus.recv(timeout=max(0, left))
            if frame is not None and not frame.is_remote_frame:
                if not frame.is_extended_id:
                    self.on_frame(frame)
                elif frame.arbitration_id >> 18 == EMERGENCY_STOP:
                    self.on_numbered_stop(frame.arbitration_id & 0x3FFFF)
            elif left <= 0:
                return False
        return True

    def on_frame(self, frame):
        data = bytes(frame.data)
        if frame.arbitration_id == self.other_id and data and data[0] >> 4 == 3:
            self.flow_control = data
            return
        receiver = self.receivers.get(frame.arbitration_id)
        if receiver is None:
            self.on_raw_frame(frame.arbitration_id, data)
            return
        message = receiver.on_frame(data, frame.timestamp)
        if message:
            packed = message[0] >= 0x80
            self.on_text(packed_form.unpack(message) if packed else message.decode('ascii'), packed)

    def on_raw_frame(self, identifier, data):
        raise NotImplementedError

    def on_numbered_stop(self, number):
        pass

    def on_text(self, text, packed):
        raise NotImplementedError


# --- a host

class Host(Peer):
    """A host (protocol.md, 4.1) of one board."""

    def __init__(self, interface, node, fd=False, block_size=0, stmin=0, packs=True):
        super().__init__(interface, TO_BOARD + node, REPLIES + node,
                         [REPLIES + node, TELEMETRY + node, WENT_SAFE + node], fd)
        self.receivers = {REPLIES + node: Receiver(lambda data: self.send_frame(self.own_id, data), block_size, stmin),
                          TELEMETRY + node: Receiver()}
        self.session = f'{random.randrange(1, 2 ** 64):016x}'
        self.pnum = random.randrange(2 ** 32)
        self.board_time = 0
        self.cause = 0  # from the newest heartbeat
        self.beats = True
        self.echoed = False
        self.packs = packs
        self.next_beat = 0.0
        self.newest_command = ''
        self.heard = []      # (text, fields, packed), in their order
        self.went_safe = []  # (time, reason)

    def on_raw_frame(self, identifier, data):
        self.went_safe.append((time.monotonic(), data[0]))

    def on_text(self, text, packed):
        fields = read(text)
        if fields is None:
            return
        self.heard.append((text, fields, packed))
        if fields.get('H') == 'R4-ROS2':
            self.board_time = int(fields['T'])
            self.cause = int(fields.get('CAUSE', 0))
            self.next_beat = 0.0  # answer each heartbeat at once

    def send(self, fields):
        """Sends a new datagram, and returns its number and bytes."""
        self.pnum = (self.pnum + 1) % 2 ** 32
        text = datagram(fields, self.pnum, self.board_time, self.session)
        self._send_text(text)
        return self.pnum, text

    def _send_text(self, text):
        self.send_message(self.own_id, (packed_form.pack(text) if self.packs else None) or text.encode())

    def stop(self):
        self.send_frame(EMERGENCY_STOP, b'', raw=True)

    def run_until(self, done, timeout=10.0, retry=None):
        """Keeps the link until `done()`, and repeats the datagram `retry`."""
        deadline = time.monotonic() + timeout
        next_retry = time.monotonic() + RETRY_S
        while not done():
            now = time.monotonic()
            assert now < deadline, f'not within {timeout} s; heard last: {[each[0] for each in self.heard[-5:]]}'
            if self.beats and now >= self.next_beat:
                self.next_beat = now + HOST_HEARTBEAT_S
                self.echoed = self.board_time != 0
                self.send('H:ROS2-R4')
            if retry and now >= next_retry:
                next_retry = now + RETRY_S
                self._send_text(retry)
            self.take_frames_until(min(deadline, self.next_beat if self.beats else deadline,
                                       next_retry if retry else deadline), done)

    def find(self, is_it, start=0):
        return next((fields for _, fields, _ in self.heard[start:] if is_it(fields)), None)

    def next(self, is_it, timeout=10.0, retry=None):
        """Returns the fields of the next datagram for which `is_it` is true."""
        start = len(self.heard)
        self.run_until(lambda: self.find(is_it, start), timeout, retry)
        return self.find(is_it, start)

    def take_control(self):
        """Waits until the board executes commands. The board must first receive an echo of its T."""
        self.next(lambda fields: 'AIN24' in fields)
        self.run_until(lambda: self.echoed)
        assert self.command('F:DEFAULT,SAFE,CMD') == 'done'

    def command(self, fields):
        """Returns 'done', or the code of the refusal. After STALE (overtaken), repeats the command with a new number."""
        answer = {'N': 'STALE'}
        while answer.get('N', '').endswith('STALE'):
            pnum, self.newest_command = self.send(fields)
            ends = {f'{pnum},{code}' for code in CODES}
            answer = self.next(lambda each: each.get('CMD') == str(pnum) or each.get('N') in ends,
                               retry=self.newest_command)
        return answer['N'].partition(',')[2] if 'N' in answer else 'done'


# --- a board

class Board(Peer):
    """The parts of a board for r4: the link, F, O, Q, E:STOP, E:CLEAR. As a context, the board runs in a thread."""

    def __init__(self, interface, node, fd=False, packs=True, refuses=()):
        super().__init__(interface, REPLIES + node, TO_BOARD + node, [EMERGENCY_STOP, TO_BOARD + node], fd)
        self.receivers = {TO_BOARD + node: Receiver(lambda data: self.send_frame(self.own_id, data))}
        self.node, self.packs, self.refuses = node, packs, refuses
        self.host_packs = False  # true if the newest datagram of the host was packed
        self.offset = random.randrange(2 ** 31)
        self.began = time.monotonic()
        self.state, self.safe, self.pnum = 'CONNECTING', 0, 0
        self.echoable, self.armed, self.host_heard, self.newest = [], False, 0.0, None
        self.session = 0     # the number of the heartbeat that began the session
        self.cause, self.stop_number = random.randrange(2 ** 30), None
        self.fields, self.osmc, self.last_command = [], '0,0', 0
        self.next_state = self.next_beat = 0.0
        self.answers = []    # datagrams to send
        self.executed, self.stops, self.heard_packed = [], 0, []
        self.ends = threading.Event()
        self.thread = threading.Thread(target=self._run)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.ends.set()
        self.thread.join()
        self.close()

    def _run(self):
        while not self.ends.is_set():
            self._act(time.monotonic())
            wake = self.next_beat if self.state != 'ACTIVE' else min(self.next_beat, self.next_state)
            self.take_frames_until(min(wake, time.monotonic() + 0.05), lambda: self.answers or self.next_beat == 0.0)

    def _time(self):
        return (self.offset + int((time.monotonic() - self.began) * 1000)) % 2 ** 32

    def _number(self):
        self.pnum = (self.pnum + 1) % 2 ** 32
        return self.pnum

    def _act(self, now):
        while self.answers:
            fields = self.answers.pop(0)
            self._send(self.own_id, datagram(fields, self._number(), self._time()), True)
        if self.state == 'ACTIVE' and now - self.host_heard > 1.0:
            self.state, self.armed = 'LOST', False
            self._go_safe(1)
        if now >= self.next_beat:
            self.next_beat = now + HEARTBEAT_S
            self._send_heartbeat()
        if self.state == 'ACTIVE' and now >= self.next_state:
            self.next_state = now + STATE_PERIOD_S
            values = {'AIN24': '24.10', 'OSMC1': self.osmc if not self.safe else '0,0', 'RELAYS': 0, 'SAFE': self.safe,
                      'CMD': self.last_command}
            names = self.fields or ['AIN24', 'OSMC1']
            if self.safe and 'SAFE' not in names:
                names = [*names, 'SAFE']
            self._send(TELEMETRY + self.node, datagram(';'.join(f'{name}:{values[name]}' for name in names),
                                                       self._number(), self._time()), False)

    def _send_heartbeat(self):
        if self.state == 'CONNECTING':
            text = heartbeat('H:R4-ROS2', 0, 0, self._safe_fields())
        else:
            self.echoable = [*self.echoable[-63:], self._time()]
            text = heartbeat('H:R4-ROS2', self._number(), self.echoable[-1], self._safe_fields())
        self._send(TELEMETRY + self.node, text, False)

    def _safe_fields(self):
        fields = f'SAFE:{self.safe};' if self.safe else ''
        if self.safe == 2:
            fields += f'CAUSE:{self.cause};'
            if self.stop_number is not None:
                fields += f'STOP:{self.stop_number};'
        return fields

    def _send(self, identifier, text, flow_control):
        packs = self.packs and self.host_packs and self.state == 'ACTIVE'
        self.send_message(identifier, (packed_form.pack(text) if packs else None) or text.encode(), flow_control)

    def _go_safe(self, reason):
        if self.safe != reason:
            self.safe = reason
            self.send_frame(WENT_SAFE + self.node, bytes([reason]), raw=True)
        self.next_beat = 0.0

    def on_raw_frame(self, identifier, data):
        assert identifier == EMERGENCY_STOP
        self._stop(None)

    def on_numbered_stop(self, number):
        self._stop(number)

    def _stop(self, number):
        self.stops += 1
        if self.safe != 2 or number is None or number != self.stop_number:
            self.cause += 1
        self.stop_number = number
        self.osmc = '0,0'
        self._go_safe(2)

    def on_text(self, text, packed):
        self.host_packs = packed
        self.heard_packed.append(packed)
        fields = read(text)
        if fields is None:
            return
        if fields.get('H') == 'ROS2-R4':
            self._on_heartbeat(int(fields['T']), int(fields['PNum']))
        elif 'Q' in fields:
            self.answers.append('I:R4,python,second,none' + self._asker(fields))
        elif self.armed:
            self._on_command(fields)

    @staticmethod
    def _asker(fields):
        return f';SID:{fields["SID"]}' if 'SID' in fields else ''

    def _on_heartbeat(self, echo, pnum):
        if self.state == 'CONNECTING' and echo == 0:
            self.session = pnum
            self.state, self.armed, self.next_beat = 'ACTIVE', False, 0.0
            self.host_heard = time.monotonic()
        elif echo in self.echoable:
            self.host_heard = time.monotonic()
            self.armed = True
            if self.state == 'LOST':
                self.state, self.safe = 'ACTIVE', 0

    def _on_command(self, fields):
        pnum = int(fields['PNum'])
        if self.newest is not None and not 0 < (pnum - self.newest) % 2 ** 32 <= 65536:
            self._refuse(fields, 'DUPLICATE' if pnum == self.newest else 'STALE')
            return
        self.newest = pnum
        letter = next(iter(fields))
        if letter in self.refuses:
            self._refuse(fields, 'SAFE' if self.safe else 'RANGE')
            return
        if letter == 'E' and fields[letter] != f'CLEAR,{self.cause if self.safe == 2 else 0}':
            self._refuse(fields, 'STALE')
            return
        self.executed.append(f'{letter}:{fields[letter]}')
        self.last_command = pnum
        if letter == 'F':
            self.fields = [name for name in fields[letter].replace('DEFAULT', 'AIN24,OSMC1').split(',')]
        elif letter == 'O':
            self.osmc = fields[letter].rpartition(',')[0]
        elif letter == 'E':
            self.safe = 0

    def _refuse(self, fields, code):
        self.answers.append(f'N:{fields["PNum"]},{code};SESSION:{self.session}{self._asker(fields)}')
