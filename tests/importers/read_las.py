#!/usr/bin/env python3
"""What a LAS file says, as text: a reader that shares nothing with roomtex, by the specification (ASPRS, 1.4 - R15).

Prints version, point format, the WKT bit, records of variable length, and each point as x y z intensity r g b; ends
with a sentence where a number that the specification fixes is another one.
"""

import struct
import sys

HEADERS = {2: 227, 3: 235, 4: 375}
SIZES = {0: 20, 1: 28, 2: 26, 3: 34, 6: 30, 7: 36, 8: 38}
COLORS = {2: 20, 3: 28, 7: 30, 8: 30}


def require(holds, finding):
    if not holds:
        sys.exit(finding)


def main(path):
    with open(path, "rb") as file:
        data = file.read()

    def at(code, offset):
        values = struct.unpack_from("<" + code, data, offset)
        return values[0] if len(values) == 1 else values

    require(data[:4] == b"LASF", "signature")
    major, minor = at("BB", 24)
    require(major == 1 and at("H", 94) == HEADERS[minor], "version and size of the header")
    kind, size = at("BH", 104)
    require(size == SIZES[kind], "size of a point")
    require((minor >= 4) == (kind >= 6), "these points are not those of the version")
    encoding, begin, num_records = at("H", 6), at("I", 96), at("I", 100)
    require(minor >= 3 or encoding in (0, 1), "bits that the version does not know")
    count, by_return = at("I", 107), at("5I", 111)
    behind = num_behind = 0
    if kind >= 6:
        require(encoding & 16, "the WKT bit is not set")
        require(count == 0 and not any(by_return), "counts of 32 bits beside new points")
        behind, num_behind = at("Q", 235), at("I", 243)
        count, by_return = at("Q", 247), at("15Q", 255)
    require(minor < 3 or at("Q", 227) == 0, "waveforms")
    end = begin + count * size
    require(behind == (end if num_behind else 0), "the records behind the points do not begin there")
    require(num_behind or len(data) == end, "the points do not end with the file")
    require(by_return[0] == count and not any(by_return[1:]), "points by return")
    print(f"{major}.{minor} format {kind} wkt {encoding >> 4 & 1} points {count}")

    def records(place, number, code, head):
        for _ in range(number):
            user, record, length = struct.unpack_from(code, data, place + 2)
            text = data[place + head:place + head + length]
            require(len(text) == length and text.endswith(b"\0"), "the system does not end with a zero")
            print(user.rstrip(b"\0").decode(), record, text[:-1].decode())
            place += head + length
        return place

    require(records(HEADERS[minor], num_records, "<16sHH", 54) == begin, "the points do not begin behind the records")
    require(records(end, num_behind, "<16sHQ", 60) == len(data), "the records do not end with the file")
    scale, shift, box = at("3d", 131), at("3d", 155), at("6d", 179)
    for i in range(count):
        point = begin + i * size
        xyz = [scale[k] * at("3i", point)[k] + shift[k] for k in range(3)]
        require(all(box[2 * k + 1] - 1e-4 <= xyz[k] <= box[2 * k] + 1e-4 for k in range(3)), "outside the bounds")
        returns = at("B", point + 14)
        number, total = (returns & 15, returns >> 4) if kind >= 6 else (returns & 7, returns >> 3 & 7)
        require((number, total) == (1, 1), "return 1 of 1")
        require(not any(data[point + 15:point + (20 if kind < 6 else 30)]), "something else than place, light and return")
        rgb = at("3H", point + COLORS[kind]) if kind in COLORS else ()
        print(*(f"{x:.4f}" for x in xyz), at("H", point + 12), *rgb)


if __name__ == "__main__":
    main(sys.argv[1])
