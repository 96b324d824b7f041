// Tiles of large pictures: what is fetched, what is kept, and how they are put on a canvas.

const kMaxBytes = 200e6;   // of decoded tiles kept, all pictures together
const kMaxRequests = 3;    // a browser opens six connections: picks must not wait behind tiles
const kRetryAfter = 3000;  // milliseconds

// A table for the bytes of a picture: out = in ^ (1 / gamma), so that more than 1 lightens.
export function gammaTable(gamma) {
  if (gamma === 1) return null;
  const bytes = new Uint8ClampedArray(256);
  for (let i = 0; i < 256; ++i) bytes[i] = Math.round(255 * (i / 255) ** (1 / gamma));
  return {key: gamma.toFixed(2), bytes};
}

export class TileStore {
  #tiles = new Map();  // url -> {bitmap, toned, tone, bytes}, least recently used first
  #bytes = 0;
  #wanted = new Map();   // owner -> urls, most urgent first
  #running = new Map();  // url -> AbortController
  #failed = new Map();   // url -> when to ask again, milliseconds; Infinity = never
  #listeners = new Set();
  #onRefused = () => {};

  // Called when a tile has come.
  onTile(listener) {
    this.#listeners.add(listener);
  }

  // listener(url, sentence): the server has no such picture, or its file is broken.
  onRefused(listener) {
    this.#onRefused = listener;
  }

  get bytes() {
    return this.#bytes;
  }

