# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads an MCAP file by its specification (mcap.dev/spec), without code of r4: by the index at its end and from
its beginning. Asserts that both agree, and that every checksum, offset and count is right.
"""
import json
import struct
import subprocess
import zlib

MAGIC = b'\x89MCAP0\r\n'
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, SUMMARY_OFFSET, DATA_END = 0x0B, 0x0E, 0x0F


class Fields:
    """The fields of a record, one after the other."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def number(self, form):
        value, = struct.unpack_from('<' + form, self.data, self.at)
        self.at += struct.calcsize('<' + form)
        return value

    def numbers(self, forms):
        return [self.number(form) for form in forms]

    def bytes(self, size_form='I'):
        size = self.number(size_form)
        assert self.at + size <= len(self.data)
        self.at += size
        return self.data[self.at - size:self.at]

    def string(self):
        return self.bytes().decode('utf-8')

    def pairs(self, first, second):
        """A map, or an array of tuples."""
        inner = Fields(self.bytes())
        found = []
        while inner.at < len(inner.data):
            found.append(tuple(inner.string() if form == 's' else inner.number(form)
                               for form in (first, second)))
        return found

    def ended(self):
        assert self.at == len(self.data)


def records(data, begin, end):
    """(offset, size with its head, opcode, content) of each."""
    while begin < end:
        opcode, size = struct.unpack_from('<BQ', data, begin)
        assert begin + 9 + size <= end
        yield begin, 9 + size, opcode, data[begin + 9:begin + 9 + size]
        begin += 9 + size


def schema_of(content):
    fields = Fields(content)
    number, name, encoding, text = fields.number('H'), fields.string(), fields.string(), fields.string()
    fields.ended()
    assert number and encoding == 'jsonschema' and json.loads(text)['type'] == 'object'
    return number, name


def channel_of(content):
    fields = Fields(content)
    number, schema, topic, encoding = fields.number('H'), fields.number('H'), fields.string(), fields.string()
    metadata = dict(fields.pairs('s', 's'))
    fields.ended()
    assert encoding == 'json'
    return number, schema, topic, metadata


def unpack_chunk(content):
    fields = Fields(content)
    first, last, size, crc = fields.numbers('QQQI')
    compression, packed = fields.string(), fields.bytes('Q')
    fields.ended()
    assert compression == 'zstd'
    unpacked = subprocess.run(['zstd', '-dcq'], input=packed, capture_output=True, check=True).stdout
    assert len(unpacked) == size and zlib.crc32(unpacked) == crc
    return first, last, unpacked, len(packed)


def read(path):
    """The channels by number, and the messages in the order of the file: (topic, ns, object)."""
    data = path.read_bytes()
    assert data.startswith(MAGIC) and data.endswith(MAGIC)
    footer = len(data) - len(MAGIC) - 29
    opcode, size, summary, offsets, summary_crc = struct.unpack_from('<BQQQI', data, footer)
    assert (opcode, size) == (FOOTER, 20)
    assert zlib.crc32(data[summary:footer + 25]) == summary_crc

    groups, indexes, statistics, schemas, channels = {}, {}, None, {}, {}
    for offset, size, opcode, content in records(data, summary, offsets):
        group = groups.setdefault(opcode, [offset, 0])
        assert offset == sum(group), 'grouped by opcode'
        group[1] += size
        if opcode == SCHEMA:
            schemas[schema_of(content)[0]] = content
        elif opcode == CHANNEL:
            channels[channel_of(content)[0]] = content
        elif opcode == CHUNK_INDEX:
            indexes[struct.unpack_from('<QQQ', content)[2]] = content
        else:
            assert opcode == STATISTICS and statistics is None
            statistics = content
    told = {}
    for _, _, opcode, content in records(data, offsets, footer):
        assert opcode == SUMMARY_OFFSET
        group, begin, length = struct.unpack('<BQQ', content)
        told[group] = [begin, length]
    assert told == groups

    messages, counts = [], {}
    everything = list(records(data, len(MAGIC), summary))
    header = Fields(everything[0][3])
    assert everything[0][2] == HEADER and header.string() == 'r4log' and header.string().startswith('r4 ')
    end_offset, _, opcode, content = everything[-1]
    assert opcode == DATA_END and struct.unpack('<I', content)[0] == zlib.crc32(data[:end_offset])
    chunks = [each for each in everything[1:-1] if each[2] == CHUNK]
    assert {each[2] for each in everything[1:-1]} <= {CHUNK, MESSAGE_INDEX}
    assert [offset for offset, *_ in chunks] == sorted(indexes)
    for offset, size, _, content in chunks:
        first, last, unpacked, packed_size = unpack_chunk(content)
        index = Fields(indexes[offset])
        assert index.numbers('QQQQ') == [first, last, offset, size]
        where = dict(index.pairs('H', 'Q'))
        index_size = index.number('Q')
        assert (index.string(), *index.numbers('QQ')) == ('zstd', packed_size, len(unpacked))
        index.ended()
        found = {}
        for at, _, opcode, inside in records(unpacked, 0, len(unpacked)):
            if opcode == SCHEMA:
                assert schemas[schema_of(inside)[0]] == inside
            elif opcode == CHANNEL:
                assert channels[channel_of(inside)[0]] == inside
            else:
                assert opcode == MESSAGE
                channel, sequence, log_time, publish_time = struct.unpack_from('<HIQQ', inside)
                assert publish_time == log_time and sequence == counts.get(channel, 0)
                counts[channel] = sequence + 1
                found.setdefault(channel, []).append((log_time, at))
                messages.append((channel_of(channels[channel])[2], log_time, json.loads(inside[22:])))
        times = [time for entries in found.values() for time, _ in entries]
        assert [first, last] == [min(times), max(times)]
        behind = list(records(data, offset + size, offset + size + index_size))
        assert {each[0] for each in behind} == set(where.values()) and set(where) == set(found)
        for at, _, opcode, inside in behind:
            fields = Fields(inside)
            channel = fields.number('H')
            assert opcode == MESSAGE_INDEX and where[channel] == at
            assert fields.pairs('Q', 'Q') == found[channel]
            fields.ended()

    fields = Fields(statistics)
    times = [time for _, time, _ in messages]
    assert fields.numbers('QHIIII') == [len(messages), len(schemas), len(channels), 0, 0, len(chunks)]
    assert fields.numbers('QQ') == [min(times), max(times)]
    assert dict(fields.pairs('H', 'Q')) == counts
    fields.ended()
    described = {}
    for content in channels.values():
        number, schema, topic, metadata = channel_of(content)
        assert schema in schemas
        described[topic] = (schema_of(schemas[schema])[1], metadata)
        assert number in counts
    return described, messages
