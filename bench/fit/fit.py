"""The peer of bench_fit: the same rows and normal equations, solved by numpy in batches.

    fit.py ROWS_FILE BENCH_FIT_OUTPUT

Compares the answers, prints both times and their ratio; exit status 1 if the answers differ.
"""
import itertools
import sys
import time

import numpy as np

PLACES, ROWS, TESTS, CHUNK, ROUNDS = 22, 480, 9, 4096, 3


def search(rows):
    grams = np.einsum("tri,trj->tij", rows, rows)
    total = grams.sum(axis=0)
    output = PLACES
    best = []
    for terms in range(1, 7):
        sets = np.array(list(itertools.combinations(range(PLACES), terms)))
        scores = np.zeros(len(sets))
        for begin in range(0, len(sets), CHUNK):
            part = sets[begin:begin + CHUNK]
            square = (part[:, :, None], part[:, None, :])
            for gram in grams:
                train = total - gram
                b = np.linalg.solve(train[square], train[part, output][:, :, None])[:, :, 0]
                own = np.matmul(gram[square], b[:, :, None])[:, :, 0]
                scores[begin:begin + CHUNK] += (
                    gram[output, output] - 2 * (b * gram[part, output]).sum(1) + (b * own).sum(1))
        lowest = int(scores.argmin())
        best.append((scores[lowest] / total[output, output], sets[lowest].tolist()))
    return best


def main():
    rows = np.fromfile(sys.argv[1]).reshape(TESTS, ROWS, PLACES + 1)
    ours, seconds = [], None
    with open(sys.argv[2], encoding="ascii") as answers:
        for line in answers:
            words = line.split()
            if words[0] == "best":
                ours.append((float(words[2]), [int(word) for word in words[3:]]))
            elif words[0] == "seconds":
                seconds = float(words[1])
    took = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        theirs = search(rows)
        took.append(time.perf_counter() - start)
    same = all(a[1] == b[1] and abs(a[0] - b[0]) <= 1e-8 * b[0] for a, b in zip(ours, theirs))
    for a, b in zip(ours, theirs):
        print(f"terms {len(b[1])}: {a[0]:.9e} {a[1]}, numpy {b[0]:.9e} {b[1]}")
    print(f"the same answer: {'yes' if same else 'no'}")
    print(f"seconds {seconds:.6f} s")
    print(f"numpy_seconds {min(took):.6f} s")
    print(f"time_over_numpy {seconds / min(took):.5f} ratio")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
