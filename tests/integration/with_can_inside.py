# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests that test_can.py runs where the kernel has CAN: tools/with-can runs a command on that kernel."""
import os
import pathlib
import pty
import shutil
import signal
import subprocess
import tempfile

import pytest

if os.geteuid() != 0:
    pytest.skip('it takes root to make interfaces and to become somebody else', allow_module_level=True)

TOOLS = pathlib.Path(__file__).resolve().parents[2] / 'tools'
WITH_CAN = TOOLS / 'with-can'
NOBODY = 65534
PATIENCE_S = 30
BOOT_ID = '/proc/sys/kernel/random/boot_id'
# Counts the Ctrl-C signals until 0.5 s pass without a signal.
COUNTS_CTRL_C = '''
import signal
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
print("begun", flush=True)
signal.sigwait([signal.SIGINT])
print("one", flush=True)
count = 1
while signal.sigtimedwait([signal.SIGINT], 0.5):
    count += 1
print(count, "Ctrl-C", flush=True)
'''


def run(*command, **options):
    return subprocess.run([WITH_CAN, *command], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          timeout=PATIENCE_S, check=False, **options)


def index(interface):
    """The index of the interface, or None if it does not exist. A later interface with the same name has another index."""
    file = pathlib.Path(f'/sys/class/net/{interface}/ifindex')
    return int(file.read_text(encoding='ascii')) if file.exists() else None


@pytest.fixture(name='without_vcan')
def no_vcan():
    subprocess.run(['ip', 'link', 'del', 'vcan0'], check=True)
    yield
    subprocess.run(['ip', 'link', 'add', 'dev', 'vcan0', 'type', 'vcan'], check=True)
    subprocess.run(['ip', 'link', 'set', 'vcan0', 'mtu', '72', 'txqueuelen', '1000', 'up'], check=True)


def test_the_command_runs_on_this_kernel_with_its_interfaces(tmp_path):
    before = index('vcan0')
    result = run('sh', '-c', f'cat {BOOT_ID} && pwd && echo words >&2 && cansend vcan0 123#11 && exit 9', cwd=tmp_path)
    assert result.returncode == 9 and result.stderr == 'words\n', result
    assert result.stdout.split() == [pathlib.Path(BOOT_ID).read_text(encoding='ascii').strip(), str(tmp_path)]
    assert index('vcan0') == before is not None
    assert run('--time', '0.1', 'sleep', '60').returncode == 124


def begun(process):
    assert process.stdout.readline() == 'begun\n'
    return process


def test_a_signal_reaches_the_command():
    with begun(subprocess.Popen([WITH_CAN, 'sh', '-c', 'echo begun; exec sleep 60'], stdout=subprocess.PIPE,
                                text=True)) as process:
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 128 + signal.SIGINT
    with begun(subprocess.Popen([WITH_CAN, '/usr/bin/python3', '-c', COUNTS_CTRL_C], stdout=subprocess.PIPE,
                                text=True)) as process:
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == 'one\n' and process.stdout.readline() == '1 Ctrl-C\n'
        assert process.wait(PATIENCE_S) == 0


def test_ctrl_c_reaches_the_command_once():
    process, terminal = pty.fork()
    if process == 0:
        os.execv(WITH_CAN, [WITH_CAN, '/usr/bin/python3', '-c', COUNTS_CTRL_C])
    seen = b''

    def await_word(word):
        nonlocal seen
        while word not in seen:
            seen += os.read(terminal, 4096)

    await_word(b'begun')
    os.kill(process, signal.SIGSTOP)  # so that a signal that the stopped program passes on arrives later
    os.write(terminal, b'\x03')
    await_word(b'one')
    os.kill(process, signal.SIGCONT)
    await_word(b' Ctrl-C')
    assert b'1 Ctrl-C' in seen
    assert os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) == 0
    os.close(terminal)


def test_the_last_program_removes_the_created_interfaces(without_vcan):
    def user():
        return begun(subprocess.Popen([WITH_CAN, 'sh', '-c', 'echo begun; read end'], stdin=subprocess.PIPE,
                                      stdout=subprocess.PIPE, text=True))

    with user() as first:
        made = index('vcan0')
        with user() as second:
            first.communicate('end\n', timeout=PATIENCE_S)
            assert index('vcan0') == made is not None
            second.communicate('end\n', timeout=PATIENCE_S)
    assert index('vcan0') is None


def test_an_ordinary_user_can_use_an_existing_vcan0():
    # Every user can read /run/tmp, but perhaps not the tree.
    with tempfile.TemporaryDirectory(dir='/run/tmp') as folder:
        os.chmod(folder, 0o755)
        shutil.copy(WITH_CAN, folder)
        shutil.copy(TOOLS / 'trouble.py', folder)
        shutil.copytree(TOOLS / 'with-can.d', f'{folder}/with-can.d')
        before = index('vcan0')
        result = subprocess.run(
            ['setpriv', f'--reuid={NOBODY}', f'--regid={NOBODY}', '--clear-groups', f'{folder}/with-can', 'sh', '-c',
             f'id -u; cat {BOOT_ID}; cansend vcan0 123#11; exit 7'], stdin=subprocess.DEVNULL, capture_output=True,
            text=True, timeout=PATIENCE_S, check=False, cwd='/')
    assert result.returncode == 7 and result.stderr == '', result
    assert result.stdout.split() == [str(NOBODY), pathlib.Path(BOOT_ID).read_text(encoding='ascii').strip()]
    assert index('vcan0') == before is not None
