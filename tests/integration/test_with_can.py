# SPDX-License-Identifier: GPL-3.0-or-later
"""tools/with-can: a command in its guest behaves as on this machine, and no guest remains after its end."""
import os
import pathlib
import pty
import random
import shutil
import signal
import subprocess
import tempfile
import termios
import time

import pytest

TOOLS = pathlib.Path(__file__).resolve().parents[2] / 'tools'
WITH_CAN = [str(TOOLS / 'with-can'), '--guest']
PATIENCE_S = 600  # for the guest on a busy machine
ERROR = 'tools/with-can: '


def run(*command, **options):
    options = {'capture_output': True, 'stdin': subprocess.DEVNULL, **options}
    if 'input' in options:
        del options['stdin']
    return subprocess.run([*WITH_CAN, *command], timeout=PATIENCE_S, check=False, **options)


def children(pid):
    with open(f'/proc/{pid}/task/{pid}/children', encoding='ascii') as file:
        return [int(each) for each in file.read().split()]


def await_guest(process):
    """Returns the process id of QEMU as soon as QEMU runs, even if the guest has not booted."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        for pid in children(process.pid):
            if pathlib.Path(f'/proc/{pid}/comm').read_text(encoding='ascii').startswith('qemu'):
                return pid
        time.sleep(0.01)
    raise AssertionError('there is no guest')


def await_end(pid):
    deadline = time.monotonic() + 10
    while os.path.exists(f'/proc/{pid}') and time.monotonic() < deadline:
        with open(f'/proc/{pid}/stat', encoding='ascii') as stat:
            if ') Z ' in stat.read():
                return True
        time.sleep(0.01)
    return not os.path.exists(f'/proc/{pid}')


@pytest.fixture(scope='module', autouse=True)
def kernel():
    """Prepares the kernel, which the first run downloads."""
    subprocess.run(['/usr/bin/python3', '-B', '-c', 'import kernel; kernel.prepared()'], check=True, timeout=300,
                   env={**os.environ, 'PYTHONPATH': f'{TOOLS}:{TOOLS}/with-can.d'})


ARGUMENTS = ['', "a 'b' $c\n"]
CONTENT = bytes(range(256)) * 64 + random.Random(1).randbytes(4_000_000)
NEEDS = '''
import mmap, os, pty, socket, sys, tempfile
print(os.getcwdb(), os.environ["ODD"], sys.argv[1:])
open("made", "w").write("x" * 3_000_000)
os.chdir(tempfile.mkdtemp())
os.mkfifo('fifo')
listener = socket.socket(socket.AF_UNIX)
listener.bind('socket')
os.ttyname(pty.openpty()[1])
open('/dev/shm/r4', 'w').write('x')
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
    one.bind(('127.0.0.1', 0))
    one.sendto(b'x', one.getsockname())
    assert one.recv(9) == b'x'
print(os.environ['R4_CAN_GUEST'])
'''
FRAMES = r'''
for pair in "vcan0 vcan0" "vxcan0 vxcan1" "vxcan1 vxcan0" "can0 can1" "can1 can0"; do
  set -- $pair
  candump -T 20000 -n 1 $2 &
  until grep -q "^ *$2 " /proc/net/can/rcvlist_all; do sleep 0.01; done
  cansend $1 123#DEADBEEF
  wait
done
candump -T 20000 -n 1 vcan0 &
until grep -q '^ *vcan0 ' /proc/net/can/rcvlist_all; do sleep 0.01; done
cansend vcan0 123##1000102030405060708090A0B0C0D0E0F
wait
[ "$(id -u)" = 0 ] || exit 0
ip link del vcan0 && ip link del vxcan0
"$TOOL" sh -c 'cat /sys/class/net/vcan0/mtu /sys/class/net/vxcan1/tx_queue_len; exit 9' here
echo $?
ls /sys/class/net
'''


@pytest.fixture(scope='module', name='folder')
def folder_of_the_command(tmp_path_factory):
    return tmp_path_factory.mktemp('folder')


@pytest.fixture(scope='module', name='result')
def what_a_command_has_done(folder):
    """Runs one command for four tests, because a boot takes long. The command leaves the output of its programs in `folder`."""
    (folder / 'frames.sh').write_text(FRAMES)
    return run('sh', '-c', r"""/usr/bin/python3 -S -c "$0" "$@" </dev/null >told 2>&1
