# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs can_test for test_can.py where SocketCAN exists: our ISO-TP engine against the kernel's and can-utils'.

Fails if a test was not executed. Under a sanitizer, only the tests in TESTS run.
"""
import os
import pathlib
import re
import subprocess

from r4_process import R4

CAN_TEST = pathlib.Path(os.environ.get('R4_CAN_TEST') or pathlib.Path(R4).parent / 'tests/can_test')
# The unit tests run the engine under the sanitizers. Only this file runs the code that reads SocketCAN.
TESTS = '--gtest_filter=' + ('CanBus*' if os.environ.get('R4_SANITIZER') else '*')
FILTERS = ('GTEST_FILTER', 'GTEST_TOTAL_SHARDS', 'GTEST_SHARD_INDEX', 'GTEST_REPEAT')


def test_every_test_of_can_test_is_executed_and_passes():
    listed = subprocess.run([CAN_TEST, TESTS, '--gtest_list_tests'], capture_output=True, text=True,
                            timeout=60, check=True).stdout
    count = len(re.findall(r'^  \w', listed, re.MULTILINE))
    assert count > 0
    environment = {key: value for key, value in os.environ.items() if key not in FILTERS}
    result = subprocess.run([CAN_TEST, TESTS], env=environment, stdin=subprocess.DEVNULL, capture_output=True,
                            text=True, check=False)
    print(result.stdout[-20000:])
    assert result.returncode == 0, result.stdout[-20000:] + result.stderr[-20000:]
    # If tests failed while the machine stood still, other runs repeat these tests.
    assert re.findall(r'^\[==========\] (\d+) tests? from \d+ test suites? ran\.', result.stdout,
                      re.MULTILINE)[0] == str(count)
    passed = re.findall(r'^\[  PASSED  \] (\d+) tests?\.', result.stdout, re.MULTILINE)
    repeated = len(re.findall(r'The machine stood still for \d+ ms: run again', result.stdout))
    assert passed and (repeated or passed == [str(count)])
    assert 'SKIPPED' not in result.stdout and 'DISABLED' not in result.stdout
