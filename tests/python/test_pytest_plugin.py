# SPDX-License-Identifier: GPL-3.0-or-later
"""The pytest plugin, by the example of docs/testing.md and tests that fail."""
import os
import pathlib
import re
import subprocess
import sys

import pytest

EXAMPLE = pathlib.Path(__file__).resolve().parents[2] / 'docs/examples/robot_tests'


def run_pytest(*arguments, cwd, **env):
    return subprocess.run([sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', '-p', 'r4link.pytest_plugin',
                           *map(str, arguments)], cwd=cwd, env={**os.environ, **env}, capture_output=True, text=True,
                          check=False)


@pytest.mark.parametrize('transport', ['sim', 'udp', 'pty'])
def test_the_example_passes(transport):
    ended = run_pytest(EXAMPLE, '--r4-transport', transport, cwd=EXAMPLE)
    assert ended.returncode == 0 and '5 passed' in ended.stdout, ended.stdout


def test_what_is_not_as_expected_is_told(tmp_path):
    (tmp_path / 'test_wrong.py').write_text('''
import r4link

def test_field(r4_board):
    r4_board.expect(osmc1=358, dmhsta=True, within=0.05)

def test_unknown(r4_board):
    r4_board.expect(motor=1)

def test_safe(r4_board):
    r4_board.expect_safe('stop', within=0.05)

def test_link(r4_link):
    assert False

def test_can(request, tmp_path):
    import pytest
    from r4link.testing import make_robot
    with pytest.raises(r4link.Error) as raised:
        make_robot('can', tmp_path, interface='nocan0')
    assert 'nocan0' in str(raised.value)
''')
    ended = run_pytest('test_wrong.py', cwd=tmp_path)
    assert '4 failed, 1 passed' in ended.stdout, ended.stdout
    assert re.search(r"@pytest.mark.r4\(link='loss=2%,delay=5ms±5,seed=\d+'\)", ended.stdout)
    for words in ('osmc1 is Drive(pwm=0, direction=0), not 358 (link active, reason none; State(pnum=',
                  'the board has no such field; see r4link.FIELDS',
                  'after 0.05 s the board is not safe (stop): the link is active, its reason none'):
        assert words in ended.stdout.replace('\n', ' '), ended.stdout


def test_without_the_command_it_is_told_how_to_get_it(tmp_path):
    (tmp_path / 'test_it.py').write_text('def test_it(r4_board): pass\n')
    env = {'R4': '', 'PATH': str(tmp_path)}
    ended = run_pytest('test_it.py', '--r4-transport', 'udp', cwd=tmp_path, **env)
    assert 'the command r4: it is not on PATH; set R4=FILE' in ended.stdout, ended.stdout
