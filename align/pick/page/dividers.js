// The bars between photo and scan, and between pictures and lists: dragged, or moved by arrow keys.
// Shares of the window are kept, so both sides grow with it; they are remembered for the next time.

import {byId, clamp} from './dom.js';

function listenTo(id, variable, shareAt, keys) {
  const divider = byId(id);
  const low = Number(divider.getAttribute('aria-valuemin'));
  const high = Number(divider.getAttribute('aria-valuemax'));
  const set = (share) => {
    const value = clamp(share, low, high);
    document.documentElement.style.setProperty(variable, `${value}%`);
    divider.setAttribute('aria-valuenow', value.toFixed(2));
    try {
      localStorage.setItem(`roomtex-pick ${variable}`, String(value));
    } catch {
      // Storage is switched off: then it is not remembered.
    }
  };
  const now = () => Number(divider.getAttribute('aria-valuenow'));
  try {
    const known = Number(localStorage.getItem(`roomtex-pick ${variable}`));
    if (known) set(known);
  } catch {
    // As above.
  }
  let grabbed = 0;  // share between where the bar is and where it was taken
  divider.addEventListener('pointerdown', (event) => {
    grabbed = now() - shareAt(event);
    divider.setPointerCapture(event.pointerId);
    event.preventDefault();
    divider.focus();
  });
  divider.addEventListener('pointermove', (event) => {
    if (divider.hasPointerCapture(event.pointerId)) set(shareAt(event) + grabbed);
  });
  divider.addEventListener('keydown', (event) => {
    if (!(event.key in keys)) return;
    event.preventDefault();
    set(now() + keys[event.key]);
  });
}

export function listenToDividers() {
  listenTo('divider', '--photo-share', (event) => {
    const box = byId('work').getBoundingClientRect();
    return 100 * (event.clientX - box.left) / box.width;
  }, {ArrowLeft: -2, ArrowRight: 2});
  listenTo(
      'dock-divider', '--dock-share', (event) => 100 * (innerHeight - event.clientY) / innerHeight,
      {ArrowUp: 2, ArrowDown: -2});
}
