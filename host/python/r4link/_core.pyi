# SPDX-License-Identifier: GPL-3.0-or-later
"""The module of host/python/bindings, with times in milliseconds. Programs use the names in r4link/__init__.py."""
import os
from datetime import datetime
from types import TracebackType
from typing import Any, Callable, Sequence, Type, overload

from typing_extensions import Self

from .enums import (BoardRole, DeviceRole, DisarmCause, EventKind, FleetEventKind, LinkCause, LinkState, LoopEnd, Outcome,
                    PathState, PostResult, Refusal, SafeReason, Word)
from .errors import Program
from .transport import Transport
from .values import Bldc, Drive, I2cAnswer, I2cBusReport, I2cReading, UartBytes, UartData

__version__: str
FIELDS: tuple[str, ...]
ENUMS: dict[str, tuple[Word, ...]]
"""The members of each enumeration of enums.py, in the order of their numbers in C++."""

class _Record:
    def as_dict(self) -> dict[str, Any]: ...

class LinkStatus(_Record):
    @property
    def state(self) -> LinkState: ...
    @property
    def reason(self) -> SafeReason:
        """Why the board is safe."""
    @property
    def causes(self) -> tuple[LinkCause, ...]:
        """All causes of the link's status, the gravest first: in the order of LinkCause."""
    @property
    def cause(self) -> LinkCause | None:
        """The gravest cause."""
    @property
    def busy(self) -> bool:
        """True if another host controls the board."""
    @property
    def gated(self) -> bool:
        """True if heartbeats and commands are held back: the watchdog was not fed, or a callback hangs."""
    @property
    def in_control(self) -> bool: ...
    @property
    def carrying(self) -> tuple[int, ...]:
        """The numbers of the paths that carry datagrams, from 0."""
    @property
    def chip(self) -> str | None:
        """The chip with a fault, and the fault."""

class PathStatus(_Record):
    @property
    def name(self) -> str: ...
    @property
    def state(self) -> PathState: ...
    @property
    def busy(self) -> bool: ...
    @property
    def board_id(self) -> str:
        """The board that last answered on this path."""
    @property
    def received(self) -> int: ...
    @property
    def lost(self) -> int: ...
    @property
    def loss(self) -> float: ...
    @property
    def copies(self) -> int:
        """Duplicates: datagrams received before on this or another path."""
    @property
    def round_trip_us(self) -> float:
        """The round trip of the newest question and answer; 0: unknown."""
    @property
    def age_us(self) -> float:
        """Microseconds since the newest datagram; 0: no datagram yet."""

class Identity(_Record):
    @property
    def firmware(self) -> str: ...
    @property
    def board_id(self) -> str: ...
    @property
    def capabilities(self) -> tuple[str, ...]: ...
    @property
    def name(self) -> str: ...

class Statistics(_Record):
    """The counts and measurements of a link: include/r4link/link.hpp."""
    @property
    def received(self) -> int: ...
    @property
    def states(self) -> int: ...
    @property
    def damaged(self) -> int: ...
    @property
    def packets_received(self) -> int:
        """Datagrams with a packet number; lost, duplicate, late and old are among these."""
    @property
    def lost(self) -> int: ...
    @property
    def duplicate(self) -> int: ...
    @property
    def late(self) -> int: ...
    @property
    def old(self) -> int:
        """Datagrams that arrived too late to be recognised as duplicates."""
    @property
    def restarts(self) -> int: ...
    @property
    def loss(self) -> float: ...
    @property
    def state_rate_hz(self) -> float: ...
    @property
    def round_trip_us(self) -> float: ...
    @property
    def round_trip_min_us(self) -> float: ...
    @property
    def round_trip_mean_us(self) -> float: ...
    @property
    def jitter_us(self) -> float: ...
    @property
    def state_age_us(self) -> float: ...
    @property
    def clock_drift_ppm(self) -> float:
        """How much slower the board's clock runs than this computer's clock. The drift and its error
        are 0 until known."""
    @property
    def clock_drift_error_ppm(self) -> float: ...
    @property
    def heartbeats(self) -> int: ...
    @property
    def commands(self) -> int: ...
    @property
    def retries(self) -> int: ...
    @property
    def confirmed(self) -> int: ...
    @property
    def refused(self) -> int: ...
    @property
    def timed_out(self) -> int: ...

