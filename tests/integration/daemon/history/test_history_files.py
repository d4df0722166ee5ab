"""The files of a history are removed while the daemon writes them; then kill -9."""

import contextlib
import sqlite3

import pytest

from lab import assert_replays_exactly, eventually
from plain_devices import Machine


@pytest.fixture
def machine(lab):
    return Machine(lab)


def chunks(history):
    with contextlib.closing(sqlite3.connect(f"file:{history}?mode=ro", uri=True)) as base:
        return set(base.execute("SELECT id, segment, number, through_cycle, records FROM chunk"))


@pytest.mark.parametrize("ends", (("-wal", "-shm"), ("-wal",), ("-shm",)))
@pytest.mark.parametrize("at_once", (True, False))
def test_committed_data_outlives_its_log(machine, lab, ends, at_once):
    """`at_once`: killed before the next commit can detect it."""
    if at_once:
        machine.daemon.write_config(machine.config.replace("commit_s = 0.2", "commit_s = 2.0"))
    daemon = machine.start()
    machine.warm_by(9.0)
    daemon.wait_for_offset(9.0, 0.05)
    daemon.committed()
    before = chunks(daemon.history)
    assert before
    for end in ends:
        daemon.history.with_name(daemon.history.name + end).unlink()
    if not at_once:
        eventually(lambda: daemon.status()["history"]["files_replaced"] == 1, "it is noticed")
        daemon.committed()
        history = daemon.status()["history"]
        assert history["working"] and history["lost_records"] == 0 and history["last_error"] == ""
        eventually(lambda: any("-wal" in event["what"] or "-shm" in event["what"]
                               for event in daemon.call("events")["events"]), "it is an event")
        assert "was removed, replaced or cut" in daemon.log_text()
        before = chunks(daemon.history)
    daemon.kill()
    assert before <= chunks(daemon.history)
    daemon.start().wait_for_mode("compensating")
    daemon.committed()
    assert before <= chunks(daemon.history)
    daemon.end()
    assert_replays_exactly(daemon.history, lab.folder / "out.csv")
