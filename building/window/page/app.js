// What the window shows and what is going on in it; the other files share it.

import {View} from './view.js';

export const byId = (id) => document.getElementById(id);
export const view = new View();
export const app = {
  state: null,
  cloud: null,
  buildings: [],
  selected: -1,
  corner: -1,
  tool: 'select',
  contour: [],
  cursor: null,  // x, y of the scene, in the top view
  snap: null,
  box: null,
  stroke: null,
  done: [],    // buildings as they were, for undo
  undone: [],
  drag: null,    // what the pointer does (pointer.js)
  nudged: null,  // a corner that the arrows move (edits.js)
  busy: Promise.resolve(),
};

export function say(text, seconds = 6) {
  const toast = byId('toast');
  toast.textContent = text;
  toast.hidden = !text;
  clearTimeout(say.timer);
  say.timer = setTimeout(() => {
    toast.hidden = true;
  }, 1000 * seconds);
}

export async function trying(body) {
  try {
    await body();
  } catch (error) {
    say(error.message);
  }
}
