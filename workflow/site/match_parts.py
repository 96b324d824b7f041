"""Matching of one room in parts: each on a copy of the database, side by side.

    match_parts.py list PAIRS roomtex-auto ARGUMENTS...            the list of pairs; empty where there is none
    match_parts.py match PAIRS PART PARTS COPY roomtex-auto ARGUMENTS...    the PARTth of PARTS, from 1
    match_parts.py merge STATE_BEFORE STATE FOLDER COPY...         all of them into FOLDER/database.partial.db

The commands are those that roomtex-auto --dry_run prints, with other lists and databases.
"""

import os
import shlex
import shutil
import subprocess
import sys


def find(lines, *words):
    """The command line that starts with these programs and commands; None if there is none."""
    for line in lines:
        command = [] if line.startswith("#") else shlex.split(line)
        if len(command) >= len(words) and all(word in command[:2] for word in words):
            return command
    return None


def planned(auto):
    return subprocess.run(auto + ["--dry_run"], check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()


def value_of(command, option):
    return command[command.index(option) + 1]


def with_value(command, option, value):
    place = command.index(option)
    return command[:place + 1] + [value] + command[place + 2:]


def run(command):
    print("$ " + shlex.join(command), flush=True)
    subprocess.run(command, check=True)


def list_pairs(path, auto):
    command = find(planned(auto), "roomtex-pairs")
    # None: every photo is matched with every other, or the matches were made before.
    if command is None or not os.path.exists(value_of(command, "--database_path")):
        open(path, "w").close()
        return
    run(with_value(command, "--output_path", path))


def match(list_path, part, parts, copy, auto):
    with open(list_path, encoding="utf-8") as file:
        pairs = file.readlines()
    pairs = pairs[len(pairs) * (part - 1) // parts:len(pairs) * part // parts]
    command = find(planned(auto), "matches_importer")
    for ending in ("", "-journal", "-wal", "-shm"):
        if os.path.exists(copy + ending):
            os.remove(copy + ending)
    if not pairs or command is None:
        open(copy, "w").close()
        return
    part_list = copy + ".txt"
    with open(part_list, "w", encoding="utf-8") as file:
        file.writelines(pairs)
    database = value_of(command, "--database_path")
    for ending in ("", "-wal"):  # of a COLMAP that was killed: what it wrote last
        if os.path.exists(database + ending):
            shutil.copyfile(database + ending, copy + ending)
    run(with_value(with_value(command, "--database_path", copy), "--match_list_path", part_list))
    os.remove(part_list)


def merge(before, state, folder, copies):
    copies = [copy for copy in copies if os.path.getsize(copy) > 0]
    database, merged = f"{folder}/database.partial.db", f"{folder}/parts/merged.db"
    if copies and os.path.exists(database):
        command = ["roomtex-merge", "--database_path", database, "--output_path", merged]
        for copy in copies:
            command += ["--copy_path", copy]
        run(command)
        # What a COLMAP that was killed left belongs to the file that goes: SQLite would take it for the new one's.
        for ending in ("-wal", "-shm"):
            if os.path.exists(database + ending):
                os.remove(database + ending)
        os.replace(merged, database)
    shutil.copyfile(before, state)


def main():
    what, words = sys.argv[1], sys.argv[2:]
    try:
        if what == "list":
            list_pairs(words[0], words[1:])
        elif what == "match":
            match(words[0], int(words[1]), int(words[2]), words[3], words[4:])
        else:
            merge(words[0], words[1], words[2], words[3:])
    except subprocess.CalledProcessError as error:
        sys.exit(f"match_parts: {error}")


main()
