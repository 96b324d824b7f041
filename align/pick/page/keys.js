// The keyboard: one table that both acts and explains itself in the help dialog.

import { byId, el, typing } from './dom.js';

// Controls that have a use of their own for these keys.
const kOwn = {
  Space: 'button, input, summary, select, [role="listbox"]',
  Enter: 'button, input, summary, select, a, [role="listbox"]',
  Arrow: 'input[type="range"], select, [role="listbox"], [role="separator"]',
};

// "Ctrl+Shift+Z", "Shift+ArrowLeft", "N", "?", "+".
function nameOf(event) {
  let key = event.key === ' ' ? 'Space' : event.key;
  if (key.length === 1) key = key.toUpperCase();
  const ctrl = event.ctrlKey || event.metaKey ? 'Ctrl+' : '';
  // Shift is part of what a sign is ("?", "+"), but not of a letter or an arrow.
  const shift = event.shiftKey && (/^[A-Z]$/.test(key) || key.length > 1) ? 'Shift+' : '';
  return `${ctrl}${shift}${key}`;
}

function belongsToControl(event) {
  if (typing(event.target)) return true;
  const kind = event.key === ' ' ? 'Space' : event.key.startsWith('Arrow') ? 'Arrow' : event.key;
  const own = kOwn[kind];
  return own && event.target instanceof Element && event.target.closest(own) !== null;
}

// groups: [{title, keys: [{keys: [names], shown, does, run}]}]. run(event) may return false: not
// used after all.
export function listenToKeys(groups) {
  const table = new Map();
  for (const { keys } of groups) {
    for (const entry of keys) for (const key of entry.keys) table.set(key, entry);
  }
  document.addEventListener('keydown', (event) => {
    if (event.altKey || event.isComposing || document.querySelector('dialog[open]')) return;
    const entry = table.get(nameOf(event));
    if (!entry || belongsToControl(event)) return;
    if (entry.run(event) !== false) event.preventDefault();
  });
  fillHelp(groups);
}

function fillHelp(groups) {
  const dialog = byId('help');
  const keysOf = (shown) => shown.split(' ').map(
      (part) => /^(or|–|to)$/.test(part) ? ` ${part} ` : el('kbd', {}, part));
  dialog.append(
      el('header', {}, el('h2', { id: 'help-title' }, 'Keys and mouse'),
         el('button', { type: 'button', onclick: () => dialog.close() }, 'Close')),
      el('div', { class: 'body', tabindex: '0', role: 'region', 'aria-label': 'Keys' },
         ...groups.map(({ title, keys }) => el('section', {}, el('h3', {}, title),
             el('dl', {}, ...keys.filter((entry) => entry.does).flatMap((entry) => [
               el('dt', {}, ...(entry.mouse ? [entry.shown] : keysOf(entry.shown))),
               el('dd', {}, entry.does)]))))));
}
