// SPDX-License-Identifier: GPL-3.0-or-later
// The chosen fields over the last minutes: a row of charts for each unit, with a chart for each
// board, all with the same time range. Dragging zooms and pauses the display; receiving continues.
import {board_name, clock_text, element, put, value_text} from './text.js';

const GAP_MS = 500;  // states further apart are not joined
const COLOURS = 8;   // --line0 … of the style; further lines are dashed
const MOST_ZOOM_MS = 50;
const {uPlot} = globalThis;

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// Fields of the same kind share an axis.
function kind_of(hello, field) {
  const part = hello.fields[field].split('.')[1];
  return part ? `${part} ${hello.units[field]}` : hello.units[field];
}

// Gaps in a column for uPlot, as pairs of pixels.
function gaps_of(plot, series, first, last) {
  const [times, values] = [plot.data[0], plot.data[series]];
  const gaps = [];
  let before = -1;
  for (let i = first; i <= last; ++i) {
    if (Number.isNaN(values[i])) continue;
    if (before >= 0 && times[i] - times[before] > GAP_MS) {
      gaps.push([plot.valToPos(times[before], 'x', true), plot.valToPos(times[i], 'x', true)]);
    }
    before = i;
  }
  return gaps;
}

function range_of(plot) {
  let low = Infinity;
  let high = -Infinity;
  for (const values of plot.data.slice(1)) {
    for (const value of values) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (low > high) return [0, 1];
  const margin = (high - low) * 0.08 || Math.max(Math.abs(high) * 0.02, 0.5);
  return [low - margin, high + margin];
}

class Chart {
  #plot = null;
  #readout = [];
  #time = element('span', {className: 'hint'});
  #hello;

  constructor(hello, board, fields, plots) {
    this.#hello = hello;
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
      'Left and right move the readout, plus and minus zoom.'});
    const title = hello.boards.length > 1 ? [element('strong', {}, board_name(hello.boards[board]))] : [];
    this.node = element('figure', {}, element('figcaption', {}, ...title, legend, this.#time), this.area);
    this.area.onkeydown = (key) => this.#key(key, plots);
    this.#plots = plots;
  }
  #plots;

  #key(key, plots) {
    const step = {ArrowLeft: -1, ArrowRight: 1}[key.key];
    if (step && this.#plot) {
      const left = this.#plot.cursor.left < 0 ? this.#plot.over.clientWidth : this.#plot.cursor.left;
      this.#plot.setCursor({left: Math.max(0, Math.min(this.#plot.over.clientWidth - 1, left + step * 4)), top: 1});
    } else if (key.key === '+') {
      plots.zoom(0.5);
    } else if (key.key === '-') {
      plots.zoom(2);
    } else {
      return;
    }
    key.preventDefault();
  }

  #make(width, height) {
    const text = css('--quiet');
    const grid = {stroke: css('--grid'), width: 1};
    const axis = {stroke: text, font: '11px system-ui, sans-serif', grid, ticks: {show: false}};
    this.#plot = new uPlot({
      width, height, ms: 1, padding: [8, 28, 0, 0],
      legend: {show: false},
      cursor: {drag: {x: true, y: false, setScale: false}, sync: {key: 'r4', setSeries: false}, points: {size: 6}},
      select: {show: true},
      scales: {x: {time: false}, y: {range: range_of}},
      axes: [
        {...axis, size: 22, space: 80, values: (_, splits) => splits.map((at) => clock_text(at, this.#plots.digits()))},
        {...axis, size: 52, gap: 4},
      ],
      series: [{}, ...this.fields.map((_, index) => ({
        stroke: css(`--line${index % COLOURS}`), width: 1.5, points: {show: false}, gaps: gaps_of,
        dash: index >= COLOURS ? [6, 4] : undefined,
      }))],
      hooks: {
        setSelect: [(plot) => {
          if (plot.select.width < 4) return;
          this.#plots.show(plot.posToVal(plot.select.left, 'x'), plot.posToVal(plot.select.left + plot.select.width, 'x'));
          plot.setSelect({left: 0, width: 0, top: 0, height: 0}, false);
        }],
        setCursor: [() => this.read()],
      },
    }, [[], ...this.fields.map(() => [])], this.area);
    this.#plot.over.ondblclick = () => this.#plots.go_on();
  }

  restyle() { this.#plot?.destroy(); this.#plot = null; }

  draw(history, from_ms, to_ms) {
    const width = this.area.clientWidth;
    const height = this.area.clientHeight;
    if (width < 40 || height < 40) return false;
    if (!this.#plot) this.#make(width, height);
    if (this.#plot.width !== width || this.#plot.height !== height) this.#plot.setSize({width, height});
    const data = history.between(from_ms, to_ms, this.fields);
    this.#plot.batch(() => {
      this.#plot.setData(data, false);
      this.#plot.setScale('x', {min: from_ms, max: to_ms});
    });
    this.read();
    return data[0].length > 1;
  }

  read() {
    if (!this.#plot) return;
    const times = this.#plot.data[0];
    const at = this.#plot.cursor.idx;
    const under = at !== null && at !== undefined && this.#plot.cursor.left >= 0;
    const index = under ? at : times.length - 1;
    put(this.#time, under && times.length ? clock_text(times[index], 3) : '');
    this.fields.forEach((field, series) => put(this.#readout[series],
      times.length ? value_text(this.#plot.data[series + 1][index], this.#hello.units[field]) : '–'));
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
      [element('p', {className: 'empty'}, 'Nothing is plotted. Tick a field.')]));
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
    put(button, on ? 'Go on' : 'Pause');
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
