// SPDX-License-Identifier: GPL-3.0-or-later
// The page of r4 web: passes server messages to its parts, and draws once per frame.
import {Boards} from './boards.js';
import {add_event} from './events.js';
import {Fields} from './fields.js';
import {History} from './history.js';
import {listen_for_stop} from './keys.js';
import {Link} from './link.js';
import {measured, was_drawn, was_received} from './measure.js';
import {Outputs} from './outputs.js';
import {Plots} from './plots.js';
import {board_name, put} from './text.js';

const at = (id) => document.getElementById(id);
const link = new Link();
let hello = null;
let boards, fields, plots, outputs, histories;
let frame_asked = false;
let stopped_ms = 0;

function ask_frame() {
  if (frame_asked) return;
  frame_asked = true;
  requestAnimationFrame(() => {
    frame_asked = false;
    fields.draw(histories);
    outputs.draw(histories);
    was_drawn(plots.paused || plots.draw());
  });
}

function show_alarm() {
  const lost = link.up ? boards.missing() : [server_lost];
  at('alarm').hidden = lost.length === 0 || lost[0] === '';
  put(at('alarm'), lost.join(' '));
}
let server_lost = '';

link.addEventListener('hello', ({detail}) => {
  const same = hello && JSON.stringify([hello.boards, hello.fields, hello.channels]) ===
    JSON.stringify([detail.boards, detail.fields, detail.channels]);
  if (hello) add_event('info', 'r4 web is connected again');
  hello = detail;
  document.title = `R4 ${hello.boards.map(board_name).join(', ')}`;
  if (same) {
    plots.set_clock(hello.clock_ms);
  } else {
    histories = hello.boards.map(() => new History(hello.fields));
    boards = new Boards(hello, link);
    plots = new Plots(hello, histories);
    fields = new Fields(hello, () => { plots.choose(fields.chosen()); ask_frame(); });
    outputs = new Outputs(hello, link);
    plots.choose(fields.chosen());
    document.documentElement.classList.toggle('several', hello.boards.length > 1);
  }
  document.documentElement.classList.remove('stale');
  put(at('server'), `Connected to r4 web ${hello.version}`);
  at('control').disabled = false;
  show_alarm();
});

link.addEventListener('lost-server', ({detail}) => {
  server_lost = detail.refused ?
    'r4 web refuses this page: open the printed address with its #token=, or close other pages.' :
    'The connection to r4 web is lost: r4 web has ended, or the network is down. The values on this page are old. ' +
    'The boards that this page drove go safe. Trying again …';
  put(at('server'), 'Not connected');
  document.documentElement.classList.add('stale');
  at('control').disabled = true;
  show_control({holder: null, you: false, why: ''});
  show_recording({path: null, you: false, why: ''});
  boards?.forget();
  if (boards) show_alarm(); else { at('alarm').hidden = false; put(at('alarm'), server_lost); }
  if (detail.was_up) add_event('error', 'the connection to r4 web is lost');
});

link.addEventListener('states', ({detail}) => {
  was_received();
  for (const {board, states} of detail.boards) {
    measured.states += states.length;
    for (const state of states) histories[board].push(state);
  }
  ask_frame();
});

link.addEventListener('lost', ({detail}) => { measured.lost_messages += detail.messages; });

link.addEventListener('board', ({detail}) => {
  const before = boards.health[detail.board];
  boards.take(detail);
  if (detail.safe && before && !before.safe) {
    outputs.forget();
    if (stopped_ms && detail.safe === 'stop') measured.stop_ms = performance.now() - stopped_ms;
  }
  show_alarm();
});

link.addEventListener('event', ({detail}) => {
  const board = hello.boards.length > 1 && detail.board !== null && hello.boards[detail.board];
  add_event(detail.level, detail.text, board ? board_name(board) : '', detail.time_ms);
});
link.addEventListener('error', ({detail}) => add_event('error', detail.text));

let released_why = '';
function show_control(control) {
  const words = control.you ? 'You control' : control.holder !== null ? `Browser ${control.holder} controls; you watch` :
    'No browser is in control; you watch';
  put(at('holder'), [words, (control.holder === null && released_why) || control.why].filter(Boolean).join(': '));
  put(at('control'), control.you ? 'Give control back' : 'Take control');
  at('control').setAttribute('aria-pressed', String(control.you));
  put(at('outputs-hint'), control.you ? 'confirmed by the board' : 'take control to set them');
  document.documentElement.classList.toggle('controls', control.you);
  boards?.allow(control.you);
  outputs?.allow(control.you);
  allow_recording();
}
link.addEventListener('control', ({detail}) => show_control(detail));
link.addEventListener('released', ({detail}) => {
  released_why = detail.why && `given back, ${detail.why}`;
  show_control({holder: null, you: false, why: ''});
});
at('control').onclick = () => {
  released_why = '';
  if (link.controls) link.release(''); else link.tell({type: 'control', want: true});
};

function stop() {
  stopped_ms = performance.now();
  const sent = link.stop();
  outputs?.forget();
  add_event(sent ? 'info' : 'error', sent ? 'STOP was pressed on this page' :
    'STOP was not sent, because the connection to r4 web is lost. Cut the power. STOP is sent after a reconnection.');
  at('stop').classList.remove('pressed');
  requestAnimationFrame(() => at('stop').classList.add('pressed'));
}
// Reacts to the press, not the release, because a finger may slip off.
at('stop').onpointerdown = stop;
at('stop').onclick = (click) => { if (click.detail === 0) stop(); };  // keyboard or screen reader
listen_for_stop(stop, () => link.controls);

let recording_is_ours = false;
function allow_recording() { at('record').disabled = !link.controls && !recording_is_ours; }

function show_recording(recording) {
  const on = recording.path !== null;
  recording_is_ours = on && recording.you;
  at('record').setAttribute('aria-pressed', String(on));
  put(at('record'), on ? 'Stop recording' : 'Record');
  const size = on ? `recording ${recording.path}, ${(recording.bytes / 1e6).toFixed(1)} MB` : '';
  put(at('recording'), [size, recording.why].filter(Boolean).join('; '));
  allow_recording();
}
link.addEventListener('recording', ({detail}) => show_recording(detail));
at('record').onclick = () => link.tell({type: 'record', on: at('record').getAttribute('aria-pressed') !== 'true'});

let states_before = 0;
setInterval(() => {
  const p95_ms = measured.on_screen_ms(0.95);
  put(at('measured'), `${measured.states - states_before} states/s · on screen ${Number.isNaN(p95_ms) ? '–' :
    p95_ms.toFixed(0)} ms after they came (95 %) · ${measured.lost_messages} messages lost by a slow page`);
  states_before = measured.states;
}, 1000);

link.open();