class CarrierCounters(_Record):
    """The counters of a transport: include/r4link/carrier.hpp."""
    @property
    def rx_datagrams(self) -> int: ...
    @property
    def rx_bytes(self) -> int: ...
    @property
    def rx_oversize(self) -> int: ...
    @property
    def rx_foreign(self) -> int: ...
    @property
    def rx_overflows(self) -> int: ...
    @property
    def tx_datagrams(self) -> int: ...
    @property
    def tx_bytes(self) -> int: ...
    @property
    def tx_dropped(self) -> int: ...
    @property
    def tx_errors(self) -> int: ...
    @property
    def downs(self) -> int: ...
    @property
    def ups(self) -> int: ...

class Event(_Record):
    @property
    def kind(self) -> EventKind: ...
    @property
    def thing(self) -> str: ...
    @property
    def reason(self) -> str: ...
    @property
    def fix(self) -> str: ...

class RefusedPost(_Record):
    @property
    def refusal(self) -> Refusal:
        """The board's code; Refusal.NONE if the command was not sent: see `why`."""
    @property
    def why(self) -> PostResult: ...
    @property
    def at(self) -> int: ...
    @property
    def group(self) -> int: ...

class State:
    """A state of the board.

    A field that the board has not reported since it started raises AttributeError: request it by
    `Board.fields()`. `present` names the fields of the newest datagram. Another field has the
    value of an earlier datagram. `fault` is always present; None: no fault.
    """
    @property
    def pnum(self) -> int: ...
    @property
    def t_ms(self) -> int:
        """The board's clock; wraps at 2^32."""
    @property
    def received(self) -> float | None:
        """When the state arrived, by time.monotonic(); None if there is no state."""
    @property
    def sampled(self) -> float | None:
        """When the board sampled the state, from the board's clock and round trips; as time.monotonic()."""
    @property
    def sampled_error(self) -> float | None:
        """The largest error of `sampled` in seconds. None: unknown, and `sampled` is the latest time."""
    @property
    def sampled_utc(self) -> datetime | None:
        """`sampled` by the present setting of the calendar's clock."""
    @property
    def present(self) -> tuple[str, ...]: ...
    @property
    def safe(self) -> SafeReason:
        """Why the outputs are safe; SafeReason.NONE: they are not safe."""
    @property
    def fault(self) -> str | None: ...
    @property
    def dmhsta(self) -> bool | None:
        """True if the dead-man's handle is held."""
    def relay(self, channel: int) -> bool:
        """True if the relay is closed. `channel`: 1 to 8."""
    def as_dict(self) -> dict[str, Any]:
        """The fields that the newest datagram carries, with `pnum` and `t_ms`."""
    def __bool__(self) -> bool: ...
    # One attribute for each field of docs/reference/protocol.md, in its unit.
    ain24: float
    ain12: float
    ain5: float
    aindmh: float
    ainsteer: float
    dhb1a: Drive
    osmc1: Drive
    step1pos: int
    servo1pos: int
    ain6: float
    dhb1b: Drive
    dhb2a: Drive
    dhb2b: Drive
    osmc2: Drive
    osmc3: Drive
    osmc4: Drive
    step2pos: int
    step3pos: int
    step4pos: int
    servo2pos: int
    servo3pos: int
    servo4pos: int
    servo5pos: int
    servo6pos: int
    servo7pos: int
    servo8pos: int
    servo9pos: int
    servo10pos: int
    servo11pos: int
    servo12pos: int
    servo13pos: int
    servo14pos: int
    servo15pos: int
    servo16pos: int
    enc1: int
    enc2: int
    enc3: int
    enc4: int
    us1: int
    us2: int
    us3: int
    us4: int
    bldc1: Bldc
    bldc2: Bldc
    bldc3: Bldc
    bldc4: Bldc
    relays: int
    cmd: int
    rxok: int
    rxcrc: int
    rxlost: int
    rxdup: int
    rxref: int
    late: int
    enc1hz: int
    enc2hz: int
    enc3hz: int
    enc4hz: int
    enc1idx: int
    enc2idx: int
    enc3idx: int
    enc4idx: int
    i2c1: I2cReading
    i2c2: I2cReading
    i2c3: I2cReading
    i2c4: I2cReading
    i2c5: I2cReading
    i2c6: I2cReading
    i2c7: I2cReading
    i2c8: I2cReading
    i2cx: I2cAnswer
    i2cbus: I2cBusReport
    uart1: UartBytes
    uart2: UartBytes
    dac1: int
    dac2: int
    gpio: int

