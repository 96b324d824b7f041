// The numbers of the server: the table of picks, and what they say about the photo.

import {byId, el, number, setText} from './dom.js';

const kStates = {
  used: 'used',
  off: 'check point',
  bad: '✕ left out as wrong',
  half: '? one side missing',
  waiting: 'needs more picks',
};

export class Results {
  #rows = new Map();  // uid -> cells

  // on: {choose(uid), enable(uid, bool), label(uid, text), remove(uid)}
  constructor(on) {
    this.on = on;
    this.body = byId('rows');
  }

  update(picks, selected) {
    const uids = new Set(picks.list.map((pick) => pick.uid));
    for (const [uid, row] of this.#rows) {
      if (uids.has(uid)) continue;
      // The focus goes on to the neighbour, not to the top of the page.
      if (row.line.contains(document.activeElement)) {
        (row.line.nextElementSibling ?? row.line.previousElementSibling)
            ?.querySelector('button')
            ?.focus();
      }
      row.line.remove();
      this.#rows.delete(uid);
    }
    const largest = Math.max(1e-9, ...picks.list.map((pick) => {
      return picks.statusOf(pick) === 'used' ? picks.rows.get(pick.uid)?.residual_px ?? 0 : 0;
    }));
    picks.list.forEach((pick, index) => {
      const row = this.#rows.get(pick.uid) ?? this.#add(pick.uid);
      if (this.body.children[index] !== row.line) {
        this.body.insertBefore(row.line, this.body.children[index] ?? null);
      }
      this.#fill(row, pick, index + 1, picks, selected, largest);
    });
    byId('no-picks').hidden = picks.list.length > 0;
    setText(byId('pick-count'), picks.list.length > 0 ? String(picks.list.length) : '');
  }

  show(uid) {
    this.#rows.get(uid)?.line.scrollIntoView({block: 'nearest'});
  }

  #add(uid) {
    const cells = {
      number: el('button', {type: 'button', class: 'number', onfocus: () => this.on.choose(uid)}),
      photo: el('td', {class: 'photo'}),
      label: el('input', {
        type: 'text',
        class: 'label',
        maxlength: 60,
        spellcheck: 'false',
        onchange: (event) => this.on.label(uid, event.target.value.trim()),
      }),
      px: el('span'),
      bar: el('span', {class: 'bar'}),
      mm: el('td', {class: 'right'}),
      leftOut: el('td', {class: 'right'}),
      state: el('td', {class: 'state'}),
      on:
          el('input',
             {type: 'checkbox', onchange: (event) => this.on.enable(uid, event.target.checked)}),
      remove:
          el('button', {
            type: 'button',
            class: 'icon',
            title: 'Remove (Delete)',
            onclick: () => this.on.remove(uid)
          },
             '✕'),
    };
    cells.line = el(
        'tr', {
          'data-uid': uid,
          onclick: (event) => {
            if (!event.target.closest('.actions')) this.on.choose(uid);
          },
        },
        el('td', {}, cells.number), el('td', {class: 'actions'}, cells.label), cells.photo,
        el('td', {class: 'right value'}, cells.bar, cells.px), cells.mm, cells.leftOut, cells.state,
        el('td', {class: 'actions'},
           el('label', {title: 'Unticked it is a check point: its error is shown, nothing rests on it (X)'},
              cells.on),
           cells.remove));
    this.#rows.set(uid, cells);
    return cells;
  }

  #fill(cells, pick, index, picks, selected, largest) {
    const numbers = picks.rows.get(pick.uid) ?? {};
    const status = picks.statusOf(pick);
    const worst = status === 'used' && numbers.worst === true;
    cells.line.dataset.status = status;
    cells.line.toggleAttribute('data-worst', worst);
    cells.line.toggleAttribute('data-selected', pick.uid === selected);
    cells.number.setAttribute('aria-current', String(pick.uid === selected));
    setText(cells.number, String(index));
    cells.number.setAttribute('aria-label', `Pick ${index}`);
    if (document.activeElement !== cells.label) cells.label.value = pick.label ?? '';
    cells.label.setAttribute('aria-label', `Label of pick ${index}`);
    setText(cells.photo, pick.image_name);
    cells.photo.title = pick.image_name;
    setText(cells.px, number(numbers.residual_px, 2));
    setText(cells.mm, number(numbers.residual_mm, 1));
    setText(cells.leftOut, number(numbers.leave_one_out_px, 2));
    const share = status === 'used' ? (numbers.residual_px ?? 0) / largest : 0;
    cells.bar.style.width = `${Math.round(share * 44)}px`;
    const compared =
        status === 'waiting' && picks.session.photos[pick.image_name]?.by === 'search';
    setText(
        cells.state,
        worst        ? '▲ worst' :
            compared ? 'compared with the search' :
                       kStates[status] ?? status);
    cells.on.checked = pick.weight !== 0;
    cells.on.disabled = status === 'half';
    cells.on.setAttribute('aria-label', `Count pick ${index}`);
    cells.remove.setAttribute('aria-label', `Remove pick ${index}`);
  }
}

