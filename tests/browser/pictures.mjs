// Pictures and models made and read by hand, so that a test knows every byte of them.

import {deflateSync, inflateSync} from 'node:zlib';

// PNG, 8 bits, not interlaced -> {width, height, at(x, y) -> [r, g, b]}.
export function readPng(bytes) {
  const parts = [];
  let at = 8, header;
  while (at < bytes.length) {
    const size = bytes.readUInt32BE(at), type = bytes.toString('latin1', at + 4, at + 8);
    const body = bytes.subarray(at + 8, at + 8 + size);
    if (type === 'IHDR') header = body;
    if (type === 'IDAT') parts.push(body);
    at += 12 + size;
  }
  const width = header.readUInt32BE(0), height = header.readUInt32BE(4);
  const channels = {2: 3, 6: 4}[header[9]];
  if (header[8] !== 8 || !channels || header[12] !== 0) throw new Error('a PNG of another kind');
  const raw = inflateSync(Buffer.concat(parts)), row = width * channels;
  const pixels = Buffer.alloc(row * height);
  for (let y = 0; y < height; ++y) {
    const filter = raw[y * (row + 1)];
    for (let x = 0; x < row; ++x) {
      const left = x >= channels ? pixels[y * row + x - channels] : 0;
      const up = y > 0 ? pixels[(y - 1) * row + x] : 0;
      const corner = x >= channels && y > 0 ? pixels[(y - 1) * row + x - channels] : 0;
      const p = left + up - corner;
      const [a, b, c] = [Math.abs(p - left), Math.abs(p - up), Math.abs(p - corner)];
      const paeth = a <= b && a <= c ? left : b <= c ? up : corner;
      const add = [0, left, up, (left + up) >> 1, paeth][filter];
      pixels[y * row + x] = raw[y * (row + 1) + 1 + x] + add;
    }
  }
  return {
    width,
    height,
    at: (x, y) => {
      const i = Math.floor(y) * row + Math.floor(x) * channels;
      return [pixels[i], pixels[i + 1], pixels[i + 2]];
    },
  };
}

const crcTable = Array.from({length: 256}, (_, n) => {
  for (let k = 0; k < 8; ++k) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
  return n >>> 0;
});
function pngChunk(type, body) {
  const bytes = Buffer.alloc(12 + body.length);
  bytes.writeUInt32BE(body.length, 0);
  bytes.write(type, 4, 'latin1');
  body.copy(bytes, 8);
  let crc = 0xffffffff;
  for (const byte of bytes.subarray(4, 8 + body.length)) {
    crc = crcTable[(crc ^ byte) & 255] ^ (crc >>> 8);
  }
  bytes.writeUInt32BE((crc ^ 0xffffffff) >>> 0, 8 + body.length);
  return bytes;
}
// color(x, y) -> [r, g, b].
export function writePng(width, height, color) {
  const raw = Buffer.alloc(height * (1 + 3 * width));
  for (let y = 0; y < height; ++y) {
    for (let x = 0; x < width; ++x) raw.set(color(x, y), y * (1 + 3 * width) + 1 + 3 * x);
  }
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width, 0);
  header.writeUInt32BE(height, 4);
  header.set([8, 2, 0, 0, 0], 8);
  return Buffer.concat([
    Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'), pngChunk('IHDR', header),
    pngChunk('IDAT', deflateSync(raw)), pngChunk('IEND', Buffer.alloc(0))
  ]);
}

// A square in the plane z = 0, from -1 to 1, that looks along +z and carries the picture.
export function writeSquareGlb(png) {
  const positions = new Float32Array([-1, 1, 0, 1, 1, 0, -1, -1, 0, 1, -1, 0]);
  const uv = new Float32Array([0, 0, 1, 0, 0, 1, 1, 1]);
  const corners = new Uint32Array([0, 2, 1, 1, 2, 3]);
  const parts = [positions, uv, corners].map((array) => Buffer.from(array.buffer));
  parts.push(Buffer.concat([png, Buffer.alloc((4 - png.length % 4) % 4)]));
  const views = [];
  let at = 0;
  for (const part of parts) {
    views.push({buffer: 0, byteOffset: at, byteLength: part.length});
    at += part.length;
  }
  views[3].byteLength = png.length;
  let text = JSON.stringify({
    asset: {version: '2.0'},
    scene: 0,
    scenes: [{nodes: [0]}],
    nodes: [{mesh: 0}],
    meshes: [{primitives: [{attributes: {POSITION: 0, TEXCOORD_0: 1}, indices: 2, material: 0}]}],
    materials: [{pbrMetallicRoughness: {baseColorTexture: {index: 0}}}],
    textures: [{source: 0}],
    images: [{bufferView: 3, mimeType: 'image/png'}],
    accessors: [
      {
        bufferView: 0,
        componentType: 5126,
        count: 4,
        type: 'VEC3',
        min: [-1, -1, 0],
        max: [1, 1, 0]
      },
      {bufferView: 1, componentType: 5126, count: 4, type: 'VEC2'},
      {bufferView: 2, componentType: 5125, count: 6, type: 'SCALAR'},
    ],
    bufferViews: views,
    buffers: [{byteLength: at}],
  });
  text += ' '.repeat((4 - text.length % 4) % 4);
  const head = Buffer.alloc(20), middle = Buffer.alloc(8);
  head.write('glTF', 0, 'latin1');
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(28 + text.length + at, 8);
  head.writeUInt32LE(text.length, 12);
  head.write('JSON', 16, 'latin1');
  middle.writeUInt32LE(at, 0);
  middle.write('BIN\0', 4, 'latin1');
  return Buffer.concat([head, Buffer.from(text), middle, ...parts]);
}

// The same square with one colour per corner, as a PLY.
export function writeSquarePly(colors) {
  const places = ['-1 1 0', '1 1 0', '-1 -1 0', '1 -1 0'];
  return 'ply\nformat ascii 1.0\ncomment roomtex up 0 1 0\nelement vertex 4\nproperty float x\nproperty float y\n' +
      'property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n' +
      'element face 2\nproperty list uchar int vertex_indices\nend_header\n' +
      places.map((place, i) => `${place} ${colors[i].join(' ')}\n`).join('') + '3 0 2 1\n3 1 2 3\n';
}
