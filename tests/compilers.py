#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiles the product with compilers other than the default: tests/compilers.py FOLDER [JOBS] [COMPILER...]

All warnings are errors. No code is generated, so warnings of the optimizer appear only in the build. Without a COMPILER
(such as g++-11) the oldest installed GCC reads all sources, and the newest GCC and the oldest clang read the public
headers. tools/test builds the tree with the default compiler and with the newest clang. Each compiler gets a configured
build in FOLDER.
"""
import concurrent.futures
import json
import os
import pathlib
import re
import resource
import shlex
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
OPTIONS = ['-DR4_TESTS=OFF', '-DR4_UNITY=ON', '-DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON']
OLDEST = {'g++': 11, 'clang++': 14}  # the oldest supported versions


def version_of(compiler):
    """Returns (kind, major version) of a command."""
    text = subprocess.run([compiler, '--version'], capture_output=True, text=True, check=True).stdout
    return ('clang++' if 'clang' in text else 'g++', int(re.search(r' (\d+)\.\d+\.\d+', text)[1]))


def installed():
    """kind -> its supported versions, oldest first."""
    found = {kind: set() for kind in OLDEST}
    for folder in os.environ['PATH'].split(':'):
        for path in pathlib.Path(folder).glob('*++-*'):
            match = re.fullmatch(r'(g\+\+|clang\+\+)-(\d+)', path.name)
            if match and int(match[2]) >= OLDEST[match[1]]:
                found[match[1]].add(int(match[2]))
    return {kind: sorted(versions) for kind, versions in found.items()}


def chosen():
    """The compilers for all sources, and the compilers for the public headers."""
    default = version_of('c++')
    gcc, clang = (installed()[kind] for kind in ('g++', 'clang++'))
    sources = [f'g++-{version}' for version in gcc[:1] if ('g++', version) != default]
    headers = [f'g++-{version}' for version in gcc[1:][-1:] if ('g++', version) != default]
    headers += [f'clang++-{version}' for version in clang[:-1][:1]]
    return sources, headers


def run(command, folder=ROOT):
    """If the command fails, returns the command's output, else an empty text."""
    ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return f'{shlex.join(map(str, command))}\n{ended.stdout}{ended.stderr}' if ended.returncode else ''


def configured(compiler, build):
    """Yields (folder, command) for each source: the command by which a build with `compiler` reads it."""
    trouble = (run(['cmake', '--preset', 'release', '-B', build, f'-DCMAKE_CXX_COMPILER={compiler}', *OPTIONS]) or
               run(['cmake', '--build', build, '--target', 'r4_ros2_idl_generate']))
    if trouble:
        sys.exit(trouble)
    for entry in json.loads((build / 'compile_commands.json').read_text()):
        command = shlex.split(entry['command'])
        file = pathlib.Path(entry['directory'], entry['file'])
        if file.suffix in ('.cpp', '.cxx') and file.exists():  # except page_content.cpp, which is data
            at = command.index('-o')
            yield entry['directory'], [*command[:at], *command[at + 2:], '-Werror', '-fsyntax-only']


def reading_headers(compiler):
    for header in sorted((ROOT / 'include/r4link').rglob('*.hpp')):
        yield ROOT, [compiler, '-std=c++20', '-Wall', '-Wextra', '-Wpedantic', '-Werror', '-I', ROOT / 'include',
                     '-DASIO_STANDALONE', '-fsyntax-only', '-include', header, '-x', 'c++', '/dev/null']


def main():
    folder = pathlib.Path(sys.argv[1]).resolve()
    jobs = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    sources, headers = (sys.argv[3:], []) if len(sys.argv) > 3 else chosen()
    commands = [each for compiler in sources for each in configured(compiler, folder / compiler)]
    commands += [each for compiler in headers for each in reading_headers(compiler)]
    failed = 0
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for trouble in pool.map(lambda each: run(each[1], each[0]), commands):
            failed += bool(trouble)
            sys.stdout.write(trouble)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f'all sources by {", ".join(sources) or "none"}; the headers by {", ".join(headers) or "none"}: '
          f'{len(commands)} read, {failed} with faults, {used.ru_utime + used.ru_stime:.0f} s of a processor')
    return 1 if failed or not sources else 0


if __name__ == '__main__':
    sys.exit(main())