  // Says all that `owner` needs now; what nobody needs any longer is given up.
  want(owner, urls) {
    this.#wanted.set(owner, urls);
    const needed = new Set([...this.#wanted.values()].flat());
    for (const [url, controller] of this.#running) {
      if (!needed.has(url)) controller.abort();
    }
    this.#next();
  }

  // The picture of a tile, or null. tone: of gammaTable().
  get(url, tone = null) {
    const tile = this.#tiles.get(url);
    if (!tile) return null;
    this.#tiles.delete(url);
    this.#tiles.set(url, tile);
    if (!tone) return tile.bitmap;
    if (tile.tone !== tone.key) this.#tone(tile, tone);
    return tile.toned;
  }

  #tone(tile, tone) {
    const {width, height} = tile.bitmap;
    if (!tile.toned) {
      tile.toned = new OffscreenCanvas(width, height);
      tile.bytes += width * height * 4;
      this.#bytes += width * height * 4;
    }
    const context = tile.toned.getContext('2d', {willReadFrequently: true});
    context.drawImage(tile.bitmap, 0, 0);
    const pixels = context.getImageData(0, 0, width, height);
    const data = pixels.data;
    for (let i = 0; i < data.length; i += 4) {
      data[i] = tone.bytes[data[i]];
      data[i + 1] = tone.bytes[data[i + 1]];
      data[i + 2] = tone.bytes[data[i + 2]];
    }
    context.putImageData(pixels, 0, 0);
    tile.tone = tone.key;
    this.#evict(tile);
  }

  #next() {
    if (this.#running.size >= kMaxRequests) return;
    // In turns, so that the loupe of one pane does not wait for all of the other.
    const lists = [...this.#wanted.values()];
    const longest = Math.max(0, ...lists.map((list) => list.length));
    for (let i = 0; i < longest; ++i) {
      for (const list of lists) {
        const url = list[i];
        if (url === undefined || this.#tiles.has(url) || this.#running.has(url)) continue;
        if ((this.#failed.get(url) ?? 0) > Date.now()) continue;
        this.#fetch(url);
        if (this.#running.size >= kMaxRequests) return;
      }
    }
  }

  async #fetch(url) {
    const controller = new AbortController();
    this.#running.set(url, controller);
    try {
      const response = await fetch(url, {signal: controller.signal});
      if (!response.ok) {
        const {error = ''} = await response.json().catch(() => ({}));
        if (response.status < 500 && error) this.#onRefused(url, error);
        throw new Error(String(response.status));
      }
      const bitmap = await createImageBitmap(await response.blob(), {colorSpaceConversion: 'none'});
      const bytes = bitmap.width * bitmap.height * 4;
      this.#tiles.set(url, {bitmap, toned: null, tone: '', bytes});
      this.#bytes += bytes;
      this.#failed.delete(url);
      this.#evict(this.#tiles.get(url));
      for (const listener of this.#listeners) listener(url);
    } catch (error) {
      if (error.name !== 'AbortError') {
        const refused = /^4/.test(error.message);
        this.#failed.set(url, refused ? Infinity : Date.now() + kRetryAfter);
        if (!refused) setTimeout(() => this.#next(), kRetryAfter + 50);
      }
    }
    this.#running.delete(url);
    this.#next();
  }

  #evict(keep) {
    for (const [url, tile] of this.#tiles) {
      if (this.#bytes <= kMaxBytes) return;
      if (tile === keep) continue;
      this.#tiles.delete(url);
      this.#bytes -= tile.bytes;
      tile.bitmap.close();
    }
  }
}

// picture: {width, height, tile_size, num_levels, url(level, x, y)}.
// The level of which a pixel is at most one device pixel wide, and never wider than needed.
export function levelFor(picture, view, ratio) {
  const device = Math.max(view.scale, view.scale * view.aspect) * ratio;
  const level = Math.floor(Math.log2(1 / device) + 0.02);
  return Math.min(picture.num_levels - 1, Math.max(0, level));
}

// The tiles of a level that the view shows: {level, x, y}, nearest to the middle first.
export function visibleTiles(picture, view, level) {
  const size = picture.tile_size * 2 ** level;
  const [left, top] = view.toImg([0, 0]);
  const [right, bottom] = view.toImg([view.width, view.height]);
  const lastX = Math.ceil(picture.width / size) - 1;
  const lastY = Math.ceil(picture.height / size) - 1;
  const tiles = [];
  for (let y = Math.max(0, Math.floor(top / size)); y <= Math.min(lastY, Math.floor(bottom / size));
       ++y) {
    for (let x = Math.max(0, Math.floor(left / size));
         x <= Math.min(lastX, Math.floor(right / size)); ++x) {
      const distance =
          Math.hypot((x + 0.5) * size - view.centre[0], (y + 0.5) * size - view.centre[1]);
      tiles.push({level, x, y, distance});
    }
  }
  return tiles.sort((a, b) => a.distance - b.distance);
}

// Draws what is there, coarser where the finer has not come, onto a canvas whose pixels are
// 1 / ratio CSS pixels. Returns the URLs that are needed, most urgent first.
export function drawTiles(context, picture, view, store, {ratio, tone = null, level = null}) {
  const wantedLevel = level ?? levelFor(picture, view, ratio);
  const coarsest = picture.num_levels - 1;
  const tiles = visibleTiles(picture, view, wantedLevel);
  const device = (x, y) => view.toScreen([x, y]).map((value) => Math.round(value * ratio));
  const [left, top] = device(0, 0);
  const [right, bottom] = device(picture.width, picture.height);
  const urls = tiles.length > 0 && wantedLevel < coarsest ? [picture.url(coarsest, 0, 0)] : [];
  context.save();
  context.beginPath();
  context.rect(left, top, right - left, bottom - top);
  context.clip();
  // Above 2x a pixel is to be seen as what it is.
  context.imageSmoothingEnabled = view.scale * ratio <= 2;
  context.imageSmoothingQuality = 'medium';
  for (const tile of tiles) {
    urls.push(picture.url(tile.level, tile.x, tile.y));
    for (let coarser = wantedLevel; coarser <= coarsest; ++coarser) {
      const shift = coarser - wantedLevel;
      const bitmap = store.get(picture.url(coarser, tile.x >> shift, tile.y >> shift), tone);
      if (!bitmap) continue;
      drawPart(context, picture, bitmap, tile, coarser, device);
      break;
    }
  }
  context.restore();
  return urls;
}

// The part of a tile of level `coarser` that lies under `tile`. Corners are rounded to whole device
// pixels: neighbours then meet without a seam.
function drawPart(context, picture, bitmap, tile, coarser, device) {
  const size = picture.tile_size;
  const step = 2 ** tile.level;
  const shift = coarser - tile.level;
  const share = 2 ** shift;
  const sourceSize = size / share;
  const sourceX = (tile.x % share) * sourceSize;
  const sourceY = (tile.y % share) * sourceSize;
  const sourceWidth = Math.min(sourceSize, bitmap.width - sourceX);
  const sourceHeight = Math.min(sourceSize, bitmap.height - sourceY);
  if (sourceWidth <= 0 || sourceHeight <= 0) return;
  const x = tile.x * size * step;
  const y = tile.y * size * step;
  const [left, top] = device(x, y);
  const [right, bottom] = device(x + sourceWidth * share * step, y + sourceHeight * share * step);
  context.drawImage(
      bitmap, sourceX, sourceY, sourceWidth, sourceHeight, left, top, right - left, bottom - top);
}
