"""Operator's commands to a running daemon, and its reactions."""

import time

import pytest

from lab import Refused, assert_replays_exactly, eventually
from plain_devices import MODEL, assert_slewed


CLAIMS = """[made_from]
runs = ["monday.csv", "tuesday.csv"]
within_one_run = false
rows = 1000.0
hours = 10.0
columns = ["column_degC", "spindle_degC"]
low = [10.0, 10.0]
high = [30.0, 30.0]
tau_s = [0.0]
mean = [20.0, 20.0, 0.0, 0.0]
covariance = [[99.0, 0.0, 0.0, 0.0], [0.0, 99.0, 0.0, 0.0], [0.0, 0.0, 99.0, 0.0], [0.0, 0.0, 0.0, 99.0]]
distance_max = 3.0
[made_from.output.z_um]
remainder_rms_um = 1.0
noise_um = 0.3
noise_time_s = 600.0
left_out_rms_um = 1.5
no_model_rms_um = 10.0
freedom = 30.0
"""


def end_and_replay(machine, lab):
    machine.daemon.end()
    assert_replays_exactly(machine.daemon.history, lab.folder / "out.csv")


def test_a_broken_configuration_is_not_taken_over(machine):
    daemon = machine.start()
    machine.warm_by(5.0)
    daemon.wait_for_offset(5.0, 0.05)
    good = daemon.config.read_text()
    line = 1 + good.splitlines().index("rate_um_per_s_max = 8.0")
    daemon.config.write_text(good.replace("rate_um_per_s_max = 8.0", "rate_um_per_s_max = -8.0"))
    status, _, output = daemon.cli("reload")
    assert status == 1 and f"thermocompd.toml:{line}: " in output, (status, output)
    assert "rate_um_per_s_max" in output and "nothing was taken" in output, output
    daemon.hang_up()
    eventually(lambda: f"thermocompd.toml:{line}: " in daemon.log_text(), "the log says why")
    assert daemon.status()["mode"] == "compensating"
    machine.warm_by(7.0)
    daemon.wait_for_offset(7.0, 0.05)


def test_another_bus_is_reported_to_need_a_restart(machine):
    daemon = machine.start()
    text = daemon.config.read_text()
    daemon.config.write_text(text.replace(f"port = {machine.module.port}", "port = 1"))
    status, _, output = daemon.cli("reload")
    assert status == 1 and "restart" in output and "cabinet" in output, output
    assert daemon.status()["mode"] == "compensating"


def test_a_command_is_noted_with_whom_it_is_for(machine):
    daemon = machine.start()
    daemon.call("disable", **{"for": "maria"})
    daemon.call("enable")
    events = [each for each in daemon.call("events")["events"] if each["kind"] == "command"]
    assert [each.get("for") for each in events] == ["maria", None]
    assert " for maria\n" in daemon.cli("events")[1]
    for name in ("m" * 65, 7, "maria\ndaemon stopped"):
        with pytest.raises(Refused, match="params.for must be a printable name"):
            daemon.call("disable", **{"for": name})
    assert daemon.status()["enabled"]


def test_the_switch_at_the_controller_works_without_a_terminal(machine):
    daemon = machine.start()
    machine.warm_by(6.0)
    daemon.wait_for_offset(6.0, 0.05)
    machine.controller.switch_compensation_off(True)
    assert "controller_disabled" in daemon.wait_for_mode("disabled")["reasons"]
    eventually(lambda: machine.controller.applied_um() == 0.0, "the offset is gone")
    machine.controller.switch_compensation_off(False)
    daemon.wait_for_mode("compensating")
    daemon.wait_for_offset(6.0, 0.05)
    assert_slewed(machine.controller.orders())


def test_only_a_latched_axis_is_released(machine):
    """What follows from a release: the attacks with a false read-back."""
    daemon = machine.start()
    status, _, output = daemon.cli("release", "z")
    assert status == 1 and "no latched mismatch" in output
    with pytest.raises(Refused, match="nosuch"):
        daemon.call("release", axis="nosuch")


def test_a_measured_displacement_that_cannot_be_is_refused(machine):
    """The bound is 60 um; the model claims no error and expects no remainder."""
    daemon = machine.start()
    for value_um in (900.0, -900.0, 60.5, 1e9):
        with pytest.raises(Refused, match="value refused: .*Check axis, sign"):
            daemon.call("measured", axis="z", value_um=value_um)
    status, _, output = daemon.cli("measured", "z", "60.5")
    assert status == 2 and "60.0 um" in output, output
    assert daemon.axis()["measured"] is None
    daemon.call("measured", axis="z", value_um=-59.0)
    assert daemon.axis()["measured"] == -59.0


def test_a_value_beyond_the_claimed_error_needs_confirmation(machine, lab):
    """The model claims 1.5 um: a remainder of 12 um is a factor-of-ten mistake, 2 um are its error."""
    machine.model.write_text(MODEL + CLAIMS)
    daemon = machine.start()
    status, _, output = daemon.cli("measured", "z", "12", "--source", "part")
    assert status == 1 and "not confirmed, value refused: +12 um" in output, output
    assert "a tenth of it would fit" in output and "--confirm" in output, output
    assert daemon.axis()["measured"] is None
    assert daemon.cli("measured", "z", "2", "--source", "part")[0] == 0
    assert daemon.axis()["measured"] == 2.0
    assert daemon.cli("measured", "z", "12", "--source", "part", "--confirm")[0] == 0
    assert daemon.axis()["measured"] == 12.0
    end_and_replay(machine, lab)


def test_a_part_from_before_the_start_is_refused(machine, lab):
    daemon = machine.start()
    status, _, output = daemon.cli("measured", "z", "1.5", "--source", "part", "--ago", "100")
    assert status == 1 and "state 100 min ago is unknown" in output, output
    assert daemon.axis()["measured"] is None
    with pytest.raises(Refused, match="params.confirm must be true or false"):
        daemon.call("measured", axis="z", value_um=1.5, confirm=1)
    end_and_replay(machine, lab)


def test_a_second_daemon_on_the_same_socket_is_refused(machine, lab):
    daemon = machine.start()
    second = lab.daemon(machine.config, "second")
    second.start(wait=False)
    assert second.process.wait(30) == 1
    output = [line for line in second.log_text().splitlines() if line.startswith("thermocompd: ")]
    assert len(output) == 1 and str(daemon.socket) in output[0], second.log_text()
    assert daemon.status()["mode"] == "compensating"
    time.sleep(0.1)
    assert daemon.cli("status")[0] == 0
