"""A lost or unreadable state file is not a first start if an earlier start is known: the warm
machine does not become the reference, and an operator's "off" stays."""

import contextlib
import sqlite3

import pytest

from lab import PATIENCE_S

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
