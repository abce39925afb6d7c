# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 plot as a program, and its pictures."""
import os
import re
import subprocess
import zlib
from xml.etree import ElementTree

import pytest

from r4_process import ERROR, R4, run

DATA_BAD, USAGE, OPEN, UNSUPPORTED = 1, 2, 4, 6
SVG = '{http://www.w3.org/2000/svg}'


def good(fields):
    """A datagram with `fields` and a valid checksum."""
    return f'{fields}^{hex(zlib.crc32((fields + "^").encode()))}^'


@pytest.fixture(name='native')
def a_drive(tmp_path):
    """Two boards with ten states a second for 4 s. left-arm is stopped from 1 s to 2 s and silent from 2 s to 3.5 s."""
    lines = ['# r4log 1 by r4 0.1.0', '# path 1 udp://192.168.0.125 left-arm', '# path 2 udp://192.168.0.126 right-arm']
    for i in range(40):
        stopped = 10 <= i < 20
        for path in (1, 2):
            if path == 1 and 20 <= i < 35:
                continue
            fields = f'AIN24:{24 + i / 10:.2f};OSMC1:{100 * (i % 7)},{int(i < 5)};SAFE:{2 if path == 1 and stopped else 0};'
            lines.append(f'{1795468293 + i / 10:.6f} {path}< {good(f"{fields}PNum:{i};T:{100 * i};")}')
    path = tmp_path / 'drive.r4log'
    path.write_text('\n'.join(lines + ['1795468297.000000 0! end', '']), encoding='ascii')
    return path


def curve(picture, name):
    """The points of each unbroken part of a curve."""
    group = next(each for each in picture.iter(f'{SVG}g') if each.get('id') == name)
    parts = group.find(f'{SVG}path').get('d').split('M')[1:]
    return [re.findall(r'(-?[0-9.]+) (-?[0-9.]+)', part) for part in parts]


def test_nothing_in_the_working_directory_is_executed_or_read(native, tmp_path):
    for module in ('json', 'random', 'string', 'token', 'numpy', 'matplotlib', 'sitecustomize'):
        (tmp_path / f'{module}.py').write_text(f"open({str(tmp_path / 'executed')!r}, 'a').write('{module}')")
    (tmp_path / 'matplotlibrc').write_text('svg.fonttype: nonsense')
    (tmp_path / 'python3').write_text(f'#!/bin/sh\ntouch {tmp_path}/executed\n')
    (tmp_path / 'python3').chmod(0o755)
    for extra in ({}, {'PYTHONPATH': ''}, {'PYTHONPATH': '.', 'PATH': ':' + os.environ['PATH']}):
        result = run('plot', native.name, 'AIN24', '-o', 'drive.svg', '--force', cwd=tmp_path, env={**os.environ, **extra})
        assert (result.returncode, result.stderr) == (0, ''), extra
        assert (tmp_path / 'drive.svg').stat().st_size > 1000
        assert not (tmp_path / 'executed').exists(), extra


def test_draws_curves_safe_states_and_gaps(native, tmp_path):
    result = run('plot', str(native), 'ain24', 'left-arm:OSMC1', '-o', str(tmp_path / 'drive.svg'))
    assert result.returncode == 0 and not result.stderr, result
    picture = ElementTree.parse(tmp_path / 'drive.svg').getroot()
    texts = [text.text for text in picture.iter(f'{SVG}text')]
    for expected in ('left-arm AIN24', 'right-arm AIN24', 'left-arm OSMC1', 'left-arm safe: stop', 'left-arm no data',
                     'V', 'pwm [±4095]', 'seconds'):
        assert expected in texts, (expected, texts)
    assert not any('right-arm OSMC1' in text or 'right-arm safe' in text for text in texts)
    assert len(curve(picture, 'left-arm AIN24')) == 2, 'the curve is not broken where the board was silent'
    assert len(curve(picture, 'right-arm AIN24')) == 1
    assert len([each for each in picture.iter(f'{SVG}g') if (each.get('id') or '').startswith('span ')]) == 2 * 2
    heights = [float(y) for _, y in curve(picture, 'left-arm OSMC1')[0]]
    assert heights[4] < heights[0] < heights[6], 'forward is not above zero, or backward not below it'


