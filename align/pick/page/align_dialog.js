// Runs roomtex-align on the saved picks and shows what it says, also when it says no.

import {api, ServerError} from './api.js';
import {byId, el} from './dom.js';

const kPoll = 400;  // milliseconds
const kVerdicts = {
  trusted: {sign: '✓', text: 'Trusted'},
  untrusted: {sign: '▲', text: 'Not trusted'},
  failed: {sign: '✕', text: 'Failed'},
};

// "Trusted: the photos ..." under the word Trusted is "The photos ...".
function withoutVerdict(headline) {
  const rest = headline.replace(/^(Trusted|Not to be trusted)[:.] ?/, '');
  return rest === '' ? '' : rest[0].toUpperCase() + rest.slice(1);
}

// The reasons come as one paragraph; a line each is easier to work through.
function lines(sentences) {
  return sentences.flatMap((one) => one.split(/(?<=\S\S[.!]) (?=[A-Z])/))
      .map(withoutOptions)
      .filter(Boolean);
}
// Options of the command line help nobody here: what the page has instead, or nothing.
const kSixPairs = 'Set six pairs: then the place need not be searched for.';
const kInstead = [
  [/^Say where the photos belong: --near .*/, kSixPairs],
  [
    /^One pick where these places differ .*/,
    'Set a pair where these places differ, or six: then the place need not be searched for.',
  ],
  [
    /^Read it with --azimuth .*/,
    'Press Mirror above the scan: it is read the other way round then, and the picks stay.',
  ],
  [/^If the scan is coarse, .*/, ''],
  [/; give --camera_params [^.]*/, ''],
  [/ \(--[^)]*\)/g, ''],
];
function withoutOptions(sentence) {
  return kInstead.reduce((text, [from, to]) => text.replace(from, to), sentence);
}

function offer(text, name, action) {
  return el(
      'div', {class: 'offer'}, el('p', {}, text),
      el('button', {type: 'button', class: 'main', onclick: action}, name));
}

export class AlignDialog {
  #status = null;  // the server's last answer
  #revision = -1;  // of the picks that it rests on
  #parts = {};
  #timer = 0;
  #confirming = false;  // a pair was asked for: with it the search goes on
  #pairsBefore = 0;     // it is one more than these

