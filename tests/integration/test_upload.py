# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 upload with a simulated dfu-util, and a board at a pseudo-terminal."""
import contextlib
import fcntl
import json
import os
import pty
import re
import signal
import struct
import subprocess
import threading
import tty
import zlib

import pytest

from r4_process import ERROR, R4, Board, objects, run

# From the N-th call with -l, reports the boot loader. The file `there` has N. Writes the port's bit rate to `speed`.
DFU_UTIL = '''#!/bin/bash
echo "$*" >>"$R4_TEST_DFU/calls"
case "$*" in
*-l*)
  echo 'dfu-util 0.11'
  [[ ! -e $R4_TEST_DFU/port ]] || stty -F "$(cat "$R4_TEST_DFU/port")" speed >"$R4_TEST_DFU/speed"
  [[ $(grep -c -e -l "$R4_TEST_DFU/calls") -ge $(cat "$R4_TEST_DFU/there") ]] || exit 0
  [[ ! -e $R4_TEST_DFU/denied ]] || { echo 'Cannot open DFU device 2341:0366 found on devnum 9 (LIBUSB_ERROR_ACCESS)'; exit 74; }
  for device in $(cat "$R4_TEST_DFU/paths"); do
    echo "Found DFU: [2341:0366] ver=0200, devnum=9, cfg=1, intf=0, path=\\"$device\\", alt=1, name=\\"@External\\""
    echo "Found DFU: [2341:0366] ver=0200, devnum=9, cfg=1, intf=0, path=\\"$device\\", alt=0, name=\\"@Internal\\""
  done
  ;;
*)
  printf 'Erase\\t[============] 100%%        65536 bytes\\n'
  printf 'Download\\t[            ]   0%%            0 bytes\\rDownload\\t[=====       ]  45%%        24576 bytes\\r'
  [[ ! -p $R4_TEST_DFU/go ]] || read -r <"$R4_TEST_DFU/go"
  printf 'Download\\t[============] 100%%        65536 bytes\\nDownload done.\\n'
  [[ ! -p $R4_TEST_DFU/ended ]] || echo ended >"$R4_TEST_DFU/ended"
  [[ ! -e $R4_TEST_DFU/fails ]] || { printf 'dfu-util: \\033[31mverify failed\\n'; exit 74; }
  echo 'File downloaded successfully'
  exit 74
  ;;
esac
'''
SKETCH = struct.pack('<II', 0x24080000, 0x080402c1) + bytes(1000)
WRITE = '-d 2341:0366 -p 1-2 -a 0 -s 0x08040000:leave -D '


def write_fake_dfu_util(folder, usb_paths):
    program = folder / 'bin' / 'dfu-util'
    program.parent.mkdir()
    program.write_text(DFU_UTIL)
    program.chmod(0o755)
    (folder / 'there').write_text('2')
    (folder / 'paths').write_text(usb_paths)
    (folder / 'sketch.bin').write_bytes(SKETCH)


@pytest.fixture(name='place')
def fake_dfu_util(tmp_path, monkeypatch):
    write_fake_dfu_util(tmp_path, '1-2')
    monkeypatch.setenv('PATH', f'{tmp_path}/bin:{os.environ["PATH"]}')
    monkeypatch.setenv('R4_TEST_DFU', str(tmp_path))
    return tmp_path


def calls(place):
    return (place / 'calls').read_text().splitlines() if (place / 'calls').exists() else []


def test_stops_the_board_writes_the_sketch_and_reports_the_version(place):
    with Board(f'pty:{place}/board') as board:
        assert run('send', board.host_url, 'R:1,On', 'O:358,1,1').returncode == 0
        done = run('upload', str(place / 'sketch.bin'), board.host_url, '--json')
        assert done.returncode == 0, done
        board.outputs(lambda outputs: outputs['osmc'][0][0] == 0)
    lines = objects(done.stdout)
    assert [each['type'] for each in lines] == ['stopped', 'progress', 'progress', 'progress', 'written', 'identity']
    assert [each['percent'] for each in lines if each['type'] == 'progress'] == [0, 45, 100]
    assert lines[-1]['firmware'] and calls(place)[-1] == f'{WRITE}{place}/sketch.bin'


def test_serial_auto_writes_a_board_in_its_boot_loader_at_once(place):
    (place / 'there').write_text('1')
    done = run('upload', str(place / 'sketch.bin'), 'serial:auto', '--timeout', '0.2')
    assert done.returncode == 3 and 'is written' in done.stdout and 'R4 firmware does not answer' in done.stderr
    assert 'the board reports that its outputs' not in done.stdout
    assert len(calls(place)) == 3 and calls(place)[-1].startswith(WRITE)


@pytest.mark.parametrize('url', ['serial:///dev/ttyACM99', 'serial:?sn=12345'])
def test_upload_writes_no_other_board_than_the_named_one(place, url):
    (place / 'there').write_text('1')
    done = run('upload', str(place / 'sketch.bin'), url)
    assert done.returncode == 4 and ERROR.search(done.stderr)
    assert not any(each.startswith(WRITE) for each in calls(place))


