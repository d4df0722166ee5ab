"""A machine's first day: nothing moves before an operator's command, and a wrong reference is
refused. The real daemon with the simulated machine."""

import json
import os
import subprocess
import time

import pytest

from lab import BIN, Refused, eventually, run_tool, with_addresses_of_localhost
from plain_devices import CONFIG, MODEL, SIMULATED

# The column cools by 4 K, which requires 12 um.
WANTED_um = 12.0
REJECTS = '[[event]]\nkind = "reject"\ntarget = "cnc"\nat_s = 0.0\nduration_s = 1e9\n'


class FirstDay:
    """thermocomp-sim with module and controller; the daemon's configuration without first-start keys."""

    def __init__(self, lab):
        self.lab = lab
        run = lab.folder / "run.csv"
        run.write_text("time_s,column_degC,spindle_degC,z_um\n0,20,20,0\n1,16,20,0\n2,16,20,0\n")
        (lab.folder / "model.toml").write_text(MODEL)
        self.ports = {"sensors": 0, "cnc": 0}
        self.simulator = None

    def show(self, rows, events=""):
        """Shows these rows of the run from now on; the machine keeps its position."""
        if self.simulator is not None:
            self.simulator.end()
        ports = [word for name, port in self.ports.items() for word in ("--port", f"{name}={port}")]
        self.simulator = self.lab.simulator(
            SIMULATED + events, *ports, "--replay", self.lab.folder / "run.csv", "--rows", rows,
            "--row-period-ms", 20, "--stay")
        self.ports = self.simulator.ready["ports"]

    def daemon(self, more=""):
        config = CONFIG.format(module=self.ports["sensors"], controller=self.ports["cnc"])
        assert "enabled_at_first_start = true\n" in config
        config = config.replace("enabled_at_first_start = true\n", more)
        return self.lab.daemon(config.replace("prove_hold_s = 0.2", "prove_hold_s = 3.0"))


@pytest.fixture
def day(lab):
    return FirstDay(lab)


def column(daemon):
    return daemon.status()["inputs"][0]


def test_nothing_moves_before_an_operator_enables_it_and_the_switch_survives(day):
    day.show("0:1")
    daemon = day.daemon()
    status, out, errors = run_tool("check", daemon.config)
    assert status == 0, errors
    assert "first start: switched off until `thermocomp enable`" in out
    assert "compared: NEVER" in out
    daemon.start()
    eventually(lambda: daemon.status()["reasons"] == ["operator_disabled"] and
               daemon.axis()["driven"], "nothing but the operator is missing")
    assert daemon.status()["mode"] == "disabled" and not daemon.status()["enabled"]
    day.show("1:")  # cold now
    eventually(lambda: daemon.axis()["displacement"] == pytest.approx(-WANTED_um, abs=0.05),
               "the model sees it")
    eventually(lambda: daemon.axis()["driven"] and daemon.axis()["applied"] == 0.0,
               "the controller is back")
    reported = daemon.status()
    assert reported["axes"][0]["offset"] == 0.0 and reported["axes"][0]["applied"] == 0.0
    assert not reported["model"]["compared"]
    status, out, _ = daemon.cli("status")
    assert status == 1 and "never switched on yet -> switch it on: thermocomp enable" in out
    assert "NEVER COMPARED with measured displacement" in out
    daemon.end()
    daemon.start().wait_for_mode("disabled")  # a restart does not change this

    status, out, _ = daemon.cli("enable")
    assert status == 0 and "axis z moves from +" in out and " to +12.00 um" in out, out
    eventually(lambda: daemon.axis()["applied"] == pytest.approx(WANTED_um, abs=0.05), "applied")
    daemon.kill()
    daemon.start().wait_for_mode("compensating")
    assert daemon.cli("disable")[0] == 0
    daemon.kill()
    daemon.start().wait_for_mode("disabled")


def reference(daemon):
    """Without what speaks against another one."""
    return {key: value for key, value in daemon.status()["reference"].items() if key != "objections"}


