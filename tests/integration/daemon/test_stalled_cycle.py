"""A cycle that stalls longer than anyone waits for it: the answers given to an operator then are
true, also after a restart."""

import json
import threading
import time

import pytest

from lab import Refused, assert_replays_exactly, eventually
from plain_devices import MODEL, Machine, assert_slewed
from stall import Stall

@pytest.fixture
def stall(lab):
    return Stall(lab.folder / "stall")


@pytest.fixture
def machine(lab, stall):
    machine = Machine(lab)
    machine.daemon.environment = stall.environment
    return machine


def saved(daemon):
    return json.loads(daemon.state.read_text())


def asked(daemon, method):
    """The daemon's result, or the text of its refusal."""
    try:
        return daemon.call(method)
    except Refused as refusal:
        return str(refusal)


def test_a_reload_that_is_not_taken_in_time_never_happens(machine, stall, lab):
    daemon = machine.start()
    machine.warm_by(6.0)
    daemon.wait_for_offset(6.0, 0.05)
    before = daemon.status()["model"]["checksum"]
    machine.model.write_text(MODEL.replace("3.0,", "1.5,"))
    with stall:
        output = asked(daemon, "reload")
        assert "does not answer" in output and "withdrawn" in output, output
    # The old model still compensates, and is shown.
    assert daemon.status()["model"]["checksum"] == before
    machine.warm_by(9.0)
    daemon.wait_for_offset(9.0, 0.05)
    assert saved(daemon)["enabled"] is True
    # Later commands work as usual.
    assert asked(daemon, "disable") == {"done": True}
    assert daemon.status()["mode"] == "disabled" and saved(daemon)["enabled"] is False
    assert asked(daemon, "enable") == {"done": True}
    assert asked(daemon, "reload")["done"] is True
    assert daemon.status()["model"]["checksum"] != before
    daemon.wait_for_offset(4.5, 0.05)
    assert_slewed(machine.controller.orders(), 7.0)
    daemon.end()
    assert_replays_exactly(daemon.history, lab.folder / "out.csv")


def test_a_disable_after_a_late_reload_survives_a_restart(machine, stall):
    daemon = machine.start()
    machine.warm_by(6.0)
    daemon.wait_for_offset(6.0, 0.05)
    with stall:
        asked(daemon, "reload")
    answer = asked(daemon, "disable")
    eventually(lambda: machine.controller.applied_um() == 0.0 or answer != {"done": True},
               "the offset is taken back")
    was_disabled = daemon.status()["mode"] == "disabled"
    daemon.kill()
    daemon.start()
    assert answer == {"done": True} and was_disabled
    daemon.wait_for_mode("disabled")


def test_others_are_answered_during_a_reload_and_a_second_reload_is_refused(machine, stall):
    daemon = machine.start()
    answers = []
    with stall:
        waiting = threading.Thread(target=lambda: answers.append(asked(daemon, "reload")))
        waiting.start()
        time.sleep(0.3)
        took_s = []
        for _ in range(20):
            begun = time.monotonic()
            daemon.status()
            took_s.append(time.monotonic() - begun)
        print(f"slowest status beside a waiting reload: {1000 * max(took_s):.1f} ms")
        assert max(took_s) < 1.0
        assert "a reload is in progress" in asked(daemon, "reload")
        with pytest.raises(Refused, match="a reload is in progress"):
            daemon.call("measured", axis="z", value_um=1.0)
        waiting.join(10)
    assert len(answers) == 1 and "withdrawn" in answers[0]
    assert asked(daemon, "reload")["done"] is True
