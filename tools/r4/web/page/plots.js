// SPDX-License-Identifier: GPL-3.0-or-later
// The chosen fields over the last minutes: a row of charts for each unit, with a chart for each
// board, all with the same time range. Dragging zooms and pauses the display; receiving continues.
import {board_name, clock_text, element, put, value_text} from './text.js';

const GAP_MS = 500;  // states further apart are not joined
const COLOURS = 8;   // --line0 … of the style; further lines are dashed
const MOST_ZOOM_MS = 50;
const KEY_STEP = 0.005;  // fraction of a chart's width
const LEAST_DRAG = 0.005;
const {Dygraph} = globalThis;
// The legend sets a style attribute, which the page's policy forbids.
Dygraph.PLUGINS = Dygraph.PLUGINS.filter((plugin) => plugin !== Dygraph.Plugins.Legend);

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// Fields of the same kind share an axis.
function kind_of(hello, field) {
  const part = hello.fields[field].split('.')[1];
  return part ? `${part} ${hello.units[field]}` : hello.units[field];
}

// The lowest and the highest value in the order of their times; null if all values are missing.
function extremes(values, from, end) {
  let [low, high] = [-1, -1];
  for (let i = from; i < end; ++i) {
    if (Number.isNaN(values[i])) continue;
    if (low < 0 || values[i] < values[low]) low = i;
    if (high < 0 || values[i] > values[high]) high = i;
  }
  return low < 0 ? [null, null] : [values[Math.min(low, high)], values[Math.max(low, high)]];
}

// Rows for Dygraphs, at most two a pixel, with the extremes of its states. A null joins the values
// beside it, a NaN does not.
export function rows_of([times, ...columns], pixel_ms) {
  const rows = [];
  const seen_ms = columns.map(() => -Infinity);
  const pixel_at = (i) => Math.floor(times[i] / pixel_ms);
  for (let i = 0, end = 1; i < times.length; i = end++) {
    while (end < times.length && pixel_at(end) === pixel_at(i)) ++end;
    if (i > 0 && times[i] - times[i - 1] > GAP_MS) rows.push([times[i - 1] + 1, ...columns.map(() => NaN)]);
    const pairs = columns.map((values, k) => {
      const pair = extremes(values, i, end);
      if (pair[0] !== null) seen_ms[k] = times[end - 1];
      return times[end - 1] - seen_ms[k] > GAP_MS ? [NaN, NaN] : pair;
    });
    rows.push([times[i], ...pairs.map(([first]) => first)]);
    if (end > i + 1) rows.push([times[end - 1], ...pairs.map(([, second]) => second)]);
  }
  return rows;
}

class Chart {
  #plot = null;
  #readout = [];
  #time = element('span', {className: 'hint'});
  #picked = element('div', {className: 'picked', hidden: true});
  #canvas = element('div', {className: 'canvas'});
  #size = '';
  #last = [];  // the newest value of each field in the window
  #drag_from = null;
  #hello;
  #plots;

