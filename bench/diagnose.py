"""Times `thermocomp diagnose` beside diagnose_numpy.py, plain and tuned, on the data of
diagnose_data.py. All must weigh and find the same: anything else is an error."""

import json
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile

import diagnose_data

HERE = pathlib.Path(__file__).resolve().parent
os.environ["OPENBLAS_NUM_THREADS"] = "1"  # of numpy; else a second one waits, and counts
ROUNDS = 21
HIDDEN = ("missing_heat_source", "s0_rpm")
AGREEMENT = 1e-6
# Not timed: little heat and wrong coefficients, which are reckoned with in all that is weighed.
DOUBTFUL = {"heat_um_per_rpm": 0.001, "coefficient_sd": 0.3}


def cpu_s(command, folder):
    """User and system time of one run: others may use this machine too."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, done.stdout


def blas():
    """The library that multiplies numpy's matrices: Debian has several behind one name."""
    code = ("import numpy; print(*{line.split()[-1] for line in open('/proc/self/maps') "
            "if 'blas' in line})")
    done = subprocess.run(["/usr/bin/python3", "-c", code], capture_output=True, text=True,
                          check=True)
    return " ".join(sorted(pathlib.Path(path).name for path in done.stdout.split()))


def pairs_of_finding(finding, other):
    pairs = []
    if finding["cause"] == "missing_heat_source":
        parameters = finding["parameters"]
        pairs += [(parameters["tau_s"], other["shape"]), (parameters["power"], other["power"]),
                  (parameters["gain_um_per_unit"]["z_um"], other["gains"][0])]
    if finding["test_rms_um"]:
        pairs += [(finding["test_rms_um"]["z_um"][key], other["test_rms_um"][key])
                  for key in ("before", "after", "reduction")]
    return pairs


def difference(ours, numpy):
    """Largest difference of anything weighed (2 ln L, shares of left-out rows), of the findings'
    parameters and of the test rows, relative to 1 or to their size; infinite when other hypotheses
    came into question. Intervals and probabilities are not compared: the peer has none of the
    draws, of the blocks' scatter and of the calibration that they come from."""
    name = lambda each: (each.get("round"), each["cause"], each["subject"])
    for names in (lambda a: [name(w) for w in a["weighed"]],
                  lambda a: [name(f) for f in a["findings"]]):
        if names(ours) != names(numpy):
            return float("inf")
    pairs = [(a[key], b[key]) for a, b in zip(ours["weighed"], numpy["weighed"])
             for key in ("score", "left_out_gain", "log_left")]
    for finding, other in zip(ours["findings"], numpy["findings"]):
        pairs += pairs_of_finding(finding, other)
    pairs += [(ours[part]["z_um"][key], value) for part in ("baseline", "extended")
              for key, value in numpy[part].items()]
    pairs.append((ours["unexplained_fraction"]["z_um"], numpy["unexplained_fraction"]))
    return max(abs(a - b) / max(1.0, abs(a)) for a, b in pairs)


def commands_of(program, folder):
    answer = str(pathlib.Path(folder) / "answer.json")
    numpy = ["/usr/bin/python3", str(HERE / "diagnose_numpy.py"), folder]
    return {"diagnose": [program, "diagnose", "--model", "model.toml", "--weighed", "--train",
                         "train.csv", "--test", "test.csv", "--json", answer],
            "numpy": [*numpy, "--plain"], "numpy_tuned": numpy}


def compared(folder, said):
    """The answer of the plain peer, and how far both peers' are from the program's: said, what
    each command printed. All must be the same."""
    ours = json.loads((pathlib.Path(folder) / "answer.json").read_text())
    answers = {name: json.loads(said[name]) for name in ("numpy", "numpy_tuned")}
    for name, answer in answers.items():
        if not difference(ours, answer) <= AGREEMENT:
            raise SystemExit(f"diagnose and {name} do not make the same search: largest difference "
                             f"{difference(ours, answer):.1e}, at most {AGREEMENT:.0e} is allowed")
    return answers["numpy"], max(difference(ours, answer) for answer in answers.values())


def compare_doubtful(program):
    with tempfile.TemporaryDirectory() as folder:
        diagnose_data.write(folder, **DOUBTFUL)
        said = {name: cpu_s(command, folder)[1]
                for name, command in commands_of(program, folder).items()}
        numpy, apart = compared(folder, said)
    if not numpy["coefficients_doubted"]:
        raise SystemExit("the coefficients of the second day are not doubted")
    return apart


def main(program):
    print(f"numpy multiplies with {blas()}", file=sys.stderr)
    with tempfile.TemporaryDirectory() as folder:
        diagnose_data.write(folder)
        commands = {**commands_of(program, folder),
                    "diagnose_start": [program, "diagnose", "--help"],
                    "numpy_start": ["/usr/bin/python3", "-c", "import json, tomllib, numpy"]}
        taken, said = {name: [] for name in commands}, {}
        for _ in range(ROUNDS):
            for name, command in commands.items():
                seconds, said[name] = cpu_s(command, folder)
                taken[name].append(seconds)
        numpy, apart = compared(folder, said)
    if [(f["cause"], f["subject"]) for f in numpy["findings"]] != [HIDDEN]:
        raise SystemExit("not found what was hidden: " + json.dumps(numpy["findings"]))
    print(f"largest_difference {max(apart, compare_doubtful(program)):.1e} ratio")
    median = {name: statistics.median(values) for name, values in taken.items()}
    for name in ("diagnose_start", "numpy_start"):
        print(f"{name}_seconds {median[name]:.3f} s")
    for name in ("diagnose", "numpy", "numpy_tuned"):
        print(f"{name}_seconds {median[name]:.3f} s")
    work = median["diagnose"] - median["diagnose_start"]
    for name, said_as in (("numpy_tuned", "tuned_numpy"), ("numpy", "numpy")):
        work_of_numpy = median[name] - median["numpy_start"]
        print(f"without_start_over_{said_as} {work / work_of_numpy:.4f} ratio")
        print(f"time_over_{said_as} {median['diagnose'] / median[name]:.4f} ratio")


if __name__ == "__main__":
    main(os.path.abspath(sys.argv[1]))
