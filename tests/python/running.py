# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions by which the tests of the Python package run other programs."""
import os
import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]
OFFLINE = {**os.environ, 'PIP_NO_INDEX': '1', 'PIP_DISABLE_PIP_VERSION_CHECK': '1'}
OFFLINE.pop('PYTHONPATH')


def run(*command, cwd=ROOT, env=None):
    ended = subprocess.run([str(each) for each in command], cwd=cwd, env=env or os.environ, capture_output=True, text=True,
                           check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout
