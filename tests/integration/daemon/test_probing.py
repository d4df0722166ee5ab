"""Displacements measured at the tool correct the running daemon's model; machining cycles determine
when the offset may change."""

import json
import time

import pytest

from lab import assert_replays_exactly, eventually, read_columns, run_tool
from plain_devices import assert_slewed

STEP_UM = 2.5
CORRECTION = f"""
[correction]
form = "recursive"
gain_sd = 1.0
step_um_max = {STEP_UM}
[[correction.group]]
inputs = ["column_degC"]
[[correction.group]]
inputs = ["spindle_degC"]
"""
CYCLE_SIGNAL = """[[controller.signal]]
name = "cycle_end_on"
table = "discrete_input"
address = 1
"""


def with_config(machine, edit):
    machine.daemon.write_config(edit(machine.config))
    return machine


def gain(daemon):
    return daemon.axis()["correction"]["gains"][0]["gain"]


def test_a_probing_moves_the_estimate_by_a_bounded_step_and_is_replayed(machine, lab):
    with_config(machine, lambda text: text.replace("[history]", CORRECTION + "[history]"))
    daemon = machine.start()
    machine.warm_by(12.0)  # -12 um by the model
    daemon.wait_for_offset(12.0, 0.05)
    before = daemon.axis()["displacement"]
    assert gain(daemon) == 1.0 and daemon.axis()["correction"]["probing_wanted"]
    due = daemon.status()["probe_due"]
    assert due["z"] is True and due["because_um"] > 3.0, due
    assert "a probing is due: the model may be off by" in daemon.cli("status")[1]
    assert daemon.status()["warm"]["z"] == {"remaining_um": None, "minutes": None}  # too short
    # A remainder of 12.3 um: far more than one probing may change.
    status, out, errors = daemon.cli("measured", "z", "12.3")
    assert status == 0, errors
    after = eventually(lambda: daemon.axis()["displacement"] != before and
                       daemon.axis()["displacement"], "the estimate changes")
    assert 0.1 < abs(after - before) <= STEP_UM + 0.02, (before, after)
    daemon.wait_for_offset(-after, 0.05)
    taught = gain(daemon)
    assert taught != 1.0
    assert json.loads(daemon.state.read_text())["correction"]["z.gain1"] == pytest.approx(taught)
    assert_slewed(machine.controller.orders())

    daemon.end()
    daemon.start().wait_for_mode("compensating")
    assert gain(daemon) == pytest.approx(taught)
    daemon.wait_for_offset(-after, 0.05)
    daemon.end()
    assert_replays_exactly(daemon.history, lab.folder / "out.csv")
    exported = lab.folder / "run.csv"
    status, _, errors = run_tool("export", daemon.history, "-o", exported)
    assert status == 0, errors
    header, *rows = [line for line in exported.read_text().splitlines()
                     if not line.startswith("#")]
    column = header.split(",").index("z_measured_um")
    assert any(row.split(",")[column] not in ("", "nan") for row in rows)


def test_a_candidate_is_scored_promoted_and_taken_back(machine, lab):
    candidate = lab.folder / "new.toml"
    old = machine.model.read_text()
    candidate.write_text(old.replace("[[3.0, -1.5]]", "[[2.0, -1.5]]"))
    kept = lab.folder / "model.toml.before"
    with_config(machine, lambda text: text.replace('file = "model.toml"',
                                                   'file = "model.toml"\ncandidate = "new.toml"'))
    daemon = machine.start()

    def rms():
        return daemon.status()["candidate"]["rms_um"].get("z")

    machine.warm_by(12.0)  # 4 K colder: -12 um by the model, -8 by the candidate
    daemon.wait_for_offset(12.0, 0.05)
    assert daemon.cli("measured", "z", "4.0")[0] == 0
    eventually(rms, "the probing is scored")
    assert rms() == {"model": pytest.approx(4.0, abs=0.1), "candidate": pytest.approx(0, abs=0.1)}
    assert "new.toml, z leaves 0.0 of 4.0 um over 1 probing" in daemon.cli("status")[1]
    before = daemon.status()["candidate"]
    daemon.end()
    daemon.start().wait_for_mode("compensating")
    assert daemon.status()["candidate"] == before

    status, out, _ = daemon.cli("promote")
    assert status == 0 and " to +8.00 um at its slew rate" in out, out
    daemon.wait_for_offset(8.0, 0.05)
    assert machine.model.read_text() == candidate.read_text() and kept.read_text() == old
    assert "candidate" not in daemon.status()
    assert daemon.cli("promote", "--back")[0] == 0
    daemon.wait_for_offset(12.0, 0.05)
    assert machine.model.read_text() == old and kept.read_text() == candidate.read_text()

    kept.write_text("nonsense")
    assert daemon.cli("promote", "--back")[0] != 0
    assert machine.model.read_text() == old
    candidate.write_text("nonsense")
    assert daemon.cli("reload")[0] == 0
    assert "new.toml" in daemon.status()["candidate"]["problem"]
    status, _, errors = daemon.cli("promote")
    assert status != 0 and "does not run" in errors
    daemon.end()
    daemon.start().wait_for_mode("compensating")
    assert abs(daemon.axis()["offset"] - 12.0) < 0.05
    assert_slewed(machine.controller.orders())
    daemon.end()
    assert_replays_exactly(daemon.history, lab.folder / "out.csv")
    status, week, errors = run_tool("report", daemon.history, "-o", "-")
    assert status == 0, errors
    assert "new.toml, z leaves 0.0 of 4.0 um over 1 probing, better with" in week


