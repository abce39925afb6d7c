# SPDX-License-Identifier: GPL-3.0-or-later
"""Another participant in a ROS 2 graph: ros2_peer (ros2_peer.cpp) on Fast DDS, and a reader of CDR."""
import contextlib
import itertools
import json
import os
import queue
import struct
import subprocess
import threading
import time

from r4_process import PATIENCE_S, R4, Board, Running, again

PROGRAM = os.path.join(os.path.dirname(R4), 'tests', 'ros2_peer')
# ROS domains: one per graph, because a killed participant stays in its graph for a while.
DOMAINS = itertools.count(os.getpid() * 8)
ENVIRONMENT = {name: value for name, value in os.environ.items()
               if not name.startswith('ROS_') and name != 'CYCLONEDDS_URI'}
# The DDS names of ROS 2's messages, and the hashes that releases since Iron compare (measured).
STRING, BOOL, FLOAT32, INT32, UINT32, TWIST, TWIST_STAMPED = (f'{package}::msg::dds_::{name}_' for package, name in (
    ('std_msgs', 'String'), ('std_msgs', 'Bool'), ('std_msgs', 'Float32'), ('std_msgs', 'Int32'), ('std_msgs', 'UInt32'),
    ('geometry_msgs', 'Twist'), ('geometry_msgs', 'TwistStamped')))
LOG = 'rcl_interfaces::msg::dds_::Log_'
DIAGNOSTICS = 'diagnostic_msgs::msg::dds_::DiagnosticArray_'
NODES = 'rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_'
NODES_HASH = 'typehash=RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e;'
HEAD = bytes((0, 1, 0, 0))  # little-endian XCDR1


def own_domain():
    """The environment of a new graph. Its ports, 7400 + 250 per domain, are below the ports that Linux assigns."""
    return {**ENVIRONMENT, 'ROS_DOMAIN_ID': str(1 + next(DOMAINS) % 100)}


class Ros2(Running):
    """A running r4 ros2. `ready` is its first report."""

    def __init__(self, domain, *arguments, **process):
        super().__init__('ros2', '--json', *arguments, env=domain, **process)
        self.domain = domain
        self.ready = self.next(lambda each: each['type'] == 'ready')

    def armed(self, timeout=PATIENCE_S):
        return self.next(lambda each: each['type'] == 'log' and each['text'] == 'armed', timeout)

    def logged_both(self, *texts):
        """Waits until all texts are logged, in any order."""
        missing = set(texts)
        while missing:
            missing.discard(self.next(lambda each: each['type'] == 'log')['text'])

    def logged(self, words, **options):
        return self.next(lambda each: each['type'] == 'log' and words in each['text'], **options)


