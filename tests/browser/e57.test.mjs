// What roomtex writes as E57, read by a reader that shares nothing with ours (web-e57, in Rust).

import assert from 'node:assert/strict';
import {readFile, writeFile} from 'node:fs/promises';
import {join} from 'node:path';
import {after, before, test} from 'node:test';

import {makeFolder, run} from './browser.mjs';

// Its e57.js imports the .wasm as a module, which Node does not do by itself.
async function loadReader() {
  const folder = join(process.env.ROOMTEX_BROWSER_PACKAGES, 'node_modules/web-e57');
  const glue = await import(join(folder, 'e57_bg.js'));
  const module = await WebAssembly.compile(await readFile(join(folder, 'e57_bg.wasm')));
  const instance = await WebAssembly.instantiate(module, {'./e57_bg.js': glue});
  glue.__wbg_set_wasm(instance.exports);
  instance.exports.__wbindgen_start?.();  // some versions have it
  return async (path, format) => glue.convertE57(new Uint8Array(await readFile(path)), format);
}

let convert, folder;
before(async () => {
  convert = await loadReader();
  folder = makeFolder();
});
after(() => folder.remove());

// Two stations with poses, some samples missing.
function makePtx() {
  const points = [];
  let text = '';
  for (const [station, x0] of [[0, 0], [1, 7.25]]) {
    const columns = 40, rows = 25 + station;
    text += `${columns}\n${rows}\n${x0} 0 0\n1 0 0\n0 1 0\n0 0 1\n` +
        `1 0 0 0\n0 1 0 0\n0 0 1 0\n${x0} 0 0 1\n`;
    const grid = [];
    for (let column = 0; column < columns; ++column) {
      for (let row = rows - 1; row >= 0; --row) {
        if ((column * 7 + row * 3) % 13 === 0) {
          text += '0 0 0 0.5\n';
          continue;
        }
        const azimuth = 0.15 * column, elevation = 0.8 - 0.06 * row, range = 3 + 0.01 * column;
        const p = [
          range * Math.cos(elevation) * Math.cos(azimuth),
          range * Math.cos(elevation) * Math.sin(azimuth), range * Math.sin(elevation)
        ].map((value) => value.toFixed(6));
        text += p.join(' ') + ' 0.25\n';
        grid.push({row, column, p: [Number(p[0]) + x0, Number(p[1]), Number(p[2])]});
      }
    }
    grid.sort((a, b) => a.row - b.row || a.column - b.column);
    points.push(...grid.map((cell) => cell.p));
  }
  return {text, points};
}

function parse(xyz) {
  return xyz.trim().split('\n').map((line) => line.split(' ').map(Number));
}

test('another reader finds the same points in the same order', async () => {
  const {text, points} = makePtx();
  await writeFile(folder.path('site.ptx'), text);
  const result = await run('roomtex-import', [
    '--quiet', '--input_path', folder.path('site.ptx'), '--output_path', folder.path('site.e57')
  ]);
  assert.equal(result.code, 0, result.stderr);
  const read = parse(await convert(folder.path('site.e57'), 'XYZ'));
  assert.equal(read.length, points.length);
  for (let i = 0; i < points.length; ++i) {
    for (let k = 0; k < 3; ++k) assert.ok(Math.abs(read[i][k] - points[i][k]) < 2e-6, `point ${i}`);
  }
});

test('another reader finds the same colours', async () => {
  const capture = process.env.ROOMTEX_CAPTURE;
  const result = await run('roomtex-texture', [
    '--quiet', '--input_path', join(capture, 'capture/truth'), '--image_path',
    join(capture, 'capture/photos'), '--scan_path', join(capture, 'capture/scan.rtpi'),
    '--Texture.scale', '1', '--E57.images', '1', '--output_path', folder.path('textured')
  ]);
  assert.equal(result.code, 0, result.stderr);
  const read = parse(await convert(folder.path('textured/model.e57'), 'XYZ'));
  const ply = await readFile(folder.path('textured/model.ply'));
  const header = ply.subarray(0, 4096).toString('latin1');
  const body = header.indexOf('end_header\n') + 11;
  assert.match(
      header,
      /property float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar views\n/);
  assert.equal(read.length, Number(header.match(/element vertex (\d+)/)[1]));
  for (let i = 0; i < read.length; ++i) {
    const at = body + 16 * i;
    const [x, y, z] = [0, 4, 8].map((offset) => ply.readFloatLE(at + offset));
    // y was up, z is.
    const wanted = [x, -z, y, ply[at + 12], ply[at + 13], ply[at + 14]];
    for (let k = 0; k < 6; ++k) {
      assert.ok(Math.abs(read[i][k] - wanted[k]) < 3e-6, `${read[i]} is not ${wanted}`);
    }
  }
  const xml = await convert(folder.path('textured/model.e57'), 'XML');
  assert.equal(xml.match(/<pinholeRepresentation/g).length, 12);
  assert.equal(xml.match(/<associatedData3DGuid/g).length, 12);
});
