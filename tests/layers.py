#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fails when a source includes a file that its room (folder) may not include. Usage: layers.py TREE

The layers are host > transports > protocol, and firmware > transports/framing > protocol; tools include public headers,
and some rooms of tools any layer. ALLOWED orders
the rooms of a layer. Only host/standard_registry.cpp may include firmware/ports/sim. The public headers, include/r4link,
are below all layers. The portable rooms (protocol, transports/framing, firmware without its ports, the chip models)
and the public headers that these rooms include use only headers that a C++14 board has.
A room holds at most 20 sources. A source has at most 430 lines.
"""
import collections
import pathlib
import re
import sys

PUBLIC = {'include/r4link', 'include/r4link/can', 'include/r4link/commands', 'include/r4link/commissioning', 'include/r4link/control',
          'include/r4link/devices', 'include/r4link/discovery', 'include/r4link/messages', 'include/r4link/recordings',
          'include/r4link/simulation', 'include/r4link/tables', 'include/r4link/transports', 'include/r4link/wiring'}
PROTOCOL = PUBLIC | {'protocol/datagram', 'protocol/keys', 'protocol/messages', 'protocol/link', 'protocol/wiring'}
FRAMING = PROTOCOL | {'transports/framing', 'transports/framing/can'}
CARRIERS = {'transports/can', 'transports/impaired', 'transports/own', 'transports/serial', 'transports/share', 'transports/udp',
            'transports/udp/network', 'transports/udp/search'}
TRANSPORTS = FRAMING | CARRIERS | {'transports'}
FIRMWARE = FRAMING | {'firmware', 'firmware/application', 'firmware/devices', 'firmware/drivers'}
MODELS = {'firmware/ports/sim/chips', 'firmware/ports/sim/devices', 'firmware/ports/sim/robot'}
HOST = TRANSPORTS | {'host', 'host/arming', 'host/async', 'host/blocking', 'host/commands', 'host/control', 'host/devices',
                     'host/discovery', 'host/link', 'host/measurement', 'host/paths', 'host/recording', 'host/replay', 'host/session', 'host/uart', 'host/wiring'}
SIMULATED = HOST | FIRMWARE | MODELS | {'firmware/ports/sim'}
SHELL = PUBLIC | {'tools/r4/boards', 'tools/r4/shell'}
# Tools use only the public interface. Two rooms may include internal headers: the analysis of frames (bus) and the
# simulated board (sim). For single files see EXCEPTIONS.
BELOW = SIMULATED | SHELL
FORMATS = {'tools/r4/formats', 'tools/r4/formats/mcap', 'tools/r4/formats/packets'}
# room: the other rooms that it may include
ALLOWED = {
    'include/r4link': PUBLIC,
    'include/r4link/can': {'include/r4link', 'include/r4link/discovery', 'include/r4link/messages'},
    'include/r4link/commands': {'include/r4link'},
    'include/r4link/commissioning': {'include/r4link', 'include/r4link/wiring'},
    'include/r4link/control': {'include/r4link'},
    'include/r4link/devices': {'include/r4link'},
    'include/r4link/discovery': {'include/r4link'},
    'include/r4link/messages': {'include/r4link'},
    'include/r4link/recordings': {'include/r4link', 'include/r4link/messages'},
    'include/r4link/simulation': {'include/r4link'},
    'include/r4link/tables': {'include/r4link'},
    'include/r4link/transports': {'include/r4link'},
    'include/r4link/wiring': {'include/r4link', 'include/r4link/tables'},
    'protocol/datagram': PUBLIC,
    'protocol/keys': PUBLIC | {'protocol/datagram'},
    'protocol/messages': PUBLIC | {'protocol/datagram', 'protocol/keys', 'protocol/wiring'},
    'protocol/link': PROTOCOL,
    'protocol/wiring': PUBLIC | {'protocol/datagram'},
    'transports/framing': PROTOCOL,
    'transports/framing/can': FRAMING,
    'transports': FRAMING,
    'transports/can': FRAMING | {'transports'},
    'transports/impaired': FRAMING | {'transports'},
    'transports/serial': FRAMING | {'transports'},
    'transports/own': FRAMING | {'transports', 'transports/can'},
    'transports/share': FRAMING | {'transports'},
    'transports/udp/network': {'transports'},
    'transports/udp/search': FRAMING | {'transports', 'transports/udp/network'},
    'transports/udp': FRAMING | {'transports', 'transports/udp/network', 'transports/udp/search'},
    'firmware/drivers': PROTOCOL,
    'firmware/devices': PROTOCOL,
    'firmware': FRAMING | {'firmware/drivers'},
    'firmware/application': FRAMING | {'firmware', 'firmware/devices'},
    'firmware/ports': FIRMWARE,
    'firmware/ports/sim/chips': PUBLIC | {'firmware/drivers'},
    'firmware/ports/sim/devices': PUBLIC | {'firmware/devices', 'firmware/ports', 'firmware/ports/sim/chips'},
    'firmware/ports/sim/robot': FIRMWARE | {'firmware/ports/sim/chips', 'firmware/ports/sim/devices'},
    'firmware/ports/sim': FIRMWARE | MODELS | TRANSPORTS,
    'firmware/ports/m7/chip': FIRMWARE,
    'firmware/ports/m7/links': FIRMWARE | {'firmware/ports', 'firmware/ports/m7/chip'},
    'firmware/ports/m7': FIRMWARE | MODELS | {'firmware/ports', 'firmware/ports/m7/chip', 'firmware/ports/m7/links',
                                              'firmware/ports/sim'},
    'firmware/ports/giga/chip': FIRMWARE,
    'firmware/ports/giga/links': FIRMWARE | {'firmware/ports', 'firmware/ports/giga/chip'},
    'firmware/ports/giga/devices': FIRMWARE | {'firmware/ports', 'firmware/ports/giga/chip'},
    'firmware/ports/giga': FIRMWARE | {'firmware/ports/giga/chip', 'firmware/ports/giga/devices',
                                       'firmware/ports/giga/links'},
    'host/arming': TRANSPORTS | {'host/link', 'host/measurement'},
    'host/async': HOST,
    'host/blocking': TRANSPORTS | {'host/commands', 'host/measurement'},
    'host/bridge': HOST,
    'host/commands': TRANSPORTS | {'host/arming', 'host/link', 'host/measurement', 'host/paths'},
    'host/commissioning': PUBLIC | {'host'},
    'host/control': PUBLIC,
    'host/devices': HOST,
    'host/discovery': HOST,
    'host/fleet': HOST,
    'host/link': TRANSPORTS | {'host/measurement', 'host/paths'},
    'host/measurement': TRANSPORTS,
    'host/recording': TRANSPORTS,
    'host/replay': TRANSPORTS | {'host/recording'},
    'host/paths': TRANSPORTS | {'host/measurement'},
    'host/session': TRANSPORTS | {'host/arming', 'host/commands', 'host/link', 'host/measurement', 'host/paths'},
    'host/uart': HOST,
    'host/wiring': PUBLIC | {'host', 'protocol/wiring'},
    'host/python/bindings': PUBLIC,
    'host/python/bindings/board': PUBLIC | {'host/python/bindings'},
    'host/python/bindings/transports': PUBLIC | {'host/python/bindings'},
    'host': HOST,
    'tools/r4/shell': PUBLIC,
    'tools/r4/boards': PUBLIC | {'tools/r4/shell'},
    'tools/r4/manual': SHELL,
    'tools/r4/drive': SHELL,
    'tools/r4/list': SHELL,
    'tools/r4/doctor': SHELL | {'tools/r4/bus'},
    'tools/r4/bridge': SHELL,
    'tools/r4/bus': BELOW,
    'tools/r4/formats': SHELL | {'tools/r4/bus'},
    'tools/r4/formats/mcap': SHELL | {'tools/r4/formats'},
    'tools/r4/formats/packets': SHELL | {'tools/r4/bus', 'tools/r4/formats'},
    'tools/r4/devices': SHELL,
    'tools/r4/recording': SHELL | FORMATS,
    'tools/r4/watch': SHELL | {'tools/r4/bus', 'tools/r4/devices', 'tools/r4/web/server'},
    'tools/r4/ros2/domain': SHELL,
    'tools/r4/ros2/graph': SHELL | {'tools/r4/ros2/domain'},
    'tools/r4/ros2/discovery': SHELL | {'tools/r4/ros2/graph'},
    'tools/r4/ros2': SHELL | {'tools/r4/devices', 'tools/r4/ros2/domain', 'tools/r4/ros2/graph', 'tools/r4/ros2/discovery'},
    'tools/r4/sim': BELOW,
    'tools/r4/wiring': SHELL,
    'tools/r4/commission': SHELL,
    'tools/r4/web/server': SHELL,
    'tools/r4/web': SHELL | FORMATS | {'tools/r4/devices', 'tools/r4/watch', 'tools/r4/web/server'},
    'tools/r4': SHELL | {'tools/r4/ros2'},
}
# file: the rooms that it may include although its own room may not
EXCEPTIONS = {
    'transports/registry.cpp': CARRIERS,
    'host/standard_registry.cpp': {'firmware/ports/sim'},
    # Prints every part of a datagram as it is sent.
    'tools/r4/watch/decode.cpp': BELOW,
    # Makes the frames of both ends of a CAN bus, including flow control, with the node of each end.
    'tools/r4/formats/candump_log.cpp': {'transports', 'transports/framing/can'},
}
# room: the files that it may not include although it may include their room
FORBIDDEN = {room: {'transports/registry.hpp'} for room in CARRIERS}
PORTABLE = (FIRMWARE - PUBLIC) | {'firmware/ports/sim/chips', 'firmware/ports/sim/devices'}
# The public headers that the board also uses.
PORTABLE_PUBLIC = {f'include/r4link/{name}.hpp' for name in (
    'can/can_bits', 'can/can_frame', 'can/can_ids', 'command', 'config', 'datagram', 'key', 'messages/datagram_writer',
    'messages/message', 'messages/packed_form', 'messages/packet_tracker', 'simulation/simulated_pins', 'state', 'tables/commands',
    'tables/settings', 'tables/state_fields', 'text', 'vocabulary', 'wiring/wiring', 'wiring/wiring_value')} | {'include/r4link/tables/board.def'}
# Headers of GCC 7 with C++14 that need no heap, I/O or clock. C headers have both spellings.
PORTABLE_STANDARD = {
    'algorithm', 'array', 'atomic', 'cassert', 'climits', 'cmath', 'cstddef', 'cstdint', 'cstring',
    'initializer_list', 'iterator', 'limits', 'new', 'numeric', 'type_traits', 'utility',
    'limits.h', 'stddef.h', 'stdint.h', 'string.h',
}
PORTABLE_EXCEPTIONS = {
    ('protocol/datagram/crc32.cpp', 'libdeflate.h'),  # only with R4_CRC32_LIBDEFLATE
    ('protocol/datagram/grammar.cpp', 'emmintrin.h'),  # only with __SSE2__
}
MOST_SOURCES = 20
MOST_LINES = 430
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
SPDX = '// SPDX-License-Identifier: GPL-3.0-or-later'


def faults_of(root, path):
    """Yields (line, reason) for each broken rule of the source at `path` below `root`."""
    room = str(pathlib.PurePath(path).parent)
    if room not in ALLOWED:
        yield 1, f'{room} is not a room of ALLOWED in tests/layers.py'
        return
    allowed = ALLOWED[room] | {room} | EXCEPTIONS.get(path, set())
    portable = room in PORTABLE or path in PORTABLE_PUBLIC
    lines = (root / path).read_text().splitlines()
    if not lines or lines[0] != SPDX:
        yield 1, f'the first line is not "{SPDX}"'
    if len(lines) > MOST_LINES:
        yield len(lines), f'{MOST_LINES} lines at most: a file holds one idea'
    for number, line in enumerate(lines, 1):
        match = INCLUDE.match(line)
        if not match:
            continue
        quote, name = match.groups()
        if quote == '<':
            if portable and name not in PORTABLE_STANDARD and (path, name) not in PORTABLE_EXCEPTIONS:
                yield number, f'<{name}> is not for portable code'
            continue
        target = ((root / path).parent / name).resolve()
        if not target.is_file():
            target = (root / 'include' / name).resolve()
        if not target.is_file() and room.startswith('tools/'):
            target = (root / name).resolve()
        if not target.is_file():
            yield number, f'"{name}" is not there (write it relative to this file)'
            continue
        other = target.relative_to(root) if target.is_relative_to(root) else None
        if other is None or str(other.parent) not in allowed or str(other) in FORBIDDEN.get(room, ()):
            yield number, f'{room} may not include {other or "what is outside the tree"}'
        elif portable and str(other.parent) in PUBLIC and str(other) not in PORTABLE_PUBLIC:
            yield number, f'{other} is not for portable code'


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    tops = ('include', 'protocol', 'transports', 'firmware', 'host', 'tools')
    sources = sorted(str(path.relative_to(root)) for top in tops
                     for path in (root / top).rglob('*') if path.suffix in ('.hpp', '.cpp'))
    faults = [f'{path}:{line}: {reason}' for path in sources for line, reason in faults_of(root, path)]
    rooms = collections.Counter(str(pathlib.PurePath(path).parent) for path in sources)
    faults += [f'{room} holds {count} sources, {MOST_SOURCES} at most: make a room of what belongs together'
               for room, count in rooms.items() if count > MOST_SOURCES]
    print('\n'.join(faults + [f'{len(sources)} sources, {len(faults)} faults']))
    return 1 if faults or not sources else 0


if __name__ == '__main__':
    sys.exit(main())
