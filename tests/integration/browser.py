# SPDX-License-Identifier: GPL-3.0-or-later
"""Chromium without a window, driven by npm's puppeteer-core (tests/browser/driver.cjs)."""
import json
import os
import pathlib
import subprocess

from r4_process import PATIENCE_S

TESTS = pathlib.Path(__file__).resolve().parents[1]
NODE_MODULES = TESTS.parent / 'build/npm/node_modules'


class Browser:
    """Opens pages, each with its own storage."""

    def __init__(self):
        assert (NODE_MODULES / 'puppeteer-core').is_dir(), f'{NODE_MODULES} has no puppeteer-core; tools/setup --can installs it'
        self.process = subprocess.Popen(['node', TESTS / 'browser/driver.cjs'], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        text=True, env={**os.environ, 'NODE_PATH': str(NODE_MODULES)})
        self.opened = 0

    def ask(self, what, **request):
        self.process.stdin.write(json.dumps({'do': what, **request}) + '\n')
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        assert line, 'the browser has ended'
        answer = json.loads(line)
        assert 'error' not in answer, answer['error']
        return answer['value']

    def open(self, url, **options):
        self.opened += 1
        return BrowserPage(self, f'page {self.opened}', url, options)

    def end(self):
        self.process.stdin.close()
        self.process.wait(PATIENCE_S)
        self.process.stdout.close()


class BrowserPage:
    def __init__(self, browser, name, url, options):
        self.browser = browser
        self.name = name
        self.do('open', url=url, **options)

    def do(self, what, **request):
        return self.browser.ask(what, page=self.name, **request)

    def evaluate(self, script):
        return self.do('evaluate', script=script)

    def until(self, script, timeout=PATIENCE_S):
        """Waits until the script's value is true, and returns the value."""
        return self.do('until', script=script, timeout_ms=1000 * timeout)

    def text(self, selector):
        return self.evaluate(f'document.querySelector({selector!r}).textContent')

    def until_text(self, selector, part, timeout=PATIENCE_S):
        """Waits until the element is visible and its text contains `part`, and returns all of its text."""
        return self.until(f'(() => {{ const it = document.querySelector({selector!r}); return it && !it.hidden && '
                          f'it.textContent.includes({part!r}) && it.textContent; }})()', timeout)

    def click(self, selector):
        self.do('click', selector=selector)

    def focus(self, selector):
        self.do('focus', selector=selector)

    def press(self, key):
        self.do('press', key=key)

    def errors(self):
        """The errors that the page wrote to its console."""
        return self.do('errors')

    def close(self):
        self.do('close')

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        if self.browser.process.poll() is None:
            self.close()
