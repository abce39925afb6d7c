# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a command in a guest under QEMU whose kernel has CAN, as if the command ran on this machine.

The guest sees the host's root file system by 9p. The command's input and outputs go over virtio
serial ports. Each is a socket pair between QEMU and here, so that no byte is translated and no
file is left. `init` is the guest's side, and documents the lines on the control port.
"""
import ctypes
import fcntl
import os
import pathlib
import secrets
import selectors
import shlex
import shutil
import signal
import socket
import struct
import subprocess
import sys
import termios
import threading
import time
import tty

from cable import Cable
from kernel import Cpio, prepared
from trouble import Trouble

QEMU = 'qemu-system-x86_64'
# A boot takes 4 s of processor time, and much longer on a busy machine.
BOOT_S = 60
BOOT_CPU_S = 30
LONGEST_BOOT_S = 600
KILL_AFTER_S = 2  # after the time limit's SIGTERM
TIME_LIMIT_EXIT = 124  # as timeout(1)
KERNEL_ARGUMENTS = ('console=ttyS0 quiet panic=-1 mitigations=off no_timer_check tsc=reliable '
                    'net.ifnames=0 random.trust_cpu=on')
# Page tables of four levels, and no kernel protection that costs time at each access to memory: 25 % less time.
MACHINE = ('-M pc -cpu max,-la57,-smap,-smep,-umip,-pku -m 768M '
           '-nodefaults -no-user-config -vga none -display none -no-reboot -device virtio-serial-pci,max_ports=8').split()
# One processor, whose instructions take 2 ns each. The guest's clock counts them, and stops while QEMU has no
# processor. While the guest waits, the guest's clock is this machine's.
COUNTED_TIME = '-accel tcg -icount shift=1 -smp 1'.split()
# A guest with a cable to a program of this machine needs the same clock as the program.
REAL_TIME = '-accel tcg,thread=multi -smp 2'.split()
CAN = ('-object can-bus,id=bus -device kvaser_pci,canbus=bus '
       '-device kvaser_pci,canbus=bus').split()
PASSED_ON = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1,
             signal.SIGUSR2)
HERE = pathlib.Path(__file__).parent


def job(command):
    """The text of /job, a shell script in the guest's own root, which becomes the command."""
    variables = dict(os.environb)
    variables[b'PATH'] = b'/run/r4/bin:' + variables.get(b'PATH', os.fsencode(os.defpath))
    variables[b'TMPDIR'] = b'/run/tmp'
    variables[b'R4_CAN_GUEST'] = b'1'
    words = ['/usr/bin/env', '-i', '-C', os.getcwd()]
    words += [os.fsdecode(name + b'=' + value) for name, value in variables.items()]
    if os.geteuid() != 0:
        groups = os.getgroups()
        words += ['/usr/bin/setpriv', f'--reuid={os.geteuid()}', f'--regid={os.getegid()}',
                  '--groups=' + ','.join(map(str, groups)) if groups else '--clear-groups',
                  # The right to set up the network is harmless, because the guest has its own network.
                  '--inh-caps=+net_admin,+net_raw', '--ambient-caps=+net_admin,+net_raw']
    words += command
    return os.fsencode('echo $$ >/pid.job\nexec chroot /host ' + shlex.join(words) + '\n')


def die_with_us():
    """Lets the kernel kill QEMU if this process ends without ending QEMU."""
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
    if os.getppid() == 1:
        os._exit(1)


class Interrupted(Exception):
    """Ends the guest early; the argument is the exit status of the command."""

    def __init__(self, status):
        super().__init__()
        self.status = status


class Output(threading.Thread):
    """Copies the bytes of a port to a file of this process, up to the mark."""

    def __init__(self, port, descriptor, mark, on_closed, on_done):
        super().__init__(daemon=True)
        self._port = port
        self._descriptor = descriptor
        self._mark = mark
        self._on_closed = on_closed
        self._on_done = on_done
        self.done = False
        self.start()

    def run(self):
        kept = b''  # bytes that may be the beginning of the mark
        while not kept.endswith(self._mark):
            received = self._port.recv(1 << 18)
            if not received:
                break
            kept += received
            sure = len(kept) - self._beginning_of_mark(kept)
            self._write(kept[:sure])
            kept = kept[sure:]
        else:
            kept = b''
        self._write(kept)
        self.done = True
        self._on_done()

    def _beginning_of_mark(self, received):
        for length in range(min(len(self._mark), len(received)), 0, -1):
            if received.endswith(self._mark[:length]):
                return length
        return 0

    def _write(self, received):
        left = memoryview(received)
        while left and self._descriptor is not None:
            try:
                left = left[os.write(self._descriptor, left):]
            except BlockingIOError:
                selector = selectors.DefaultSelector()
                selector.register(self._descriptor, selectors.EVENT_WRITE)
                selector.select()
            except OSError:  # no reader: the command gets SIGPIPE, as on this machine
                self._descriptor = None
                self._on_closed()


