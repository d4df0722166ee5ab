"""Error states of a real CAN interface, reported by its driver: a serial adapter on a pseudo
terminal goes to error warning, error passive and bus-off."""

import pytest

import rig as rigs
import serial_adapter
from lab import Lab, eventually
from rig import ip, set_up

pytestmark = pytest.mark.skipif(not serial_adapter.is_possible(),
                                reason="the kernel has no slcan (tests/vm/run_with_can.sh)")


class OneBusRig(rigs.Rig):
    def __init__(self, lab, adapter):
        self.lab = lab
        self.windows = []
        self.monitor = adapter
        (lab.folder / "model.toml").write_text(rigs.MODEL)
        self.daemon = lab.daemon(rigs.daemon_text(adapter.name, adapter.name)).start()
        self.daemon.wait_for_mode("compensating")


@pytest.fixture(scope="module")
def adapter(tmp_path_factory):
    lab = Lab(tmp_path_factory.mktemp("states"))
    try:
        made = lab.also_end(serial_adapter.SerialAdapter())
        ip("set", made.name, "type", "can", "bitrate", "250000")
        set_up(made.name)
        made.rig = OneBusRig(lab, made)
        yield made
        for recovery in made.rig.finish():
            print(recovery)
            assert recovery.held_um == 0.0, str(recovery)
    finally:
        lab.end()


def test_warning_and_passive_are_reported_and_change_nothing(adapter):
    rig = adapter.rig
    for letter, state in (("w", "warning"), ("p", "passive"), ("w", "warning"), ("a", "active")):
        adapter.report_state(letter)
        eventually(lambda: rig.bus("body")["state"] == state, state + " is reported")
        status = rig.daemon.status()
        assert status["mode"] == "compensating" and rig.bus("body")["connected"]
        eventually(lambda: rig.daemon.status()["controller"]["state"] == state, "so is the other's")
    assert rig.bus("body")["last_error"] == ""
    assert rig.bus("body")["error_frames"] >= 4


def bus_off(adapter):
    adapter.report_state("b")
    eventually(lambda: adapter.rig.bus("body")["state"] == "bus_off", "bus-off is reported")
    eventually(lambda: adapter.rig.daemon.status()["controller"]["state"] == "bus_off",
               "by the controller's link too")
    output = adapter.rig.daemon.cli("status")[1]
    assert "bus body: bus-off for " in output and "controller cnc: bus-off for " in output


def test_bus_off_until_the_interface_is_restarted(adapter):
    adapter.rig.outage("bus-off (slcan), down and up", "both", lambda: bus_off(adapter),
                       lambda: set_up(adapter.name), lambda: ip("set", adapter.name, "down"))
    assert adapter.rig.bus("body")["bus_offs"] == 1
    assert adapter.rig.daemon.status()["controller"]["bus_offs"] == 1


def test_cable_out_and_in(adapter):
    def cut(out):
        adapter.cut = out

    adapter.rig.outage("cable out, in (slcan)", "both", lambda: cut(True), lambda: cut(False))


def test_a_start_on_a_bus_that_is_off_is_reported(adapter):
    """Error frames do not report an earlier bus-off; the missing carrier does."""
    rig = adapter.rig
    bus_off(adapter)
    rig.daemon.end()
    rig.daemon.start()
    eventually(lambda: rig.bus("body")["state"] == "bus_off", "bus-off is reported")
    assert not rig.bus("body")["connected"]
    ip("set", adapter.name, "down")
    set_up(adapter.name)
    rig.daemon.wait_for_mode("compensating")
    eventually(lambda: rig.bus("body")["state"] == "active", "the carrier is back")
