// What the page says about itself: whether the picks are saved, whether the server is there, and
// why a place cannot be picked.

import {app} from './app.js';
import {byId, el, setText} from './dom.js';

const kSaveTexts = {
  saved: (why, unfinished) =>
      unfinished > 0 ? `saved, but for ${unfinished} unfinished` : 'saved',
  saving: () => 'saving…',
  unsaved: () => 'not saved',
  gone: (why) => `not saved: ${why}; trying again`,
  restarted: (why) => `not saved: ${why}`,
  stale: (why) => `not saved: ${why}`,
};

export function showSync() {
  const {picks, server} = app;
  const box = byId('save');
  box.dataset.state = picks.state;
  const unfinished = picks.numUnfinished;
  box.title = server ? server.picks_path : '';
  if (unfinished > 0) box.title += `\n${unfinished} unfinished, kept only while roomtex-pick runs`;
  // Nothing is unsaved when the server is gone and nothing was changed since.
  const nothingLost = !picks.pending && ['gone', 'restarted'].includes(picks.state);
  setText(byId('save-text'), nothingLost ? picks.why : kSaveTexts[picks.state](picks.why, unfinished));
  const banner = byId('banner');
  // The line at the top has no room for a reason.
  const shown = picks.state === 'unsaved' ? `unsaved ${picks.why}` : picks.state;
  if (banner.dataset.shown === shown) return;
  banner.dataset.shown = shown;
  const content = bannerOf(picks.state);
  banner.replaceChildren(...content);
  banner.hidden = content.length === 0;
}

function bannerOf(state) {
  const {picks, editor} = app;
  if (state === 'stale') {
    const reload = () => {
      picks.takeOther();
      editor.select(null);
    };
    return [
      el('p', {},
         'The picks were changed in another tab or window. What you change here is not saved ' +
             'until you choose.'),
      el('button', {type: 'button', onclick: () => picks.keepOwn()}, 'Keep mine'),
      el('button', {type: 'button', class: 'main', onclick: reload}, 'Reload the picks'),
    ];
  }
  if (state === 'unsaved') {
    return [
      el('p', {},
         `${picks.why.replace(/\.*$/, '.')} They are kept here, and saved as soon as it can be ` +
             'done; do not close this page.'),
      copyButton(),
    ];
  }
  if (state === 'gone') {
    return [
      el('p', {},
         'roomtex-pick does not answer. What you change is kept here and saved as soon as it is ' +
             'back; do not close this page.'),
      copyButton(),
    ];
  }
  if (state === 'restarted') {
    return [
      el('p', {},
         'roomtex-pick was started anew and has a new address, which it printed. What the last ' +
             'one had not saved is only on this page.'),
      copyButton(),
    ];
  }
  return [];
}

// The picks as lines of the picks file, for when nothing else takes them. Every scan place has been
// seen by the server, so its point is known.
function copyButton() {
  const button =
      el('button', {
        type: 'button',
        onclick: async () => {
          const lines = app.picks.list.filter((pick) => pick.img && pick.point)
                            .map(({image_name, img, point, weight, label}) => {
                              const quoted = (text) =>
                                  /[",]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
                              return [
                                quoted(image_name), ...img, ...point, weight, quoted(label)
                              ].join();
                            });
          const text = ['image_name,x,y,scan_x,scan_y,scan_z,weight,label', ...lines, ''].join('\n');
          try {
            await navigator.clipboard.writeText(text);
            button.textContent = `Copied ${lines.length} picks`;
          } catch {
            button.textContent = 'The browser does not allow it';
          }
        }
      },
         'Copy the picks as CSV');
  return button;
}

// The server's sentence where the click was, with the nearest place that can be picked.
export function showHint() {
  const {editor, panes} = app;
  const hint = byId('hint');
  const {tried} = editor;
  const message = tried?.message || (tried ? editor.dragMessage : '');
  if (!message || tried.scan !== editor.scan.id) {
    hint.hidden = true;
    return;
  }
  const key = `${message} ${tried.snap !== null} ${tried.message !== ''}`;
  if (hint.dataset.key !== key) {
    hint.dataset.key = key;
    hint.replaceChildren(el('p', {}, message), hintActions(tried));
  }
  hint.hidden = false;
  const box = panes.scan.element.getBoundingClientRect();
  const [x, y] = panes.scan.view.toScreen(tried.place);
  // Beside the place, never over it.
  const left = box.left + x + 20;
  const top = box.top + y + 20;
  const fitsRight = left + hint.offsetWidth < innerWidth - 8;
  const fitsBelow = top + hint.offsetHeight < innerHeight - 8;
  hint.style.left = `${Math.max(8, fitsRight ? left : left - hint.offsetWidth - 40)}px`;
  hint.style.top = `${Math.max(50, fitsBelow ? top : top - hint.offsetHeight - 40)}px`;
}

function hintActions(tried) {
  const {editor, panes} = app;
  const then = (action) => () => {
    action();
    panes.scan.element.focus();
  };
  const actions = el('div', {class: 'actions'});
  if (tried.snap) {
    actions.append(
        el('button', {type: 'button', class: 'main', onclick: then(() => editor.takeSnap())},
           'Nearest place (Enter)'));
  }
  if (tried.message) {
    actions.append(
        el('button', {type: 'button', onclick: then(() => editor.back())}, 'Leave it (Esc)'));
  }
  return actions;
}
