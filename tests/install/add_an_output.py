#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Adds and drives the output of docs/design/contributing.md in a copy of the tree. Usage: add_an_output.py TREE CXX"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

MOST_FILES = 3
COPIED = ('docs', 'include', 'protocol', 'transports', 'firmware', 'host')
# The board, the codec with its packed form, and the words of commands, without transports and host links.
PORTABLE = ('protocol/*/*.cpp', 'transports/framing/can/*pack*.cpp', 'firmware/*.cpp', 'firmware/application/*.cpp',
            'firmware/devices/*.cpp', 'firmware/drivers/*.cpp', 'firmware/ports/sim/chips/*.cpp',
            'firmware/ports/sim/devices/*.cpp', 'firmware/ports/sim/robot/*.cpp', 'firmware/ports/sim/simulated_hardware.cpp')
HOST = ('host/commands/command_*.cpp', 'host/commands/setpoints.cpp', 'transports/error.cpp', 'transports/url*.cpp')


def edits(page):
    """(path, old text, new text) of each hunk in the page's first diff. Ignores the line of each `@@`."""
    path = None
    for part in re.split(r'^(?=\+\+\+ |@@)', re.search(r'^```diff\n(.*?)^```', page, re.M | re.S)[1], flags=re.M):
        head, _, body = part.partition('\n')
        if head.startswith('+++ '):
            path = head[4:]
        elif head.startswith('@@'):
            lines = [line or ' ' for line in body.splitlines()]
            yield path, *('\n'.join(line[1:] for line in lines if line[0] != other) + '\n' for other in '+-')


def main():
    tree, compiler = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2]
    with tempfile.TemporaryDirectory() as folder:
        scratch = pathlib.Path(folder)
        for top in COPIED:
            shutil.copytree(tree / top, scratch / top)
        touched = set()
        for path, old, new in edits((tree / 'docs/design/contributing.md').read_text('utf-8')):
            text = (scratch / path).read_text('utf-8')
            if text.count(old) != 1:
                sys.exit(f'docs/design/contributing.md: {path} does not have once:\n{old}')
            (scratch / path).write_text(text.replace(old, new), 'utf-8')
            touched.add(path)
        print('\n'.join(sorted(touched)))
        if not 0 < len(touched) <= MOST_FILES:
            sys.exit(f'docs/design/contributing.md: the output takes {len(touched)} files, {MOST_FILES} at most')
        flags = [compiler, '-O0', '-std=c++20', '-Wall', '-Wextra', '-Werror', f'-I{scratch}', f'-I{scratch}/include']
        sources = sorted(path for pattern in PORTABLE + HOST for path in scratch.glob(pattern))
        program = scratch / 'add_an_output'
        subprocess.run([*flags, '-o', program, tree / 'tests/install/add_an_output.cpp', *sources, '-lfmt'], check=True)
        subprocess.run([program, scratch / 'docs/reference/protocol.md'], check=True)


if __name__ == '__main__':
    main()
