# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs test files where SocketCAN exists: in the guest of tools/with-can. If this is the guest, runs the files here.

The tests run nowhere else, because a machine's own CAN interfaces may be connected to motors.
A run fails if one of the tests was not executed.
"""
import os
import pathlib
import re
import subprocess

from r4_process import R4

HERE = pathlib.Path(__file__).resolve().parent
TOOL = HERE.parents[1] / 'tools' / 'with-can'
WITH_CAN = [TOOL] if 'R4_CAN_GUEST' in os.environ else [TOOL, '--guest']

# The guest needs less than three minutes. A busy machine may be several times as slow.
LONGEST_S = 900
PACKAGE = pathlib.Path(R4).resolve().parent / 'python'
PYTEST = ['/usr/bin/python3', '-X', f'pycache_prefix={HERE.parents[1] / "build/pycache"}', '-m', 'pytest', '-q',
          '-p', 'no:cacheprovider']
# The search for plugins reads the metadata of every installed package, which takes seconds in the guest.
PLAIN = {**os.environ, 'PYTEST_DISABLE_PLUGIN_AUTOLOAD': '1', 'PYTHONPATH': str(PACKAGE), 'PYTHONDONTWRITEBYTECODE': '1'}


def compile_here(files):
    """Compiles the Python files on this machine, because the guest needs ten times as long."""
    environment = {name: value for name, value in PLAIN.items() if name != 'PYTHONDONTWRITEBYTECODE'}
    subprocess.run([*PYTEST, *files, '--collect-only'], env=environment, stdin=subprocess.DEVNULL, capture_output=True,
                   timeout=120, check=False)


def run_inside(*names):
    """`names`: files in this folder."""
    files = [HERE / name for name in names]
    compile_here(files)
    inside = subprocess.run(
        [*WITH_CAN, '--time', str(LONGEST_S), *PYTEST, *files, '-ra', '-s', '--durations=20'], env=PLAIN,
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=LONGEST_S + 50, check=False)
    print(inside.stdout)
    written = sum(len(re.findall(r'^def test_', file.read_text(), re.MULTILINE)) for file in files)
    passed = re.search(r'(\d+) passed', inside.stdout)
    assert inside.returncode == 0, inside.stdout[-20000:] + inside.stderr
    assert passed and int(passed[1]) >= written and 'skipped' not in inside.stdout
