"""Many reloads with active clients; THERMOCOMP_RELOAD_SHARE=6 in the environment makes it a long run."""

import os

import pytest

from reload_rounds import ReloadRounds
from service_manager import WATCHDOG_S

ROUNDS = {1: 8, 100: 150, 1000: 150}
SHARE = float(os.environ.get("THERMOCOMP_RELOAD_SHARE", "1"))


@pytest.mark.parametrize("rate_hz", ROUNDS)
def test_reloads_with_clients_complete(lab, rate_hz):
    rounds = ReloadRounds(lab, rate_hz)
    rounds.run(max(3, round(SHARE * ROUNDS[rate_hz])))
    rounds.print_figures()
    assert rounds.wrong == []
    assert rounds.gap_s < 0.75 * WATCHDOG_S
    assert max(rounds.answers_s) < 1.5