def test_a_board_with_other_firmware_is_opened_at_1200_baud(place):
    board, port = pty.openpty()
    tty.setraw(port)
    (place / 'port').write_text(os.ttyname(port))
    done = run('upload', str(place / 'sketch.bin'), f'serial://{os.ttyname(port)}', '--timeout', '0.2')
    os.close(board)
    os.close(port)
    assert done.returncode == 3 and 'R4 firmware does not answer' in done.stderr and ERROR.search(done.stderr)
    assert 'cannot switch outputs off' in done.stdout
    assert (place / 'speed').read_text().strip() == '1200'
    assert calls(place)[-1].startswith(WRITE)


@pytest.mark.parametrize('content, reason', [
    (b'', 'too short'), (b'abc', 'too short'), (bytes(100), 'not a sketch'),
    (struct.pack('<II', 0x24080000, 0x080402c0), 'not a sketch'),
    (struct.pack('<II', 0x24080000, 0x08000001), 'not a sketch'),
    (struct.pack('<II', 0x30000000, 0x080402c1), 'not a sketch'),
    (SKETCH + bytes(1966080), 'it is too large'),
], ids=['empty', 'short', 'zeros', 'even', 'boot-loader', 'no-ram', 'long'])
def test_an_invalid_sketch_is_refused_before_the_board_is_stopped(place, content, reason):
    (place / 'sketch.bin').write_bytes(content)
    done = run('upload', str(place / 'sketch.bin'), 'serial:///dev/null')
    assert done.returncode == 1 and reason in done.stderr and ERROR.search(done.stderr)
    assert not calls(place)


def upload(place, *options):
    with Board(f'pty:{place}/board') as board:
        return run('upload', str(place / 'sketch.bin'), board.host_url, '--timeout', '0.3', *options)


def test_upload_names_the_reason_for_a_failure(place):
    (place / 'there').write_text('999')
    done = upload(place)
    assert done.returncode == 4 and 'it was not found; press the board' in done.stderr
    (place / 'there').write_text('1')
    done = upload(place)
    assert done.returncode == 2 and 'another board waits in it' in done.stderr
    (place / 'calls').unlink()
    (place / 'there').write_text('2')
    (place / 'paths').write_text('1-2 1-3')
    done = upload(place)
    assert done.returncode == 2 and 'two or more boards' in done.stderr
    (place / 'calls').unlink()
    (place / 'denied').touch()
    done = upload(place)
    assert done.returncode == 5 and 'udev' in done.stderr
    (place / 'denied').unlink()
    (place / 'calls').unlink()
    (place / 'paths').write_text('1-2')
    (place / 'fails').touch()
    done = upload(place)
    assert done.returncode == 4 and r'r4: dfu-util: \x1b[31mverify failed; press' in done.stderr
    assert run('upload', str(place / 'sketch.bin'), 'udp://127.0.0.1').returncode == 2


def test_upload_refuses_a_port_that_another_program_uses(place):
    with Board(f'pty:{place}/board') as board:
        assert run('send', board.host_url, 'R:1,On', 'O:358,1,1').returncode == 0
        with open(f'{place}/board', 'rb', buffering=0) as port:
            fcntl.flock(port, fcntl.LOCK_EX)
            done = run('upload', str(place / 'sketch.bin'), board.host_url)
    assert done.returncode == 4 and 'another program uses the port' in done.stderr
    assert not any(each.startswith(WRITE) for each in calls(place))


@pytest.mark.parametrize('stop', [lambda r4: r4.stdout.close(), lambda r4: os.killpg(r4.pid, signal.SIGINT)],
                         ids=['output closed', 'Ctrl-C'])
def test_a_write_that_has_begun_is_finished(place, stop):
    (place / 'there').write_text('1')
    for name in ('go', 'ended'):
        os.mkfifo(place / name)
    with subprocess.Popen([R4, 'upload', place / 'sketch.bin', 'serial:auto', '--json', '--timeout', '0.2'],
                          stdout=subprocess.PIPE, text=True, start_new_session=True) as r4:
        while json.loads(r4.stdout.readline())['percent'] != 45:
            pass
        stop(r4)
        (place / 'go').write_text('\n')
        assert (place / 'ended').read_text() == 'ended\n'
    assert r4.returncode < 0


def test_a_board_that_does_not_confirm_the_stop_is_not_written(place):
    """The board answers questions, but not a stop."""
    board, port = pty.openpty()
    tty.setraw(port)

    def answer():
        with contextlib.suppress(OSError):  # until the terminal is closed
            while received := os.read(board, 4096):
                if question := re.search(rb'Q:ID;(SID:[^;]*;)', received):
                    fields = b'I:R4,0.1.0,deaf,serial;BUSY:0;' + question[1] + b'PNum:1;T:2;^'
                    os.write(board, fields + b'0x%x^\r\n' % zlib.crc32(fields))

    answering = threading.Thread(target=answer)
    answering.start()
    done = run('upload', str(place / 'sketch.bin'), f'serial://{os.ttyname(port)}')
    os.close(port)
    answering.join()
    os.close(board)
    assert done.returncode == 3 and 'E:STOP' in done.stderr and ERROR.search(done.stderr)
    assert not any(each.startswith(WRITE) for each in calls(place))


def test_a_missing_dfu_util_is_named(place, monkeypatch):
    monkeypatch.setenv('PATH', '/nowhere')
    done = run('upload', str(place / 'sketch.bin'), 'serial:///dev/null')
    assert done.returncode == 6 and 'apt-get install dfu-util' in done.stderr
