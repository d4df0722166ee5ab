#!/usr/bin/python3
"""The structure given by #includes: no cycles, and levels that include downwards.

    scripts/check_includes.py            cycles, and whether the table is current; exit status 1 if there
                                         is a cycle or it is not
    scripts/check_includes.py --write    renews the levels in scripts/include_levels.md
    scripts/check_includes.py --sizes    the largest folders and files

A unit is a header and its source (`screening.hpp` and `screening.cpp`). A cycle is a set of units,
or of folders, that all lead to each other; a folder and one inside it are two folders.
"""
import argparse
import collections
import os
import re
import sys

CODE = ("estimator", "drivers", "config", "status", "report", "daemon", "simulator", "cli", "gateway",
        "fleet", "linuxcnc", "modelling", "docs", "bench", "tests")
DRAWN = CODE[:12]  # installed code
INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)


def read_includes(root):
    """{file: [file that it includes]}, paths from `root`; files outside the tree are omitted."""
    texts = {}
    for top in CODE:
        for folder, _, names in os.walk(os.path.join(root, top)):
            for name in names:
                if name.endswith((".hpp", ".cpp")):
                    path = os.path.join(folder, name)
                    with open(path, encoding="utf-8") as text:
                        texts[os.path.relpath(path, root)] = text.read()
    includes = {}
    for path, text in sorted(texts.items()):
        beside = os.path.dirname(path)
        found = []
        for name in INCLUDE.findall(text):
            for candidate in (name, os.path.normpath(os.path.join(beside, name))):
                if candidate in texts:
                    found.append(candidate)
                    break
        includes[path] = found
    return includes


def graph_of(includes, node_of):
    """{node: {node that it includes: (file, included file)}}, without edges to itself."""
    graph = {}
    for path, found in includes.items():
        node = graph.setdefault(node_of(path), {})
        for other in found:
            if node_of(other) != node_of(path):
                node.setdefault(node_of(other), (path, other))
    return graph


def reached(graph, start):
    """All nodes reached from `start` by one or more edges."""
    seen, waiting = set(), [start]
    while waiting:
        for other in graph.get(waiting.pop(), ()):
            if other not in seen:
                seen.add(other)
                waiting.append(other)
    return seen


def circles(graph):
    """Sets of nodes that lead to each other, as sorted lists."""
    ways = {node: reached(graph, node) for node in graph}
    found = {frozenset(other for other in ways[node] if node in ways[other])
             for node in graph if node in ways[node]}
    return sorted(sorted(circle) for circle in found)


def check(kind, graph):
    """Prints each cycle and its includes; returns their count."""
    found = circles(graph)
    for circle in found:
        print(f"check_includes: {kind}s in a circle: {' '.join(circle)}")
        for node in circle:
            for other, (path, included) in sorted(graph[node].items()):
                if other in circle:
                    print(f"  {path} includes {included}")
    return len(found)


def levels(graph):
    """The folders by level, the lowest first: a folder is above all that it includes. Folders in a
    cycle share a level."""
    together = {node: node for node in graph}
    for circle in circles(graph):
        together.update({node: circle[0] for node in circle})
    below = collections.defaultdict(set)
    for node, others in graph.items():
        below[together[node]] |= {together[other] for other in others} - {together[node]}
    height = {}

    def height_of(node):
        if node not in height:
            height[node] = 1 + max((height_of(other) for other in below[node]), default=0)
        return height[node]

    found = collections.defaultdict(list)
    for node in sorted(graph):
        found[height_of(together[node])].append(node)
    return [found[level] for level in sorted(found)]


def drawing(includes):
    drawn = {path: [other for other in found if other.split("/")[0] in DRAWN]
             for path, found in includes.items() if path.split("/")[0] in DRAWN}
    stack = levels(graph_of(drawn, os.path.dirname))
    lines = ["| level | folders |", "|---|---|"]
    for number in range(len(stack), 0, -1):
        lines.append(f"| {number} | {', '.join(f'`{node}`' for node in stack[number - 1])} |")
    return "\n".join(lines)


def print_sizes(root, includes):
    folders = collections.Counter(os.path.dirname(path) for path in includes)
    lines = {}
    for path in includes:
        with open(os.path.join(root, path), encoding="utf-8") as text:
            lines[path] = sum(1 for _ in text)
    for folder, count in folders.most_common(5):
        print(f"{folder}: {count} files")
    for path, count in sorted(lines.items(), key=lambda item: -item[1])[:5]:
        print(f"{path}: {count} lines")


def main():
    parser = argparse.ArgumentParser(description="Circles of #includes, and the levels.")
    parser.add_argument("--root", default=os.path.join(os.path.dirname(__file__), ".."))
    parser.add_argument("--write", action="store_true", help="draw the levels anew")
    parser.add_argument("--sizes", action="store_true", help="print the largest folders and files")
    options = parser.parse_args()
    includes = read_includes(options.root)
    if options.sizes:
        print_sizes(options.root, includes)
        return 0

    document = os.path.join(options.root, "scripts", "include_levels.md")
    now = drawing(includes) + "\n"
    if options.write:
        with open(document, "w", encoding="utf-8") as text:
            text.write(now)
        return 0
    with open(document, encoding="utf-8") as text:
        drawn = text.read()

    units = graph_of(includes, lambda path: os.path.splitext(path)[0])
    folders = graph_of(includes, os.path.dirname)
    wrong = check("unit", units) + check("folder", folders)
    if now != drawn:
        wrong += 1
        print("check_includes: the levels in scripts/include_levels.md are not those of the tree: "
              "scripts/check_includes.py --write")
    print(f"check_includes: {len(includes)} files, {len(folders)} folders, {wrong} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
