// SPDX-License-Identifier: GPL-3.0-or-later
// The control of one output. A slider streams: while a command waits for its confirmation, only the
// newest value is queued. While the user does not set the slider, it follows the board's report, so
// no old setpoint remains after a stop.
import {kind_of} from './channel_kinds.js';
import {element, put} from './text.js';

const SETTLE_MS = 200;  // the report may arrive after the confirmation

export class Channel {
  #kind;
  #channel;
  #fields;
  #ask;
  #range = null;
  #number = null;
  #direction = null;
  #brake = null;
  #speed = null;
  #toggle = null;
  #reported = element('span', {className: 'reported'});
  #answer = element('output', {className: 'answer'});
  #busy = false;
  #next = null;
  #follow_after_ms = 0;
  #typing = false;

  // `ask(command)` resolves to the board's answer.
  constructor(channel, fields, ask) {
    this.#kind = kind_of(channel);
    this.#channel = channel.channel;
    this.#fields = fields;
    this.#ask = ask;
    const parts = this.#kind.toggle ? [this.#make_toggle(channel.label)] : this.#make_value(channel.label);
    this.node = element('div', {className: `channel ${channel.kind}`, role: 'group', 'aria-label': channel.label,
      'data-channel': channel.id}, element('span', {className: 'label'}, channel.label), ...parts, this.#reported, this.#answer);
  }

  #make_toggle(label) {
    this.#toggle = element('button', {type: 'button', className: 'switch', role: 'switch', 'aria-checked': 'false',
      'aria-label': label}, 'off');
    this.#toggle.onclick = () => this.#set({value: this.#toggle.getAttribute('aria-checked') === 'true' ? 0 : 1});
    return this.#toggle;
  }

  #make_value(label) {
    const {name, min, max, step, any} = this.#kind.value;
    this.#range = element('input', {type: 'range', min, max, step, value: 0, 'aria-label': `${label} ${name}`});
    this.#number = element('input', {type: 'number', step, value: 0, 'aria-label': `${label} ${name}, as a number`});
    if (!any) Object.assign(this.#number, {min, max});
    this.#range.oninput = () => { this.#number.value = this.#range.value; this.#set(); };
    this.#number.oninput = () => { this.#typing = true; };
    this.#number.onblur = () => { this.#typing = false; };
    this.#number.onkeydown = (key) => { if (key.key === 'Enter') this.#enter(); };
    this.#number.onchange = () => this.#enter();
    const parts = [this.#number];
    if (this.#kind.direction) parts.push(this.#direction = this.#make_choice(label, 'direction', ['rev', 'fwd'], 1));
    if (this.#kind.brake) parts.push(this.#brake = this.#make_choice(label, 'brake', ['free', 'brake'], 0));
    if (this.#kind.speed) {
      const {name: speed, ...limits} = this.#kind.speed;
      this.#speed = element('input', {type: 'number', className: 'speed', ...limits, title: speed,
        'aria-label': `${label} ${speed}`});
      const zero = element('button', {type: 'button', title: 'sets the counts of the encoder and the stepper to 0',
        'aria-label': `${label}: zero here`}, '=0');
      zero.onclick = () => this.#send(`Z:${this.#channel}`);
      parts.push(this.#speed, zero);
    }
    return [this.#range, element('span', {className: 'set'}, ...parts)];
  }

  // A turning motor is stopped before it changes direction.
  #make_choice(label, what, words, value) {
    const button = element('button', {type: 'button', className: 'choice', 'aria-label': `${label} ${what}`});
    const show = (chosen) => {
      button.value = chosen;
      put(button, words[chosen]);
      button.setAttribute('aria-label', `${label} ${what}: ${words[chosen]}`);
    };
    button.show = show;
    show(value);
    button.onclick = () => {
      show(button.value === '1' ? 0 : 1);
      if (what === 'direction') this.#range.value = this.#number.value = 0;
      this.#set();
    };
    return button;
  }

  #enter() {
    if (!this.#typing) return;
    this.#typing = false;
    if (!this.#number.reportValidity() || this.#number.value === '') return;
    this.#range.value = this.#number.value;
    this.#set();
  }

  #set(set = {value: this.#number.value, direction: this.#direction?.value, brake: this.#brake?.value,
    speed: this.#speed?.value}) {
    this.#send(this.#kind.command(set));
  }

  async #send(command) {
    this.#next = command;
    if (this.#busy) return;
    this.#busy = true;
    while (this.#next) {
      const asked = this.#next;
      this.#next = null;
      this.#say('waits', '…', asked);
      const result = await this.#ask(asked);
      if (result.ok) {
        this.#say('good', `✓ ${result.ms === undefined ? '' : `${result.ms.toFixed(1)} ms`}`, `${asked}: ${result.text}`);
      } else {
        this.#next = null;  // the queued value predates the refusal
        this.#say('bad', `✗ ${result.text}`, asked);
      }
    }
    this.#busy = false;
    this.#follow_after_ms = performance.now() + SETTLE_MS;
  }

  #say(kind, text, title) {
    this.#answer.className = `answer ${kind}`;
    this.#answer.title = title;
    put(this.#answer, text);
  }

  // After a stop: discards queued values.
  forget() { this.#next = null; this.#follow_after_ms = 0; this.#typing = false; }

  draw(history) {
    const values = this.#fields.map((field) => history.newest(field));
    if (Number.isNaN(values[0])) return put(this.#reported, '–');
    const {value, direction, brake} = this.#kind.of(values);
    put(this.#reported, this.#toggle ? '' : [value, value && direction !== undefined ? (direction ? 'fwd' : 'rev') : '']
      .filter((each) => each !== '').join(' '));
    this.#reported.classList.toggle('moves', Boolean(value) && !this.#kind.zero);
    if (this.#busy || this.#typing || performance.now() < this.#follow_after_ms) return;
    if (this.#toggle) {
      this.#toggle.setAttribute('aria-checked', String(Boolean(value)));
      put(this.#toggle, value ? 'on' : 'off');
      return;
    }
    if (Number(this.#number.value) !== value) this.#range.value = this.#number.value = value;
    if (value && direction !== undefined && this.#direction.value !== String(direction)) this.#direction.show(direction);
    if (brake !== undefined && this.#brake.value !== String(brake)) this.#brake.show(brake);
  }
}
