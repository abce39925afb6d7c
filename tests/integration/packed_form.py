# SPDX-License-Identifier: GPL-3.0-or-later
"""A second implementation of the packed form, written from docs/reference/packed.md alone.

pack(datagram) -> bytes, or None if the datagram is sent as text. unpack(bytes) -> datagram, ValueError if malformed.
"""
import re

NAMES = [*'AIN24 AIN12 AIN5 AINDMH DMHSTA AINSTEER DHB1A OSMC1 STEP1POS SERVO1POS AIN6'.split(),
         *'DHB1B DHB2A DHB2B OSMC2 OSMC3 OSMC4 STEP2POS STEP3POS STEP4POS'.split(),
         *(f'SERVO{n}POS' for n in range(2, 17)), *(f'ENC{n}' for n in range(1, 5)),
         *(f'US{n}' for n in range(1, 5)), *(f'BLDC{n}' for n in range(1, 5)),
         *'RELAYS SAFE CMD RXOK RXCRC RXLOST RXDUP RXREF LATE PNum T'.split(), *'HODSREPZBUFCQNIA', 'AN',
         *'R4-ROS2 ROS2-R4 On Off STOP CLEAR DEFAULT ALL ID'.split(),
         *'rate heartbeat timeout recovery pack last rearm'.split(),
         *'UNKNOWN FORMAT RANGE CHANNEL STALE DUPLICATE BUSY AUTH R4 sim udp serial pty can FAULT'.split(),
         *(f'ENC{n}HZ' for n in range(1, 5)), *(f'ENC{n}IDX' for n in range(1, 5)),
         *(f'I2C{n}' for n in range(1, 9)), *'I2CX I2CBUS X FULL UART1 UART2 DAC1 DAC2 GPIO SID LEAVE'.split()]
CODES = {name: code for code, name in enumerate(NAMES)}
# first code, last code, form
FORMS = [(0x00, 0x03, 'hundredths'), (0x04, 0x04, 'flag'), (0x05, 0x05, 'hundredths'), (0x06, 0x07, 'drive'),
         (0x08, 0x08, 'steps'), (0x09, 0x09, 'short'), (0x0A, 0x0A, 'hundredths'), (0x0B, 0x10, 'drive'),
         (0x11, 0x13, 'steps'), (0x14, 0x22, 'short'), (0x23, 0x26, 'steps'), (0x27, 0x2A, 'count'),
         (0x2B, 0x2E, 'bldc'), (0x2F, 0x2F, 'count'), (0x30, 0x30, 'flag'), (0x31, 0x39, 'count'),
         (0x6A, 0x71, 'steps'), (0x72, 0x7A, 'bytes'), (0x7E, 0x7F, 'bytes'),
         (0x80, 0x82, 'count'), (0x83, 0x83, 'session')]
GIVEN = {2: NAMES[:10], 3: NAMES[:10] + ['SAFE', 'CMD'], 4: NAMES[:0x38]}
HEARTBEATS = {5: 'R4-ROS2', 6: 'ROS2-R4'}
SIZES = [(0, 0), (4, 5), (4, 8), (5, 8), (6, 8), (4, 11), (8, 8), (8, 11)]
OF_SESSION = 7
SESSION = re.compile('[0-9a-f]{16}')
PLAIN = r'(0|[1-9][0-9]*)'
DATAGRAM = re.compile(r'((?:[!-+\--9<-\]_-~]+:[ -:<-\]_-~]*;)+)\^0x(0|[1-9a-f][0-9a-f]{0,7})\^')


def form_of(name):
    code = CODES.get(name, 0xFF)
    return next((form for first, last, form in FORMS if first <= code <= last), 'text')


# --- writing

def fixed(value, most, digits):
    return f'{value:0{digits}x}' if value <= most else None


def count(value):
    digits = f'{value:x}' if value else ''
    return f'{len(digits):x}{digits}' if len(digits) <= 14 else None


