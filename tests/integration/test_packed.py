# SPDX-License-Identifier: GPL-3.0-or-later
"""The packed form of r4 against a second implementation, written from docs/reference/packed.md alone."""
import os
import random
import re
import zlib

import pytest

import packed_form
from r4_process import DATA, objects, run

DATA_BAD = 1


def captured_lines():
    with open(os.path.join(DATA, 'paper_capture.tsv'), encoding='ascii') as file:
        return [line.rstrip('\n').split('\t')[1] for line in file]

NAMES = [name for name in packed_form.NAMES if name != 'SID']  # r4 checks the values of SID


def with_crc(fields):
    return f'{fields}^0x{zlib.crc32((fields + "^").encode()):x}^'


def any_values(rng):
    return rng.choice([
        lambda: str(rng.randrange(10 ** rng.randrange(1, 20))), lambda: str(-rng.randrange(10 ** 9)),
        lambda: f'{rng.randrange(50)}.{rng.randrange(100):02}', lambda: f'{rng.randrange(5000)},{rng.randrange(2)}',
        lambda: f'{rng.randrange(5000)},{rng.randrange(2)},{rng.randrange(2)}',
        lambda: f'{rng.randrange(10 ** 9)},{rng.randrange(9)},x{rng.randbytes(rng.randrange(70)).hex()}',
        lambda: f'{rng.randrange(9)},0{rng.randrange(9)},x{rng.choice(["", "0", "AB", "ab", "abg0"])}',
        lambda: ','.join(rng.choices(packed_form.NAMES, k=rng.randrange(1, 4))),
        lambda: ''.join(rng.choices('0123456789.-,', k=rng.randrange(10))),
        lambda: ''.join(rng.choices('ab1 :23.-,', k=rng.randrange(60)))])()


def any_fields(rng):
    state = captured_lines()[0].split('PNum')[0]
    everything = ''.join(f'{name}:{any_values(rng)};' for name in packed_form.NAMES[:0x38])
    fields = rng.choice(['', '', state, state + 'SAFE:0;CMD:77;', state + 'SAFE:1;', everything, 'H:R4-ROS2;',
                         'H:ROS2-R4;', 'H:R4-ROS2;PNum:7;T:8;'])
    for _ in range(rng.randrange(6)):
        name = rng.choice([rng.choice(NAMES), 'Other', 'a' * rng.randrange(1, 17)])
        fields += f'{name}:{any_values(rng)};'
    if rng.random() < 0.3:
        fields += f'SID:{rng.randrange(1, 2 ** 64):016x};'
        if rng.random() < 0.5:
            return f'{fields}PNum:{rng.getrandbits(rng.randrange(33))};'
    if rng.random() < 0.7 or not fields:
        fields += f'PNum:{rng.getrandbits(rng.randrange(33))};T:{rng.getrandbits(rng.randrange(65))};'
    return fields


def decoded(packed):
    """The plain text to which r4 decodes each packed datagram, or None if it is malformed."""
    result = run('decode', stdin=''.join(f'packed:{each.hex()}\n' for each in packed))
    assert result.stderr == ''
    return [None if each.get('error') == 'packed' else without_escapes(each['text'])
            for each in objects(result.stdout)]


def without_escapes(text):
    """Undoes the escapes of r4 decode, which shows a backslash in a name as \\x5c."""
    return re.sub(r'\\x([0-9a-f]{2})', lambda found: chr(int(found[1], 16)), text)


def expected(packed):
    try:
        return packed_form.unpack(packed)
    except ValueError:
        return None


def may_be_masked(text):
    """True if `r4 decode` may mistake a part of the text for the value of a setting, which shows as dots."""
    return 'C:' in text


def test_the_document_lists_every_name_of_the_second_implementation():
    with open(os.path.join(DATA, '..', '..', 'docs', 'reference', 'packed.md'), encoding='utf-8') as file:
        text = file.read()
    for name in packed_form.NAMES:
        assert re.search(rf'\b{re.escape(name)}\b', text) or re.match(r'SERVO|ENC|US|BLDC|I2C', name), name


