#!/usr/bin/env python3
"""Re-projects what roomtex-export wrote, by nothing but the formats' documents.

reproject.py colmap|nerfstudio FOLDER -> one line: pixels of the largest and the mean error of the points in the photos,
how many were compared; metres of the median difference between depth map and depth of the points."""
import json
import math
import os
import statistics
import struct
import sys
import zlib


def read(file, layout):
    return struct.unpack('<' + layout, file.read(struct.calcsize('<' + layout)))


def rotate(w, x, y, z):
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]


def colmap(folder):
    cameras, points, errors, depths, answered = {}, {}, [], [], 0
    with open(folder + '/sparse/0/cameras.bin', 'rb') as file:
        for _ in range(read(file, 'Q')[0]):
            number, model, width, height = read(file, 'iiQQ')
            assert model == 1, 'PINHOLE'
            cameras[number] = (width, height) + read(file, 'dddd')
    with open(folder + '/sparse/0/points3D.bin', 'rb') as file:
        for _ in range(read(file, 'Q')[0]):
            values = read(file, 'QdddBBBdQ')
            points[values[0]] = (values[1:4], set(struct.iter_unpack('<ii', file.read(8 * values[8]))))
    with open(folder + '/sparse/0/images.bin', 'rb') as file:
        for _ in range(read(file, 'Q')[0]):
            image, w, x, y, z, tx, ty, tz, camera = read(file, 'idddddddi')
            name = b''
            while (byte := file.read(1)) != b'\0':
                name += byte
            r, t = rotate(w, x, y, z), (tx, ty, tz)
            width, height, fx, fy, cx, cy = cameras[camera]
            with open(folder + '/stereo/depth_maps/' + name.decode() + '.geometric.bin', 'rb') as map_file:
                content = map_file.read()
            head = ('%d&%d&1&' % (width, height)).encode()
            assert content.startswith(head) and len(content) == len(head) + 4 * width * height
            for index in range(read(file, 'Q')[0]):
                u, v, number = read(file, 'ddq')
                p, track = points[number]
                assert (image, index) in track, 'a track that does not answer'
                answered += 1
                c = [sum(r[k][i] * p[i] for i in range(3)) + t[k] for k in range(3)]
                errors.append(math.hypot(fx * c[0] / c[2] + cx - u, fy * c[1] / c[2] + cy - v))
                pixel = int(v) * width + int(u)
                depth = struct.unpack_from('<f', content, len(head) + 4 * pixel)[0]
                if depth > 0:
                    depths.append(abs(depth - c[2]))
    assert answered == sum(len(track) for _, track in points.values())
    return errors, depths


def png16(path):
    """Rows of a 16-bit grey PNG."""
    data = open(path, 'rb').read()
    place, packed = 8, b''
    while place < len(data):
        length, kind = struct.unpack('>I4s', data[place:place + 8])
        if kind == b'IHDR':
            width, height, bits, color = struct.unpack('>IIBB', data[place + 8:place + 18])
            assert (bits, color) == (16, 0)
        if kind == b'IDAT':
            packed += data[place + 8:place + 8 + length]
        place += 12 + length
    raw, before, rows = zlib.decompress(packed), bytearray(2 * width), []
    for y in range(height):
        begin = y * (2 * width + 1)
        kind, row = raw[begin], bytearray(raw[begin + 1:begin + 1 + 2 * width])
        for i in range(2 * width):
            a, b, c = (row[i - 2] if i > 1 else 0), before[i], (before[i - 2] if i > 1 else 0)
            p = a + b - c
            nearest = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            row[i] = (row[i] + (0, a, b, (a + b) // 2, nearest)[kind]) & 255
        rows.append(struct.unpack('>%dH' % width, row))
        before = row
    return rows


def nerfstudio(folder):
    """Points of the cloud, by depth: where the depth image has a point's depth, it is at that pixel."""
    scene = json.load(open(folder + '/transforms.json'))
    assert scene['applied_transform'] == [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]
    content = open(folder + '/' + scene['ply_file_path'], 'rb').read()
    body = content[content.index(b'end_header\n') + 11:]
    points = [p[:3] for p in struct.iter_unpack('<fffBBB', body)]
    depths, heights = [], []
    for frame in scene['frames'][:3]:
        assert os.path.exists(folder + '/' + frame['file_path'])
        rows, m = png16(folder + '/' + frame['depth_file_path']), frame['transform_matrix']
        assert len(rows) == frame['h'] and len(rows[0]) == frame['w']
        heights.append(m[2][1])  # of the camera's up
        for p in points:
            d = [p[k] - m[k][3] for k in range(3)]
            x, y, z = (sum(m[k][i] * d[k] for k in range(3)) for i in range(3))
            if z > -0.1:
                continue
            u, v = frame['fl_x'] * x / -z + frame['cx'], frame['fl_y'] * -y / -z + frame['cy']
            if 0 <= u < frame['w'] and 0 <= v < frame['h'] and rows[int(v)][int(u)] > 0:
                depths.append(abs(rows[int(v)][int(u)] / 1000 + z))
    assert min(heights) > 0.5, 'z is not up'
    near = [d for d in depths if d < 0.05]  # the others are hidden behind something
    assert len(near) > 0.5 * len(depths), (len(near), len(depths))
    return [0.0], near


errors, depths = {'colmap': colmap, 'nerfstudio': nerfstudio}[sys.argv[1]](sys.argv[2])
print(max(errors), statistics.mean(errors), len(errors), statistics.median(depths), len(depths))
