// SPDX-License-Identifier: GPL-3.0-or-later
// Drives Chromium for tests/integration/browser.py. Each line of standard input is a request, and each line of standard
// output is an answer. Each page has a name and its own cookies and storage, as in a separate browser.
const readline = require('node:readline');
const puppeteer = require('puppeteer-core');

const pages = new Map();

const does = {
  async open(browser, {page: name, url, width = 1280, height = 800, scheme = 'dark', touch = false}) {
    const page = await (await browser.createBrowserContext()).newPage();
    const errors = [];
    page.on('console', (message) => ['error', 'warn'].includes(message.type()) && errors.push(message.text()));
    page.on('pageerror', (error) => errors.push(error.message));
    await page.setViewport({width, height, hasTouch: touch, isMobile: touch});
    await page.emulateMediaFeatures([{name: 'prefers-color-scheme', value: scheme}]);
    pages.set(name, {page, errors});
    await page.goto(url);
  },
  evaluate: (_, {page, script}) => pages.get(page).page.evaluate(script),
  async until(_, {page, script, timeout_ms}) {
    return (await pages.get(page).page.waitForFunction(script, {polling: 20, timeout: timeout_ms})).jsonValue();
  },
  click: (_, {page, selector, ...options}) => pages.get(page).page.click(selector, options),
  focus: (_, {page, selector}) => pages.get(page).page.focus(selector),
  press: (_, {page, key}) => pages.get(page).page.keyboard.press(key),
  type: (_, {page, text}) => pages.get(page).page.keyboard.type(text),
  async drag(_, {page, from, to}) {
    const {mouse} = pages.get(page).page;
    await mouse.move(...from);
    await mouse.down();
    await mouse.move(...to, {steps: 8});
    await mouse.up();
  },
  screenshot: (_, {page, path}) => pages.get(page).page.screenshot({path}).then(() => null),
  errors: (_, {page}) => pages.get(page).errors,
  async close(_, {page}) {
    await pages.get(page).page.browserContext().close();
    pages.delete(page);
  },
};

async function main() {
  const args = ['--disable-gpu', '--disable-dev-shm-usage'];
  if (process.getuid() === 0) args.push('--no-sandbox');  // Chromium has no sandbox for root
  const browser = await puppeteer.launch({executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium', headless: true, args});
  for await (const line of readline.createInterface({input: process.stdin})) {
    const {do: what, ...request} = JSON.parse(line);
    let answer;
    try {
      answer = {value: (await does[what](browser, request)) ?? null};
    } catch (error) {
      answer = {error: `${what} ${JSON.stringify(request)}: ${error.message}`};
    }
    process.stdout.write(`${JSON.stringify(answer)}\n`);
  }
  await browser.close();
}

main();
