#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Counts the tests that tools/test ran. Usage: summary.py BUILD

Reads BUILD/results/*.xml (ctest), BUILD/[asan|tsan/]junit/*.xml (pytest, in place of the one
ctest entry of the file) and BUILD/results/checks.txt. Names every failed and every skipped test.
A skipped test counts as failed. Names the tests that were repeated because the machine stood still
(main.cpp, integration/repeat.py), and the tests that failed beside other tests and were repeated alone.
The result in NAME.alone.xml replaces the result in NAME.xml. The last line is `N passed, N failed`.
"""
import pathlib
import sys
import xml.etree.ElementTree as ET


def cases(file):
    """Yields (name, outcome) for each test case of a JUnit file."""
    for case in ET.parse(file).iter('testcase'):
        children = {child.tag for child in case}
        if children & {'failure', 'error'} or case.get('status') == 'fail':
            outcome = 'failed'
        elif 'skipped' in children or case.get('status', 'run') != 'run':
            outcome = 'skipped'
        else:
            outcome = 'passed'
        yield case.get('name'), outcome


def alone(report):
    """The outcomes of the tests of a report that were repeated alone."""
    again = report.with_suffix('.alone.xml')
    return dict(cases(again)) if again.exists() else {}


def reports(build):
    return [each for each in sorted((build / 'results').glob('*.xml')) if not each.match('*.alone.xml')]


def repeated(build):
    repeats = build / 'results/repeats.txt'
    if repeats.exists():
        yield from repeats.read_text(encoding='utf-8').splitlines()
    for report in reports(build):
        for name, outcome in alone(report).items():
            yield f'{report.stem}: {name}: failed beside others; {outcome} alone ({report.with_suffix(".log")})'
        for case in ET.parse(report).iter('testcase'):
            for line in (case.findtext('system-out') or '').splitlines():
                if 'The machine stood still' in line:
                    yield f'{report.stem}: {case.get("name")}: {line}'


def outcomes(build):
    for line in (build / 'results/checks.txt').read_text().splitlines():
        outcome, name = line.split(' ', 1)
        yield name, outcome
    for report in reports(build):
        preset = report.stem.split('.')[0]
        junit = (build if preset == 'release' else build / preset) / 'junit'
        second = alone(report)
        for name, outcome in cases(report):
            outcome = second.get(name, outcome)
            file = junit / f'{name}.xml'
            inner = list(cases(file)) if file.exists() else []
            if outcome == 'failed' and all(each == 'passed' for _, each in inner):
                inner = []  # the process failed although all its tests passed
            for each, its_outcome in [(f'{name}.{case}', o) for case, o in inner] or [(name, outcome)]:
                yield f'{preset}: {each}', its_outcome


def main():
    build = pathlib.Path(sys.argv[1])
    found = list(outcomes(build))
    for each in repeated(build):
        print(f'repeated: {each}')
    for name, outcome in found:
        if outcome != 'passed':
            print(f'{outcome}: {name}')
    passed = sum(outcome == 'passed' for _, outcome in found)
    print(f'{passed} passed, {len(found) - passed} failed')
    return 0 if found and passed == len(found) else 1


if __name__ == '__main__':
    sys.exit(main())
