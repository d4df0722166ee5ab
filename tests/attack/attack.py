#!/usr/bin/python3
"""Attacks the running daemon through configuration files, sockets and buses, without using its
code. docs/robustness.md lists the attacks and the required behaviour.

    attack.py [--bin DIR] [--seed N] [--links tcp,rtu,...] [--only TEXT]... [--minutes M] [--jobs N]
    attack.py --list

Prints the seed, one line per finished try, and a table of the attacks. Exit status: 0 nothing was
broken, 1 something was, 2 usage error.
"""

import argparse
import concurrent.futures
import contextlib
import json
import multiprocessing
import os
import pathlib
import random
import signal
import sys
import tempfile
import threading
import time
import traceback

# Servers, client of the status socket and service manager are those of the daemon's tests.
sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "integration" / "daemon"))

# ruff: noqa: E402
import attacks_daemon  # noqa: F401
import attacks_link  # noqa: F401
import attacks_read_back  # noqa: F401
import attacks_sensors  # noqa: F401
import rig as rig_module
from registry import ALL

DEFAULT_BIN = os.environ.get("THERMOCOMP_BIN", "build/release/bin")
HEAD = ("attack", "on", "tries", "step um", "may um", "|value|", "bound", "ended", "rows lost",
        "of", "cmds lost", "unfed s", "wait s", "verdict")
LAYOUT = "{:36} {:7} {:>5} {:>8} {:>7} {:>8} {:>6} {:>5} {:>9} {:>6} {:>9} {:>7} {:>6}  {}"


def run_one(name, link, seed, programs, keep):
    """Runs one try in this process and prints its result."""
    attack = ALL[name]
    result = None
    rig = rig_module.Rig(programs, link, seed, **attack.choices)
    try:
        try:
            attack.run(rig)
        except Exception:  # noqa: BLE001  whatever it was, the daemon is judged all the same
            rig.broke("the attack itself failed: " + traceback.format_exc().splitlines()[-1])
            traceback.print_exc()
        result = rig.judge()
    finally:
        rig.close(keep)
        if keep:
            print(f"kept: {rig.folder}", file=sys.stderr)
    rig_module.print_result(result)


forking = multiprocessing.get_context("fork")
one_bus = threading.Lock()  # all CAN tries share two interfaces


def run_in_group(name, link, seed, given, output):
    """In the child: its own process group, its output in a file, no signal handler of the parent."""
    os.setsid()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for target in (1, 2):
        os.dup2(output.fileno(), target)
    sys.stdout, sys.stderr = (open(target, "w", buffering=1, closefd=False) for target in (1, 2))
    run_one(name, link, seed, given.bin, given.keep)


def start_try(name, link, seed, given):
    """Result of a try in a child process, with all its processes ended. Forked: a guest needs seconds to start
    Python."""
    limit_s = ALL[name].limit_s + 4 * rig_module.PATIENCE_S
    with tempfile.TemporaryFile("w+") as output:
        child = forking.Process(target=run_in_group, args=(name, link, seed, given, output))
        child.start()
        child.join(limit_s)
        late = f"not done after {limit_s:.0f} s" if child.is_alive() else ""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.join()
        output.seek(0)
        lines = output.read().splitlines()
    results = [line for line in lines if line.startswith("RESULT ")]
    said = "\n".join(line for line in lines if line not in results)
    if late or not results:
        tail = [late] if late else lines[-1:] or ["no output"]
        return failed_try("the attack itself failed: " + tail[0]), said
    return json.loads(results[-1][len("RESULT "):]), said


def failed_try(why):
    return {"step_um": 0.0, "allowed_um": 0.0, "beyond": 0, "value_um": 0.0, "writes": 0,
            "tries": 1, "bound_um": 0.0, "ended": 0, "rows": 0, "rows_lost": 0,
            "commands_lost": 0, "unfed_s": 0.0, "wait_s": 0.0, "broken": [why]}


class Table:
    def __init__(self):
        self.rows = {}

    def add(self, name, link, result):
        row = self.rows.setdefault((name, link), result)
        if row is result:
            return
        if result["step_um"] - result["allowed_um"] > row["step_um"] - row["allowed_um"]:
            row["step_um"], row["allowed_um"] = result["step_um"], result["allowed_um"]
        for key in ("value_um", "bound_um", "unfed_s", "wait_s"):
            row[key] = max(row[key], result[key])
        for key in ("tries", "beyond", "writes", "ended", "rows", "rows_lost", "commands_lost"):
            row[key] += result[key]
        if result["broken"] and not row["broken"]:
            row["seed"] = result["seed"]
        row["broken"] += [what for what in result["broken"] if what not in row["broken"]]

    def line(self, name, link, row):
        return LAYOUT.format(
            name, link, row["tries"], f"{row['step_um']:.3f}", f"{row['allowed_um']:.3f}",
            f"{row['value_um']:.2f}", f"{row['bound_um']:g}", row["ended"], row["rows_lost"],
            row["rows"], row["commands_lost"], f"{row['unfed_s']:.1f}", f"{row['wait_s']:.1f}",
            "BROKEN: " + "; ".join(row["broken"]) if row["broken"] else
            "held when repeated: " + "; ".join(row["once"]) if row.get("once") else "held")

    def print(self):
        print("\n" + LAYOUT.format(*HEAD))
        for (name, link), row in sorted(self.rows.items()):
            print(self.line(name, link, row))
        rows = self.rows.values()
        broken = sum(bool(row["broken"]) for row in rows)
        for text, count in (
                ("attacks", len(self.rows)), ("tries", sum(row["tries"] for row in rows)),
                ("writes", sum(row["writes"] for row in rows)),
                ("writes_that_leap", sum(row["beyond"] for row in rows)),
                ("processes_ended", sum(row["ended"] for row in rows)),
                ("committed_rows_lost", sum(row["rows_lost"] for row in rows)),
                ("commands_lost", sum(row["commands_lost"] for row in rows)),
                ("attacks_broken_once", sum(bool(row.get("once")) for row in rows)),
                ("attacks_broken", broken)):
            print(text, count)
        return broken


