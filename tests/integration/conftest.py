# SPDX-License-Identifier: GPL-3.0-or-later
import signal

import own_network
from repeat import pytest_runtest_protocol  # noqa: F401

# The tests interrupt programs with SIGINT. Under nohup or in a shell's background, the programs would ignore SIGINT.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

own_network.enter()
