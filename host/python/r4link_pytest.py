# SPDX-License-Identifier: GPL-3.0-or-later
"""The entry point for pytest: loads the plugin r4link.pytest_plugin, if possible.

If r4link is installed, pytest loads this module in every project of the machine. r4link cannot be imported if a library
is missing, or if it was built for another Python. Then only projects that use its fixtures fail. Other projects get
a warning.
"""
from __future__ import annotations

import pytest

_trouble: list[str] = []


def pytest_addoption(pluginmanager: pytest.PytestPluginManager) -> None:
    try:
        from r4link import pytest_plugin
    except Exception as error:  # pylint: disable=broad-except
        _trouble.append(f'r4link: its pytest plugin cannot be loaded: {type(error).__name__}: {error}; '
                        'install r4link anew, or leave it out: -p no:r4link')
        return
    if not pluginmanager.is_registered(pytest_plugin):  # if not loaded already by -p
        pluginmanager.register(pytest_plugin, 'r4link.pytest_plugin')


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for each in _trouble:
        terminalreporter.write_line(f'warning: {each}', yellow=True)
