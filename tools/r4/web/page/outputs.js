// SPDX-License-Identifier: GPL-3.0-or-later
import {Channel} from './channel.js';
import {board_name, element} from './text.js';

export class Outputs {
  #panels;
  #groups = [];

  constructor(hello, link) {
    this.#panels = hello.boards.map((board) => {
      const channels = hello.channels.map((each) => {
        const fields = each.fields.map((name) => hello.fields.indexOf(name));
        const ask = (command) => link.send({type: 'command', board: board.board, command});
        return {kind: each.kind, made: new Channel(each, fields, ask)};
      });
      const groups = [...new Set(channels.map((each) => each.kind))].map((kind) => {
        const of_kind = channels.filter((each) => each.kind === kind).map((each) => each.made.node);
        const {title, name, max} = hello.channels.find((each) => each.kind === kind);
        return element('fieldset', {disabled: true, className: kind},
          element('legend', {}, title, element('small', {}, max ? name : '')), ...of_kind);
      });
      this.#groups.push(...groups);
      const title = hello.boards.length > 1 ? [element('h3', {}, board_name(board))] : [];
      return {channels: channels.map((each) => each.made),
        node: element('div', {className: 'panel', 'data-board': board.board}, ...title, ...groups)};
    });
    document.getElementById('panels').replaceChildren(...this.#panels.map((panel) => panel.node));
  }

  allow(on) { for (const group of this.#groups) group.disabled = !on; }
  forget() { for (const panel of this.#panels) for (const channel of panel.channels) channel.forget(); }

  draw(histories) {
    this.#panels.forEach((panel, board) => {
      for (const channel of panel.channels) channel.draw(histories[board]);
    });
  }
}
