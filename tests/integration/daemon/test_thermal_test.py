"""Evaluation of thermal tests from the daemon's history, with an operator's measurements at the tool."""

import contextlib
import json
import sqlite3

import pytest

from lab import BIN, eventually, read_columns, run_tool
from plain_devices import Machine

pytestmark = pytest.mark.skipif(not (BIN / "thermocomp-modelling").exists(),
                                reason="thermocomp-modelling is not in this build")

SPINDLE = """[[controller.signal]]
name = "spindle_rpm"
table = "input"
address = 20
encoding = "uint16"
"""


@pytest.fixture
def machine(lab):
    made = Machine(lab)
    made.daemon.write_config(made.config.replace("[[axis]]", SPINDLE + "[[axis]]"))
    return made


def turn(machine, rpm):
    with machine.controller.lock:
        machine.controller.tables[4][20] = rpm
    eventually(lambda: machine.daemon.status()["controller"]["signals"]["spindle_rpm"] == rpm,
               "the daemon reads the speed")


def measure(machine, value_um):
    count = len(machine.daemon.call("events")["events"])
    status, _, errors = machine.daemon.cli("measured", "z", str(value_um))
    assert status == 0, errors
    eventually(lambda: len(machine.daemon.call("events")["events"]) > count, "it is an event")
    machine.daemon.committed()


def slow_down(history, times=300):
    """Stretches the cycles, so that measurements seconds apart become minutes apart."""
    with contextlib.closing(sqlite3.connect(history)) as base:
        base.execute("UPDATE segment SET period_ns = period_ns * ?, checksum = NULL", (times,))
        base.commit()


def report(lab, *arguments):
    page, figures = lab.folder / "report.html", lab.folder / "figures.json"
    status, out, errors = run_tool("thermal-test", "report", *arguments, "--noise-um", "0.2", "-o", page,
                                 "--json", figures)
    assert status == 0, errors
    return page.read_text(), json.loads(figures.read_text()), out


def axis_of(figures, side="before"):
    axis, = figures[side]["axes"]
    return axis


def test_the_probed_values_of_a_history_are_the_figures(machine, lab):
    machine.start()
    for value_um in (0.0, 4.5, 11.75, 9.0):
        measure(machine, value_um)
    machine.daemon.end()
    slow_down(machine.daemon.history)
    page, figures, out = report(lab, machine.daemon.history, "--test", "environment")
    z = axis_of(figures)
    assert z["axis"] == "Z" and z["range_whole"]["value"] == pytest.approx(11.75)
    assert z["values"] == 4
    assert "Z moved by 11.8" in out or "Z moved by 11.7" in out
    assert "z_measured_um" in page and "nan" not in page
    # The same from its export.
    exported = lab.folder / "run.csv"
    assert run_tool("export", machine.daemon.history, "-o", exported)[0] == 0
    _, again, _ = report(lab, exported, "--test", "environment")
    assert axis_of(again)["range_whole"] == z["range_whole"]


def test_when_the_spindle_ran_is_in_the_history_too(machine, lab):
    machine.start()
    measure(machine, 0.0)
    turn(machine, 4000)
    for value_um in (2.0, 7.0, 8.5):
        measure(machine, value_um)
    turn(machine, 0)
    measure(machine, 6.0)
    machine.daemon.end()
    slow_down(machine.daemon.history)
    _, figures, _ = report(lab, machine.daemon.history, "--test", "spindle")
    z = axis_of(figures)
    assert z["range_until_end"]["value"] == pytest.approx(8.5)
    assert z["range_cooling"]["value"] == pytest.approx(2.5)


def test_two_stretches_of_one_history_are_before_and_after(machine, lab):
    machine.start()
    for value_um in (0.0, 12.0, 8.0, 1.0, 4.0, 2.0):
        measure(machine, value_um)
    machine.daemon.end()
    history = machine.daemon.history
    slow_down(history)
    exported = lab.folder / "run.csv"
    assert run_tool("export", history, "-o", exported)[0] == 0
    columns = read_columns(exported)
    until_s = next(time for time, value in zip(columns["time_s"], columns["z_measured_um"])
                   if value == 1.0)
    page, figures, _ = report(lab, f"{history}@:{until_s}", f"{history}@{until_s}:", "--test",
                              "environment")
    assert axis_of(figures)["range_whole"]["value"] == pytest.approx(12.0)
    assert axis_of(figures, "after")["range_whole"]["value"] == pytest.approx(3.0)
    assert figures["after_by_before"]["Z"]["whole"]["value"] == pytest.approx(0.25)
    assert "Before against after" in page


def test_a_history_without_probings_has_advice(machine, lab):
    machine.start()
    machine.daemon.committed()
    machine.daemon.end()
    status, _, errors = run_tool("thermal-test", "report", machine.daemon.history, "--test", "environment",
                               "-o", lab.folder / "report.html")
    assert status == 2
    assert "thermocomp measured" in errors and "z_measured_um" in errors, errors
