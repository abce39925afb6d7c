# SPDX-License-Identifier: GPL-3.0-or-later
"""An error that stops a command: the thing, the reason, the fix."""

UNSUPPORTED = 6  # the exit code, as in r4: the kernel or the machine lacks something


class Trouble(Exception):
    def __init__(self, thing, reason, fix, code=UNSUPPORTED):
        super().__init__(f'{thing}: {reason}')
        self.fix = fix
        self.code = code