def in_form(form, text):
    """Returns the digits of the values, or None if the form would not reproduce the text exactly."""
    def match(pattern):
        found = re.fullmatch(pattern, text)
        return found and [int(group) for group in found.groups()]
    if form == 'flag':
        found = match(PLAIN)
        return found and fixed(found[0], 14, 1)
    if form == 'short':
        found = match(PLAIN)
        return found and fixed(found[0], 0xEFF, 3)
    if form == 'hundredths':
        found = match(PLAIN + r'\.([0-9]{2})')
        return found and fixed(100 * found[0] + found[1], 0xEFF, 3)
    if form == 'drive':
        found = match(PLAIN + ',([01])')
        return found and fixed(2 * found[0] + found[1], 0xEFFF, 4)
    if form == 'bldc':
        found = match(PLAIN + ',([01]),([01])')
        return found and fixed(4 * found[0] + 2 * found[1] + found[2], 0xEFFF, 4)
    if form == 'count':
        found = match(PLAIN)
        return found and count(found[0])
    if form == 'bytes':
        found = re.fullmatch(f'{PLAIN},{PLAIN},x((?:[0-9a-f]{{2}}){{0,64}})', text)
        counts = found and [count(int(found.group(n))) for n in (1, 2)]
        return ''.join(counts) + f'{len(found.group(3)) // 2:02x}{found.group(3)}' if found and all(counts) else None
    if form == 'session':
        return '0' + text if SESSION.fullmatch(text) else None
    assert form == 'steps'
    found = match('-?' + PLAIN)
    if not found or text == '-0':
        return None
    return count(2 * found[0] - 1 if text[0] == '-' else 2 * found[0])


def as_bytes(text):
    return text.encode('ascii').hex()


def text_digits(values):
    parts = []
    for value in values.split(','):
        if value in CODES:
            parts.append(f'f{CODES[value]:02x}')
            continue
        digits = ''
        at = 0
        while at < len(value):
            if value[at] in '0123456789.-':
                digits += value[at].replace('.', 'a').replace('-', 'b')
                at += 1
                continue
            end = at + 1
            while end < len(value) and end - at < 15 and not re.match(r'[0-9.-]{3}|[0-9.-]+$', value[end:]):
                end += 1
            digits += f'e{end - at:x}{as_bytes(value[at:end])}'
            at = end
        parts.append(digits)
    return 'c'.join(parts) + 'd'


def value_digits(name, values):
    if form_of(name) == 'text':
        return text_digits(values)
    return in_form(form_of(name), values) or 'f' + text_digits(values)


def size_of(first, second):
    """Returns S for the two fields, or None."""
    if (first[0], second[0]) != ('PNum', 'T') or not all(re.fullmatch(PLAIN, v) for _, v in (first, second)):
        return None
    pnum, time = int(first[1]), int(second[1])
    return next((s for s, (p, t) in enumerate(SIZES) if pnum < 16 ** p and time < 16 ** t), None)


def layout_of(fields):
    """Returns the layout, S, the digits of PNum, T and SID, and the other fields."""
    def is_session(field):
        return field[0] == 'SID' and SESSION.fullmatch(field[1])

    def digits(size, numbers):
        return ''.join(f'{int(number):0{width}x}' for (_, number), width in zip(numbers, SIZES[size]) if width)
    for layout, word in HEARTBEATS.items():
        at = 1 if layout == 5 else 2  # index of PNum
        if len(fields) < at + 2 or fields[0] != ['H', word] or (at == 2 and not is_session(fields[1])):
            continue
        size = size_of(*fields[at:at + 2])
        if size is not None:
            session = fields[1][1] if at == 2 else ''
            return layout, size, digits(size, fields[at:at + 2]) + session, fields[at + 2:]
    if len(fields) < 2:
        return 0, 0, '', fields
    size = size_of(*fields[-2:])
    if size is not None:
        names = [name for name, _ in fields[:-2]]
        layout = next((l for l in (4, 3, 2) if names[:len(GIVEN[l])] == GIVEN[l]), 1)
        return layout, size, digits(size, fields[-2:]), fields[:-2]
    session, (name, pnum) = fields[-2:]
    if is_session(session) and name == 'PNum' and re.fullmatch(PLAIN, pnum) and int(pnum) < 16 ** 8:
        return OF_SESSION, 0, f'{int(pnum):08x}{session[1]}', fields[:-2]
    return 0, 0, '', fields


