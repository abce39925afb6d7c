# SPDX-License-Identifier: GPL-3.0-or-later
"""The stack that functions need with all functions that they call, from the output of GCC with -fcallgraph-info=su.

GCC does not list the functions that are called through an interface. Rules list these functions: (caller, classes,
functions), regular expressions over mangled names. A caller without a rule is an error, so no call is left out.
"""
import re

LIBRARY_FRAME = 64  # for a function of the C library: more than any such function needs


def is_of(name, classes):
    return re.search(rf'\d(?:{classes})(?=[\dE])', name)


class CallGraph:
    """`files`: the output of GCC (.ci). `turns`: functions that call themselves, and the largest number of calls.
    `leaves`: functions whose calls through pointers are not followed."""

    def __init__(self, files, through_interfaces, turns=None, leaves=()):
        self.frames, self.calls, self.depths = {}, {}, {}
        self.through_interfaces, self.turns, self.leaves = through_interfaces, turns or {}, leaves
        for file in files:
            self._read(file.read_text())

    def _read(self, text):
        for title, label in re.findall(r'^node: \{ title: "([^"]+)" label: "([^"]*)"', text, re.MULTILINE):
            frame = re.search(r'(\d+) bytes \(([\w,]+)\)', label)
            if frame:
                assert frame[2] == 'static', f'{title}: its frame has no bound'
                self.frames[title.split(':')[-1]] = int(frame[1])
                self.calls.pop(title, None)  # the calls of a weak function that this function replaces
        for edge in re.findall(r'^edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', text, re.MULTILINE):
            caller, callee = (name.split(':')[-1] for name in edge)
            self.calls.setdefault(caller, set()).add(callee)

    def callees(self, caller):
        callees = self.calls.get(caller, set()) - (self.turns.keys() & {caller})
        if '__indirect_call' not in callees:
            return callees
        callees = callees - {'__indirect_call'}
        if caller in self.leaves:
            return callees
        rules = [rule for rule in self.through_interfaces if is_of(caller, rule[0])]
        assert rules, f'{caller} calls a function through an interface and has no rule'
        for _, classes, functions in rules:
            callees |= {name for name in self.frames if is_of(name, rf'(?:{classes})\d+(?:{functions})')}
        return callees

    def depth(self, name, path=()):
        """The largest number of bytes of stack from the call of `name`."""
        assert name not in path, f'{name} calls itself: {path}'
        if name not in self.depths:
            self.depths[name] = self.frames.get(name, LIBRARY_FRAME) * self.turns.get(name, 1) + max(
                (self.depth(callee, (*path, name)) for callee in self.callees(name)), default=0)
        return self.depths[name]