  constructor(hello, board, fields, plots) {
    this.#hello = hello;
    this.#plots = plots;
    this.board = board;
    this.fields = fields;
    const legend = element('ul', {className: 'readout'});
    fields.forEach((field, index) => {
      const value = element('b');
      this.#readout.push(value);
      legend.append(element('li', {className: `line${index % COLOURS}`}, element('i'), hello.fields[field], value));
    });
    this.area = element('div', {className: 'area', tabIndex: 0, role: 'img', 'aria-label':
      `${fields.map((field) => hello.fields[field]).join(', ')} of ${board_name(hello.boards[board])} over time. ` +
      'Left and right move the readout, plus and minus zoom.'}, this.#canvas, this.#picked);
    const title = hello.boards.length > 1 ? [element('strong', {}, board_name(hello.boards[board]))] : [];
    this.node = element('figure', {}, element('figcaption', {}, ...title, legend, this.#time), this.area);
    this.area.onkeydown = (key) => this.#key(key);
    this.area.ondblclick = () => plots.go_on();
    this.area.onpointerdown = (event) => { this.#drag_from = this.#share_at(event); };
    this.area.onpointermove = (event) => this.#point(event);
    this.area.onpointerup = (event) => this.#pick(event);
    this.area.onpointerleave = () => { this.#drag_from = null; this.#picked.hidden = true; plots.point(null); };
  }

  #key(key) {
    const step = {ArrowLeft: -1, ArrowRight: 1}[key.key];
    if (step) {
      this.#plots.point(Math.max(0, Math.min(1, (this.#plots.pointed ?? 1) + step * KEY_STEP)));
    } else if (key.key === '+') {
      this.#plots.zoom(0.5);
    } else if (key.key === '-') {
      this.#plots.zoom(2);
    } else {
      return;
    }
    key.preventDefault();
  }

  // 0 at the left end of the lines, 1 at the right end.
  #share_at(event) {
    const {x, w} = this.#plot?.getArea() ?? {x: 0, w: 1};
    return Math.max(0, Math.min(1, (event.clientX - this.area.getBoundingClientRect().x - x) / w));
  }

  #point(event) {
    const share = this.#share_at(event);
    this.#plots.point(share);
    if (this.#drag_from === null || !this.#plot) return;
    const {x, w} = this.#plot.getArea();
    this.#picked.style.left = `${x + w * Math.min(share, this.#drag_from)}px`;
    this.#picked.style.width = `${w * Math.abs(share - this.#drag_from)}px`;
    this.#picked.hidden = false;
  }

  #pick(event) {
    const [from, to] = [this.#drag_from, this.#share_at(event)].sort((a, b) => a - b);
    const dragged = this.#drag_from !== null && !this.#picked.hidden && to - from > LEAST_DRAG;
    this.#drag_from = null;
    this.#picked.hidden = true;
    if (dragged) this.#plots.show_shares(from, to);
  }

  #make(rows) {
    const labels = this.fields.map((field) => this.#hello.fields[field]);
    const line = (index) => ({strokePattern: index >= COLOURS ? [6, 4] : null});
    this.#plot = new Dygraph(this.#canvas, rows, {
      labels: ['time', ...labels], colors: labels.map((_, index) => css(`--line${index % COLOURS}`)),
      series: Object.fromEntries(labels.map((label, index) => [label, line(index)])),
      strokeWidth: 1.5, connectSeparatedPoints: true, interactionModel: {}, rightGap: 28,
      yRangePad: 8, highlightCircleSize: 3, gridLineColor: css('--grid'), axisLineColor: css('--grid'), axisLabelFontSize: 11,
      axes: {x: {ticker: Dygraph.dateTicker, axisLabelFormatter: (at) => clock_text(at, this.#plots.digits()), pixelsPerLabel: 80},
             y: {axisLabelWidth: 44, pixelsPerLabel: 20}},
    });
  }

  restyle() { this.#plot?.destroy(); this.#plot = null; }

  draw(history, from_ms, to_ms) {
    const [width, height] = [this.#canvas.clientWidth, this.#canvas.clientHeight];
    if (width < 40 || height < 40) return false;
    const [times, ...columns] = history.between(from_ms, to_ms, this.fields);
    this.#last = columns.map((values) => values.at(-1) ?? NaN);
    const file = rows_of([times, ...columns], (to_ms - from_ms) / width);
    if (!file.length) return false;
    if (!this.#plot) this.#make(file);
    if (this.#size !== `${width} ${height}`) this.#plot.resize();
    this.#size = `${width} ${height}`;
    this.#plot.updateOptions({file, dateWindow: [from_ms, to_ms]});
    this.read();
    return file.length > 1;
  }

  read() {
    if (!this.#plot) return;
    const {x, w} = this.#plot.getArea();
    const {pointed} = this.#plots;
    const row = pointed === null ? -1 : this.#plot.findClosestRow(x + pointed * w);
    if (row < 0) this.#plot.clearSelection(); else this.#plot.setSelection(row);
    put(this.#time, row < 0 ? '' : clock_text(this.#plot.getValue(row, 0), 3));
    this.fields.forEach((field, series) => put(this.#readout[series], value_text(
      row < 0 ? this.#last[series] : this.#plot.getValue(row, series + 1) ?? NaN, this.#hello.units[field])));
  }
}

export class Plots {
  #hello;
  #histories;
  #charts = [];
  #from_ms = 0;
  #to_ms = 0;
  #clock_ahead_ms;
  paused = false;
  pointed = null;

  constructor(hello, histories) {
    this.#hello = hello;
    this.#histories = histories;
    this.set_clock(hello.clock_ms);
    document.getElementById('pause').onclick = () => this.paused ? this.go_on() : this.show(...this.#stretch());
    document.getElementById('zoom-in').onclick = () => this.zoom(0.5);
    document.getElementById('zoom-out').onclick = () => this.zoom(2);
    document.getElementById('span').onchange = () => this.go_on();
    matchMedia('(prefers-color-scheme: dark)').onchange = () => this.#charts.forEach((chart) => chart.restyle());
  }

  choose(fields) {
    this.#charts.forEach((chart) => chart.restyle());
    const kinds = grouped(this.#hello, fields);
    this.#charts = [];
    const rows = [...kinds].map(([kind, fields_of_kind]) => {
      const charts = this.#hello.boards.map((_, board) => new Chart(this.#hello, board, fields_of_kind, this));
      this.#charts.push(...charts);
      return element('div', {className: 'row', 'data-unit': kind}, ...charts.map((chart) => chart.node));
    });
    document.getElementById('charts').replaceChildren(...(rows.length ? rows :
      [element('p', {className: 'empty'}, 'There is no plot. Tick a field.')]));
  }

  set_clock(server_ms) { this.#clock_ahead_ms = server_ms - performance.now(); }

  // Uses the server's clock, which continues while a board is silent.
  #stretch() {
    if (this.paused) return [this.#from_ms, this.#to_ms];
    const now_ms = this.#clock_ahead_ms + performance.now();
    return [now_ms - 1000 * document.getElementById('span').value, now_ms];
  }

  digits() {
    const [from_ms, to_ms] = this.#stretch();
    return to_ms - from_ms < 800 ? 3 : to_ms - from_ms < 8000 ? 1 : 0;
  }

  // Moves the readout of all charts to a share of their width; null follows the newest state.
  point(share) {
    this.pointed = share;
    this.#charts.forEach((chart) => chart.read());
  }

  show_shares(from, to) {
    const [from_ms, to_ms] = this.#stretch();
    this.show(from_ms + from * (to_ms - from_ms), from_ms + to * (to_ms - from_ms));
  }

  show(from_ms, to_ms) {
    this.#set_paused(true);
    [this.#from_ms, this.#to_ms] = [from_ms, to_ms];
    this.draw();
  }

  go_on() { this.#set_paused(false); this.draw(); }

  zoom(factor) {
    const [from_ms, to_ms] = this.#stretch();
    const half_ms = Math.max(MOST_ZOOM_MS, (to_ms - from_ms) * factor) / 2;
    const middle_ms = (from_ms + to_ms) / 2;
    this.show(middle_ms - half_ms, middle_ms + half_ms);
  }

  #set_paused(on) {
    this.paused = on;
    const button = document.getElementById('pause');
    put(button, on ? 'Continue' : 'Pause');
    button.setAttribute('aria-pressed', String(on));
    document.getElementById('plots').classList.toggle('paused', on);
  }

  draw() {
    const [from_ms, to_ms] = this.#stretch();
    return this.#charts.map((chart) => chart.draw(this.#histories[chart.board], from_ms, to_ms)).some(Boolean);
  }
}

function grouped(hello, fields) {
  const kinds = new Map();
  for (const field of fields) {
    const kind = kind_of(hello, field);
    kinds.set(kind, [...(kinds.get(kind) ?? []), field]);
  }
  return kinds;
}
