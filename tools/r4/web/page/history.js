// SPDX-License-Identifier: GPL-3.0-or-later
// States of one board, a column for each field, oldest first; missing values are NaN. Columns are
// contiguous, so plots draw slices without copying. When full, the newer half moves to the front.

const KEPT = 32768;  // states: five minutes at 100 Hz

export class History {
  #times = new Float64Array(2 * KEPT);
  #columns;
  #end = 0;

  constructor(fields) { this.#columns = fields.map(() => new Float64Array(2 * KEPT)); }

  // [time in ms, values…]
  push(state) {
    if (this.#end === 2 * KEPT) {
      for (const column of [this.#times, ...this.#columns]) column.copyWithin(0, KEPT);
      this.#end = KEPT;
    }
    this.#times[this.#end] = state[0];
    for (let i = 0; i < this.#columns.length; ++i) this.#columns[i][this.#end] = state[i + 1] ?? NaN;
    ++this.#end;
  }

  get newest_ms() { return this.#end ? this.#times[this.#end - 1] : NaN; }
  newest(field) { return this.#end ? this.#columns[field][this.#end - 1] : NaN; }

  #find(time) {
    let low = 0;
    let high = this.#end;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.#times[middle] < time) low = middle + 1; else high = middle;
    }
    return low;
  }

  // Columns between two times, with one more state at each side; times first.
  between(from_ms, to_ms, fields) {
    const first = Math.max(0, this.#find(from_ms) - 1);
    const end = Math.min(this.#end, this.#find(to_ms) + 1);
    return [this.#times, ...fields.map((field) => this.#columns[field])].map((column) => column.subarray(first, end));
  }
}
