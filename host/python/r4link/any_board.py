# SPDX-License-Identifier: GPL-3.0-or-later
"""The common part of r4link.Board and r4link.aio.Board. Times are seconds.

A call that waits returns None or, from r4link.aio.Board, a coroutine. Each `timeout` is the time
within which the board's state must confirm the command. Otherwise the call raises RefusedError.
"""
from __future__ import annotations

import os
from abc import ABC, abstractmethod
from typing import Any, Callable, Generic

from ._core import (Board as Core, CarrierCounters, Command, Event, LinkStatus, PathStatus, Recording, RefusedPost,
                    Setpoints, State, Statistics, Subscription, Wiring)
from .channels import BldcChannel, DriveChannel, RelayChannel, Sent, ServoChannel, StepperChannel, _ms
from .devices import Device
from .enums import BoardRole, DisarmCause, PostResult


class AnyBoard(ABC, Generic[Sent]):
    """A board, blocking or asynchronous."""

    _core: Core

    @abstractmethod
    def _call(self, call: Callable[[Core], Any],
              then: Callable[[Any], Any] = lambda result: result) -> Any:
        """Makes a call that waits. Returns then(result), or its coroutine."""

    @abstractmethod
    def _callback(self, callback: Callable[..., object]) -> Callable[..., object]:
        """Returns the function that the callbacks' thread calls for a callback of the program."""

    @property
    def role(self) -> BoardRole:
        """The present role of this program at the board."""
        return self._core.role()

    def take_control(self) -> Sent:
        """Makes this program control the board; callbacks and recordings stay. The program is then disarmed: call
        wait_active() and arm(). If another program of this computer controls the board, take_control() raises
        RefusedError with the `holder`, and this program continues to watch."""
        sent: Sent = self._call(lambda core: core.take_control())
        return sent

    def release_control(self, timeout: float = 1.0) -> Sent:
        """Disarms, and sends the farewell until the board has answered. The board is then safe and
        free, and this program watches. Without an answer the board goes safe by its own timeout,
        and release_control() raises NotConfirmedError. Commands that wait in other threads raise
        CancelledError."""
        sent: Sent = self._call(lambda core: core.release_control(_ms(timeout)))
        return sent

    def wait_active(self, timeout: float = 3.0) -> Sent:
        """Waits until this program controls the board or, as a watcher, receives its states. Raises
        RefusedError with the link's state and cause."""
        sent: Sent = self._call(lambda core: core.wait_active(_ms(timeout)))
        return sent

    # --- commands

    def send(self, command: str | Command | Setpoints, timeout: float = 1.0) -> Sent:
        """Sends a command, or its text: 'O:358,1,1'. Setpoints, as in 'O:358,1,1;O:358,1,2', are
        executed in one pass and confirmed together, or not at all. Command.clear() clears the stop,
        the watchdog or the fault that the board reports, and moves nothing."""
        sent: Sent = self._call(lambda core: core.send(command, _ms(timeout)))
        return sent

    def post(self, command: Command | Setpoints) -> PostResult:
        """Sends once, without waiting or confirmation. on_refused() reports a refusal."""
        return self._core.post(command)

    def arm(self, timeout: float = 1.0) -> Sent:
        """Allows output commands. Call arm() before the first output command, and again after the
        outputs went safe, except after a lost link.

        Clears a stop, a watchdog or a fault that began while this program controlled the board, and closes relay 1.
        Does not clear a cause that may be older than the program, or a fault with which the board began. arm() then
        raises NotArmedError, and Command.clear() clears the cause.
        """
        sent: Sent = self._call(lambda core: core.arm(_ms(timeout)))
        return sent

    @property
    def disarmed_by(self) -> DisarmCause:
        """Why output commands are refused; DisarmCause.NONE when armed."""
        return self._core.disarmed_by()

    def stop(self, timeout: float = 1.0) -> Sent:
        """Makes all outputs safe at once. The stop is repeated until confirmed, and latched until
        Command.clear(), or arm() of the same program. If the stop is not confirmed within the timeout, raises an
        error: cut the power. A new session then begins, so that the outputs do not resume."""
        sent: Sent = self._call(lambda core: core.stop(_ms(timeout)))
        return sent

    def stop_async(self) -> None:
        """Begins a stop as stop() does, and returns at once."""
        self._core.stop_async()

    def osmc(self, channel: int) -> DriveChannel[Sent]:
        """`channel`: 1 to 4."""
        return DriveChannel(self, channel, Command.osmc)

    def dhb12(self, channel: int) -> DriveChannel[Sent]:
        """`channel`: 1 to 4, for DHB1A, DHB1B, DHB2A and DHB2B."""
        return DriveChannel(self, channel, Command.dhb12)

    def servo(self, channel: int) -> ServoChannel[Sent]:
        """`channel`: 1 to 16."""
        return ServoChannel(self, channel)

    def relay(self, channel: int) -> RelayChannel[Sent]:
        """`channel`: 1 to 8; relay 1 is in the motor supply."""
        return RelayChannel(self, channel)

    def stepper(self, channel: int) -> StepperChannel[Sent]:
        """`channel`: 1 to 4."""
        return StepperChannel(self, channel)

    def bldc(self, channel: int) -> BldcChannel[Sent]:
        """`channel`: 1 to 4."""
        return BldcChannel(self, channel)

    def dac(self, channel: int, *, millivolts: int, timeout: float = 1.0) -> Sent:
        """Sets a voltage: `channel` 1 or 2, `millivolts` 0 to 3300; 0 in the safe state. This
        output command needs arm(). Command.dac() can be posted, and can be one of Setpoints."""
        return self.send(Command.dac(channel, millivolts=millivolts), timeout)

    def proximity(self, channel: int, *, cm: int, timeout: float = 1.0) -> Sent:
        """The board goes safe when ultrasonic sensor `channel`, 1 to 4, measures less than `cm`,
        1 to 400 centimetres; 0: off."""
        return self.send(Command.proximity(channel, cm=cm), timeout)

    def fields(self, names: str, timeout: float = 1.0) -> Sent:
        """Requests state fields: 'DEFAULT,ENC1'."""
        return self.send(f'F:{names}', timeout)

    def setting(self, key: str, value: str, timeout: float = 1.0) -> Sent:
        """Changes a setting of the board (docs/reference/protocol.md): setting('rate', '50')."""
        return self.send(f'C:{key},{value}', timeout)

    def give_wiring(self, wiring: Wiring, timeout: float = 1.0) -> Sent:
        """Checks `wiring` and sends it to the board, which uses it from its next start on. Works only over the board's
        own cable. Raises DataError for a wiring with a fault."""
        wiring.check()
        return self.setting('wiring', wiring.setting, timeout)

    def attach(self, device: Device, timeout: float = 1.0) -> Sent:
        """Sets up a described device (r4link.devices): checks its identity, writes its settings,
        which needs arm(), and starts the board's readings until this session ends. `timeout`: for
        each step. Raises RefusedError if the device does not answer or is another device. Raises
        UsageError if a device with another address or name has one of the slots: i2c.poll_off()
        frees a slot. Call attach() again after on_restart() and a lost link."""
        sent: Sent = self._call(lambda core: core.attach(device._core, _ms(timeout)))
        return sent

    def link_timing(self, board_timeout: float, heartbeat: float, timeout: float = 1.0) -> Sent:
        """Changes two settings together: `board_timeout`, the seconds without a host heartbeat
        after which the board goes safe, and `heartbeat`, the seconds between its own heartbeats."""
        sent: Sent = self._call(lambda core: core.link_timing(_ms(board_timeout), _ms(heartbeat), _ms(timeout)))
        return sent

    # --- reports of the board

    @property
    def state(self) -> State:
        """The newest state; false before the first state. `received`: on the clock of time.monotonic()."""
        return self._core.state()

    @property
    def link(self) -> LinkStatus:
        """The present status of the link."""
        return self._core.link()

    @property
    def statistics(self) -> Statistics:
        """The counts and measurements of the link."""
        return self._core.statistics()

    @property
    def carrier_counters(self) -> CarrierCounters:
        """The counters of the transport."""
        return self._core.carrier_counters()

    @property
    def name(self) -> str:
        """The transport's name for people; with several paths, all names."""
        return self._core.name()

    @property
    def paths(self) -> list[PathStatus]:
        """The status of each path, in the order of the URLs."""
        return self._core.paths()

    # --- callbacks, as functions or decorators. A new callback first gets the newest value.

    def on_state(self, callback: Callable[[State], object]) -> Subscription:
        """Called for each new state."""
        return self._core.on_state(self._callback(callback))

    def on_link(self, callback: Callable[[LinkStatus], object]) -> Subscription:
        """Called when the link has changed."""
        return self._core.on_link(self._callback(callback))

    def on_path(self, callback: Callable[[PathStatus], object]) -> Subscription:
        """Called when a path begins or ceases to carry datagrams."""
        return self._core.on_path(self._callback(callback))

    def on_event(self, callback: Callable[[Event], object]) -> Subscription:
        """Called when the transport goes up or down, and for a warning."""
        return self._core.on_event(self._callback(callback))

    def on_restart(self, callback: Callable[[], object]) -> Subscription:
        """Called when the board has restarted, or this computer slept. Thresholds and readings have then ended."""
        return self._core.on_restart(self._callback(callback))

    def on_arming(self, callback: Callable[[DisarmCause], object]) -> Subscription:
        """Called when the program is armed (DisarmCause.NONE) or disarmed, with the cause."""
        return self._core.on_arming(self._callback(callback))

    def on_refused(self, callback: Callable[[RefusedPost], object]) -> Subscription:
        """Called when a posted command is refused by the board, or does not reach the board."""
        return self._core.on_refused(self._callback(callback))

    def record(self, to: str | os.PathLike[str] | Recording, *, rotate_bytes: int = 0, rotate_after: int = 0,
               keep_bytes: int = 0) -> None:
        """Records every datagram from now on, in both directions, into a file (docs/how-to/recordings.md).
        A new file begins after `rotate_bytes` bytes or `rotate_after` seconds, and at most
        `keep_bytes` bytes are kept; 0: no limit."""
        if isinstance(to, Recording):
            self._core.record(to)
        else:
            self._core.record(os.fspath(to), rotate_bytes, rotate_after, keep_bytes)

    def watchdog(self, period: float) -> None:
        """After `period` seconds without feed() the heartbeats stop and the board goes safe; 0:
        off. Call feed() where the program controls the robot. Callbacks and an event loop do not
        feed the watchdog."""
        self._core.watchdog(_ms(period))

    def feed(self) -> None:
        """Reports that the program works, which restarts the period of watchdog()."""
        self._core.feed()
