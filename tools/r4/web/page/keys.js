// SPDX-License-Identifier: GPL-3.0-or-later
// Escape always stops. While this page controls, Space stops everywhere, also after a click on a
// button. Otherwise Space stops where it has no other meaning. Enter presses buttons, ticks boxes.

const takes_space = (target) => target.closest('button, input, select, a, [role=group], [role=log]') !== null;

export function listen_for_stop(stop, controls) {
  const is_stop = (key) => key.key === 'Escape' || (key.key === ' ' && (controls() || !takes_space(key.target)));
  const down = (key) => {
    if (key.ctrlKey || key.altKey || key.metaKey) return;
    if (is_stop(key)) {
      key.preventDefault();
      key.stopImmediatePropagation();
      if (!key.repeat) stop();
    } else if (key.key === 'Enter' && key.target.matches('input[type=checkbox]')) {
      key.target.click();
    }
  };
  addEventListener('keydown', down, {capture: true});
  // Browsers press a button when Space is released.
  addEventListener('keyup', (key) => { if (is_stop(key)) key.preventDefault(); }, {capture: true});
}
