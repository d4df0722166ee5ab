"""kill -9 at random times; `bench/run.sh kill9` is the long version."""

import os
import time

import pytest

from kill_rounds import KillRounds

ROUNDS = int(os.environ.get("THERMOCOMP_KILL_ROUNDS", "25"))


def test_kills_at_random_moments_lose_nothing_and_the_axis_never_jumps(lab):
    seed = int(os.environ.get("THERMOCOMP_KILL_SEED", time.time_ns() % 1_000_000))
    print(f"seed {seed}: THERMOCOMP_KILL_SEED={seed} draws the same moments")
    kills = KillRounds(lab, seed)
    begun = time.monotonic()
    kills.run(ROUNDS)
    kills.print_figures(ROUNDS, time.monotonic() - begun)
    assert kills.lost == 0
    assert kills.restarts_wrong == []
    assert len(kills.rows) > ROUNDS


@pytest.mark.parametrize("controller, power_cuts", [("registers", False), ("silent", False),
                                                    ("silent", True)])
def test_without_read_back_the_axis_never_jumps_either(lab, controller, power_cuts):
    seed = int(os.environ.get("THERMOCOMP_KILL_SEED", time.time_ns() % 1_000_000))
    print(f"seed {seed}: THERMOCOMP_KILL_SEED={seed} draws the same moments")
    kills = KillRounds(lab, seed, controller, power_cuts, history=False)
    begun = time.monotonic()
    kills.run(ROUNDS // 3)
    kills.print_figures(ROUNDS // 3, time.monotonic() - begun)
    assert kills.restarts_wrong == []
