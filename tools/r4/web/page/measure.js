// SPDX-License-Identifier: GPL-3.0-or-later
// Times from receiving to display and to the first plot: `r4_measured` in the console.

const KEPT = 1000;
const latencies = new Float64Array(KEPT);
let count = 0;
let received_ms = 0;
const after_frame = new MessageChannel();

after_frame.port1.onmessage = () => {
  if (received_ms) latencies[count++ % KEPT] = performance.now() - received_ms;
  received_ms = 0;
};

export const measured = {
  first_plot_ms: 0,
  states: 0,
  lost_messages: 0,
  frames: () => count,
  on_screen_ms(share) {
    const sorted = latencies.slice(0, Math.min(count, KEPT)).sort();
    return sorted.length ? sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] : NaN;
  },
  stop_ms: NaN,
};
globalThis.r4_measured = measured;

export function was_received() { received_ms ||= performance.now(); }

// Call at the end of a frame's work: the channel's message arrives after the frame was handed over.
export function was_drawn(plotted) {
  if (plotted && !measured.first_plot_ms) {
    performance.mark('r4-first-plot');
    measured.first_plot_ms = performance.now();
  }
  if (received_ms) after_frame.port2.postMessage(null);
}
