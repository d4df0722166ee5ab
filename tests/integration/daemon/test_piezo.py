"""A piezo amplifier instead of a controller, over Modbus TCP: voltage, approach and read-back."""

import pytest

from lab import assert_replays_exactly, eventually, free_port
from plain_devices import CONFIG, MODEL, PlainAmplifier, PlainModule

OFFSET = 'offset = { table = "holding", address = 0, encoding = "int32", scale = 0.001 }\n'
APPLIED = 'applied = { table = "input", address = 10, encoding = "int32", scale = 0.001 }\n'
VOLTS = 'offset = { table = "holding", address = 0, encoding = "uint16", scale = 0.01 }\n'
READ_BACK = 'applied = { table = "input", address = 10, encoding = "uint16", scale = 0.01 }\n'
CURVE = f"""[axis.piezo]
curve_V = {[volt for volt, _ in PlainAmplifier.CURVE]}
curve_um = {[um for _, um in PlainAmplifier.CURVE]}
settle_s = 0.1
steady_s = 0.3
"""


class PiezoMachine:
    """A module of thermocouples, an amplifier with its piezo, and a daemon."""

    def __init__(self, lab, read_back):
        self.module = lab.also_end(PlainModule(free_port()))
        self.amplifier = lab.also_end(PlainAmplifier(free_port()))
        self.module.show(20.0, 20.0)
        (lab.folder / "model.toml").write_text(MODEL)
        config = CONFIG.format(module=self.module.port, controller=self.amplifier.port)
        config = config.replace('name = "cnc"\nkind = "modbus', 'name = "cnc"\nkind = "piezo')
        config = config.replace(OFFSET, VOLTS)
        config = config.replace("offset_um_max = 60.0", "offset_um_max = 20.0")
        config = config.replace(APPLIED, (READ_BACK if read_back else "") + CURVE)
        self.daemon = lab.daemon(config)

    def warm_by(self, offset_um):
        self.module.show(20.0 - offset_um / 3.0, 20.0)

    def reaches(self, displacement_um):
        """The daemon's offset and the piezo's displacement, within one register and one omitted step."""
        self.daemon.wait_for_offset(displacement_um, 0.05)
        eventually(lambda: abs(self.amplifier.displacement_um() - displacement_um) < 0.25,
                   f"the piezo stands at {displacement_um} um")


@pytest.mark.parametrize("read_back", [False, True])
def test_every_voltage_comes_from_0_V_and_is_that_of_the_curve(lab, read_back):
    machine = PiezoMachine(lab, read_back)
    daemon = machine.daemon.start()
    daemon.wait_for_mode("compensating")
    for offset_um in (6.0, 12.0, 3.0, -9.0):  # also downwards, where the piezo would lag
        machine.warm_by(offset_um)
        machine.reaches(offset_um)
        assert not daemon.axis()["mismatch"]
    volts = machine.amplifier.all_volts()
    raised = [volt for volt in volts if volt > 0.0]
    assert len(raised) >= 4
    assert all(before == 0.0 for before, volt in zip([0.0] + volts, volts) if volt > 0.0), volts
    # Beyond the bound the voltage is that of the bound, within the curve.
    machine.warm_by(40.0)
    machine.reaches(20.0)
    assert daemon.axis()["at_bound"]
    assert max(machine.amplifier.all_volts()) <= 150.0
    daemon.committed()
    daemon.end()
    assert_replays_exactly(daemon.history, lab.folder / "out.csv")


def compensating_with_read_back(lab, warmed_K):
    machine = PiezoMachine(lab, read_back=True)
    machine.daemon.start().wait_for_mode("compensating")
    machine.warm_by(warmed_K)
    machine.reaches(warmed_K)
    return machine, machine.daemon


def test_with_read_back_a_restart_does_not_move_the_tool(lab):
    machine, daemon = compensating_with_read_back(lab, 10.0)
    before = machine.amplifier.all_volts()
    daemon.end()
    daemon.start().wait_for_mode("compensating")
    daemon.wait_for_offset(10.0, 0.2)
    machine.warm_by(4.0)
    machine.reaches(4.0)
    # Through 0 V to the new voltage, not again to the previous one.
    after = machine.amplifier.all_volts()[len(before):]
    assert len(after) == 2 and after[0] == 0.0 and 0.0 < after[1] < before[-1], (before, after)


def test_an_amplifier_that_does_not_obey_is_detected_and_written_again(lab):
    machine, daemon = compensating_with_read_back(lab, 6.0)
    eventually(lambda: abs(daemon.axis()["applied"] - 6.0) < 0.1, "applied as asked for")
    machine.amplifier.give(75.0)
    eventually(lambda: abs(daemon.axis()["applied"] + 1.3) < 0.2, "what 75 V stand for")
    eventually(lambda: daemon.axis()["mismatch"], "the mismatch is reported")
    eventually(lambda: "mismatch_latched" in daemon.status()["reasons"], "and asked to mend it")
    eventually(lambda: "axis 1 shows 75" in daemon.status()["controller"]["last_error"],
               "and what the amplifier shows")
    disobeyed = len(machine.amplifier.all_volts())
    machine.amplifier.obey()
    # Releasing needs two equal read-backs: a changing one keeps the axis latched.
    eventually(lambda: abs(daemon.axis()["applied"] - 6.0) < 0.1, "it shows the offset it received")
    assert daemon.cli("release", "z")[0] == 0
    machine.reaches(6.0)
    eventually(lambda: 0.0 in machine.amplifier.all_volts()[disobeyed:], "by way of 0 V")
    eventually(lambda: not daemon.axis()["mismatch"], "all is well again")
    machine.reaches(6.0)
