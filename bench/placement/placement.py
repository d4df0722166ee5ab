"""Table of `thermocomp place` on several machines.  placement.py THERMOCOMP NAME=STRUCTURE.toml..."""
import json
import subprocess
import sys


def place(program, structure):
    run = subprocess.run([program, "place", structure, "--json"], capture_output=True, text=True,
                         check=False)
    if run.returncode != 0:
        sys.exit(f"{structure}: {run.stderr}")
    return json.loads(run.stdout)


def table(results):
    methods = ["uncompensated"] + list(next(iter(results.values()))["methods"])
    print(f"{'RMS um: used / left out':24}" + "".join(f"{name:>18}" for name in results))
    for method in methods:
        cells = []
        for result in results.values():
            figures = result[method] if method == "uncompensated" else result["methods"][method]
            cells.append(f"{figures['used']['rms_um']:9.2f} /{figures['left_out']['rms_um']:7.2f}")
        print(f"{method:24}" + "".join(cells))


def main():
    program, *machines = sys.argv[1:]
    results = {}
    for machine in machines:
        name, structure = machine.split("=", 1)
        results[name] = place(program, structure)
    table(results)
    for name, result in results.items():
        runs = [run for way in result["tendency"]["history"].values() for run in way]
        ends = sorted({run["ended"] for run in runs})
        rounds = sorted(len(run["rounds"]) for run in runs)
        print(f"{name}: {len(runs)} runs of tendency patterns, {rounds[0]} to {rounds[-1]} rounds;",
              "ended: " + "; ".join(f"{end} ({sum(run['ended'] == end for run in runs)})"
                                    for end in ends))
    for name, result in results.items():
        best = "tendency_" + result["tendency"]["best_way"]
        for method, label in ((best, "tendency"), ("greedy", "greedy"), ("centroid", "centroid")):
            figures = result["methods"][method]
            print(f"{name}_{label}_used {figures['used']['rms_um']:.3f} um")
            print(f"{name}_{label}_left_out {figures['left_out']['rms_um']:.3f} um")


main()
