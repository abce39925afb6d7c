# SPDX-License-Identifier: GPL-3.0-or-later
"""The wishes from the events of a gamepad and of a keyboard."""
import os
import pty
import struct
import sys
import time
import types

import pytest

import hand
import scout
from hand import Gamepad, Keyboard


@pytest.fixture(name='plugged')
def make_plugged(tmp_path):
    """A gamepad, a function that sends its events, and a function that unplugs it."""
    events = tmp_path / 'event0'
    os.mkfifo(events)
    pad = Gamepad(str(events))
    writer = os.open(events, os.O_WRONLY)
    yield (pad, lambda *event: os.write(writer, struct.pack('llHHi', 0, 0, *event)), lambda: os.close(writer))
    pad.close()


def test_the_gamepad_drives_while_its_shoulder_button_is_held(plugged):
    pad, happens, unplug = plugged
    happens(3, Gamepad.ABS_Y, -32768)
    assert pad.wish().twist == (0, 0)
    happens(1, Gamepad.SHOULDER, 1)
    pad.begin()  # pressed before arming: ignored
    assert pad.wish().twist == (0, 0)
    happens(1, Gamepad.SHOULDER, 0)
    happens(1, Gamepad.SHOULDER, 1)
    assert pad.wish().twist.forward == pytest.approx(0.5)
    happens(3, Gamepad.ABS_RY, 32767)
    pad.wish()
    time.sleep(0.02)
    assert pad.wish().arm[1] > 1500
    happens(1, Gamepad.SHOULDER, 0)
    assert pad.wish().twist == (0, 0)
    happens(1, Gamepad.LOWER, 1)
    assert pad.wish() and pad.stop and not pad.ended
    happens(1, Gamepad.SHOULDER, 1)
    unplug()
    assert pad.wish().twist == (0, 0) and pad.ended


def test_the_gamepad_stops_when_the_kernel_drops_events(plugged):
    pad, happens, unplug = plugged
    happens(3, Gamepad.ABS_Y, -32768)
    happens(1, Gamepad.SHOULDER, 1)
    happens(0, 0, 0)
    assert pad.wish().twist.forward > 0
    happens(0, 3, 0)  # SYN_DROPPED: the release of the button is lost
    assert pad.wish().twist == (0, 0)
    happens(1, Gamepad.SHOULDER, 1)  # before SYN_REPORT: dropped
    happens(3, Gamepad.ABS_Y, -32768)
    assert pad.wish().twist == (0, 0)
    happens(0, 0, 0)
    happens(3, Gamepad.ABS_Y, -32768)
    happens(1, Gamepad.SHOULDER, 2)
    happens(0, 0, 0)
    assert pad.wish().twist == (0, 0)
    happens(1, Gamepad.SHOULDER, 0)
    happens(1, Gamepad.SHOULDER, 1)
    assert pad.wish().twist.forward > 0
    unplug()


class Terminal:
    """A keyboard at a terminal, with a clock that the test moves."""

    def __init__(self, monkeypatch):
        self._keys, terminal = pty.openpty()
        self._stdin = os.fdopen(terminal)
        self.now = 0.0
        monkeypatch.setattr(sys, 'stdin', self._stdin)
        monkeypatch.setattr(hand, 'time', types.SimpleNamespace(monotonic=lambda: self.now))
        self.keyboard = Keyboard()

    def type(self, keys):
        os.write(self._keys, keys)
        return self.keyboard.wish()

    def hang_up(self):
        os.close(self._keys)

    def close(self):
        self.keyboard.close()
        self._stdin.close()


@pytest.fixture(name='terminal')
def make_terminal(monkeypatch):
    terminal = Terminal(monkeypatch)
    yield terminal
    terminal.close()


def test_the_keyboard_drives_as_long_as_a_key_is_held(terminal):
    keyboard = terminal.keyboard
    assert keyboard.wish() == ((0, 0), scout.ARM_REST)
    for key, twist in ((b'w', (hand.SPEED, 0)), (b's', (-hand.SPEED, 0)), (b'a', (0, hand.TURN)), (b'd', (0, -hand.TURN))):
        assert terminal.type(key).twist == twist
        terminal.now += 0.5  # until the terminal repeats the key
        assert keyboard.wish().twist == twist
        terminal.now += hand.HOLD
        assert keyboard.wish().twist == (0, 0)
    assert terminal.type(b'wx').twist == (0, 0)  # any other key
    assert terminal.type(b'wuuujik' + b'l' * 60) == ((hand.SPEED, 0), (1540, 1500, 600))
    assert not keyboard.stop and not keyboard.ended
    assert terminal.type(b' ').twist == (0, 0)
    assert keyboard.stop and not keyboard.ended
    terminal.type(b'q')
    assert keyboard.ended
    terminal.hang_up()


def test_only_a_stop_key_counts_before_arming(terminal):
    terminal.type(b'w')
    terminal.keyboard.begin()
    assert terminal.keyboard.wish().twist == (0, 0) and not terminal.keyboard.stop
    terminal.type(b'w ')
    terminal.keyboard.begin()
    assert terminal.keyboard.wish().twist == (0, 0) and terminal.keyboard.stop
    terminal.hang_up()


def test_the_keyboard_ends_when_its_terminal_is_closed(terminal):
    assert terminal.type(b'w').twist == (hand.SPEED, 0)
    terminal.hang_up()
    assert terminal.keyboard.wish().twist == (0, 0) and terminal.keyboard.ended
