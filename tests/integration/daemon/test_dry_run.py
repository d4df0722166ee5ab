"""A dry run with real sockets: everything is read, computed and recorded, nothing is written."""

import json
import math

import pytest

from lab import Refused, assert_replays_exactly, eventually, free_port, read_columns, run_tool
from plain_devices import CONFIG, PlainAmplifier, PlainController, PlainModule
from test_piezo import APPLIED, CURVE, OFFSET, READ_BACK, VOLTS

READS = {1, 2, 3, 4}  # Modbus function codes that change nothing
# With axis position and spindle speed, which the model also needs in a dry run.
MODEL = """format = 1
inputs = ["column_degC", "spindle_degC"]
outputs = ["z_um"]
reference = "first_sample"
matrix_um_per_K = [[3.0, -1.5]]
[guideway.x_slide]
axis = "x_mm"
positions_mm = [0.0, 500.0]
rows_um_per_K.z_um = [[0.0, 1.0], [0.0, 0.0]]
[[term]]
kind = "missing_heat_source"
subject = "spindle_rpm"
tau_s = 900.0
power = 1
gain_um_per_unit = { z_um = 0.0008 }
"""
SIGNALS = """[[controller.signal]]
name = "x_mm"
table = "input"
address = 20
encoding = "uint16"
[[controller.signal]]
name = "spindle_rpm"
table = "input"
address = 21
encoding = "uint16"
[[axis]]
"""


def noting(kind):
    """A device of this kind that records the function code of every request."""

    class Noting(kind):
        def start(self):
            self.functions = getattr(self, "functions", [])  # kept over a restart
            super().start()

        def answer(self, pdu, unit=1):
            with self.lock:
                self.functions.append(pdu[0])
            return super().answer(pdu, unit)

        def asked(self):
            with self.lock:
                return list(self.functions)

    return Noting


class Machine:
    def __init__(self, lab, device=PlainController, edit=lambda text: text):
        self.module = lab.also_end(PlainModule(free_port()))
        self.controller = lab.also_end(noting(device)(free_port()))
        with self.controller.lock:
            self.controller.tables[4].update({20: 250, 21: 0})
        self.module.show(20.0, 20.0)
        (lab.folder / "model.toml").write_text(MODEL)
        text = CONFIG.format(module=self.module.port, controller=self.controller.port)
        text = text.replace("[[axis]]\n", SIGNALS)
        self.real = edit(text.replace("[compensation]\n",
                                      '[compensation]\non_stop = "ramp_to_zero"\n'))
        self.dry = self.real.replace('[controller]\n', '[controller]\ndry_run = true\n')
        self.daemon = lab.daemon(self.dry)

    def warm_by(self, offset_um):
        self.module.show(20.0 - offset_um / 3.0, 20.0)

    def dry_run_to(self, offset_um):
        self.daemon.start().wait_for_mode("dry_run")
        self.warm_by(offset_um)
        self.daemon.wait_for_offset(offset_um)
        return self.daemon


def assert_only_read(controller):
    asked = set(controller.asked())
    assert {2, 4} <= asked <= READS, sorted(asked)  # inputs of both kinds


def test_everything_is_read_and_nothing_is_written(lab):
    machine = Machine(lab)
    status, out, errors = run_tool("check", machine.daemon.config)
    assert status == 0, errors
    assert "controller cnc (modbus_tcp), DRY RUN: nothing is written to it" in out
    machine.controller.force_applied_um(3.0)  # an offset of another writer
    daemon = machine.dry_run_to(6.0)
    answered = eventually(lambda: (now := daemon.status())["controller"]["shown"]["z"] and now,
                      "what the controller applies is read")
    assert answered["dry_run"] and answered["mode"] == "dry_run" and answered["reasons"] == []
    assert answered["controller"]["shown"] == {"z": 3.0}
    assert answered["controller"]["signals"]["x_mm"] == 250.0
    assert answered["controller"]["writes"] == 0
    status, out, _ = daemon.cli("status")
    assert status == 1
    assert "Compensating    : no: DRY RUN, nothing is written" in out and "yes" not in out
    assert "applies by itself z +3.00 um" in out
    status, out, _ = daemon.cli("status", "--json")
    assert status == 1 and json.loads(out)["dry_run"]
    with pytest.raises(Refused, match="a dry run writes nothing"):
        daemon.call("prove", axis="z", value_um=3.0)
    for command in ("disable", "enable"):
        daemon.call(command)
    # The computed offset of a dry run does not count, the other writer's does.
    with pytest.raises(Refused, match="axis z has an offset of \\+3.00"):
        daemon.call("reference")
    daemon.call("reference", force=True)
    daemon.committed()
    daemon.end()
    assert_only_read(machine.controller)
    assert machine.controller.applied_um() == 3.0
    assert_replays_exactly(daemon.history, lab.folder / "out.csv")
    run = lab.folder / "run.csv"
    assert run_tool("export", daemon.history, "-o", run)[0] == 0
    columns = read_columns(run)
    assert 250.0 in columns["x_mm"] and 0.0 in columns["spindle_rpm"]
    assert max(columns["z_offset_um"]) > 5.0
    assert all(math.isnan(value) for value in columns["z_applied_um"]), "nothing was applied"


