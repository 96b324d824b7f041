// What the parts of the page share; main.js fills it.

import {Picks} from './picks.js';
import {TileStore} from './tiles.js';

export const kSides = ['photo', 'scan'];

export const app = {
  server: null,  // its state, see align/pick/README.md
  store: new TileStore(),
  picks: new Picks(),
  editor: null,
  panes: {},    // of each side
  loupes: {},   // of each side
  back: null,   // the photo on the scan
  edges: null,  // the scan's edges on the photo
  strip: null,
  results: null,
  // "mouse" or "keys": what the crosshair and the loupe of each side follow.
  lastInput: {photo: 'mouse', scan: 'mouse'},
  refresh: null,      // () => all that is shown, with the next frame
  choosePhoto: null,  // (id)
  chooseScan: null,   // (id)
};
