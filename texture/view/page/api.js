// What the server is asked (words: view_answers.h), or the folder that was given away. Every failure
// becomes an Error with a sentence.

// A folder has each answer in a script: browsers let a page that was opened from a disk read nothing
// else. data/folder.js, which says what sizes of pictures there are, makes it one.
const folder = globalThis.roomtexFolder ?? null;

// The smallest size of a picture that is large enough, or the largest.
function sizeInFolder(word, wanted) {
  const sizes = folder.sizes[word];
  return sizes.find((size) => size >= wanted) ?? sizes.at(-1);
}
function nameInFolder(path) {
  const [word] = path.split('?');
  return path.replace(/(?<=max=)\d+/, (wanted) => sizeInFolder(word, Number(wanted)))
      .replace(/[?&]/g, '.')
      .replaceAll('=', '-');
}
function readScript(name) {
  return new Promise((done, failed) => {
    const script = document.createElement('script');
    const end = (act) => {
      script.remove();
      folder.waiting.delete(name);
      act();
    };
    const missing = `data/${name}.js is missing in this folder, or damaged. Copy the folder again.`;
    folder.waiting.set(name, (value, type) => end(() => done({value, type})));
    script.onload = script.onerror = () => end(() => failed(new Error(missing)));
    script.src = `data/${name}.js`;
    document.head.append(script);
  });
}
// {value, type} of the answer: JSON, or base64 with its type. Who asks for the same meanwhile gets
// the same.
const underWay = new Map();
function askFolder(path) {
  const name = nameInFolder(path);
  if (!underWay.has(name)) {
    underWay.set(name, readScript(name).finally(() => underWay.delete(name)));
  }
  return underWay.get(name);
}
function bytesOf(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}
async function blobInFolder(path) {
  const {value, type} = await askFolder(path);
  return new Blob([bytesOf(value)], {type});
}

async function ask(path) {
  let response;
  try {
    response = await fetch(path);
  } catch {
    throw new Error('roomtex-view no longer answers. If it has ended, start it again.');
  }
  if (response.ok) return response;
  let sentence = `The server answers with error ${response.status}.`;
  try {
    sentence = (await response.json()).error ?? sentence;
  } catch { /* not JSON */
  }
  throw new Error(sentence);
}

export async function getJson(path) {
  return folder ? (await askFolder(path)).value : (await ask(path)).json();
}
export async function getBytes(path) {
  return folder ? bytesOf((await askFolder(path)).value).buffer :
                  (await ask(path)).arrayBuffer();
}
export async function getBitmap(path) {
  const blob = folder ? await blobInFolder(path) : await (await ask(path)).blob();
  return createImageBitmap(blob, {premultiplyAlpha: 'none', colorSpaceConversion: 'none'});
}
// For an <img>.
export async function getImageUrl(path) {
  return folder ? URL.createObjectURL(await blobInFolder(path)) : path;
}

// Runs at most `limit` tasks at a time; the one with the smallest key first.
export class Queue {
  #limit;
  #running = 0;
  #waiting = [];
  constructor(limit) {
    this.#limit = limit;
  }

  get idle() {
    return this.#running === 0 && this.#waiting.length === 0;
  }
  get length() {
    return this.#running + this.#waiting.length;
  }

  add(key, task) {
    this.#waiting.push({key, task});
    this.#next();
  }
  clear() {
    this.#waiting.length = 0;
  }

  #next() {
    while (this.#running < this.#limit && this.#waiting.length > 0) {
      let best = 0;
      for (let i = 1; i < this.#waiting.length; ++i) {
        if (this.#waiting[i].key < this.#waiting[best].key) best = i;
      }
      const [{task}] = this.#waiting.splice(best, 1);
      ++this.#running;
      task().finally(() => {
        --this.#running;
        this.#next();
      });
    }
  }
}