def test_names_with_special_characters_are_drawn_unchanged(native, tmp_path):
    paths = native.read_text().replace('192.168.0.125 left-arm', r'$\x5cfoo$\x1b[2J&<b>').replace(' right-arm', '')
    (tmp_path / '$x^$.r4log').write_text(paths)
    result = run('plot', str(tmp_path / '$x^$.r4log'), 'AIN24', '-o', str(tmp_path / 'others.svg'))
    assert result.returncode == 0 and not result.stderr, result
    texts = [text.text for text in ElementTree.parse(tmp_path / 'others.svg').getroot().iter(f'{SVG}text')]
    assert r'udp://$\foo$\x1b[2J&<b> AIN24' in texts, texts
    assert any('$x^$.r4log' in text for text in texts), texts


def test_plot_writes_png_and_pdf_files(native, tmp_path):
    for name, begin in (('a.png', b'\x89PNG'), ('a.pdf', b'%PDF')):
        assert run('plot', str(native), 'AIN24', '-o', str(tmp_path / name)).returncode == 0
        assert (tmp_path / name).read_bytes().startswith(begin)
    assert zlib.crc32((tmp_path / 'a.png').read_bytes()[-8:-4]) == 0xAE426082, 'whole'


@pytest.mark.parametrize('arguments, code, message', [
    (['AIN99', '-o', 'a.svg'], USAGE, 'AIN99: is not a field of a state'),
    (['AIN24', '-o', 'a.bmp'], USAGE, 'does not have the ending of a picture format'),
    (['ENC1', '-o', 'a.svg'], DATA_BAD, 'ENC1: does not occur in the states of'),
    (['middle-arm:AIN24', '-o', 'a.svg'], DATA_BAD, 'middle-arm:AIN24: does not occur in the states of'),
    (['AIN24', '-o', '/nowhere/a.svg'], OPEN, 'No such file'),
])
def test_arguments_that_cannot_be_drawn_are_refused(native, tmp_path, arguments, code, message):
    result = run('plot', str(native), *arguments, cwd=tmp_path)
    assert result.returncode == code and message in result.stderr and ERROR.search(result.stderr), result
    assert [path.name for path in tmp_path.iterdir()] == ['drive.r4log']


def test_damage_is_reported_and_the_rest_is_drawn(native, tmp_path):
    native.write_text(native.read_text().replace('# path 2', 'path 2', 1))
    result = run('plot', str(native), 'AIN24', '-o', str(tmp_path / 'a.svg'))
    assert result.returncode == DATA_BAD and 'some parts could not be read' in result.stderr, result
    assert (tmp_path / 'a.svg').exists()


def test_a_missing_matplotlib_is_reported(native, tmp_path):
    (tmp_path / 'none').mkdir()
    (tmp_path / 'none' / 'matplotlib.py').write_text('raise ImportError("No module named matplotlib")')
    result = run('plot', str(native), 'AIN24', '-o', str(tmp_path / 'a.svg'), env={**os.environ, 'PYTHONPATH': str(tmp_path / 'none')})
    assert result.returncode == UNSUPPORTED and 'python3-matplotlib' in result.stderr, result
    assert not list(tmp_path.glob('a.svg*'))


def test_the_example_of_the_help_works(native, tmp_path):
    packed = tmp_path / 'robot.r4log.zst'
    subprocess.run([R4, 'convert', str(native), '-o', str(packed)], check=True, stdout=subprocess.DEVNULL)
    result = run('plot', str(packed), 'left-arm:AIN24', 'right-arm:AIN24', '-o', str(tmp_path / 'arms.png'))
    assert result.returncode == 0, result