def wanted_tries(given):
    chosen = [(name, link) for name, attack in ALL.items() for link in attack.links
              if link in given.links and
              (not given.only or any(text in name for text in given.only))]
    if not chosen:
        sys.exit("attack.py: no attack has this name on these links (--list)")
    return chosen


def run_all(given):
    table = Table()
    chooser = random.Random(given.seed)
    tries = wanted_tries(given)
    end = time.monotonic() + 60.0 * given.minutes
    signal.signal(signal.SIGTERM, lambda *_: stopped_early(table))
    with concurrent.futures.ThreadPoolExecutor(given.jobs) as pool:
        first = True
        while first or time.monotonic() < end:
            # Long ones first, then in random order.
            chooser.shuffle(tries)
            tries.sort(key=lambda each: -ALL[each[0]].limit_s)
            jobs = {}
            for name, link in tries:
                seed = given.seed if given.exact else chooser.randrange(1 << 30)
                jobs[pool.submit(run_try, name, link, seed, first, end, given)] = (name, link)
            for job in concurrent.futures.as_completed(jobs):
                if job.result() is not None:
                    table.add(*jobs[job], job.result())
            first = False
    if given.repeat:
        repeat_broken(table, given)
    return table.print()


def repeat_broken(table, given):
    """An attack that failed in parallel with others must fail again on an idle machine."""
    for (name, link), row in table.rows.items():
        if not row["broken"]:
            continue
        again = [run_try(name, link, row["seed"], True, 0.0, given) for _ in range(given.repeat)]
        if not any(result["broken"] for result in again):
            row["once"], row["broken"] = row["broken"], []
            for key in ("beyond", "ended", "rows_lost", "commands_lost"):
                row[key] = 0


def stopped_early(table):
    """Interrupted: print the results so far."""
    table.print()
    print("stopped before the end", flush=True)
    os._exit(1)


def run_try(name, link, seed, first, end, given):
    """Tries every attack once, then further ones until the time is over."""
    if not first and time.monotonic() > end:
        return None
    with one_bus if link.startswith("can") else contextlib.nullcontext():
        began = time.monotonic()
        result, output = start_try(name, link, seed, given)
    result["seed"] = seed
    verdict = "held" if not result["broken"] else "BROKEN: " + "; ".join(result["broken"])
    print(f"{name} ({link}), seed {seed}, {time.monotonic() - began:.0f} s: {verdict}", flush=True)
    if result["broken"]:
        print(f"  again: {sys.argv[0]} --bin {given.bin} --links {link} --only '{name}' "
              f"--exact --seed {seed}", flush=True)
    if given.verbose:
        print(output, flush=True)
    return result


def read_options():
    options = argparse.ArgumentParser(description=__doc__,
                                      formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--bin", default=DEFAULT_BIN, help="folder of the programs")
    options.add_argument("--seed", type=int, default=None, help="of all choices; default: drawn")
    options.add_argument("--exact", action="store_true", help="each try has just this seed")
    options.add_argument("--links", default="tcp,rtu,bridge,piezo")
    options.add_argument("--only", action="append", help="attacks with this in their name")
    options.add_argument("--minutes", type=float, default=0.0,
                         help="each attack once, then again and again for so long")
    options.add_argument("--jobs", type=int, default=max(2, os.cpu_count() or 2))
    options.add_argument("--repeat", type=int, default=0, metavar="N",
                         help="what broke is tried N times more, alone, and counts if it breaks again")
    options.add_argument("--list", action="store_true")
    options.add_argument("--keep", action="store_true", help="leaves the files of each try")
    options.add_argument("--verbose", action="store_true", help="print the output of each try")
    given = options.parse_args()
    given.links = given.links.split(",")
    given.seed = random.SystemRandom().randrange(1 << 30) if given.seed is None else given.seed
    return given


def main():
    given = read_options()
    if given.list:
        for name, attack in ALL.items():
            print(f"{name:36} {','.join(attack.links)}")
        return 0
    if not (pathlib.Path(given.bin) / "thermocompd").exists():
        print(f"attack.py: there is no {given.bin}/thermocompd", file=sys.stderr)
        return 2
    print(f"seed {given.seed}", flush=True)
    return 1 if run_all(given) else 0


if __name__ == "__main__":
    sys.exit(main())