class Command:
    """A command to a board, for send(), post() and Setpoints. Channels count from 1. str() gives
    its text: str(Command.osmc(1, pwm=358)) is 'O:358,1,1'."""
    @overload
    @staticmethod
    def osmc(channel: int, *, duty: float) -> Command:
        """Channel 1 to 4. `duty`: from -1, full reverse, to 1, full forward."""
    @overload
    @staticmethod
    def osmc(channel: int, *, pwm: int, direction: int = ...) -> Command:
        """Channel 1 to 4. `pwm`: 0 to 4095. `direction`: FORWARD (default) or REVERSE."""
    @overload
    @staticmethod
    def dhb12(channel: int, *, duty: float) -> Command:
        """Channel 1 to 4. `duty`: from -1, full reverse, to 1, full forward."""
    @overload
    @staticmethod
    def dhb12(channel: int, *, pwm: int, direction: int = ...) -> Command:
        """Channel 1 to 4. `pwm`: 0 to 4095. `direction`: FORWARD (default) or REVERSE."""
    @overload
    @staticmethod
    def bldc(channel: int, *, duty: float, brake: bool = ...) -> Command:
        """Channel 1 to 4. `duty`: from -1, full reverse, to 1, full forward."""
    @overload
    @staticmethod
    def bldc(channel: int, *, pwm: int, direction: int = ..., brake: bool = ...) -> Command:
        """Channel 1 to 4. `pwm`: 0 to 4095. `direction`: FORWARD (default) or REVERSE."""
    @staticmethod
    def servo(channel: int, *, us: int) -> Command:
        """Channel 1 to 16. `us`: the pulse width, up to 2500 microseconds; 0: no pulses."""
    @staticmethod
    def relay(channel: int, *, on: bool) -> Command:
        """Channel 1 to 8."""
    @staticmethod
    def stepper(channel: int, *, position: int, speed: int = 1000) -> Command:
        """Channel 1 to 4. `position`: steps, signed 32 bits. `speed`: 1 to 20000 steps a second."""
    @staticmethod
    def zero(channel: int) -> Command:
        """Sets the counts of encoder and stepper `channel`, 1 to 4, to 0; nothing moves."""
    @staticmethod
    def dac(channel: int, *, millivolts: int) -> Command:
        """Channel 1 or 2. `millivolts`: 0 to 3300."""
    @staticmethod
    def proximity(channel: int, *, cm: int) -> Command:
        """Channel 1 to 4. `cm`: 1 to 400 centimetres; 0: off."""
    @staticmethod
    def stop() -> Command:
        """All outputs off, latched until Command.clear()."""
    @staticmethod
    def clear() -> Command:
        """Clears the stop, the watchdog or the fault that the board reports."""
    @staticmethod
    def parse(text: str) -> Command:
        """The command of a text: Command.parse('O:358,1,1') is Command.osmc(1, pwm=358). Raises
        UsageError if the text is not a valid command, or a value is outside its range."""
    def describe(self) -> str:
        """The command in words with units: 'OSMC 1 forward, duty 0.087'. A key or password is hidden."""

