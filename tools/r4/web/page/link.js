// SPDX-License-Identifier: GPL-3.0-or-later
// The WebSocket to r4 web, reopened when lost. While this page controls and is visible, it sends
// `alive` every 100 ms. Each message echoes the newest `now` of the server, so delayed messages do
// not count. The timer runs in the page's own thread, so a hung page sends nothing.

const ALIVE_MS = 100;
const SILENCE_MS = 1500;  // the server sends every 100 ms
const FIRST_RETRY_MS = 200;
const LONGEST_RETRY_MS = 2000;

// Takes the token of http://robot:8080/#token=… for this tab; removes it from the address.
function token_of_address() {
  const given = new URLSearchParams(location.hash.slice(1)).get('token');
  if (given) {
    sessionStorage.setItem('r4.token', given);
    history.replaceState(null, '', location.pathname);
  }
  return sessionStorage.getItem('r4.token');
}

export class Link extends EventTarget {
  #socket = null;
  #retry_ms = FIRST_RETRY_MS;
  #request = 0;
  #now = 0;
  #heard_ms = 0;
  #alive_timer = 0;
  #waiting = new Map();
  #stop_waits = false;
  #token = token_of_address();
  up = false;

  constructor() {
    super();
    setInterval(() => this.#look_for_silence(), 250);
    document.addEventListener('visibilitychange', () => {
      if (document.hidden && this.controls) this.release('the page was hidden');
    });
    addEventListener('pagehide', () => this.controls && this.release('the page was left'));
  }

  open() {
    const protocols = ['r4.web.v1'];
    if (this.#token) protocols.push(`r4.token.${this.#token}`);
    const socket = new WebSocket(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/live`, protocols);
    this.#socket = socket;
    this.#heard_ms = performance.now();
    socket.onmessage = (message) => this.#take(JSON.parse(message.data));
    socket.onclose = () => socket === this.#socket && this.#lost();
  }

  get controls() { return this.#alive_timer !== 0; }

  // Resolves to the board's answer, or to the reason for none: {ok, ms, text}.
  send(message) {
    if (!this.up) return Promise.resolve({ok: false, text: 'not sent: no connection to r4 web'});
    const request = ++this.#request;
    this.#socket.send(JSON.stringify({...message, request}));
    return new Promise((resolve) => this.#waiting.set(request, resolve));
  }

  // False if not connected: the stop is then sent after reconnecting.
  stop() {
    this.#stop_waits = !this.up;
    if (this.up) this.#socket.send(JSON.stringify({type: 'stop', request: ++this.#request}));
    return this.up;
  }

  tell(message) { if (this.up) this.#socket.send(JSON.stringify(message)); }

  release(why) {
    this.#set_alive(false);
    this.tell({type: 'control', want: false});
    this.#say('released', {why});
  }

  #set_alive(on) {
    clearInterval(this.#alive_timer);
    this.#alive_timer = on ? setInterval(() => this.tell({type: 'alive', now: this.#now}), ALIVE_MS) : 0;
  }

  #take(message) {
    this.#heard_ms = performance.now();
    if (message.now !== undefined) this.#now = message.now;
    if (message.type === 'hello') {
      this.up = true;
      this.#retry_ms = FIRST_RETRY_MS;
      this.#say('hello', message);
      if (this.#stop_waits) this.stop();
      return;
    }
    if (message.type === 'control') {
      const ours = message.you && !document.hidden;
      if (message.you && !ours) this.tell({type: 'control', want: false});
      if (ours !== this.controls) this.#set_alive(ours);
    }
    if (message.type === 'result') {
      this.#waiting.get(message.request)?.(message);
      this.#waiting.delete(message.request);
    }
    this.#say(message.type, message);
  }

  #look_for_silence() {
    if (this.#socket && performance.now() - this.#heard_ms > SILENCE_MS) {
      const socket = this.#socket;
      this.#lost();
      socket.close();
    }
  }

  async #lost() {
    const was_up = this.up;
    this.up = false;
    this.#socket = null;
    this.#set_alive(false);
    for (const resolve of this.#waiting.values()) resolve({ok: false, text: 'unknown: the connection was lost'});
    this.#waiting.clear();
    const wait_ms = this.#retry_ms;
    this.#retry_ms = Math.min(2 * wait_ms, LONGEST_RETRY_MS);
    setTimeout(() => this.open(), wait_ms);
    this.#say('lost-server', {was_up, refused: !was_up && await this.#answers()});
  }

  // True if r4 web answers HTTP although it refuses the socket.
  async #answers() {
    try {
      return (await fetch('/', {method: 'HEAD', cache: 'no-store', signal: AbortSignal.timeout(SILENCE_MS)})).ok;
    } catch {
      return false;
    }
  }

  #say(name, detail) { this.dispatchEvent(new CustomEvent(name, {detail})); }
}
