# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/examples/openscout: the tests of the example pass, and the program drives its model."""
import os
import pathlib
import re
import subprocess
import sys

EXAMPLE = pathlib.Path(__file__).resolve().parents[2] / 'docs/examples/openscout'


def run(*command):
    return subprocess.run([sys.executable, *command], cwd=EXAMPLE, stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          env={**os.environ, 'PYTHONDONTWRITEBYTECODE': '1'}, timeout=120, check=False)


def test_the_tests_of_the_example_pass():
    ended = run('-m', 'pytest', '-q', '-s', '-p', 'no:cacheprovider')
    assert ended.returncode == 0 and re.search(r'^14 passed in', ended.stdout, re.MULTILINE), ended.stdout + ended.stderr
    print(ended.stdout)


def test_the_example_drives_its_model():
    ended = run('openscout.py', 'model', '--course', '0.5,0')
    assert (ended.returncode, ended.stdout) == (0, 'armed: it drives\nthe step function ended the loop\n'), ended.stderr


def test_the_example_reports_wrong_arguments():
    ended = run('openscout.py', 'fax:1')
    assert ended.returncode == 3 and 'udp://HOST' in ended.stderr
    ended = run('openscout.py', 'model', '--gamepad', '/dev/input/none')
    assert ended.returncode == 4 and '/dev/input/none' in ended.stderr
