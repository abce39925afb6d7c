#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The Arduino library compiles unchanged for the Giga's processor and its dialect of C++. The library needs no heap
and, apart from the core, no other library. The stacks of the library's interrupts are large enough.

The core is not available here. tests/giga/core declares the parts that the firmware uses, with the signatures and
macros of the originals. Usage: library_test.py TREE
"""
import concurrent.futures
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import zipfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from stack_bounds import stack_bounds  # noqa: E402

CROSS = 'arm-none-eabi-'
# The flags of the Arduino IDE for the Giga, with warnings as errors. The measured code has no exceptions.
FLAGS = ['-std=gnu++14', '-fno-rtti', '-fno-exceptions', '-Os', '-mcpu=cortex-m7', '-mthumb',
         '-mfloat-abi=softfp', '-mfpu=fpv5-d16', '-DARDUINO_GIGA', '-DTARGET_GIGA', '-DCORE_CM7',
         '-Wall', '-Wextra', '-Wvla', '-Werror']
# The core itself allows exceptions on the Giga, and will use C++17.
OTHER_DIALECT = ['-fexceptions', '-std=gnu++17', '-fsyntax-only']
# Code that needs one of these symbols uses the heap, or can throw.
FORBIDDEN = re.compile(r'\b(malloc|calloc|realloc|free|_Zn[wa]\w*|_Zd[la]\w*|__cxa_throw\w*|_ZSt\d+__throw\w*)$')
# The destructor of Mbed's SocketAddress frees its text (delete[]). Only get_ip_address() makes the text. The library
# does not call this function: the library does not need the symbol _ZNK13SocketAddress14get_ip_addressEv.
GIVEN_BACK = {'_ZdaPv': 'firmware/ports/giga/links/network.cpp'}
TEXT_OF_ADDRESS = '_ZNK13SocketAddress14get_ip_addressEv'
SHELL = {'library.properties', 'library.json', 'keywords.txt', 'LICENSE', 'src/R4Link.h',
         'examples/R4Board/R4Board.ino', 'extras/firmware.md'}


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if done.returncode:
        raise AssertionError(f'{" ".join(map(str, command))}\n{done.stdout}{done.stderr}')
    return done.stdout


def assemble(tree, folder):
    """Unpacks the library. Asserts that a second assembly makes the same file."""
    first, second = folder / 'a.zip', folder / 'b.zip'
    for target in (first, second):
        run(tree / 'tools/arduino', target)
    assert first.read_bytes() == second.read_bytes(), 'two runs of tools/arduino differ'
    with zipfile.ZipFile(first) as archive:
        archive.extractall(folder)
    library = folder / 'R4_Link'
    missing = [name for name in SHELL if not (library / name).is_file()]
    assert not missing, f'the library lacks {missing}'
    for name in ('library.properties', 'library.json'):
        assert '@' not in (library / name).read_text(), f'{name} has a placeholder left'
    return library


def refuses_what_it_cannot_do(tree):
    """A wrong option and a place that cannot be written give an error with a fix, and the exit status."""
    for arguments, status in ((['--nonsense'], 2), (['a.zip', '--folder', 'b'], 2), (['/proc/a/b.zip'], 4)):
        done = subprocess.run([tree / 'tools/arduino', *arguments], capture_output=True, text=True, check=False)
        assert done.returncode == status and '\n  fix: ' in done.stderr, (arguments, done)


def compile_all(tree, library, out):
    """Compiles every source, and the sketch after Arduino.h, as the IDE does."""
    sketch = out / 'sketch.cpp'
    example = library / 'examples/R4Board/R4Board.ino'
    sketch.write_text(f'#include <Arduino.h>\n#line 1 "{example}"\n{example.read_text()}')
    version = int(run(CROSS + 'g++', '-dumpversion').split('.')[0])
    with_graph = ['-fcallgraph-info=su'] if version >= 10 else []  # older compilers have no call graph
    sources = sorted((library / 'src').rglob('*.cpp')) + [sketch]

    def compile_one(numbered):
        number, source = numbered
        target = out / f'{number}.o'
        compiler = [CROSS + 'g++', *FLAGS, '-I', library / 'src', '-I', tree / 'tests/giga/core']
        run(*compiler, *with_graph, '-c', source, '-o', target)
        run(*compiler, *OTHER_DIALECT, source)
        return source, target

    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(compile_one, enumerate(sources)))


def lacking_in(file):
    """The undefined symbols of the file, as the linker names them."""
    return [line.split()[-1] for line in run(CROSS + 'nm', '-u', file).splitlines()]


def needs(objects, out):
    """The undefined symbols of the combined objects, and the combined object."""
    together = out / 'together.o'
    run(CROSS + 'ld', '-r', '-o', together, *(target for _, target in objects))
    return lacking_in(together), together


def uses_no_heap(objects, lacking):
    heap = [symbol for symbol in lacking if FORBIDDEN.search(symbol) and symbol not in GIVEN_BACK]
    assert not heap, f'the firmware uses the heap or exceptions: {heap}'
    assert TEXT_OF_ADDRESS not in lacking, 'the text of an address is made on the heap'
    for source, target in objects:
        for symbol in GIVEN_BACK.keys() & set(lacking_in(target)):
            assert str(source).endswith(GIVEN_BACK[symbol]), f'{source} uses {symbol}'


def stacks_suffice(out):
    """If the compiler reports call graphs, asserts that our interrupt handlers fit on their stacks."""
    graphs = list(out.glob('*.ci'))
    for name, (need, room) in (stack_bounds(graphs) if graphs else {}).items():
        print(f'stack of the interrupts, {name}: {need} of {room} bytes')
        assert need <= room, f'{name} is too small'


def main():
    tree = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        refuses_what_it_cannot_do(tree)
        library = assemble(tree, folder)
        out = folder / 'out'
        out.mkdir()
        objects = compile_all(tree, library, out)
        lacking, together = needs(objects, out)
        uses_no_heap(objects, lacking)
        ours = [symbol for symbol in lacking if re.match(r'_ZN?K?\w*2r4', symbol)]
        assert not ours, f'the library lacks functions that it uses: {ours}'
        stacks_suffice(out)
        text, data, bss = run(CROSS + 'size', together).splitlines()[1].split()[:3]
    print(f'{len(objects)} sources; {int(text)} bytes of code, {int(data) + int(bss)} of RAM, without the core')


if __name__ == '__main__':
    main()