sh frames.sh </dev/null >frames 2>&1; printf 'a\r\n\000b\nc' >&2; cat; exit 255""", NEEDS, *ARGUMENTS, cwd=folder,
               input=CONTENT, env={**os.environ, 'ODD': "x'\n$y", 'TOOL': str(TOOLS / 'with-can')})


def test_the_streams_and_the_exit_status_pass_unchanged(result):
    assert result.returncode == 255
    assert result.stdout == CONTENT
    assert result.stderr == b'a\r\n\0b\nc'


def test_directory_environment_and_arguments_are_those_of_the_caller(result, folder):
    assert (folder / 'told').read_text().startswith(f"{os.fsencode(folder)} x'\n$y {ARGUMENTS}\n"), result.stderr
    assert (folder / 'made').read_text() == 'x' * 3_000_000


def test_what_tests_need_is_there(result, folder):
    assert (folder / 'told').read_text().splitlines()[2:] == ['1'], result.stderr


def test_every_bus_of_the_guest_passes_frames_and_can_be_changed(result, folder):
    lines = [line.split() for line in (folder / 'frames').read_text().splitlines()]
    assert [line[0] for line in lines[:6]] == ['vcan0', 'vxcan1', 'vxcan0', 'can1', 'can0', 'vcan0'], result.stderr
    assert all(line[1:] == ['123', '[4]', 'DE', 'AD', 'BE', 'EF'] for line in lines[:5])
    assert lines[5][1:4] == ['123', '[16]', '00']
    if os.geteuid() == 0:
        assert lines[6:] == [['72'], ['1000'], ['9'], ['can0'], ['can1'], ['lo']]


def test_ctrl_c_reaches_the_command_and_the_time_limit_ends_it():
    with subprocess.Popen([*WITH_CAN, '--time', '3', 'sh', '-c', 'trap "echo interrupted" INT; echo begun; '
                           'while :; do sleep 0.1; done'], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE) as process:
        assert process.stdout.readline() == b'begun\n'
        qemu, = children(process.pid)
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == b'interrupted\n'
        assert process.wait(timeout=PATIENCE_S) == 124 and b'3 s' in process.stderr.read()
        assert await_end(qemu)


def test_a_killed_wrapper_leaves_no_guest():
    with subprocess.Popen([*WITH_CAN, 'sleep', '60'], stdin=subprocess.DEVNULL) as process:
        qemu = await_guest(process)
        process.kill()
        assert process.wait(timeout=PATIENCE_S) == -signal.SIGKILL
        assert await_end(qemu)


def test_the_command_has_the_terminal_of_the_caller():
    process, terminal = pty.fork()
    if process == 0:
        termios.tcsetwinsize(0, (33, 99))  # set in the child, because the parent may be too late
        os.execv(WITH_CAN[0], [*WITH_CAN, 'sh', '-c', 'tty; stty size; sleep 60'])
    seen = b''
    while b'33 99' not in seen:
        try:
            seen += os.read(terminal, 4096)
        except OSError as error:
            pytest.fail(f'it ended, and said {seen!r}: {error}')
    assert b'/dev/hvc0\r\n' in seen
    os.write(terminal, b'\x03')
    assert os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) == 128 + signal.SIGINT
    os.close(terminal)


def test_an_ordinary_user_can_run_a_command_with_his_own_ids():
    if os.geteuid() != 0:
        result = run('sh', '-c', 'id -u; ip link set can0 down; kill -SEGV $$')
        assert (result.stdout, result.stderr) == (b'%d\n' % os.geteuid(), b'')
        assert result.returncode == 128 + signal.SIGSEGV
        return
    # pytest's folders cannot be used, because every start of pytest closes them to other users.
    with tempfile.TemporaryDirectory(prefix='r4-user-') as name:
        folder = pathlib.Path(name)
        os.chmod(folder, 0o755)
        cache = os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache')
        shutil.copytree(f'{cache}/r4link/with-can', folder / 'r4link' / 'with-can')
        shutil.copy(TOOLS / 'with-can', folder)
        shutil.copy(TOOLS / 'trouble.py', folder)
        shutil.copytree(TOOLS / 'with-can.d', folder / 'with-can.d')
        result = subprocess.run(
            ['runuser', '-u', 'nobody', '--', 'env', f'XDG_CACHE_HOME={folder}', folder / 'with-can',
             '--guest', 'sh', '-c', 'id -un; ip link set can0 down && echo down; cat /etc/shadow; kill -SEGV $$'],
            capture_output=True, timeout=PATIENCE_S, check=False, cwd='/', stdin=subprocess.DEVNULL)
    assert result.stdout == b'nobody\ndown\n', result
    assert b'Permission denied' in result.stderr and result.returncode == 128 + signal.SIGSEGV


@pytest.mark.parametrize('arguments, environment, code, words', [
    (['no-such-command'], {}, 127, 'no such command'),
    ([], {}, 2, '--help'),
    (['--usb-serial', '/no/such/tty', 'true'], {}, 6, 'r4 sim pty:PATH'),
    (['--usb-serial', '/dev/null', 'true'], {}, 6, '/dev/null: it is neither a tty nor a socket'),
    (['/bin/true'], {'PATH': '/nowhere'}, 6, 'tools/setup --can'),
    (['true'], {'XDG_CACHE_HOME': '/dev/null'}, 6, 'XDG_CACHE_HOME'),
    (['true'], {'XDG_CACHE_HOME': '{tmp}', 'R4_CAN_KERNEL': '/no/such.deb'}, 6, 'R4_CAN_KERNEL'),
    (['true'], {'XDG_CACHE_HOME': '{tmp}', 'PATH': '{bin}'}, 6, 'apt-get update'),
])
def test_a_missing_requirement_is_reported_with_a_fix(tmp_path, arguments, environment, code, words):
    # A simulated Debian whose package lists are empty.
    programs = tmp_path / 'bin'
    programs.mkdir()
    for name in ('qemu-system-x86_64', 'ip', 'apt-get', 'dpkg-deb', 'apt-cache', 'true'):
        (programs / name).symlink_to('/bin/true')
    values = {key: value.format(tmp=tmp_path, bin=programs) for key, value in environment.items()}
    result = run(*arguments, env={**os.environ, **values}, text=True)
    assert result.returncode == code
    assert result.stderr.startswith(ERROR) and '\n  fix: ' in result.stderr
    assert words in result.stderr and result.stdout == ''


def test_an_invalid_kernel_package_of_the_user_is_named():
    result = run('true', env={**os.environ, 'R4_CAN_KERNEL': '/etc/passwd'}, text=True)
    assert result.returncode == 6 and result.stdout == ''
    assert f'{ERROR}/etc/passwd: it cannot be unpacked' in result.stderr
    assert '\n  fix: set R4_CAN_KERNEL to the path' in result.stderr


def test_a_kernel_panic_is_reported(tmp_path):
    cache = os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache')
    shutil.copytree(f'{cache}/r4link/with-can', tmp_path / 'r4link' / 'with-can', copy_function=os.symlink)
    for initrd in tmp_path.glob('r4link/with-can/kernel-*/initrd'):
        initrd.unlink()
        initrd.write_bytes(b'')
    result = run('true', env={**os.environ, 'XDG_CACHE_HOME': str(tmp_path)}, text=True)
    assert result.returncode == 6 and 'Kernel panic' in result.stderr and 'fix: ' in result.stderr


def test_the_workflow_action_ends_at_the_first_failed_command():
    program = TOOLS.parent / '.github/actions/with-can/run.sh'
    environment = {**os.environ, 'WITH_CAN_OPTIONS': '--guest --time 50',
                   'WITH_CAN_RUN': 'ip -br link show can1\nfalse\necho and on'}
    result = subprocess.run([program], env=environment, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert (result.returncode, result.stderr) == (1, '')
    assert result.stdout.startswith('can1 ') and 'and on' not in result.stdout