def test_a_controller_that_is_gone_is_noticed(lab):
    machine = Machine(lab)
    daemon = machine.dry_run_to(6.0)
    machine.controller.stop()
    eventually(lambda: "controller_offline" in daemon.status()["reasons"], "offline")
    machine.controller.start()
    eventually(lambda: daemon.status()["reasons"] == [], "back")
    daemon.end()
    assert_only_read(machine.controller)


def test_earlier_offsets_are_kept_and_a_real_run_writes(lab):
    machine = Machine(lab, edit=lambda text: text.replace('on_stop = "ramp_to_zero"\n', ""))
    daemon = machine.daemon
    daemon.write_config(machine.real)
    daemon.start().wait_for_mode("compensating")
    machine.warm_by(6.0)
    daemon.wait_for_offset(6.0)
    daemon.end()
    assert 16 in machine.controller.asked()  # this test detects a write
    sent_um = json.loads(daemon.state.read_text())["offset_um"]
    assert abs(sent_um["z"] - 6.0) < 0.02
    daemon.write_config(machine.dry)
    seen = len(machine.controller.asked())
    machine.dry_run_to(12.0).end()
    assert set(machine.controller.asked()[seen:]) <= READS
    assert json.loads(daemon.state.read_text())["offset_um"] == sent_um


@pytest.mark.parametrize("read_back", [False, True])
def test_a_dry_run_sends_no_voltage_to_a_piezo(lab, read_back):
    def piezo(text):
        text = text.replace('name = "cnc"\nkind = "modbus', 'name = "cnc"\nkind = "piezo')
        text = text.replace(OFFSET, VOLTS).replace("offset_um_max = 60.0", "offset_um_max = 20.0")
        return text.replace(APPLIED, (READ_BACK if read_back else "") + CURVE)

    machine = Machine(lab, PlainAmplifier, piezo)
    daemon = machine.dry_run_to(6.0)
    assert daemon.status()["reasons"] == []
    daemon.end()
    assert_only_read(machine.controller)
    assert machine.controller.all_volts() == []


def test_a_bridge_is_offered_nothing(lab):
    machine = Machine(lab)
    begin, end = machine.dry.index("[controller]"), machine.dry.index("[[controller.signal]]")
    text = (machine.dry[:begin] + '[controller]\nname = "mill"\nkind = "linuxcnc"\n'
            "dry_run = true\n" + machine.dry[end:])
    for line in ('table = "input"\naddress = 20\nencoding = "uint16"\n',
                 'table = "input"\naddress = 21\nencoding = "uint16"\n',
                 'table = "discrete_input"\naddress = 0\n', OFFSET, APPLIED):
        assert line in text
        text = text.replace(line, "")
    machine.daemon.write_config(text)
    daemon = machine.daemon.start()
    report = {"session": 1, "taking": True, "applied_um": {"z": 0.0},
              "signals": {"x_mm": 250.0, "spindle_rpm": 0.0, "compensation_off_on": 0.0}}
    answers = []

    def reported():
        answers.append(daemon.call("controller_state", **report))
        return daemon.status()["mode"] == "dry_run" and abs(daemon.axis()["offset"] - 6.0) < 0.01

    machine.warm_by(0.0)
    eventually(lambda: reported() or daemon.status()["mode"] == "dry_run", "reports are taken")
    machine.warm_by(6.0)
    eventually(reported, "the offset is computed")
    assert len(answers) > 3
    assert all(answer["offsets_um"] == {"z": None} for answer in answers)
    assert answers[-1]["mode"] == "dry_run"
    daemon.end()
