"""A block without a good sensor: estimated from the other, reported, kept over a restart, replayed."""

import pytest

from lab import assert_replays_exactly, eventually, run_tool
from plain_devices import MODEL, Machine, assert_slewed

# The spindle follows the column; a year's drift is invisible in this test.
COVARIANCE = "[covariance]\nmatrix_K2 = [[4.0, 3.9], [3.9, 4.0]]\ndrift_time_s = 3e7\n"
SHARE = 3.9 / 4.0004  # of the column's change, noise_K included
BROKEN_degC = 320.0


@pytest.fixture
def machine(lab):
    made = Machine(lab)
    made.model.write_text(MODEL + COVARIANCE)
    return made


def offset_um(column_K, spindle_K):
    return -(3.0 * column_K - 1.5 * spindle_K)


def wait_for_reasons(daemon, *reasons):
    return eventually(lambda: (lambda s: s["reasons"] == list(reasons) and s)(daemon.status()),
                      "reasons " + ", ".join(reasons))


def lose_the_spindle(machine):
    machine.module.show(20.0, BROKEN_degC)
    wait_for_reasons(machine.daemon, "block_estimated")
    machine.module.show(22.0, BROKEN_degC)
    machine.daemon.wait_for_offset(offset_um(2.0, 2.0 * SHARE), 0.02)


def test_a_lost_block_is_estimated_reported_and_replayed(machine, lab):
    daemon = machine.start()
    lose_the_spindle(machine)
    status, out, _ = daemon.cli("status")
    assert status == 0
    assert "block spindle is estimated from 1 other, +-0.03 K" in out
    assert "z +-0.04 um" in out
    assert "block spindle is estimated" in daemon.cli("sensors")[1]
    column, spindle = daemon.status()["inputs"]
    assert column["good"] and not column["estimated"] and column["sd_K"] == 0.0
    assert spindle["estimated"] and not spindle["good"]
    assert spindle["temp_degC"] == pytest.approx(20.0 + 2.0 * SHARE, abs=0.01)
    assert "input spindle_degC: lost, estimated from the others" in daemon.log_text()

    machine.module.show(22.0, 21.0)
    wait_for_reasons(daemon)
    daemon.wait_for_offset(offset_um(2.0, 1.0), 0.02)
    assert daemon.axis()["offset_sd"] == 0.0
    assert "input spindle_degC: measured again" in daemon.log_text()
    assert_slewed(machine.controller.orders())
    daemon.end()
    assert_replays_exactly(daemon.history, lab.folder / "out.csv")


def test_after_a_restart_the_estimate_continues_until_it_is_too_uncertain(machine):
    daemon = machine.start()
    lose_the_spindle(machine)
    daemon.end()
    daemon.start().wait_for_mode("compensating")
    status = wait_for_reasons(daemon, "block_estimated")
    daemon.wait_for_offset(offset_um(2.0, 2.0 * SHARE), 0.02)
    sd_um = status["axes"][0]["offset_sd"]
    assert sd_um > 0.5  # unknown time of absence: the whole drift

    daemon.write_config(machine.config.replace(
        "[compensation]\n", f"[compensation]\noffset_sd_um_max = {0.5 * sd_um}\n"))
    assert daemon.cli("reload")[0] == 0
    wait_for_reasons(daemon, "block_lost")
    status, out, _ = daemon.cli("status")
    assert status == 1 and "too uncertain" in out
    held = daemon.axis()["offset"]
    machine.module.show(24.0, BROKEN_degC)
    eventually(lambda: daemon.status()["inputs"][0]["temp_degC"] == 24.0, "the warm column")
    assert daemon.axis()["offset"] == held


def test_the_covariance_of_a_history_is_put_into_the_model_file(machine, lab):
    machine.model.write_text("# mine\n" + MODEL)
    daemon = machine.start()
    for i in range(40):
        machine.module.show(20.0 + i % 7, 20.0 + 0.5 * (i % 7))
        eventually(lambda: daemon.status()["inputs"][0]["temp_degC"] == 20.0 + i % 7, "a value")
    daemon.end()
    status, _, output = run_tool("covariance", "--model", machine.model, daemon.history, "-o",
                               machine.model)
    assert status == 0, output
    assert "spindle_degC" in output
    text = machine.model.read_text()
    assert text.startswith("# mine\n" + MODEL) and "[covariance]" in text
    assert daemon.cli("check", daemon.config)[0] == 0
    daemon.start().wait_for_mode("compensating")
    machine.module.show(20.0, BROKEN_degC)
    wait_for_reasons(daemon, "block_estimated")


def test_a_record_with_too_little_data_is_refused(machine, lab):
    run = lab.folder / "run.csv"
    run.write_text("time_s,column_degC\n0,20\n15,21\n")
    status, _, output = run_tool("covariance", "--model", machine.model, run, "-o", "-")
    assert status == 2 and "spindle_degC" in output
    run.write_text("time_s,column_degC,spindle_degC\n0,20,20\n15,21,21\n")
    status, _, output = run_tool("covariance", "--model", machine.model, run, "-o", "-")
    assert status == 2 and "at least" in output
