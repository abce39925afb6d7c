// SPDX-License-Identifier: GPL-3.0-or-later
// A card for each board: its link, its safe state and the reason, and buttons to recover.
import {board_name, element, put} from './text.js';

const SAFE_WORDS = {
  link: 'no host controls the board', stop: 'the board was stopped', handle: "the dead-man's handle is released",
  proximity: 'an obstacle is near', watchdog: "the board's watchdog acted", fault: 'the board has a fault',
};

function verdict(health) {
  if (!health) return ['lost', 'Unknown', 'the state of the board is unknown'];
  if (health.link === 'lost') return ['lost', 'Lost', health.why || 'the board does not answer'];
  if (health.link === 'connecting') return ['lost', 'Connecting', health.why || 'nothing was received from the board yet'];
  if (health.safe) return ['safe', 'Safe', health.why || SAFE_WORDS[health.safe] || health.safe];
  if (health.armed) return ['armed', 'Armed', 'outputs obey commands'];
  return ['idle', 'Active', `not armed${health.disarmed ? `: ${health.disarmed}` : ''}`];
}

class Card {
  #state = element('strong');
  #why = element('span', {className: 'why'});
  #figures = element('dl');
  #values = new Map();
  #answer = element('output');
  #arm = element('button', {type: 'button', disabled: true}, 'Arm');
  #clear = element('button', {type: 'button', disabled: true}, 'Clear');
  #identity = element('span', {className: 'hint'});
  #paths = element('p', {className: 'hint'});

  constructor(board, link) {
    for (const figure of ['rate', 'loss', 'round trip', 'age']) {
      const value = element('dd', {}, '–');
      this.#values.set(figure, value);
      this.#figures.append(element('div', {}, element('dt', {}, figure), value));
    }
    const ask = async (type) => {
      put(this.#answer, '…');
      const result = await link.send({type, board: board.board});
      put(this.#answer, `${type}: ${result.text}`);
      this.#answer.className = result.ok ? 'good' : 'bad';
    };
    this.#arm.title = 'clears what can be cleared, and closes the relay of the motor supply';
    this.#clear.title = 'clears a stop, a watchdog or a fault; does not move anything';
    this.#arm.onclick = () => ask('arm');
    this.#clear.onclick = () => ask('clear');
    this.node = element('article', {className: 'card', 'aria-label': `Board ${board_name(board)}`},
      element('div', {className: 'head'}, element('h2', {title: board.url}, board_name(board)), this.#identity),
      element('div', {className: 'told'}, element('p', {className: 'state', role: 'status'}, this.#state, this.#why),
        this.#answer, this.#figures, this.#paths),
      element('div', {className: 'act'}, this.#arm, this.#clear));
    this.show(null);
  }

  show(health) {
    const [kind, word, why] = verdict(health);
    this.node.dataset.state = kind;
    put(this.#state, word);
    put(this.#why, why);
    this.#identity.title = health ? [health.id, health.firmware].filter(Boolean).join(' · ') : '';
    put(this.#identity, this.#identity.title);
    const there = health && kind !== 'lost';
    put(this.#values.get('rate'), there ? `${health.rate_hz.toFixed(1)} Hz` : '–');
    put(this.#values.get('loss'), there ? `${(100 * health.loss).toFixed(1)} %` : '–');
    put(this.#values.get('round trip'), there && health.round_trip_ms !== null ?
      `${health.round_trip_ms.toFixed(1)} ms` : '–');
    put(this.#paths, (health?.paths ?? []).map((path) => `${path.name}: ${path.state}`).join(' · '));
    this.#paths.hidden = !health?.paths;
    put(this.#values.get('age'), health && health.age_ms !== null ? age_text(health.age_ms) : '–');
  }

  allow(on) { this.#arm.disabled = this.#clear.disabled = !on; }
}

const age_text = (ms) => ms < 1000 ? `${ms.toFixed(0)} ms` : `${(ms / 1000).toFixed(1)} s`;

export class Boards {
  #cards = [];
  health = [];

  constructor(hello, link) {
    this.boards = hello.boards;
    this.#cards = hello.boards.map((board) => new Card(board, link));
    document.getElementById('boards').replaceChildren(...this.#cards.map((card) => card.node));
  }

  take(health) {
    this.health[health.board] = health;
    this.#cards[health.board].show(health);
  }

  allow(on) { for (const card of this.#cards) card.allow(on); }

  forget() {
    this.health = [];
    for (const card of this.#cards) card.show(null);
  }

  missing() {
    return this.boards.filter((board) => this.health[board.board]?.link === 'lost')
      .map((board) => `${board_name(board)} does not answer: ${this.health[board.board].why || 'its link is lost'}. ` +
        'The board goes safe by itself. It is shown again when its datagrams arrive.');
  }
}
