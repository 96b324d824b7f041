#!/usr/bin/env python3
"""Takes the verified pairs between the first N photos, by name, and the others out of a copy of a database, so that
nothing connects the two groups.

take_pairs_out.py database.db N halves.db
"""
import shutil
import sqlite3
import sys

MAX_IMAGES = 2147483647  # COLMAP's, in the number of a pair


def take_pairs_out(database, num_first, copy):
    shutil.copy(database, copy)
    db = sqlite3.connect(copy)
    photos = [image_id for image_id, in db.execute("SELECT image_id FROM images ORDER BY name")]
    first = set(photos[:num_first])
    num_out = 0
    for pair_id, rows in db.execute("SELECT pair_id, rows FROM two_view_geometries").fetchall():
        if (pair_id // MAX_IMAGES in first) != (pair_id % MAX_IMAGES in first):
            db.execute("DELETE FROM two_view_geometries WHERE pair_id = ?", (pair_id,))
            num_out += rows > 0
    db.commit()
    db.close()
    return num_out


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    print("%d pairs with verified matches" % take_pairs_out(sys.argv[1], int(sys.argv[2]), sys.argv[3]))
