# SPDX-License-Identifier: GPL-3.0-or-later
"""The bytes of each stack that our interrupt handlers need, from GCC's call graphs.

The stacks are in firmware/ports/giga/chip/interrupt_stack.hpp.
"""
import pathlib
import re
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / 'support'))
from call_graph import CallGraph  # noqa: E402

CORE_STACK = 1024      # the core's stack for all handlers: MBED_CONF_TARGET_BOOT_STACK_SIZE
OWN_STACK = 4096
LAST_STACK = 768
EXCEPTION_FRAME = 108  # the processor's frame with the registers of the FPU, aligned
SWITCH = 8             # run_on(): GCC does not count code in assembler
CORE_READ = 512        # USBSerial::read() has a buffer of 256 bytes on the stack
OF_CORE_STACK = 128    # the share of our handler, without the processor's frame

THROUGH_INTERFACES = [
    ('Guard', 'BoardHardware', 'make_safe'),
    (r'switch_off_and_reset', 'BoardHardware', 'make_safe'),
    ('Machine|step|StepTick', 'Machine', 'step_tick'),
    ('BoardHardware', 'Pca9685|Mcp23017|Mcp4728|I2cController|GpioInput|GpioOutput|AnalogValue|DacOutput',
     'make_safe|want_safe|write|write_read|recover|read'),
    (r'ChipDriver\d+(?:begin|poll|write_changes|verify)', 'Pca9685|Mcp23017|Mcp4728',
     'want_safe|on_begin|set_up|on_write_changes|on_verify'),
    (r'ChipDriver\d+(?:send|fetch)|Pca9685|Mcp23017|Mcp4728', 'I2cController', 'write|write_read'),
    ('I2cController', 'BoardClock', 'now_us'),
    ('UserUart', 'UserUartController', 'set_up|receive|take_lost|send|drop'),
    ('Stepper|UltrasonicSensors', 'GpioOutput', 'write'),
]
TURNS = {'_ZN2r412write_numberEPcy': 3}
# These functions continue with a function on another stack.
LEAVES = ('_ZN2r44giga12on_own_stackEPFvvE', '_ZN2r44giga13on_last_stackEPFvvE')


def stack_bounds(files):
    graph = CallGraph(files, THROUGH_INTERFACES, TURNS, LEAVES)

    def depth(*functions):
        """The depth of the deepest of `functions`, which are names without arguments."""
        names = [name for name in graph.frames for function in functions
                 if re.search(rf'(?<=\d){function}(?:E\w*|v)$|^{function}$', name)]
        assert len(names) >= len(functions), f'{functions}: {names}'
        return max(map(graph.depth, names))

    gives_way = depth('hear_usb_now') + CORE_READ
    at_once = depth('pass_millisecond', 'look', 'step', 'hear_can')
    return {
        # Handlers of the core need at most the core's stack, and may interrupt our handler that gives way. Our other
        # handlers may interrupt all these handlers.
        'ours': (gives_way + CORE_STACK + EXCEPTION_FRAME + at_once + SWITCH, OWN_STACK),
        'the core\'s, of us': (SWITCH + depth('on_millisecond', 'on_stop', 'on_step_timer', 'on_can', 'on_usb',
                                             'on_edge', 'listen'), OF_CORE_STACK),
        'the last': (max(depth('r4_giga_on_fault'), depth('switch_off_and_reset')), LAST_STACK),
    }
