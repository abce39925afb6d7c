# SPDX-License-Identifier: GPL-3.0-or-later
"""What pytest loads where r4link is installed: the plugin r4link.pytest_plugin, if it can be loaded.

Pytest loads it in every project of the machine. Where r4link cannot be imported, for a library is missing or it was built
for another Python, only the projects that use its fixtures may fail: the others see a warning.
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
    if not pluginmanager.is_registered(pytest_plugin):  # by -p
        pluginmanager.register(pytest_plugin, 'r4link.pytest_plugin')


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for each in _trouble:
        terminalreporter.write_line(f'warning: {each}', yellow=True)
