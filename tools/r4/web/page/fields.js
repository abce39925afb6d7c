// SPDX-License-Identifier: GPL-3.0-or-later
// All fields, live, a column for each board; and the stored choice of plotted fields.
import {board_name, element, put, value_text} from './text.js';

const FIRST_CHOICE = ['AIN24', 'AIN12', 'OSMC1.pwm', 'OSMC2.pwm', 'ENC1'];
const REMEMBERED = 'r4.plotted';

export class Fields {
  #hello;
  #rows;
  #in_view = new Set();

  constructor(hello, on_choice) {
    this.#hello = hello;
    const chosen = new Set(JSON.parse(localStorage.getItem(REMEMBERED) ?? 'null') ?? FIRST_CHOICE);
    document.getElementById('fields-head').replaceChildren(element('th', {scope: 'col'}, 'plot'),
      ...hello.boards.map((board) => element('th', {scope: 'col'}, hello.boards.length > 1 ? board_name(board) : 'value')),
      element('th', {scope: 'col'}, 'unit'));
    this.#rows = hello.fields.map((name, field) => {
      const box = element('input', {type: 'checkbox', checked: chosen.has(name)});
      box.onchange = () => {
        localStorage.setItem(REMEMBERED, JSON.stringify(this.chosen().map((each) => hello.fields[each])));
        on_choice();
      };
      const cells = hello.boards.map(() => element('td', {className: 'number'}, '–'));
      const node = element('tr', {}, element('th', {scope: 'row'}, element('label', {}, box, name)), ...cells,
        element('td', {className: 'unit'}, hello.units[field]));
      return {name, field, box, cells, node};
    });
    document.getElementById('fields-body').replaceChildren(...this.#rows.map((row) => row.node));
    // Rows that are not visible are not updated.
    const observer = new IntersectionObserver((seen) => {
      for (const each of seen) {
        const row = this.#rows[each.target.rowIndex - 1];
        if (each.isIntersecting) this.#in_view.add(row); else this.#in_view.delete(row);
      }
    });
    for (const row of this.#rows) observer.observe(row.node);
    const search = document.getElementById('search');
    search.oninput = () => this.#find(search.value.trim().toUpperCase());
    this.#find(search.value.trim().toUpperCase());
  }

  #find(wanted) {
    for (const row of this.#rows) row.node.hidden = !row.name.toUpperCase().includes(wanted);
  }

  chosen() { return this.#rows.filter((row) => row.box.checked).map((row) => row.field); }

  draw(histories) {
    for (const row of this.#in_view) {
      row.cells.forEach((cell, board) =>
        put(cell, value_text(histories[board].newest(row.field), this.#hello.units[row.field])));
    }
  }
}
