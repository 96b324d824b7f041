// What roomtex-texture writes as glTF, by Khronos' validator and by meshoptimizer's own decoder.

import assert from 'node:assert/strict';
import {readFile} from 'node:fs/promises';
import {createRequire} from 'node:module';
import {join} from 'node:path';
import {after, before, test} from 'node:test';

import {makeFolder, run} from './browser.mjs';

const require = createRequire(join(process.env.ROOMTEX_BROWSER_PACKAGES, 'package.json'));
const validator = require('gltf-validator');
const {MeshoptDecoder} = require('meshoptimizer');

const kMaxTriangles = 4000;
const capture = process.env.ROOMTEX_CAPTURE;
let folder;
before(() => {
  folder = makeFolder();
});
after(() => folder.remove());

async function texture(name, scan, ...options) {
  const result = await run('roomtex-texture', [
    '--quiet', '--input_path', join(capture, 'capture/truth'), '--image_path',
    join(capture, 'capture/photos'), '--scan_path', scan, '--Texture.scale', '1',
    '--Mesh.max_triangles', String(kMaxTriangles), '--output_path', folder.path(name), ...options
  ]);
  assert.equal(result.code, 0, result.stderr);
}

// The validator finds nothing; gives the file as JSON and bytes.
async function valid(path) {
  const bytes = new Uint8Array(await readFile(path));
  // It does not know EXT_meshopt_compression, nor that such views use the first buffer.
  const {issues, info} = await validator.validateBytes(bytes, {
    ignoredIssues: ['IMAGE_NPOT_DIMENSIONS', 'UNSUPPORTED_EXTENSION', 'UNUSED_OBJECT'],
  });
  assert.deepEqual(issues.messages, [], path);
  const jsonLength = new DataView(bytes.buffer).getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + jsonLength)));
  return {json, binary: bytes.subarray(28 + jsonLength), info, size: bytes.length};
}

async function unpack({json, binary}, accessor) {
  const packed =
      json.bufferViews[accessor.bufferView].extensions.EXT_meshopt_compression;
  await MeshoptDecoder.ready;
  const bytes = new Uint8Array(packed.count * packed.byteStride);
  MeshoptDecoder.decodeGltfBuffer(
      bytes, packed.count, packed.byteStride,
      binary.subarray(packed.byteOffset, packed.byteOffset + packed.byteLength), packed.mode,
      packed.filter);
  return bytes;
}

test('the files are valid and the one for the web is small', async () => {
  await texture('textured', join(capture, 'capture/scan.rtpi'));
  const full = await valid(folder.path('textured/model.glb'));
  const web = await valid(folder.path('textured/model_web.glb'));
  assert.ok(full.info.totalTriangleCount > 10 * kMaxTriangles);
  assert.ok(web.info.totalTriangleCount <= kMaxTriangles);
  assert.ok(web.info.totalTriangleCount > 0.9 * kMaxTriangles);
  assert.ok(web.size < full.size / 8, `${web.size} of ${full.size}`);
});

test('another decoder finds the mesh within the bounds that the file states', async () => {
  const web = await valid(folder.path('textured/model_web.glb'));
  for (const primitive of web.json.meshes[0].primitives) {
    const positions = web.json.accessors[primitive.attributes.POSITION];
    const places = new Uint16Array((await unpack(web, positions)).buffer);
    const low = [1e9, 1e9, 1e9], high = [-1e9, -1e9, -1e9];
    for (let i = 0; i < positions.count; ++i) {
      for (let k = 0; k < 3; ++k) {
        low[k] = Math.min(low[k], places[4 * i + k]);
        high[k] = Math.max(high[k], places[4 * i + k]);
      }
    }
    assert.deepEqual([low, high], [positions.min, positions.max]);
    const indices = web.json.accessors[primitive.indices];
    const corners = new Uint32Array((await unpack(web, indices)).buffer);
    assert.equal(corners.length, indices.count);
    assert.equal(Math.max(...corners), positions.count - 1);
  }
});

test('without compression it needs no decoder', async () => {
  await texture('plain', join(capture, 'capture/scan.rtpi'), '--Mesh.compression', 'none');
  const plain = await valid(folder.path('plain/model_web.glb'));
  assert.deepEqual(plain.json.extensionsRequired, ['KHR_mesh_quantization']);
  assert.equal(plain.json.buffers.length, 1);
});

test('a mesh with colours at its vertices is valid, too', async () => {
  const mesh = folder.path('mesh.ply');
  const result = await run('roomtex-import', [
    '--quiet', '--input_path', join(capture, 'capture/scan.rtpi'), '--output_path', mesh
  ]);
  assert.equal(result.code, 0, result.stderr);
  await texture('mesh', mesh);
  const web = await valid(folder.path('mesh/model_web.glb'));
  assert.ok(web.info.totalTriangleCount <= kMaxTriangles);
  assert.equal(web.info.hasTextures, false);
});