def pack(datagram):
    found = DATAGRAM.fullmatch(datagram)
    if not found:
        return None
    fields = [field.split(':', 1) for field in found.group(1)[:-1].split(';')]
    layout, size, numbers, rest = layout_of(fields)
    digits = f'{0x80 | layout << 3 | size:02x}{numbers}'
    for index, (name, values) in enumerate(rest):
        if index >= len(GIVEN.get(layout, [])):
            if name in CODES:
                digits += f'{CODES[name]:02x}'
            elif len(name) <= 14:
                digits += f'e{len(name):x}{as_bytes(name)}'
            else:
                return None
        digits += value_digits(name, values)
    digits += 'f' * (len(digits) % 2) + found.group(2).zfill(8)
    return bytes.fromhex(digits) if len(digits) // 2 < len(datagram) else None


# --- reading

class Digits:
    def __init__(self, digits):
        self.digits = digits

    def take(self, size):
        if len(self.digits) < size:
            raise ValueError('an end too early')
        taken, self.digits = self.digits[:size], self.digits[size:]
        return taken

    def number(self, size):
        return int(self.take(size) or '0', 16)

    def bytes(self, size, allowed):
        text = bytes.fromhex(self.take(2 * size)).decode('latin-1')
        if size == 0 or not re.fullmatch(allowed, text):
            raise ValueError('a byte that the grammar forbids')
        return text

    def word(self):
        code = self.number(2)
        if code >= len(NAMES):
            raise ValueError('no such code')
        return NAMES[code]

    def field(self):
        if self.digits[:1] != 'e':
            name = self.word()
            return name, self.value(form_of(name))
        size = self.number(2) & 15
        if size == 15:
            raise ValueError('a name too long')
        return self.bytes(size, r'[!-+\--9<-\]_-~]+'), self.text()

    def text(self):
        text = ''
        while (digit := self.take(1)) != 'd':
            if digit == 'e':
                text += self.bytes(self.number(1), r'[ -+\--:<-\]_-~]+')
            elif digit == 'f':
                text += self.word()
            else:
                text += {'a': '.', 'b': '-', 'c': ','}.get(digit, digit)
        return text

    def value(self, form):
        if form == 'text':
            return self.text()
        if self.digits[:1] == 'f':
            self.take(1)
            return self.text()
        if form == 'count':
            return str(self.number(self.number(1)))
        if form == 'steps':
            number = self.number(self.number(1))
            return f'-{(number + 1) // 2}' if number % 2 else str(number // 2)
        if form == 'bytes':
            first, second = (str(self.number(self.number(1))) for _ in range(2))
            size = self.number(2)
            if size > 64:
                raise ValueError('a reading too long')
            return f'{first},{second},x{self.take(2 * size)}'
        if form == 'session':
            if self.take(1) != '0':
                raise ValueError('a session id of another form')
            return self.take(16)
        number = self.number({'flag': 1, 'short': 3, 'hundredths': 3, 'drive': 4, 'bldc': 4}[form])
        if form == 'hundredths':
            return f'{number // 100}.{number % 100:02}'
        if form == 'drive':
            return f'{number >> 1},{number & 1}'
        if form == 'bldc':
            return f'{number >> 2},{number >> 1 & 1},{number & 1}'
        return str(number)


def unpack(packed):
    if len(packed) < 5 or len(packed) > 1024:
        raise ValueError('the length')
    head, checksum = packed[0], int.from_bytes(packed[-4:], 'big')
    layout, size = head >> 3 & 7, head & 7
    if head >> 6 != 2:
        raise ValueError('the version')
    if layout in (0, OF_SESSION) and size != 0:
        raise ValueError('sizes without numbers')
    digits = Digits(packed[1:-4].hex())
    pnum, time = (digits.number(width) for width in ((8, 0) if layout == OF_SESSION else SIZES[size]))
    session = [('SID', digits.take(16))] if layout in (6, OF_SESSION) else []
    fields = [(name, digits.value(form_of(name))) for name in GIVEN.get(layout, [])]
    while len(digits.digits) >= 2:
        fields.append(digits.field())
    if digits.digits not in ('', 'f') or (layout == 0 and not fields):
        raise ValueError('the end')
    numbers = [*session, ('PNum', str(pnum)), *([('T', str(time))] if layout != OF_SESSION else [])]
    if layout in HEARTBEATS:
        fields = [('H', HEARTBEATS[layout]), *numbers, *fields]
    elif layout != 0:
        fields += numbers
    datagram = ''.join(f'{name}:{values};' for name, values in fields) + f'^0x{checksum:x}^'
    if len(datagram) > 1024:
        raise ValueError('the length')
    return datagram