class Setpoints:
    """Output commands that a board executes together, in one pass over its chips, or not at all.
    Raises UsageError for a value outside its range, and for two commands to one channel.

        board.send(r4link.Setpoints(Command.osmc(1, duty=0.1), Command.servo(3, us=1500)))
    """
    def __init__(self, *commands: Command) -> None: ...
    def add(self, command: Command, /) -> Setpoints:
        """Adds the command, and returns these setpoints."""
    def __len__(self) -> int: ...

class ServoCalibration:
    """Maps the pulse of a servo linearly to its angle. `us` and `degrees`: the two ends of its
    travel, in the same order. Raises UsageError for a pulse that is not 1 to 2500, and for ends with
    the same pulse or angle.

        arm = ServoCalibration(us=(1000, 2000), degrees=(-45, 45))
    """
    def __init__(self, *, us: tuple[int, int], degrees: tuple[float, float]) -> None: ...
    def pulse(self, *, degrees: float) -> int:
        """The nearest whole microsecond. Raises UsageError for an angle beyond an end."""
    def degrees(self, *, us: int) -> float | None:
        """The angle of a pulse, also beyond an end. None for 0: the servo is off."""

class Wiring:
    """The pin or line of each signal of a board (docs/reference/wiring.md). `signal`: a name of SIGNALS, such as
    'stepper 1 step'. Places are written as in a wiring file: 'D2', 'D42 low', 'none'.

        wiring = Wiring.load('robot.wiring')
        wiring['stepper 1 step'] = 'D47'
        wiring.check()
        pathlib.Path('robot.wiring').write_text(str(wiring))
    """
    SIGNALS: tuple[str, ...]
    @staticmethod
    def plan() -> Wiring:
        """The wiring of a board to which no wiring was given."""
    @staticmethod
    def read(text: str, name: str = 'wiring') -> Wiring:
        """Reads and checks the text of a wiring file; `name` is for errors. Raises DataError."""
    @staticmethod
    def load(path: str | os.PathLike[str]) -> Wiring:
        """Reads and checks a wiring file. Raises DataError, OpenError or DeniedError."""
    def __getitem__(self, signal: str) -> str: ...
    def __setitem__(self, signal: str, place: str) -> None:
        """Raises DataError for a place that the signal cannot have. check() finds the faults of a whole wiring."""
    def check(self) -> None:
        """Raises DataError, with the reason, if the wiring breaks a rule."""
    @property
    def setting(self) -> str:
        """The value of the setting `wiring`."""
    def differences(self, other: Wiring) -> list[tuple[str, str, str]]:
        """For each difference: the signal, its place here, and its place in `other`."""
    def __str__(self) -> str:
        """The text of a wiring file, with comments."""
    def __eq__(self, other: object) -> bool: ...

class BoardWiring(_Record):
    """The wiring that a board keeps."""
    @property
    def source(self) -> str:
        """'plan': no wiring was given, and the plan was not confirmed; 'given'; 'damaged': nothing is connected."""
    @property
    def in_use(self) -> bool:
        """False: the board uses this wiring from its next start on."""
    @property
    def wiring(self) -> Wiring: ...

class Subscription:
    def cancel(self) -> None:
        """Ends the callback. After cancel() returns, the callback does not run, unless it called cancel() itself."""