  // picks: Picks; facts: {min_picks, models, photos, aligned_path}
  // on: {look() at the photos on the scan, pickIn(name) shows that photo}
  constructor(picks, facts, on) {
    this.picks = picks;
    this.facts = facts;
    this.on = on;
    picks.addEventListener('sync', () => this.#confirm());
    this.dialog = byId('align');
    this.button = byId('align-open');
    this.button.addEventListener('click', () => this.open());
    const parts = this.#parts;
    parts.close = el('button', {type: 'button', onclick: () => this.dialog.close()}, 'Close');
    parts.again =
        el('button', {type: 'button', class: 'main', onclick: () => this.#start({hint: true})},
           'Run again');
    parts.end = el('button', {type: 'button', onclick: () => this.#end()}, 'Cancel');
    parts.body =
        el('div',
           {class: 'body', tabindex: '0', role: 'region', 'aria-label': 'What roomtex-align says'});
    parts.live = el('p', {role: 'status', class: 'hidden'});
    this.dialog.append(
        el('header', {}, el('h2', {id: 'align-title'}, 'Align')), parts.live, parts.body,
        el('footer', {}, parts.end, parts.again, parts.close));
    this.#poll();  // a run may be under way from before this page was opened
  }

  // Shows the answer to the picks as they are, and starts if there is none.
  open() {
    if (!this.dialog.open) this.dialog.showModal();
    const known = this.#status && this.#status.state !== 'idle' &&
        (this.#status.state === 'running' || this.#revision === this.picks.session.revision);
    if (known) {
      this.#show();
    } else {
      this.#start();
    }
  }

  // hint: fewer picks than an alignment needs say where to search.
  async #start({hint = false} = {}) {
    const {body} = this.#parts;
    const {min_picks} = this.facts;
    const hasModel = this.facts.models.length > 0;
    const {count, where} = this.#fewest();
    if (count < min_picks && !hint) {
      this.#status = null;
      this.#buttons(false);
      const search = (text) => offer(text, 'Find it for me', () => this.#start({hint: true}));
      const needed = `roomtex-align needs ${min_picks} picks${hasModel ? '' : ' in a photo'}; ` +
          `there are ${count} so far${where}.`;
      const {found, next: sentence} = this.picks.session;
      const next = el('p', {}, sentence);
      if (hasModel && count === 0) {
        body.replaceChildren(
            search('roomtex-align can search for the place of the photos without a pick.'),
            el('p', {}, `Or show it by ${min_picks} picks.`), ...(found ? [] : [next]));
      } else {
        body.replaceChildren(el('p', {}, needed), next);
        if (hasModel) body.append(search('Or by what there is:'));
      }
      return;
    }
    this.#message('Saving the picks…');
    for (let wait = 0; wait < 100 && this.picks.pending; ++wait) {
      await new Promise((done) => setTimeout(done, 50));
    }
    if (this.picks.state !== 'saved') {
      this.#message(
          `The picks are not saved: ${this.picks.why}. roomtex-align reads the saved ones.`);
      return;
    }
    this.#revision = this.picks.session.revision;
    this.#status = null;
    this.#confirming = false;
    try {
      await api.startAlign();
    } catch (error) {
      if (!(error instanceof ServerError)) throw error;
      this.#message(error.message);
      return;
    }
    this.#message('Starting roomtex-align…');
    await this.#poll();
  }

  // The picks there are: of photos alone in the one that has most, of several models in the photos
  // of the one that has fewest and any.
  #fewest() {
    const {models, photos} = this.facts;
    const numComplete = (photo) => this.picks.session.photos[photo.name].num_complete;
    if (models.length === 0) return {count: Math.max(0, ...photos.map(numComplete)), where: ''};
    const counts = models.map(() => 0);
    for (const photo of photos) counts[photo.model] += numComplete(photo);
    const begun = counts.filter((count) => count > 0);
    const count = begun.length > 0 ? Math.min(...begun) : 0;
    const several = models.length > 1 && count > 0;
    return {count, where: several ? ` in photos of ${models[counts.indexOf(count)]}` : ''};
  }

  async #end() {
    try {
      await api.endAlign();
    } catch (error) {
      if (!(error instanceof ServerError)) throw error;
    }
    this.#status = null;
    this.#message('Cancelled. Nothing was changed by this run.');
    clearTimeout(this.#timer);
    this.button.textContent = 'Align…';
  }

  #message(text) {
    this.#buttons(false);
    this.#parts.body.replaceChildren(el('p', {}, text));
    this.#parts.live.textContent = text;
  }

  #buttons(running, done = false) {
    this.#parts.end.hidden = !running;
    this.#parts.again.hidden = !done;
    this.#parts.close.textContent = running ? 'Close (it goes on)' : 'Close';
  }

  async #poll() {
    clearTimeout(this.#timer);
    try {
      const status = await api.align();
      // What it has found is shown in place of picks.
      if (status.state === 'done' && this.#status?.state !== 'done') {
        this.picks.refresh((await api.state()).session);
      }
      this.#status = status;
    } catch (error) {
      if (!(error instanceof ServerError)) throw error;
      this.#timer = setTimeout(() => this.#poll(), 4 * kPoll);
      return;
    }
    const {state, share} = this.#status;
    const running = state === 'running';
    this.button.textContent = !running ? 'Align…' :
        typeof share === 'number'      ? `Aligning, ${Math.round(100 * share)} %` :
                                         'Aligning…';
    if (running) this.#timer = setTimeout(() => this.#poll(), kPoll);
    if (this.dialog.open && state !== 'idle') this.#show();
  }

  #show() {
    if (this.#status.state === 'running') {
      this.#showRunning();
    } else {
      this.#showDone();
    }
  }