def test_r4_unpacks_datagrams_of_the_second_implementation():
    rng = random.Random(4)
    datagrams = captured_lines() + [with_crc(any_fields(rng)) for _ in range(3000)]
    packed = [(each, packed_form.pack(each)) for each in datagrams if len(each) <= 1024]
    packed = [(each, form) for each, form in packed if form and len(form) < 500 and not may_be_masked(each)]
    assert len(packed) > 2400
    assert decoded([form for _, form in packed]) == [each for each, _ in packed]
    assert all(packed_form.unpack(form) == each for each, form in packed)


def test_r4_and_the_second_implementation_pack_the_same_bytes():
    rng = random.Random(5)
    form = re.compile(r'^(.*);PNum:(\d+);T:(\d+);\^')
    lines = [line for line in captured_lines() if form.match(line)][:12]
    while len(lines) < 200:
        line = with_crc(any_fields(rng))
        if form.match(line) and int(form.match(line).group(2)) < 2 ** 32 and len(line) <= 1024:
            lines.append(line)
    compared = 0
    for line in lines:
        fields, pnum, t = form.match(line).groups()
        if re.search(r'(^|;)(PNum|T):', fields):
            continue  # encode adds PNum and T itself
        result = run('encode', fields, '--pnum', pnum, '--time', t, '--packed', '--force')
        packed = packed_form.pack(line)
        assert result.stdout.strip() == (f'packed:{packed.hex()}' if packed else line), line
        compared += 1
    assert compared > 150


def test_both_implementations_accept_the_same_damaged_bytes():
    rng = random.Random(6)
    damaged = []
    for _ in range(4000):
        packed = packed_form.pack(with_crc(any_fields(rng))) or b'\x80'
        damaged_bytes = bytearray(packed[:400])
        for _ in range(rng.randrange(1, 4)):
            damaged_bytes[rng.randrange(len(damaged_bytes))] = rng.randrange(256)
        damaged.append(bytes(damaged_bytes[:rng.randrange(len(damaged_bytes))]
                             if rng.random() < 0.2 else damaged_bytes))
    damaged = [each for each in damaged if each]
    theirs = decoded(damaged)
    ours = [expected(each) for each in damaged]
    differ = [(a.hex(), b, c) for a, b, c in zip(damaged, theirs, ours) if b != c]
    assert [each for each in differ if not each[2] or not may_be_masked(each[2])] == []
    assert sum(each is not None for each in ours) > 100


def test_decode_reads_the_packed_output_of_encode():
    line = run('encode', 'O:358,1,1', '--pnum', '66', '--time', '1699276044383', '--packed').stdout
    assert line == 'packed:8d004218ba4beb85f3b358c1c1df7fefae81\n'
    result = run('decode', stdin=line)
    assert result.returncode == 0
    (one,) = objects(result.stdout)
    assert one['ok'] and one['packed'] == 18 and one['fields'] == {'O': [358, 1, 1]}
    assert one['text'] == 'O:358,1,1;PNum:66;T:1699276044383;^0x7fefae81^'


@pytest.mark.parametrize('line, reason', [
    ('packed:', 'length'), ('packed:8', 'hex'), ('packed:8x', 'hex'), ('packed:80', 'length'),
    ('packed:' + b'O:1;^0x0^'.hex(), 'version'), ('packed:c000000000', 'version'),
    ('packed:806aff00000000', 'syntax')])
def test_decode_reports_why_a_packed_line_is_invalid(line, reason):
    result = run('decode', stdin=line + '\n')
    assert result.returncode == DATA_BAD
    assert objects(result.stdout) == [
        {'line': 1, 'ok': False, 'error': 'packed', 'reason': reason, 'text': line}]


def test_encode_writes_plain_text_if_packing_does_not_shorten_it():
    assert run('encode', 'wxyz:wxyz', '--pnum', '4294967295', '--time', str(2 ** 64 - 1), '--packed',
               '--force').stdout.startswith('packed:')
    name = 'a-name-of-more-than-14-bytes'
    assert run('encode', f'{name}:1', '--time', '1', '--packed').stdout.startswith(f'{name}:1;PNum:0;T:1;^0x')