def test_a_reference_is_refused_where_it_would_be_wrong_unless_forced(day):
    day.show("0:1")
    daemon = day.daemon().start()
    eventually(lambda: column(daemon)["rate_K_per_h"] == 0.0, "temperatures, twice")
    began_s = time.time()
    status, out, errors = daemon.cli("reference")
    assert status == 0, errors
    assert "the temperatures have been watched for" in out  # too short to detect slow warming
    reported = reference(daemon)
    assert reported["by"] == "operator" and not reported["lost"]
    assert began_s - 1.0 <= reported["wall_s"] <= time.time() + 1.0
    assert reported["temps_degC"] == {"column_degC": 20.0, "spindle_degC": 20.0}
    taken = [line for line in daemon.cli("status")[1].splitlines() if "Reference" in line]
    assert len(taken) == 1 and "by thermocomp reference, at 20.00 degC" in taken[0], taken

    # Warming or cooling, with the offsets at zero.
    day.show("1:")
    eventually(lambda: column(daemon)["temp_degC"] == 16.0, "it is cold")
    status, _, errors = daemon.cli("reference")
    assert status == 1, errors
    assert "no reference is taken: column_degC changes by -" in errors and "cooling" in errors
    assert "thermocomp reference --force" in errors and "has an offset" not in errors
    assert reference(daemon) == reported

    # With an offset too.
    assert daemon.cli("enable")[0] == 0
    daemon.wait_for_offset(WANTED_um, 0.05)
    with pytest.raises(Refused, match=r"axis z has an offset of \+1[12]\.[0-9]*: .*column_degC"):
        daemon.call("reference")
    objections = daemon.status()["reference"]["objections"]
    assert len(objections) == 2 and objections[0].startswith("axis z has an offset of +"), objections
    with pytest.raises(Refused, match="params.force must be true or false"):
        daemon.call("reference", force="yes")
    assert reference(daemon) == reported

    # While an axis is being proved.
    moving = subprocess.Popen([BIN / "thermocomp", "--socket", daemon.socket, "prove", "z", "4"],
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    eventually(lambda: daemon.axis()["proving"], "it moves")
    with pytest.raises(Refused, match="axis z is being proved: wait until it has returned"):
        daemon.call("reference")
    out, errors = moving.communicate(timeout=60)
    assert moving.returncode == 0, (out, errors)

    status, out, errors = daemon.cli("reference", "--force")
    assert status == 0 and "taken although axis z has an offset" in out, (out, errors)
    forced = reference(daemon)
    assert forced["temps_degC"]["column_degC"] == 16.0 and forced["wall_s"] > reported["wall_s"]
    daemon.wait_for_offset(0.0, 0.0)
    # Stored in the state file, also for the next start.
    daemon.kill()
    kept = json.loads(daemon.state.read_text())["reference_taken"]
    assert kept == {"by": "operator", "wall_s": forced["wall_s"]}
    daemon.start()
    eventually(lambda: column(daemon)["good"], "temperatures")
    assert reference(daemon) == forced


def test_proving_shows_progress_and_reports_read_backs(day):
    day.show("0:1")
    daemon = day.daemon().start()
    daemon.wait_for_mode("disabled")
    eventually(lambda: daemon.axis()["driven"], "the controller takes orders")
    status, out, errors = daemon.cli("prove", "z", "4")
    assert status == 0, (out, errors)
    assert "axis z: moved and came back: sent +4.00 um at the farthest, read back +4.00 um" in out
    # 3 s there, and no terminal: a line every two seconds
    assert "axis z: sent +4.00 um, read back +4.00 um\n" in errors
    eventually(lambda: not daemon.axis()["proving"] and daemon.axis()["applied"] == 0.0, "back")

    # A controller that refuses writes: its read-back does not change.
    day.show("0:1", REJECTS)

    def prove():
        answer = daemon.cli("prove", "z", "4")
        return None if "not driven" in answer[2] else answer

    status, out, errors = eventually(prove, "the controller is back")
    assert status == 1, (out, errors)
    assert "axis z: " in out and "NOT" in out and "read back +0.00 um there" in out, out


def test_a_sensor_that_jumps_counts_only_once_an_operator_accepts_it(day):
    def show_column(temp_degC):
        (day.lab.folder / "run.csv").write_text(
            f"time_s,column_degC,spindle_degC,z_um\n0,{temp_degC},20,0\n")
        day.show("0:1")

    show_column(20)
    daemon = day.daemon("enabled_at_first_start = true\n")
    daemon.config.write_text(daemon.config.read_text().replace(
        "settle_s = 0.0\n", "settle_s = 0.5\n").replace("rate_allowance_K = 100.0\n", ""))
    daemon.start().wait_for_mode("compensating")
    assert daemon.cli("accept", "column")[0] != 0  # no question
    show_column(68)  # degF
    eventually(lambda: "sensor_unconfirmed" in daemon.status()["reasons"] and
               daemon.status()["mode"] == "holding", "the jump is reported")
    before_um = daemon.axis()["offset"]
    status, out, _ = daemon.cli("status")
    assert status == 1 and "accept column" in out, out
    assert "+48" in out, out
    eventually(lambda: daemon.cli("accept", "spindle")[0] != 0, "nothing of the spindle waits")
    assert daemon.axis()["offset"] == before_um

    daemon.end()
    daemon.start()
    eventually(lambda: "sensor_unconfirmed" in daemon.status()["reasons"], "the jump outlives a restart")
    ages_s = {each["name"]: each["age_s"] for each in daemon.call("sensors")["sensors"]}
    assert ages_s["column"] is None, ages_s  # no valid reading since the start
    assert daemon.cli("accept", "column")[0] == 0
    daemon.wait_for_mode("compensating")
    assert column(daemon)["temp_degC"] == pytest.approx(68.0, abs=0.02)
    assert "sensor_unconfirmed" not in daemon.status()["reasons"]
    assert any("accept" in line for line in daemon.log_text().splitlines())


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a process its own /etc/hosts")
def test_devices_at_one_address_of_their_name_are_found(lab, machine):
    machine.daemon.write_config(machine.config.replace('host = "127.0.0.1"', 'host = "localhost"'))
    machine.daemon.wrapper = with_addresses_of_localhost(lab.folder, "::1", "127.0.0.1")
    machine.start()
    machine.warm_by(9.0)
    machine.daemon.wait_for_offset(9.0, 0.1)
