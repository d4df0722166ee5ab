"""The disk with history and state fills up: compensation continues, the operator is informed,
committed rows stay, and everything resumes once there is space."""

import contextlib
import os
import sqlite3
import subprocess
import time

import pytest

from lab import assert_replays_exactly, eventually, read_columns, run_tool
from plain_devices import Machine, assert_slewed


class SmallDisk:
    """A tmpfs of a few megabytes."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir()
        done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", str(folder)],
                              capture_output=True, text=True)
        self.mounted = done.returncode == 0
        self.why_not = done.stderr.strip()
        self.ballast = folder / "ballast"

    def fill(self):
        """To the last byte."""
        with open(self.ballast, "ab", buffering=0) as ballast:
            for size in (1 << 16, 1 << 12, 1):
                with contextlib.suppress(OSError):
                    while True:
                        ballast.write(bytes(size))

    def make_room(self):
        self.ballast.unlink()

    def close(self):
        if self.mounted:
            subprocess.run(["umount", "-l", str(self.folder)], check=True)


@pytest.fixture
def disk(lab):
    if os.geteuid() != 0:
        pytest.skip("only root can mount a small disk")
    small = lab.also_end(SmallDisk(lab.folder / "disk"))
    if not small.mounted:
        pytest.skip("no disk can be mounted here: " + small.why_not)
    return small


@pytest.fixture
def machine(lab, disk):
    machine = Machine(lab)
    daemon = machine.daemon
    daemon.history = disk.folder / "history.db"
    daemon.state = disk.folder / "state.json"
    daemon.write_config(machine.config)
    return machine


def chunks(history):
    with contextlib.closing(sqlite3.connect(f"file:{history}?mode=ro", uri=True)) as base:
        return set(base.execute("SELECT id, segment, number, through_cycle, records FROM chunk"))


def fill_until_noticed(disk, daemon):
    """The database's log may still have space in its own blocks."""
    def noticed():
        disk.fill()
        return not daemon.status()["history"]["working"]
    eventually(noticed, "the full disk is noticed")


def wait_for_history(daemon):
    # Retried after growing pauses of at most a minute.
    eventually(lambda: daemon.status()["history"]["working"], "history goes on", 90.0)
    daemon.committed()


def test_a_full_disk_stops_the_history_and_nothing_else(machine, disk, lab):
    daemon = machine.start()
    machine.warm_by(6.0)
    daemon.wait_for_offset(6.0, 0.05)
    daemon.committed()
    fill_until_noticed(disk, daemon)
    before = chunks(daemon.history)

    machine.warm_by(14.0)
    daemon.wait_for_offset(14.0, 0.05)
    eventually(lambda: abs(machine.controller.applied_um() - 14.0) < 0.05, "applied")
    status, reported, _ = daemon.cli("status")
    assert status == 0  # the machine is compensated
    assert "disk is full" in reported
    assert any("disk is full" in warning for warning in daemon.status()["warnings"])
    assert "disk is full" in daemon.log_text()
    assert before <= chunks(daemon.history)

    disk.make_room()
    wait_for_history(daemon)
    history = daemon.status()["history"]
    assert history["lost_records"] == 0  # all records were kept in memory
    assert history["last_error"] == ""
    eventually(lambda: "history: written again after" in daemon.log_text(), "it is reported")
    assert before <= chunks(daemon.history)
    daemon.end()
    columns = assert_replays_exactly(daemon.history, lab.folder / "out.csv")
    times = columns["time_s"]
    assert max(later - earlier for earlier, later in zip(times, times[1:])) < 5.0
    assert_slewed(machine.controller.orders())


def test_a_switch_that_cannot_be_saved_is_not_called_done(machine, disk):
    daemon = machine.start()
    fill_until_noticed(disk, daemon)
    status, _, output = daemon.cli("disable")
    assert status == 2 and "not saved" in output, output
    daemon.wait_for_mode("disabled")  # it was carried out nevertheless
    disk.make_room()
    assert daemon.cli("disable")[0] == 0
    daemon.kill()
    daemon.start()
    assert daemon.status()["mode"] == "disabled"


def test_a_daemon_restarted_on_a_full_disk_compensates_and_reports_the_gap(
        machine, disk, lab):
    daemon = machine.start()
    machine.warm_by(6.0)
    daemon.wait_for_offset(6.0, 0.05)
    daemon.committed()
    fill_until_noticed(disk, daemon)
    before = chunks(daemon.history)
    time.sleep(1.0)  # records now in memory are lost with the process
    daemon.kill()
    machine.warm_by(9.0)
    machine.start()
    assert daemon.status()["inputs"][0]["reference_degC"] == 20.0
    daemon.wait_for_offset(9.0, 0.05)
    assert not daemon.status()["history"]["working"]
    disk.make_room()
    wait_for_history(daemon)
    assert before <= chunks(daemon.history)
    daemon.end()

    assert before <= chunks(daemon.history)
    assert_replays_exactly(daemon.history, lab.folder / "out.csv")
    run = lab.folder / "run.csv"
    status, _, output = run_tool("export", daemon.history, "-o", run)
    assert status == 0 and "1 gap" in output, output
    reported = [line for line in run.read_text().splitlines() if line.startswith("# nothing")]
    assert len(reported) == 1 and "nothing is recorded from" in reported[0], reported
    times = read_columns(run)["time_s"]
    assert max(later - earlier for earlier, later in zip(times, times[1:])) > 1.0
    assert_slewed(machine.controller.orders())