def test_a_candidate_is_named_while_the_daemon_runs(machine, lab):
    new = lab.folder / "new.toml"
    new.write_text(machine.model.read_text().replace("[[3.0, -1.5]]", "[[2.0, -1.5]]"))
    daemon = machine.start()
    assert "candidate" not in daemon.status()
    status, out, errors = daemon.cli("candidate", new)
    assert status == 0 and "runs as the candidate" in out, errors
    assert daemon.status()["candidate"]["file"] == str(new)
    machine.warm_by(12.0)
    daemon.wait_for_offset(12.0, 0.05)
    assert daemon.cli("reload")[0] == 0
    assert daemon.status()["candidate"]["file"] == str(new)  # kept by a reload
    status, _, errors = daemon.cli("candidate", machine.model)
    assert status != 0 and "is the model in use itself" in errors, errors
    status, _, errors = daemon.cli("candidate", lab.folder / "nothing.toml")
    assert status != 0 and "does not run" in errors and "nothing.toml" in errors, errors
    assert daemon.cli("candidate", "none")[0] == 0
    assert "candidate" not in daemon.status()
    assert abs(daemon.axis()["offset"] - 12.0) < 0.05
    assert_slewed(machine.controller.orders())
    daemon.end()
    assert_replays_exactly(daemon.history, lab.folder / "out.csv")


def test_by_cycles_the_offset_changes_at_their_ends_only(machine, lab):
    def by_cycles(text):
        text = text.replace("[[axis]]", CYCLE_SIGNAL + "[[axis]]")
        return text.replace("[compensation]", '[compensation]\nupdate = "each_cycle"\n'
                            'cycle_end_signal = "cycle_end_on"')

    daemon = with_config(machine, by_cycles).start()
    machine.warm_by(9.0)
    eventually(lambda: abs(daemon.axis()["displacement"] + 9.0) < 0.05, "the model sees it")
    time.sleep(0.5)
    assert daemon.axis()["offset"] == 0.0
    assert daemon.cli("cycle-end")[0] == 0
    daemon.wait_for_offset(9.0, 0.05)
    machine.warm_by(15.0)
    eventually(lambda: abs(daemon.axis()["displacement"] + 15.0) < 0.05, "the model sees it")
    time.sleep(0.5)
    assert abs(daemon.axis()["offset"] - 9.0) < 0.05
    with machine.controller.lock:
        machine.controller.tables[2][1] = 1  # the coil rises
    daemon.wait_for_offset(15.0, 0.05)
    assert daemon.status()["cycle_ends"] == 2

    # The held value survives a restart: nothing moves before the next cycle end.
    machine.warm_by(3.0)
    daemon.end()
    daemon.start().wait_for_mode("compensating")
    time.sleep(0.5)
    assert abs(daemon.axis()["offset"] - 15.0) < 0.05
    daemon.end()
    assert_replays_exactly(daemon.history, lab.folder / "out.csv")


def test_a_model_of_zeros_refuses_no_measured_value_and_a_promoted_one_begins_its_own_account(machine):
    """`init` writes zeros and a bound of 5 um: the values of which the first model is made go beyond it."""
    zeros = machine.model.read_text().replace("[[3.0, -1.5]]", "[[0.0, 0.0]]")
    machine.model.write_text(zeros)
    daemon = machine.start()
    machine.module.show(24.0, 20.0)
    eventually(lambda: "all its coefficients are 0" in daemon.cli("status")[1], "it is said")
    for value in ("0.0", "-300.0", "300.0"):
        status, _, errors = daemon.cli("measured", "z", value)
        assert status == 0, errors
    eventually(lambda: (daemon.status()["model"]["probed_rms_um"].get("z") or 0.0) > 100.0, "it is counted")
    assert "found a displacement of 300.0 um, of which the model gave 0.0" in daemon.cli("status")[1]
    machine.model.write_text(zeros.replace("[[0.0, 0.0]]", "[[3.0, -1.5]]"))
    assert daemon.cli("reload")[0] == 0
    state = eventually(lambda: (now := daemon.status())["model"]["moves"] and now, "the model is in use")
    assert state["model"]["probed_rms_um"].get("z") is None
    assert state["compensating_s"] < state["uptime_s"] - 0.1


def test_a_new_reference_begins_a_run_in_an_export(machine, lab):
    daemon = machine.start()
    for offset_um in (6.0, 12.0):
        machine.warm_by(offset_um)
        daemon.wait_for_offset(6.0, 0.05)  # the second from the new reference on
        assert daemon.cli("measured", "z", "0.5")[0] == 0
        if offset_um == 6.0:  # at once: often within the same row of the export
            assert daemon.cli("reference", "--force")[0] == 0
            daemon.wait_for_offset(0.0, 0.05)
    daemon.end()
    exported = lab.folder / "run.csv"
    assert run_tool("export", daemon.history, "-o", exported)[0] == 0
    predicted = lab.folder / "p.csv"
    status, out, errors = run_tool("predict", "--model", machine.model, exported, "-o", predicted)
    assert status == 0, errors
    # Each stretch begins with its own first measured value.
    assert [value for value in read_columns(predicted)["z_measured_um"] if value == value] == [0.0, 0.0]
    _, _, errors = run_tool("inspect", exported)
    assert "run.csv: displacement counts anew from each reference: read as 2 runs" in errors, errors
