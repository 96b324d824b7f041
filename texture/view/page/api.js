// What the server is asked (paths: view_server.h). Every failure becomes an Error with a sentence.

async function ask(path, options) {
  let response;
  try {
    response = await fetch(path, options);
  } catch (error) {
    if (error.name === 'AbortError') throw error;
    throw new Error('roomtex-view no longer answers. Start it again and open the new address.');
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
  return (await ask(path)).json();
}
export async function getBytes(path, options) {
  return (await ask(path, options)).arrayBuffer();
}
export async function getBitmap(path) {
  const blob = await (await ask(path)).blob();
  return createImageBitmap(blob, {premultiplyAlpha: 'none', colorSpaceConversion: 'none'});
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
