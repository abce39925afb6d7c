// SPDX-License-Identifier: GPL-3.0-or-later
import {clock_text, element} from './text.js';

const KEPT = 500;
const log = document.getElementById('log');

export function add_event(level, text, board = '', time_ms = Date.now()) {
  log.prepend(element('li', {className: level}, element('time', {}, clock_text(time_ms, 3)),
    element('span', {}, level === 'info' ? '' : `${level}: `, board ? `${board}: ` : '', text)));
  while (log.children.length > KEPT) log.lastChild.remove();
}
