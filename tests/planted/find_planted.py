"""Every bug planted in a suite's sources must fail an assertion of it; without a bug none may fail.

    find_planted.py PROGRAM SUITE

A signal, a timeout or an unexpected exception does not count as found.
"""
import os
import re
import subprocess
import sys

from unit_bugs import SUITES

FAILED = re.compile(r"^(\S.*):(\d+): FAILED:$", re.MULTILINE)
CASE = re.compile(r"^-{20,}\n(.*?)\n(?:\s.*\n)*-{20,}\n", re.MULTILINE)


def run(program, number):
    environment = dict(os.environ, THERMOCOMP_PLANTED_BUG=str(number))
    try:
        return subprocess.run([program, "--abort"], env=environment, capture_output=True, text=True,
                              timeout=120, check=False)
    except subprocess.TimeoutExpired:
        return None


def found_by(result):
    """Name of the test case whose assertion failed, or None."""
    if result is None or result.returncode <= 0 or not FAILED.search(result.stdout):
        return None
    if "due to unexpected exception" in result.stdout or "due to a fatal error" in result.stdout:
        return None
    cases = CASE.findall(result.stdout)
    return cases[-1].strip() if cases else "an assertion"


def main():
    program, suite = sys.argv[1:3]
    missed = 0
    clean = run(program, 0)
    if clean is None or clean.returncode != 0:
        print(f"{suite} fails although no bug is planted\n{clean.stdout if clean else ''}")
        missed += 1
    for number, (name, file, _, _) in enumerate(SUITES[suite], start=1):
        result = run(program, number)
        case = found_by(result)
        missed += case is None
        ending = "no end" if result is None else f"exit status {result.returncode}"
        print(f"{name:42} {file:46} {case or 'NOT FOUND: ' + ending}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
