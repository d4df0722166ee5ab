"""A lost or unreadable state file is not a first start if an earlier start is known: the warm
machine does not become the reference, and an operator's "off" stays."""

import contextlib
import sqlite3

import pytest

from lab import PATIENCE_S, Refused, eventually
from plain_devices import Machine

DAMAGE = {
    "empty": lambda file: file.write_text(""),
    "cut": lambda file: file.write_text(file.read_text()[:-20]),
    "other_json": lambda file: file.write_text("[1, 2]"),
    "newer_format": lambda file: file.write_text(file.read_text().replace('"format": 1',
                                                                          '"format": 9')),
    "binary": lambda file: file.write_bytes(bytes(range(256)) * 16),
    "zeros": lambda file: file.write_bytes(bytes(len(file.read_text()))),
    "bit": lambda file: file.write_bytes(bytes([file.read_bytes()[0] ^ 4]) +
                                         file.read_bytes()[1:]),
    "text_for_number": lambda file: file.write_text(file.read_text().replace("20.0", '"warm"')),
    "huge": lambda file: file.write_bytes(b" " * (2 << 20)),
    "folder": lambda file: (file.unlink(), file.mkdir()),
    "missing": lambda file: file.unlink(),
    "dangling_link": lambda file: (file.unlink(), file.symlink_to(file.parent / "nowhere")),
}


@pytest.fixture
def machine(lab):
    return Machine(lab)


def without_history(machine):
    own = machine.daemon.config.read_text()
    begin = own.index("[history]")
    machine.daemon.config.write_text(own[:begin] + "[history]\nenabled = false\n" +
                                     own[own.index("[socket]"):])


def references(daemon):
    return [each["reference_degC"] for each in daemon.status()["inputs"]]


def warnings(daemon):
    return "\n".join(daemon.status()["warnings"])


@pytest.mark.parametrize("damage", DAMAGE)
def test_reference_and_switch_come_from_the_history(machine, damage):
    daemon = machine.start()
    machine.warm_by(9.0)
    daemon.wait_for_offset(9.0, 0.05)
    daemon.committed()
    daemon.kill()
    DAMAGE[damage](daemon.state)
    daemon.start()
    assert references(daemon) == [20.0, 20.0]
    daemon.wait_for_offset(9.0, 0.05)
    assert "taken from the history" in warnings(daemon)
    assert daemon.cli("disable")[0] == 0
    daemon.end()
    DAMAGE[damage](daemon.state)
    daemon.start()
    daemon.wait_for_mode("disabled")
    assert references(daemon) == [20.0, 20.0]


def test_a_newer_history_is_refused_once_and_everything_stays_as_it_is(machine):
    """Return to an older program: the state file has a newer format too."""
    daemon = machine.start()
    machine.warm_by(9.0)
    daemon.wait_for_offset(9.0, 0.05)
    daemon.end()
    with contextlib.closing(sqlite3.connect(daemon.history)) as base:
        base.execute("PRAGMA user_version = 2")
    DAMAGE["newer_format"](daemon.state)
    before = {file.name: file.read_bytes() for file in (daemon.state, daemon.history)}
    daemon.start(wait=False)
    assert daemon.process.wait(PATIENCE_S) == 2
    assert "history of version 2, written by a newer thermocompd" in daemon.log_text()
    assert {name: (daemon.folder / name).read_bytes() for name in before} == before
    assert machine.controller.applied_um() == pytest.approx(9.0, abs=0.01)
    with contextlib.closing(sqlite3.connect(daemon.history)) as base:
        base.execute("PRAGMA user_version = 1")
    daemon.start()
    daemon.wait_for_offset(9.0, 0.05)
    assert "newer thermocompd wrote it (format 9" in warnings(daemon)
    assert '"format": 9' in daemon.state.with_name("state.json.format-9").read_text()


def test_a_commanded_reference_comes_from_the_history_too(machine):
    daemon = machine.start()
    machine.warm_by(9.0)
    daemon.wait_for_offset(9.0, 0.05)
    assert daemon.cli("reference", "--force")[0] == 0
    daemon.end()
    machine.warm_by(3.0)
    DAMAGE["cut"](daemon.state)
    daemon.start()
    assert references(daemon) == [17.0, 20.0]


@pytest.mark.parametrize("damage", [name for name in DAMAGE if name not in
                                    ("missing", "dangling_link")])
def test_without_a_history_it_stays_off_with_advice(machine, damage):
    without_history(machine)
    daemon = machine.start()
    machine.warm_by(9.0)
    daemon.wait_for_offset(9.0, 0.05)
    daemon.kill()
    machine.controller.force_applied_um(0.0)
    DAMAGE[damage](daemon.state)
    # Also at every later start.
    for _ in range(2):
        daemon.start()
        daemon.wait_for_mode("disabled")
        assert "thermocomp reference" in warnings(daemon)
        with pytest.raises(Refused, match="reference is lost"):
            daemon.call("enable")
        daemon.kill()
    daemon.start()
    machine.warm_by(0.0)
    eventually(lambda: daemon.status()["inputs"][0]["temp_degC"] == 20.0, "it is cold")
    assert daemon.cli("reference", "--force")[0] == 0
    assert daemon.cli("enable")[0] == 0
    assert "reference is lost" not in warnings(daemon)
    daemon.kill()
    daemon.start()
    machine.warm_by(5.0)
    daemon.wait_for_offset(5.0, 0.05)
