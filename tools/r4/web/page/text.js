// SPDX-License-Identifier: GPL-3.0-or-later

export function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in made) made[name] = value; else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

// Writes only changes, to save work for the browser.
export function put(node, text) { if (node.textContent !== text) node.textContent = text; }

export function value_text(value, unit) {
  if (Number.isNaN(value)) return '–';
  if (unit === 'V') return value.toFixed(2);
  if (unit === '0/1/2' && value === 2) return 'none';  // there is no dead-man's handle
  return String(Number.isInteger(value) ? value : Number(value.toPrecision(5)));
}

const two = (number) => String(number).padStart(2, '0');
export function clock_text(time_ms, digits = 0) {
  const time = new Date(time_ms);
  const text = `${two(time.getHours())}:${two(time.getMinutes())}:${two(time.getSeconds())}`;
  return digits ? `${text}.${String(time.getMilliseconds()).padStart(3, '0').slice(0, digits)}` : text;
}

// The board's name, else its address.
export const board_name = (board) => board.name || board.url.replace(/^\w+:\/\//, '').replace(/\?listen=\d+$/, '');
