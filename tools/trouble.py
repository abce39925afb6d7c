# SPDX-License-Identifier: GPL-3.0-or-later
"""The reason why a command cannot run: the thing, the reason, the fix."""

UNSUPPORTED = 6  # the exit code, as that of r4: what the kernel or the machine has not


class Trouble(Exception):
    def __init__(self, thing, reason, fix, code=UNSUPPORTED):
        super().__init__(f'{thing}: {reason}')
        self.fix = fix
        self.code = code
