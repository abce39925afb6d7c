#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fails when a source includes what its layer may not. Usage: layers.py TREE

tools > host > transports > protocol, tools > firmware > transports/framing > protocol;
host/sim_carrier* alone may include firmware/ports/sim. The portable layers (protocol,
transports/framing, firmware without its ports, the chip models) include nothing a C++14 board lacks.
"""
import pathlib
import re
import sys

# layer: the layers it may include besides itself
ALLOWED = {
    'protocol': set(),
    'transports/framing': {'protocol'},
    'transports': {'transports/framing', 'protocol'},
    'firmware': {'transports/framing', 'protocol'},
    'firmware/ports/sim/chips': {'firmware'},
    'firmware/ports': {'firmware/ports/sim/chips', 'firmware', 'transports', 'transports/framing', 'protocol'},
    'host': {'transports', 'transports/framing', 'protocol'},
    'tools': {'host', 'transports', 'firmware', 'firmware/ports', 'firmware/ports/sim/chips', 'transports/framing',
              'protocol'},
}
LAYERS = sorted(ALLOWED, key=len, reverse=True)
PORTABLE = {'protocol', 'transports/framing', 'firmware', 'firmware/ports/sim/chips'}
# No heap, no I/O, no clock, nothing GCC 7 in C++14 lacks; C headers in both spellings.
PORTABLE_STANDARD = {
    'algorithm', 'array', 'atomic', 'cassert', 'climits', 'cmath', 'cstddef', 'cstdint', 'cstring',
    'initializer_list', 'iterator', 'limits', 'new', 'numeric', 'type_traits', 'utility',
    'limits.h', 'stddef.h', 'stdint.h', 'string.h',
}
PORTABLE_EXCEPTIONS = {
    ('protocol/crc32.cpp', 'libdeflate.h'),  # only where R4_CRC32_LIBDEFLATE
    ('protocol/grammar.cpp', 'emmintrin.h'),  # only where __SSE2__
}
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
SPDX = '// SPDX-License-Identifier: GPL-3.0-or-later'


def layer_of(path):
    return next((layer for layer in LAYERS if path.startswith(layer + '/')), None)


def faults_of(root, path):
    """Yields (line, reason) for each broken rule of the source at `path` below `root`."""
    layer = layer_of(path)
    allowed = ALLOWED[layer] | {layer}
    if path.startswith('host/sim_carrier'):
        allowed = allowed | {'firmware/ports'}
    lines = (root / path).read_text().splitlines()
    if not lines or lines[0] != SPDX:
        yield 1, f'the first line is not "{SPDX}"'
    for number, line in enumerate(lines, 1):
        match = INCLUDE.match(line)
        if not match:
            continue
        quote, name = match.groups()
        if quote == '<':
            if (layer in PORTABLE and name not in PORTABLE_STANDARD
                    and (path, name) not in PORTABLE_EXCEPTIONS):
                yield number, f'<{name}> is not for portable code'
            continue
        target = ((root / path).parent / name).resolve()
        if not target.is_file() and layer == 'tools':
            target = (root / name).resolve()
        if not target.is_file():
            yield number, f'"{name}" is not there (write it relative to this file)'
            continue
        other = layer_of(str(target.relative_to(root))) if target.is_relative_to(root) else None
        if other not in allowed:
            yield number, f'{layer} may not include {other or "what is outside the layers"}: "{name}"'


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    sources = sorted(str(path.relative_to(root)) for top in ('protocol', 'transports', 'firmware', 'host', 'tools')
                     for path in (root / top).rglob('*') if path.suffix in ('.hpp', '.cpp'))
    faults = [f'{path}:{line}: {reason}' for path in sources for line, reason in faults_of(root, path)]
    print('\n'.join(faults + [f'{len(sources)} sources, {len(faults)} faults']))
    return 1 if faults or not sources else 0


if __name__ == '__main__':
    sys.exit(main())
