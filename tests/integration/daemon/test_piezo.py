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