class Peer:
    def __init__(self, domain, **process):
        assert os.path.exists(PROGRAM), (
            f'{PROGRAM} is not built, for which Fast DDS is needed\n  fix: install it (Debian 12 and Ubuntu: libfastrtps-dev; '
            'Debian 13: libfastdds-dev), then configure and build again')
        self.process = subprocess.Popen([PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                        env=domain, **process)
        self.lines = queue.Queue()
        self.endpoints = {}  # (kind, topic) -> the endpoint
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.put((time.monotonic(), json.loads(line)))

    def say(self, *words):
        self.process.stdin.write(' '.join(words) + '\n')
        self.process.stdin.flush()

    def read(self, topic, of, reliability='reliable', durability='volatile', user_data='-'):
        self.say('reader', topic, of, reliability, durability, user_data)

    def writer(self, topic, of, reliability='reliable', durability='volatile', user_data='-', matched=True):
        self.say('writer', topic, of, reliability, durability, user_data)
        if matched:
            self.next(lambda each: each['type'] == 'matched' and each['topic'] == topic and each['readers'] > 0)

    def write(self, topic, payload):
        self.say('write', topic, (HEAD + payload).hex())

    def write_raw(self, topic, data):
        """Writes `data` without a change, with or without the four bytes of the encapsulation."""
        self.say('write', topic, data.hex())

    def counted(self, topic):
        """The number of samples that the slowest reader of the crowd has received."""
        self.say('count', topic)
        return self.next(lambda each: each['type'] == 'counted')['least']

    def next(self, is_it, timeout=PATIENCE_S):
        deadline = time.monotonic() + timeout
        while True:
            try:
                came, each = self.lines.get(timeout=max(0, deadline - time.monotonic()))
            except queue.Empty:
                raise AssertionError(f'nothing of that kind within {timeout} s') from None
            each['came'] = came
            if each['type'] == 'endpoint':
                if each['gone']:
                    self.endpoints = {key: value for key, value in self.endpoints.items() if value['gid'] != each['gid']}
                else:
                    self.endpoints[each['kind'], each['topic']] = each
            if is_it(each):
                return each

    def sample(self, topic, is_it=lambda payload: True, timeout=PATIENCE_S):
        """Returns the payload of the next sample for which `is_it` is true."""
        found = []

        def matches(each):
            if each['type'] != 'sample' or each['topic'] != topic:
                return False
            data = bytes.fromhex(each['bytes'])
            assert data[:2] == HEAD[:2], data
            found.append(data[4:])
            return is_it(data[4:])
        each = self.next(matches, timeout)
        return Payload(found[-1], each['came'])

    def endpoint(self, kind, topic, timeout=PATIENCE_S):
        """Returns the report on a reader or writer of another participant, and waits until it exists."""
        if (kind, topic) not in self.endpoints:
            self.next(lambda each: (kind, topic) in self.endpoints, timeout)
        return self.endpoints[kind, topic]

    def end(self):
        self.process.stdin.close()
        self.process.wait(timeout=PATIENCE_S)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self.reader.join(PATIENCE_S)
        self.process.stdout.close()


@contextlib.contextmanager
def armed(*arguments, options=()):
    """A board, its armed node, and a peer."""
    domain = own_domain()
    with Board('udp://127.0.0.1:0', options=options) as board, Peer(domain) as peer:
        with Ros2(domain, board.host_url, '--arm', *arguments) as ros2:
            ros2.armed()
            yield board, ros2, peer
            assert ros2.end() == 0, ros2.errors
            peer.end()


def join(ros2, peer, topic, of):
    """Makes a publisher of the peer, and waits until both ends have matched it.

    A sample written at once may be lost, because a DDS reader drops samples before the writer's first heartbeat.
    So a test that writes a sample only once must do so after another sample has arrived.
    """
    peer.writer(f'rt/{topic}', of)
    ros2.logged(f'{topic}: 1 publishers')


def arm(ros2, peer):
    """Presses the button until the board is armed, because a sample may be lost or arrive too late."""
    def press():
        for pressed in (b'\x00', b'\x01'):
            peer.write('rt/arm', pressed)
    again(press, ros2.armed)


def drive(board, peer, topic, payload, is_it):
    """Repeats the sample until `is_it` is true for the outputs. Returns the time of the last write, and the outputs."""
    written, came = again(lambda: peer.write(topic, payload), lambda timeout: board.outputs(is_it, timeout))
    return written, came['outputs']


def pwm(outputs, channel):
    """The signed pwm of an OSMC channel."""
    value, direction = outputs['osmc'][channel - 1]
    return value if direction else -value


class Payload(bytes):
    """A sample's bytes after the encapsulation, with the time of their arrival."""

    def __new__(cls, data, came=0.0):
        self = super().__new__(cls, data)
        self.came = came
        return self


class Cdr:
    """Reads XCDR1, little-endian."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def take(self, form):
        size = struct.calcsize(form)
        self.at += -self.at % size
        (value,) = struct.unpack_from('<' + form, self.data, self.at)
        self.at += size
        return value

    def text(self):
        size = self.take('I')
        data = self.data[self.at:self.at + size]
        self.at += size
        assert data[-1:] == b'\0', data
        return data[:-1].decode()

    def list(self, read):
        return [read() for _ in range(self.take('I'))]

    def header(self):
        seconds, nanoseconds = self.take('i'), self.take('I')
        return seconds + nanoseconds / 1e9, self.text()


def text(value):
    data = value.encode() + b'\0'
    return struct.pack('<I', len(data)) + data


def texts(payload):
    return Cdr(payload).text()


def float32(value):
    return struct.pack('<f', value)


def twist(linear, angular):
    return struct.pack('<6d', linear, 0, 0, 0, 0, angular)


def stamped(stamp, payload):
    """A message that begins with a header: `stamp` in seconds, and an empty frame."""
    return struct.pack('<iIIB3x', int(stamp), int(stamp % 1 * 1e9), 1, 0) + payload


def health_of(payload):
    """(level, name, message, hardware id, values) of the only status in a message of /diagnostics."""
    cdr = Cdr(payload)
    cdr.header()
    assert cdr.take('I') == 1
    level, name, message, hardware = cdr.take('B'), cdr.text(), cdr.text(), cdr.text()
    return level, name, message, hardware, dict((cdr.text(), cdr.text()) for _ in range(cdr.take('I')))


def nodes_of(payload, gid_size):
    """{node: (readers, writers)} of a ros_discovery_info whose ids have `gid_size` bytes."""
    cdr = Cdr(payload)

    def gid():
        data = cdr.data[cdr.at:cdr.at + gid_size]
        cdr.at += gid_size
        return data
    gid()
    nodes = {}
    for _ in range(cdr.take('I')):
        space, name = cdr.text(), cdr.text()
        nodes[space.rstrip('/') + '/' + name] = (cdr.list(gid), cdr.list(gid))
    assert cdr.at == len(payload), (cdr.at, payload)
    return nodes