def feed(port):
    """Copies our stdin to a port, in a new thread."""
    def run():
        try:
            while True:
                received = os.read(0, 1 << 18)
                if not received:
                    break
                port.sendall(received)
            port.shutdown(socket.SHUT_WR)
        except OSError:  # no stdin, or the guest has ended
            try:
                port.shutdown(socket.SHUT_WR)
            except OSError:
                pass
    threading.Thread(target=run, daemon=True).start()


class Lines:
    """Splits the bytes that a socket receives into lines."""

    def __init__(self, source):
        self._source = source
        self._rest = b''

    def received(self):
        try:
            self._rest += self._source.recv(65536)
        except OSError:
            return []
        *lines, self._rest = self._rest.split(b'\n')
        return [line.decode(errors='replace') for line in lines]


class Guest:
    """One run of one command."""

    def __init__(self, command, usb=None, limit=None, verbose=False):
        if shutil.which(QEMU) is None:
            raise Trouble(QEMU, 'it is not installed', 'tools/setup --can')
        if shutil.which('ip', path=os.environ.get('PATH', '') + ':/usr/sbin:/sbin') is None:
            raise Trouble('ip', 'it is not installed', 'tools/setup --can')
        self._command = command
        self._cable = Cable(usb) if usb else None
        self._kernel = prepared()
        self._limit = limit
        self._limit_passed = False
        self._began = 0.0
        self._deadline = None
        self._verbose = verbose
        self._qemu = None
        self._mark = secrets.token_hex(16).encode()
        self._terminal = os.isatty(0) and os.isatty(1)
        self._errors_apart = not (self._terminal and os.isatty(2))
        self._ends = []  # QEMU's ends of the socket pairs
        self._arguments = []
        self._console = b''
        self._status = None
        self._ready = False

    def run(self):
        """Runs the command; returns its exit status."""
        saved = termios.tcgetattr(0) if self._terminal else None
        try:
            self._take_signals()
            self._start()
            return self._watch()
        except Interrupted as interrupted:
            return interrupted.status
        finally:
            if self._qemu:
                self._qemu.kill()
                self._qemu.wait()
            if saved:
                termios.tcsetattr(0, termios.TCSAFLUSH, saved)

    def _take_signals(self):
        """Directs the signals to a socket, which the loop reads."""
        self._woken, self._waking = socket.socketpair()
        self._waking.setblocking(False)
        for number in (*PASSED_ON, signal.SIGWINCH):
            if signal.getsignal(number) != signal.SIG_IGN:  # ignored under nohup, or in the background of a shell
                signal.signal(number, lambda *_: None)
        signal.set_wakeup_fd(self._waking.fileno(), warn_on_full_buffer=False)

    def _channel(self, name):
        """Adds a chardev to QEMU; returns our end of it."""
        ours, qemus = socket.socketpair()
        self._ends.append(qemus)
        self._arguments += ['-chardev', f'socket,id={name},fd={qemus.fileno()}']
        return ours

    def _port(self, name, number):
        ours = self._channel(name)
        kind = 'virtconsole' if number == 0 else 'virtserialport'
        self._arguments += ['-device', f'{kind},chardev={name},nr={number},name=r4.{name}']
        return ours

    def _start(self):
        self._log = self._channel('log')
        self._arguments += ['-serial', 'chardev:log']
        self._control = self._port('control', 1)
        ports = {}
        if self._terminal:
            ports['out'] = ports['in'] = self._port('terminal', 0)
        else:
            ports['in'] = self._port('in', 2)
            ports['out'] = self._port('out', 3)
        if self._errors_apart:
            ports['err'] = self._port('err', 4)
        if self._cable:
            self._arguments += self._cable.arguments()
            self._ends.append(self._cable.listener)
            self._cable.plug()
        # Made before QEMU starts, so that no other child inherits it incomplete.
        initrd = os.memfd_create('initrd')
        with open(initrd, 'wb', closefd=False) as file:
            file.write(self._kernel.initrd.read_bytes())
            file.write(self._own_files())
        descriptors = [end.fileno() for end in self._ends] + [initrd]
        self._qemu = subprocess.Popen(
            [QEMU, *MACHINE, *(REAL_TIME if self._cable else COUNTED_TIME), *CAN,
             '-fsdev', 'local,id=root,path=/,security_model=none,multidevs=remap',
             '-device', 'virtio-9p-pci,fsdev=root,mount_tag=hostroot', *self._arguments,
             '-kernel', str(self._kernel.vmlinux), '-initrd', f'/proc/self/fd/{initrd}',
             '-append', KERNEL_ARGUMENTS],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            pass_fds=descriptors, start_new_session=True, preexec_fn=die_with_us)
        for end in self._ends:
            end.close()
        os.close(initrd)
        self._outputs = [
            Output(ports[name], descriptor, self._mark, lambda name=name: self._tell(f'close {name}'),
                   lambda: self._waking.send(b'\0'))
            for name, descriptor in (('out', 1), ('err', 2)) if name in ports]
        self._input = ports['in']

    def _own_files(self):
        rows, columns = self._size()
        disk = Cpio()
        for name in ('init', 'r4-usb', 'for-everyone'):
            disk.add(name, 0o100755, (HERE / name).read_bytes())
        disk.add('job', 0o100644, job(self._command))
        disk.add('settings', 0o100644, os.fsencode(
            f'MARK={self._mark.decode()}\nHOST_NAME={shlex.quote(socket.gethostname())}\n'
            f'USB={int(bool(self._cable))}\nTERMINAL={int(self._terminal)}\nROWS={rows}\n'
            f'COLUMNS={columns}\nERRORS_APART={int(self._errors_apart)}\n'))
        return disk.closed()

    def _size(self):
        if not self._terminal:
            return 24, 80
        rows, columns, _, _ = struct.unpack('4H', fcntl.ioctl(1, termios.TIOCGWINSZ, bytes(8)))
        return rows or 24, columns or 80

    def _tell(self, line):
        try:
            self._control.sendall(line.encode() + b'\n')
        except OSError:
            pass  # QEMU has ended

    def _watch(self):
        """Handles all events except the bytes of the command, until the command ends."""
        control = Lines(self._control)
        ended = os.pidfd_open(self._qemu.pid)
        selector = selectors.DefaultSelector()
        for source, handler in (
                (self._control, lambda: [self._on_control(each) for each in control.received()]),
                (self._log, self._on_log),
                (self._woken, lambda: [self._on_signal(each) for each in self._woken.recv(64)]),
                (ended, self._on_end)):
            selector.register(source, selectors.EVENT_READ, handler)
        self._began = time.monotonic()
        self._deadline = self._began + BOOT_S
        while self._status is None or not all(output.done for output in self._outputs):
            left = None if self._deadline is None else self._deadline - time.monotonic()
            if left is not None and left <= 0:
                self._on_deadline()
                continue
            for key, _ in selector.select(left):
                key.data()
        return TIME_LIMIT_EXIT if self._limit_passed else self._status

    def _on_control(self, line):
        what, _, rest = line.partition(' ')
        if what == 'ready':
            self._ready = True
            self._deadline = None if self._limit is None else time.monotonic() + self._limit
            if self._terminal:
                tty.setraw(0)
                self._tell('size {} {}'.format(*self._size()))
            feed(self._input)
        elif what == 'exit':
            self._status = int(rest)
            self._deadline = None
        elif line == 'usb unplug':
            self._cable.unplug()
        elif line == 'usb plug':
            self._cable.plug()

    def _on_log(self):
        received = self._log.recv(65536)
        self._console = (self._console + received)[-8192:]
        if self._verbose:
            sys.stderr.buffer.write(received)
            sys.stderr.flush()

    def _on_signal(self, number):
        if number == signal.SIGWINCH:
            if self._terminal:
                self._tell('size {} {}'.format(*self._size()))
        elif number in PASSED_ON:
            if self._ready and self._status is None:
                self._tell(f'signal {signal.Signals(number).name[3:]}')
            else:
                raise Interrupted(128 + number)

    def _on_deadline(self):
        if not self._ready:
            took = time.monotonic() - self._began
            if took < LONGEST_BOOT_S and self._processor_s() < BOOT_CPU_S:
                self._deadline += BOOT_S
                return
            raise Trouble('the guest', f'it has not booted within {took:.0f} s: {self._last_words()}',
                          'try again when the machine is less busy; --verbose shows the boot')
        if self._limit_passed:
            raise Interrupted(TIME_LIMIT_EXIT)
        self._limit_passed = True
        self._say(f'the command has not ended within {self._limit:g} s')
        self._tell('signal TERM')
        self._deadline = time.monotonic() + KILL_AFTER_S

    def _processor_s(self):
        with open(f'/proc/{self._qemu.pid}/stat', encoding='ascii') as stat:
            user, system = stat.read().rsplit(')', 1)[1].split()[11:13]
        return (int(user) + int(system)) / os.sysconf('SC_CLK_TCK')

    def _on_end(self):
        """Handles an end of QEMU that was not requested."""
        reason = self._qemu.stderr.read().decode(errors='replace').strip().splitlines()
        if reason:
            raise Trouble(QEMU, reason[-1], 'is it the version that the system has packaged? '
                          'tools/setup --can installs it')
        raise Trouble('the guest', f'its kernel has stopped: {self._last_words()}',
                      '--verbose shows all that it said; rm -r ' + str(self._kernel.vmlinux.parent) +
                      ' makes a new one from the package')

    def _last_words(self):
        try:
            self._log.setblocking(False)
            self._console += self._log.recv(65536)
        except OSError:
            pass
        lines = [line.strip() for line in self._console.decode(errors='replace').splitlines()]
        told = [line for line in lines if 'Kernel panic' in line] or list(filter(None, lines))
        return told[-1] if told else 'it has said nothing'

    @staticmethod
    def _say(text):
        print(f'with-can: {text}', file=sys.stderr, end='\r\n' if os.isatty(2) else '\n')