  #showRunning() {
    const {body, live} = this.#parts;
    const {stage, share, log} = this.#status;
    this.#buttons(true);
    let progress = body.querySelector('progress');
    if (!progress) {
      progress = el('progress', {max: '1', 'aria-label': 'Progress of roomtex-align'});
      body.replaceChildren(
          el('p', {class: 'stage'}), progress, el('pre', {class: 'log', tabindex: '0'}));
    }
    body.querySelector('.stage').textContent = stage || 'Starting…';
    if (live.textContent !== stage) live.textContent = stage;
    if (typeof share === 'number') {
      progress.value = share;
    } else {
      progress.removeAttribute('value');
    }
    const box = body.querySelector('.log');
    const atEnd = box.scrollTop + box.clientHeight >= box.scrollHeight - 8;
    box.textContent = log.join('\n');
    if (atEnd) box.scrollTop = box.scrollHeight;
  }

  #showDone() {
    const status = this.#status;
    const verdict = kVerdicts[status.verdict] ?? kVerdicts.failed;
    const headline = withoutVerdict(status.headline);
    this.#buttons(false, true);
    this.#parts.live.textContent = `${verdict.text}. ${headline}`;
    const parts = [
      el('div', {class: 'verdict', 'data-verdict': status.verdict},
         el('span', {class: 'sign', 'aria-hidden': 'true'}, verdict.sign),
         el('div', {}, el('strong', {}, verdict.text), el('p', {class: 'headline'}, headline))),
    ];
    const {found} = this.picks.session;
    const confirmIn = found?.confirm_in;
    const sentences = lines(status.sentences).filter((one) => !confirmIn || one !== kSixPairs);
    if (sentences.length > 0) {
      parts.push(el('ul', {class: 'sentences'}, ...sentences.map((one) => el('li', {}, one))));
    }
    if (confirmIn) parts.push(this.#askForPair(confirmIn));
    if (found) parts.push(this.#offerLook());
    if (status.facts.length > 0) {
      parts.push(
          el('dl', {class: 'facts'},
             ...status.facts.flatMap(
                 ({name, value}) => [el('dt', {}, name), el('dd', {}, String(value))])));
    }
    if (status.overlays.length > 0) {
      parts.push(
          el('div', {class: 'overlays'}, ...status.overlays.map((name) => this.#overlay(name))));
    }
    parts.push(this.#command(status.command));
    if (status.log.length > 0) {
      parts.push(
          el('details', {},
             el('summary', {}, `What it said while it ran (exit code ${status.exit_code})`),
             el('pre', {class: 'log', tabindex: '0'}, status.log.join('\n'))));
    }
    this.#parts.body.replaceChildren(...parts);
    this.#parts.body.scrollTop = 0;
  }

  #askForPair(name) {
    const begin = () => {
      this.#confirming = true;
      this.#pairsBefore = this.#countPairs();
      this.dialog.close();
      this.on.pickIn(name);
    };
    return offer(
        `One pair decides: click a corner in ${name} that you recognise in the scan, too. The ` +
            'search then goes on with it.',
        'Set the pair', begin);
  }

  #countPairs() {
    return this.picks.session.picks.filter(({complete, weight}) => complete && weight > 0).length;
  }

  // The pair that was asked for is there.
  #confirm() {
    const {picks} = this;
    if (!this.#confirming || picks.state !== 'saved') return;
    if (this.#countPairs() <= this.#pairsBefore) return;
    if (!this.dialog.open) this.dialog.showModal();
    this.#start({hint: true});
  }

  #offerLook() {
    const look = () => {
      this.dialog.close();
      this.on.look();
    };
    return offer(
        'The photos are shown where the search has placed them, until your picks place them.',
        'Look at them on the scan', look);
  }

  #command(line) {
    const code = el('code', {tabindex: '0'}, line);
    const copy =
        el('button', {
          type: 'button',
          onclick: async () => {
            getSelection().selectAllChildren(code);
            try {
              await navigator.clipboard.writeText(line);
              copy.textContent = 'Copied';
            } catch {
              copy.textContent = 'Marked: press Ctrl+C';
            }
          }
        },
           'Copy');
    return el(
        'div', {}, el('p', {class: 'quiet'}, 'The same in a shell:'),
        el('div', {class: 'command'}, code, copy));
  }

  #overlay(name) {
    return el(
        'button',
        {type: 'button', 'aria-label': `Enlarge ${name}`, onclick: () => this.#enlarge(name)},
        el('img', {
          src: api.overlay(name),
          alt: `${name}: photo, scan from its pose, edges`,
          loading: 'lazy'
        }),
        el('span', {}, name));
  }

  #enlarge(name) {
    const large = byId('large');
    large.replaceChildren(
        el('header', {}, el('h2', {}, name),
           el('button', {type: 'button', onclick: () => large.close()}, 'Close')),
        el('img', {
          src: api.overlay(name),
          alt: `${name}: photo, scan from its pose, edges`,
          onclick: () => large.close()
        }));
    large.showModal();
  }
}
