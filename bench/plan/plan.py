"""Sizes of all-pairs plans compared with those of allpairspy (Debian's python3-allpairspy) for the
same sets of factors, and with the lower bound. Reads the output of bench_plan."""

import statistics
import sys

from allpairspy import AllPairs

ours, theirs, bounds = [], [], []
for line in sys.stdin:
    first, *rest = line.split()
    if first != "set":
        print(line, end="")
        continue
    name, levels, tests, bound = rest
    counts = [int(count) for count in levels.split(",")]
    other = sum(1 for _ in AllPairs([range(count) for count in counts]))
    print(f"{name:16} {tests:>4} tests, allpairspy {other:4}, at least {bound:>3}", flush=True)
    if name.startswith("random"):
        ours.append(int(tests))
        theirs.append(other)
        bounds.append(int(bound))
ratios = [mine / bound for mine, bound in zip(ours, bounds)]
print(f"random_sets_larger_than_allpairspy {sum(a > b for a, b in zip(ours, theirs))} sets")
print(f"size_over_bound_mean {statistics.mean(ratios):.3f} ratio")
print(f"size_over_allpairspy_mean "
      f"{statistics.mean(mine / other for mine, other in zip(ours, theirs)):.3f} ratio")
