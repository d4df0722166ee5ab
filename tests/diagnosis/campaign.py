#!/usr/bin/python3
"""Hides effects by seed, lets the tool look at the files, and counts what it says.

campaign.py PROGRAM [--cases N] [--null N] [--outside N] [--double N] [--levels 1,2,3] [--seed S]
"""

import argparse
import collections
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

import hidden_effects as hidden


def diagnose(program, folder):
    answer = folder / "answer.json"
    command = [program, "diagnose", "--model", "model.toml", "--train", "train_a.csv",
               "train_b.csv", "--test", "test.csv", "--json", str(answer)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError("%s: %s" % (folder, done.stderr))
    return json.loads(answer.read_text())


def same(finding, truth):
    return (finding["cause"], finding["subject"]) == (truth["cause"], truth["subject"])


def errors(finding, truth):
    """Relative error of every parameter that both know."""
    out = {}
    for name, value in truth["parameters"].items():
        found = finding["parameters"].get(name)
        if isinstance(value, dict) and isinstance(found, dict):
            shared = [o for o in value if o in found]
            out[name] = max([abs(found[o] / value[o] - 1) for o in shared], default=1.0)
        elif isinstance(value, (int, float)) and isinstance(found, (int, float)) and value:
            out[name] = abs(found / value - 1)
    return out


def one(program, seed, level, causes, keep, outputs):
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(keep or temporary) / ("%d_%d_%s" % (level, seed, "+".join(causes)))
        case = hidden.make(folder, seed, level, causes, outputs)
        return case.truth, diagnose(program, folder)


def label(finding):
    return finding["cause"]


def run_single(options, level):
    right = extra = 0
    confusion = collections.Counter()
    wrong = collections.defaultdict(list)
    ratios = []
    for i in range(options.cases):
        cause = hidden.CAUSES[i % len(hidden.CAUSES)]
        truth, answer = one(options.program, options.seed + i, level, [cause], options.keep,
                            options.outputs)
        found = answer["findings"]
        hit = bool(found) and same(found[0], truth[0])
        right += hit
        extra += max(0, len(found) - 1)
        if hit:
            for name, error in errors(found[0], truth[0]).items():
                wrong[truth[0]["cause"] + "." + name].append(error)
        else:
            said = "%s(%s)" % (found[0]["cause"], found[0]["subject"]) if found else \
                answer["verdict"]
            confusion["%s(%s) -> %s" % (truth[0]["cause"], truth[0]["subject"], said)] += 1
            print("  level %d seed %d: %s(%s) -> %s" % (
                level, options.seed + i, truth[0]["cause"], truth[0]["subject"], said), flush=True)
    print("level %d: %d of %d right as the first finding (%.1f %%), %d further findings" % (
        level, right, options.cases, 100 * right / max(1, options.cases), extra))
    for name, values in sorted(wrong.items()):
        print("  error of %s: median %.3f, 90 %% below %.3f (%d)" % (
            name, np.median(values), np.quantile(values, 0.9), len(values)))
    return right


def run_silent(options, level, causes, count, what, allowed):
    bad = 0
    for i in range(count):
        names = [causes[i % len(causes)]] if causes else []
        truth, answer = one(options.program, 50000 + options.seed + i, level, names, options.keep,
                            options.outputs)
        if answer["verdict"] not in allowed:
            bad += 1
            first = answer["findings"][0] if answer["findings"] else None
            print("  level %d seed %d: %s -> %s %s" % (
                level, 50000 + options.seed + i, names, answer["verdict"],
                first and (first["cause"], first["subject"], first["evidence"])), flush=True)
    print("level %d: %s: %d of %d cases not %s" % (level, what, bad, count, "/".join(allowed)))


def run_double(options, level):
    both = 0
    for i in range(options.double):
        random = np.random.default_rng(i + 7)
        pair = [str(c) for c in random.choice(hidden.ALWAYS, 2, replace=False)]
        truth, answer = one(options.program, 90000 + options.seed + i, level, pair, options.keep,
                            options.outputs)
        hits = [any(same(f, t) for f in answer["findings"]) for t in truth]
        both += all(hits)
        if not all(hits):
            print("  level %d seed %d: %s -> %s" % (
                level, 90000 + options.seed + i, [(t["cause"], t["subject"]) for t in truth],
                [(f["cause"], f["subject"]) for f in answer["findings"]]), flush=True)
    print("level %d: both of two found in %d of %d" % (level, both, options.double))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--cases", type=int, default=36)
    parser.add_argument("--null", type=int, default=20)
    parser.add_argument("--outside", type=int, default=12)
    parser.add_argument("--double", type=int, default=12)
    parser.add_argument("--levels", default="1,2,3")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--outputs", type=int, default=1)
    parser.add_argument("--keep", help="folder that keeps the files")
    options = parser.parse_args()
    options.program = str(pathlib.Path(options.program).resolve())
    for level in [int(l) for l in options.levels.split(",")]:
        if options.cases:
            run_single(options, level)
        if options.null:
            run_silent(options, level, [], options.null, "nothing hidden", ["none", "unexplained"])
        if options.outside:
            run_silent(options, level, hidden.OUTSIDE, options.outside, "outside the catalogue",
                       ["unexplained"])
        if options.double:
            run_double(options, level)


if __name__ == "__main__":
    sys.exit(main())