class Recording:
    """A recording of one or several boards (docs/how-to/recordings.md). A new file begins after
    `rotate_bytes` bytes or `rotate_after` seconds, and at most `keep_bytes` bytes are kept; 0: no
    limit."""
    def __init__(self, path: str | os.PathLike[str], *, rotate_bytes: int = ..., rotate_after: int = ...,
                 keep_bytes: int = ...) -> None: ...
    def close(self) -> None:
        """Writes waiting data, and closes the file. Idempotent."""
    def __enter__(self) -> Self: ...
    def __exit__(self, kind: Type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None: ...
    @property
    def problem(self) -> str | None:
        """Why the recording ended early; or that its file was removed or truncated, and restarted."""
    @property
    def records(self) -> int: ...
    @property
    def dropped(self) -> int: ...

class Device:
    @property
    def name(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def role(self) -> DeviceRole: ...
    @property
    def address(self) -> int: ...
    @property
    def fields(self) -> str: ...
    @property
    def units(self) -> dict[str, str]: ...
    def is_set_up(self, state: State, /) -> bool | None: ...
    def reading(self, state: State, value: str, /) -> tuple[float | None, int, int]: ...
    def readings(self, state: State, /) -> dict[str, tuple[float | None, int, int]]: ...

class FoundBoard(_Record):
    """A board that discover() has found: include/r4link/discovery/discover.hpp."""
    @property
    def url(self) -> str:
        """The URL that opens the board: 'serial:?sn=…', 'can://can0?node=1', 'udp:?id=left-arm'."""
    @property
    def place(self) -> str:
        """Where the board was found: `path` of a port, `interface` of a bus or `address` of a network."""
    @property
    def address(self) -> str:
        """UDP: the board's IPv4 address; else ''."""
    @property
    def node(self) -> int:
        """CAN: the board's number on the bus, 0 to 31."""
    @property
    def identity(self) -> Identity | None:
        """None: the board did not report its identity."""
    @property
    def busy(self) -> bool | None:
        """True if a host controls the board; None: unknown."""
    @property
    def holder(self) -> Program | None:
        """Serial and CAN: the program of this computer that holds the transport. Name '': no answer."""
    @property
    def holder_controls(self) -> bool:
        """False: the holder watches."""
    @property
    def foreign_frames(self) -> bool:
        """CAN: the board's ids have frames that are damaged or not R4's, perhaps of another device."""

class SearchedPort(_Record):
    @property
    def path(self) -> str: ...
    @property
    def url(self) -> str: ...
    @property
    def usb_id(self) -> str:
        """'2341:0266'; '': not a USB device."""
    @property
    def serial_number(self) -> str: ...
    @property
    def description(self) -> str: ...
    @property
    def is_r4(self) -> bool:
        """True if the port has the USB id of a board."""
    @property
    def asked(self) -> bool:
        """True if Q:ID was sent, or a program of this computer holds the port."""
    @property
    def trouble(self) -> str | None:
        """Why Q:ID could not be sent."""

class SearchedBus(_Record):
    @property
    def interface(self) -> str: ...
    @property
    def up(self) -> bool: ...
    @property
    def fd(self) -> bool: ...
    @property
    def has_controller(self) -> bool: ...
    @property
    def state(self) -> str:
        """The state of the controller: 'error-active' …; '': unknown."""
    @property
    def bit_rate(self) -> int:
        """In bit/s; 0: unknown."""
    @property
    def trouble(self) -> str | None:
        """Why the search could not listen."""

class SearchedNetwork(_Record):
    @property
    def interface(self) -> str: ...
    @property
    def address(self) -> str:
        """The IPv4 address of this computer in that network."""
    @property
    def trouble(self) -> str | None:
        """Why Q:ID could not be sent."""

class Discovery:
    """The boards that discover() has found, and where it has searched."""
    @property
    def boards(self) -> list[FoundBoard]: ...
    @property
    def ports(self) -> list[SearchedPort]: ...
    @property
    def buses(self) -> list[SearchedBus]: ...
    @property
    def networks(self) -> list[SearchedNetwork]: ...
    @property
    def more(self) -> bool:
        """True if more than 64 boards have answered by UDP."""
    def only(self) -> FoundBoard:
        """The only board, even on several transports. Raises OpenError without a board, and
        UsageError with the URLs if there are two boards or more."""

def discover(*, serial: bool = True, can: bool = True, udp: bool = True, serial_ports: Sequence[str] = (),
             udp_port: int = 2018) -> Discovery:
    """The boards that this computer reaches, as `r4 list` shows them. Blocks for up to 1.3 s.
    `serial_ports`: paths of further ports to search, with any USB id. `udp_port`: 1 to 65535, where
    boards listen."""

def shipped_devices() -> list[str]: ...
def load_device(text: str, first_slot: int, /) -> Device: ...
def parse_device(text: str, address: int | None, first_slot: int, /) -> Device: ...

class Pid:
    def __init__(self, kp: float, ki: float, kd: float, feed_forward: float, minimum: float, maximum: float, rate: float,
                 derivative_filter: float, /) -> None: ...
    def step(self, setpoint: float, measured: float, dt: float, /) -> float: ...
    def reset(self) -> None: ...
    def take_over(self, output: float, setpoint: float, measured: float, /) -> None: ...
    @property
    def output(self) -> float: ...
    @property
    def integral(self) -> float: ...

class Wheel:
    def __init__(self, encoder: int, counts_a_turn: float, radius: float, reversed: bool, window_ms: int, max_speed: float,
                 /) -> None: ...
    def advance(self, state: State, /) -> float: ...
    def measured(self, state: State, /) -> float: ...
    def reset(self) -> None: ...
    @property
    def speed(self) -> float: ...

class SteeringSensor:
    def __init__(self, left: tuple[float, float], right: tuple[float, float], margin: float, /) -> None: ...
    def angle(self, state: State, /) -> float | None: ...
    def volts(self, angle: float, /) -> float: ...

class DifferentialDrive:
    def __init__(self, separation: float, max_wheel: float, /) -> None: ...
    def wheels(self, forward: float, turn: float, /) -> tuple[float, float]: ...
    def twist(self, left: float, right: float, /) -> tuple[float, float]: ...

class FourWheelDrive:
    def __init__(self, track: float, slip: float, max_wheel: float, /) -> None: ...
    def wheels(self, forward: float, turn: float, /) -> tuple[float, float, float, float]: ...
    def twist(self, front_left: float, rear_left: float, front_right: float, rear_right: float,
              /) -> tuple[float, float]: ...

class Ackermann:
    def __init__(self, wheelbase: float, track: float, max_steering: float, max_speed: float, /) -> None: ...
    def command(self, forward: float, turn: float, /) -> tuple[float, float]: ...
    def twist(self, speed: float, steering: float, /) -> tuple[float, float]: ...
    def limited_steering(self, steering: float, /) -> float: ...
    def front_wheels(self, steering: float, /) -> tuple[float, float]: ...
    def rear_wheels(self, speed: float, steering: float, /) -> tuple[float, float]: ...

class Odometry:
    def __init__(self, length_per_m: float, turn_per_m: float, turn_per_rad: float, /) -> None: ...
    def advance(self, length: float, turn: float, /) -> None: ...
    def reset(self, x: float, y: float, yaw: float, covariance: Sequence[float], /) -> None: ...
    @property
    def pose(self) -> tuple[float, float, float]: ...
    @property
    def covariance(self) -> tuple[float, ...]: ...
    def ros_covariance(self, unknown: float, /) -> tuple[float, ...]: ...

class LoopOptions:
    def __init__(self, fields: str, late_ms: int, first_ms: int, rest: Setpoints, rest_timeout_ms: int, watchdog_ms: int,
                 arming: bool, /) -> None: ...
    def add_standstill(self, encoder: int, drive: str, channel: int, pwm: int, counts: int, time_ms: int,
                       /) -> None: ...

class LoopGuard:
    def __init__(self, options: LoopOptions, /) -> None: ...
    def start(self, now: float, /) -> None: ...
    def on_state(self, state: State, disarmed_by: DisarmCause | str, now: float, /) -> float | None: ...
    def on_commanded(self, setpoints: Setpoints, /) -> None: ...
    def check(self, link: LinkState | str, disarmed_by: DisarmCause | str, now: float, /) -> LoopEnd: ...
    @property
    def deadline(self) -> float: ...
    @property
    def ended(self) -> LoopEnd: ...
    @property
    def why(self) -> str: ...

def wrapped(angle: float, /) -> float: ...

def commissioning_checks() -> list[tuple[str, str, str, str]]: ...

class Commissioning:
    def __init__(self, board: Board, person: object, others: list[str], resume: str, /) -> None: ...
    def run(self, check: str, /) -> bool: ...
    def run_all(self, only: list[str], /) -> bool: ...
    def offer(self) -> bool: ...
    def json(self) -> str: ...
    def html(self) -> str: ...

class States:
    @property
    def ended(self) -> bool: ...
    @property
    def missed(self) -> int: ...

class Board:
    def __init__(self, url: str, *, transports: list[Transport], link: str, role: BoardRole | str, arming: bool, fields: str, key: str | None,
                 watch_rate_hz: int, heartbeat: int, timeout: int, command_retry: int, stop_retry: int, stop_linger: int,
                 identify_interval: int, callback_limit: int) -> None: ...
    def close(self) -> None: ...
    def role(self) -> BoardRole: ...
    def take_control(self) -> None: ...
    def release_control(self, ms: int, /) -> None: ...
    def wait_active(self, ms: int, /) -> None: ...
    def send(self, command: str | Command | Setpoints, ms: int, /) -> None: ...
    def post(self, command: Command | Setpoints, /) -> PostResult: ...
    def calibrate_servo(self, channel: int, calibration: ServoCalibration, /) -> None: ...
    def servo_calibration(self, channel: int, /) -> ServoCalibration: ...
    def transfer(self, text: str, ms: int, /) -> bytes: ...
    def uart_read(self, channel: int, ms: int, /) -> UartData: ...
    def uart_on_bytes(self, channel: int, callback: Callable[[UartData], object], /) -> Subscription: ...
    def attach(self, device: Device, ms: int, /) -> None: ...
    def arm(self, ms: int, /) -> None: ...
    def disarmed_by(self) -> DisarmCause: ...
    def stop(self, ms: int, /) -> None: ...
    def stop_async(self) -> None: ...
    def link_timing(self, timeout: int, heartbeat: int, ms: int, /) -> None: ...
    def identify(self, ms: int, /) -> Identity: ...
    def wiring(self, ms: int, /) -> BoardWiring: ...
    def state(self) -> State: ...
    def next_state(self, ms: int, /) -> State: ...
    def link(self) -> LinkStatus: ...
    def statistics(self) -> Statistics: ...
    def carrier_counters(self) -> CarrierCounters: ...
    def name(self) -> str: ...
    def paths(self) -> list[PathStatus]: ...
    @overload
    def record(self, path: str, rotate_bytes: int, rotate_after: int, keep_bytes: int, /) -> None: ...
    @overload
    def record(self, recording: Recording, /) -> None: ...
    def watchdog(self, ms: int, /) -> None: ...
    def feed(self) -> None: ...
    def run_loop(self, options: LoopOptions, step: Callable[[State, float], Setpoints | None],
                 /) -> tuple[LoopEnd, str, bool, int]: ...
    def states(self, lossless: bool, most: int, /) -> States: ...
    def take(self, states: States, ms: int, /) -> State | None: ...
    def on_state(self, callback: Callable[[State], object], /) -> Subscription: ...
    def on_link(self, callback: Callable[[LinkStatus], object], /) -> Subscription: ...
    def on_event(self, callback: Callable[[Event], object], /) -> Subscription: ...
    def on_path(self, callback: Callable[[PathStatus], object], /) -> Subscription: ...
    def on_restart(self, callback: Callable[[], object], /) -> Subscription: ...
    def on_arming(self, callback: Callable[[DisarmCause], object], /) -> Subscription: ...
    def on_refused(self, callback: Callable[[RefusedPost], object], /) -> Subscription: ...

class Call:
    def fileno(self) -> int: ...
    def cancel(self) -> None: ...
    def result(self) -> Any: ...

class Calls:
    def __init__(self, board: Board, /) -> None: ...
    def send(self, command: str | Command | Setpoints, ms: int, /) -> Call: ...
    def stop(self, ms: int, /) -> Call: ...
    def arm(self, ms: int, /) -> Call: ...
    def identify(self, ms: int, /) -> Call: ...
    def wiring(self, ms: int, /) -> Call: ...
    def transfer(self, text: str, ms: int, /) -> Call: ...
    def attach(self, device: Device, ms: int, /) -> Call: ...
    def link_timing(self, timeout: int, heartbeat: int, ms: int, /) -> Call: ...
    def wait_active(self, ms: int, /) -> Call: ...
    def take_control(self) -> Call: ...
    def release_control(self, ms: int, /) -> Call: ...

def make_state(t_ms: int, at: float, fields: dict[str, Any], /) -> State: ...
def check_link(url: str, link: str, /) -> None: ...
def read(path: str, datagrams: bool, /) -> tuple[list[Any], list[Any], list[str]]: ...

class SimulatedRobot:
    def __init__(self) -> None: ...
    @property
    def url(self) -> str: ...
    def happen(self, words: str, /) -> None: ...
    def look(self) -> dict[str, Any]: ...

class BoardHealth:
    """The health of a board of a fleet."""
    @property
    def board(self) -> int: ...
    @property
    def url(self) -> str:
        """The URL that opened the board."""
    @property
    def identity(self) -> Identity:
        """Empty until the board has answered."""
    @property
    def link(self) -> LinkStatus: ...
    @property
    def in_control(self) -> bool: ...
    @property
    def disarmed_by(self) -> DisarmCause: ...
    @property
    def statistics(self) -> Statistics: ...
    @property
    def paths(self) -> list[PathStatus]:
        """One status for each of several paths; empty for a single path."""
    @property
    def well(self) -> bool:
        """True if the link is ACTIVE and in control, so commands can be sent."""

class FleetResult:
    """The result of a command at one board."""
    @property
    def board(self) -> int: ...
    @property
    def outcome(self) -> Outcome: ...
    @property
    def elapsed(self) -> float: ...
    @property
    def confirmed(self) -> bool: ...
    @property
    def problem(self) -> tuple[str, str, str, str, Outcome, Refusal, int]:
        """For errors.error_of()."""

class Fleet:
    def __init__(self, urls: list[str], *, role: BoardRole | str, arming: bool, fields: str, key: str | None,
                 watch_rate_hz: int, heartbeat: int, timeout: int, command_retry: int, stop_retry: int, stop_linger: int,
                 identify_interval: int) -> None: ...
    def close(self) -> None: ...
    def __len__(self) -> int: ...
    def url(self, board: int, /) -> str: ...
    def find(self, url_or_name: str, /) -> int: ...
    def wait_active(self, ms: int, /) -> list[int]: ...
    def health(self) -> list[BoardHealth]: ...
    def states(self) -> list[State]: ...
    @overload
    def send(self, command: str | Command, boards: list[int] | None, ms: int, /) -> list[FleetResult]: ...
    @overload
    def send(self, setpoints: list[tuple[int, Setpoints]], ms: int, /) -> list[FleetResult]: ...
    def arm(self, boards: list[int] | None, ms: int, /) -> list[FleetResult]: ...
    def stop(self, ms: int, /) -> list[FleetResult]: ...
    def stop_async(self) -> None: ...
    def post(self, setpoints: list[tuple[int, Setpoints]], /) -> list[PostResult]: ...
    def next_event(self, ms: int, /) -> tuple[FleetEventKind, int, LinkStatus | Event | DisarmCause | RefusedPost | int |
                                              None] | None: ...
    def record(self, recording: Recording, /) -> None: ...
    def watchdog(self, ms: int, /) -> None: ...
    def feed(self) -> None: ...

class Bridge:
    def __init__(self, hosts: str, board: str, *, timeout: int, keys: list[str], open: bool) -> None: ...
    def close(self) -> None: ...
    def status(self) -> list[tuple[tuple[str, bool, list[int]], tuple[str, bool, list[int]]]]: ...