// What the picks of the photo that is shown say about its pose, and those of its model as a whole.
export function showSummary(photo, session, {min_picks, models}) {
  const solution = session.photos[photo?.name];
  const body = byId('summary-body');
  const facts = [];
  const add = (name, value) => facts.push(el('dt', {}, name), el('dd', {}, value));
  const counted = !solution?.num_complete ? 'none yet' :
      solution.by === 'search'            ? `${solution.num_complete}, compared with the search` :
                                 `${solution.num_used} used of ${solution.num_complete}`;
  add('Picks', counted);
  if (solution?.by === 'search') {
    add('Placed by',
        `the search, ${session.found.trusted ? 'trusted' : 'not trusted'}; your picks take over ` +
            'once they place it');
  } else if (solution?.solved) {
    add('Solved by',
        solution.by === 'sparse_model' ? 'the picks with the sparse model\u2019s help' :
                                         'its own picks');
    add('Residual',
        `${number(solution.rms_px, 2)} px rms` +
            (typeof solution.rms_mm === 'number' ? `, ${number(solution.rms_mm, 1)} mm` : ''));
    if (typeof solution.position_sigma_mm === 'number') {
      add('Camera', `± ${number(solution.position_sigma_mm, 1)} mm in position`);
    }
    if (typeof solution.focal_length_px === 'number') {
      add('Focal length',
          `${number(solution.focal_length_px, 0)} px ± ` +
              `${number(solution.focal_length_sigma_px, 0)}, by the picks`);
    }
  } else {
    add('Pose',
        `not solved; roomtex-align wants ${min_picks} picks, ` +
            (models.length > 0 ? 'here or in several photos' : 'in this photo'));
  }
  const similarity = session.similarities[photo?.model ?? 0];
  if (similarity) {
    add('Scale',
        `${Number(similarity.scale.toPrecision(6))}, spread ${
            number(100 * similarity.relative_mad, 2)} % over ` +
            `${similarity.num_features} features`);
    add('All picks',
        `${number(similarity.rms_px, 2)} px rms in ${similarity.num_photos} ` +
            (similarity.num_photos === 1 ? 'photo' : 'photos'));
  }
  const check = session.check_points;
  if (check) {
    add('Check points',
        `${check.count}, off by ${number(check.rms_px, 2)} px rms, ${
            number(check.rms_mm, 1)} mm`);
  }
  const warnings = [...(solution?.warnings ?? [])];
  if (solution?.ambiguous) {
    warnings.unshift(
        'Two camera positions fit these picks about equally well: add a pick at another depth.');
  }
  const text = JSON.stringify([facts.map((one) => one.textContent), warnings]);
  if (body.dataset.text === text) return;
  body.dataset.text = text;
  body.replaceChildren(
      el('dl', {}, ...facts),
      ...(warnings.length > 0 ?
              [el('ul', {'aria-label': 'Warnings'}, ...warnings.map((one) => el('li', {}, one)))] :
              []));
}
