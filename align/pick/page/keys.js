// The keyboard: one table that both acts and explains itself in the help dialog.

import {byId, el, typing} from './dom.js';

// Controls that have a use of their own for these keys.
const kOwn = {
  Space: 'button, input, summary, select, [role="listbox"]',
  Enter: 'button, input, summary, select, a, [role="listbox"]',
  Arrow: 'input[type="range"], select, [role="listbox"], [role="separator"]',
  Page: 'select',
};

// "Ctrl+Shift+Z", "Shift+ArrowLeft", "N", "?", "+".
function nameOf(event) {
  let key = event.key === ' ' ? 'Space' : event.key;
  if (key.length === 1) key = key.toUpperCase();
  const ctrl = event.ctrlKey || event.metaKey ? 'Ctrl+' : '';
  // Shift is part of what a sign is ("?", "+"); of a letter or an arrow it says something else.
  const means = key.length > 1 || (ctrl && /^[A-Z]$/.test(key));
  return `${ctrl}${event.shiftKey && means ? 'Shift+' : ''}${key}`;
}

function belongsToControl(event) {
  if (typing(event.target)) return true;
  const {key} = event;
  const kind = key === ' ' ? 'Space' : /^(Arrow|Page)/.exec(key)?.[0] ?? key;
  const own = kOwn[kind];
  return own && event.target instanceof Element && event.target.closest(own) !== null;
}

// groups: [{title, keys: [entry]}], entry: {keys: [names], shown, does, run(event)} or, for what is
// only explained, {mouse, does}. run may return false: not used after all.
export function listenToKeys(groups) {
  const table = new Map();
  for (const entry of groups.flatMap((group) => group.keys)) {
    for (const key of entry.keys ?? []) table.set(key, entry);
  }
  document.addEventListener('keydown', (event) => {
    if (event.altKey || event.isComposing || document.querySelector('dialog[open]')) return;
    const entry = table.get(nameOf(event));
    if (!entry || belongsToControl(event)) return;
    if (entry.run(event) !== false) event.preventDefault();
  });
  fillHelp(groups);
}

function keysOf({mouse, shown}) {
  if (mouse) return [mouse];
  return shown.split(' ').map((part) => part === 'or' ? ' or ' : el('kbd', {}, part));
}

function helpOf({title, keys}) {
  const lines = keys.filter((entry) => entry.does);
  return el('section', {}, el('h3', {}, title), el('dl', {}, ...lines.flatMap((entry) => {
              return [el('dt', {}, ...keysOf(entry)), el('dd', {}, entry.does)];
            })));
}

function fillHelp(groups) {
  const dialog = byId('help');
  const close = el('button', {type: 'button', onclick: () => dialog.close()}, 'Close');
  dialog.append(
      el('header', {}, el('h2', {id: 'help-title'}, 'Keys and mouse'), close),
      el('div', {class: 'body', tabindex: '0', role: 'region', 'aria-label': 'Keys'},
         ...groups.map(helpOf)));
}
