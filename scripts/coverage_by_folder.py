#!/usr/bin/python3
"""coverage_by_folder.py FILE: line coverage of each folder, from a file of `gcovr --json`.

A header has one name per library that includes it (links below build/*/include-roots); it is
counted once, a line being covered if any of them ran it.
"""
import collections
import json
import os
import sys


def main():
    with open(sys.argv[1], encoding="utf-8") as text:
        files = json.load(text)["files"]
    lines = collections.defaultdict(dict)  # per folder: (file, number) -> count of executions
    for file in files:
        path = os.path.relpath(os.path.realpath(file["file"]))
        counts = lines[path.split(os.sep)[0]]
        for line in file["lines"]:
            if not line.get("gcovr/noncode"):
                key = (path, line["line_number"])
                counts[key] = counts.get(key, 0) + line["count"]
    for folder, counts in sorted(lines.items()):
        covered = sum(1 for count in counts.values() if count > 0)
        share = 100 * covered / len(counts)
        print(f"{folder:<12} {covered:>6} of {len(counts):>6} lines {share:5.1f} %")


if __name__ == "__main__":
    main()
