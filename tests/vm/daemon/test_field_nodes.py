"""thermocompd between simulated CANopen and J1939 nodes on vcan0 and vcan1, with faults, reboots
and duplicates of the nodes. The tests wait for each state and assume no times."""

import pathlib
import threading

import pytest

import rig as rigs
from lab import PATIENCE_S, Lab, eventually

pytestmark = pytest.mark.skipif(not pathlib.Path("/sys/class/net/vcan1").exists(),
                                reason="there is no vcan1 (tests/vm/run_with_can.sh makes one)")

TEMPS_DEGC = {"front": 25.0, "back": 30.0, "polled": 30.0, "single": 25.0, "packets": 30.0}
CANOPEN, J1939 = ("front", "back", "polled"), ("single", "packets")
NAME, OTHER_NAME = 0x00FF001234567890, 0x00FF001234567891

MODEL = """
format = 1
inputs = ["all_degC"]
outputs = ["z_um"]
reference = [20.0]
matrix_um_per_K = [[1.0]]
"""
CONFIG = f"""
format = 1
@STATE@
[loop]
rate_hz = 50
[model]
file = "model.toml"
[[bus]]
name = "modules"
kind = "canopen"
interface = "vcan0"
own_node = 127
sdo_timeout_s = 2.0
heartbeat_s = 0.5
[[device]]
name = "cantrans"
bus = "modules"
node = 5
heartbeat_s = 0.2
heartbeat_timeout_s = 2.0
emergency = "jumo_cantrans"
read_mappings = [1]
type = "int16"
scale = 0.1
[[device.write]]
index = 0x6110
sub = 1
type = "uint16"
value = 1
[[sensor]]
name = "front"
device = "cantrans"
index = 0x7130
sub = 1
emergency_channel = 1
[[sensor]]
name = "back"
device = "cantrans"
index = 0x7130
sub = 2
emergency_channel = 2
[[sensor]]
name = "polled"
device = "cantrans"
index = 0x7130
sub = 2
poll_s = 0.2
emergency_channel = 2
[[bus]]
name = "vehicle"
kind = "j1939"
interface = "vcan1"
[[device]]
name = "axtc"
bus = "vehicle"
j1939_name = "0x{NAME:016X}"
length_bits = 16
scale = 0.03125
offset_degC = -273.0
error_means = "open_circuit"
[[sensor]]
name = "single"
device = "axtc"
pgn = 0xFF10
start_byte = 3
[[sensor]]
name = "packets"
device = "axtc"
pgn = 0xFF11
start_byte = 21
[screening]
settle_s = 0.0
stale_after_s = 3.0
rate_allowance_K = 100.0
[[block]]
name = "all"
input = "all_degC"
sensors = ["front", "back", "polled", "single", "packets"]
[controller]
name = "cnc"
kind = "dry_run"
[[axis]]
name = "z"
output = "z_um"
offset_um_max = 100.0
rate_um_per_s_max = 100.0
[history]
@HISTORY@
"""


def canopen_machine():
    return ('format = 1\n[[canopen_node]]\nname = "cantrans"\ninterface = "vcan0"\nnode = 5\n'
            'cob_id = 0x195\nperiod_s = 0.05\n'
            '[[canopen_node.channel]]\ncolumn = "front_degC"\n'
            '[[canopen_node.channel]]\ncolumn = "back_degC"\n')


def j1939_machine(open_circuit=None, address=0x80):
    """`open_circuit`: the channel that shows the error code."""
    return ('format = 1\n[[j1939_node]]\nname = "axtc"\ninterface = "vcan1"\n'
            f'address = {address}\nj1939_name = {NAME}\n'
            '[[j1939_node.channel]]\ncolumn = "front_degC"\npgn = 0xFF10\nstart_byte = 3\n'
            '[[j1939_node.channel]]\ncolumn = "back_degC"\npgn = 0xFF11\nstart_byte = 21\n' +
            (f'[[j1939_node.event]]\nkind = "open_circuit"\nchannel = {open_circuit}\n'
             if open_circuit else ""))


class Watch:
    """Polls the sensors continually: a reading without a fault is the right temperature."""

    def __init__(self, daemon):
        self.daemon = daemon
        self.wrong = []
        self.looks = 0
        self.ended = False
        self.ending = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        while not self.ending.wait(0.05):
            for sensor in self.daemon.call("sensors")["sensors"]:
                for value in (sensor["raw_degC"], sensor["smoothed_degC"]):
                    if value is not None and abs(value - TEMPS_DEGC[sensor["name"]]) > 0.06:
                        self.wrong.append(sensor)
            self.looks += 1
        self.ended = True

    def close(self):
        self.ending.set()
        self.thread.join(60)


class Nodes:
    def __init__(self, lab):
        self.lab = lab
        self.started = 0
        (lab.folder / "model.toml").write_text(MODEL)
        (lab.folder / "run.csv").write_text(
            "time_s,front_degC,back_degC\n0,25.0,30.0\n1,25.0,30.0\n")
        self.running = {}
        self.switch_on("canopen", canopen_machine())
        self.switch_on("j1939", j1939_machine())
        self.daemon = lab.daemon(CONFIG).start()

    def start(self, text):
        self.started += 1
        folder = self.lab.folder / f"sim{self.started}"
        folder.mkdir()
        return self.lab.also_end(rigs.Simulated(folder, text, self.lab.folder / "run.csv"))

    def switch_on(self, name, text):
        self.running[name] = self.start(text)

    def switch_off(self, name):
        self.stop(self.running.pop(name))

    @staticmethod
    def stop(simulated):
        simulated.process.kill()
        simulated.process.wait(PATIENCE_S)

    def again(self, name, text):
        self.switch_off(name)
        self.switch_on(name, text)

    def faults(self):
        return {each["name"]: each["fault"] for each in self.daemon.call("sensors")["sensors"]}

    def become(self, sensors, fault, what):
        eventually(lambda: all(self.faults()[name] == fault for name in sensors), what)

    def unit(self, bus):
        buses = self.daemon.status()["buses"]
        return next(each for each in buses if each["name"] == bus)["units"][0]

    def expect_text(self, bus, text):
        eventually(lambda: text in self.unit(bus)["last_error"],
                   f"{bus} says {text}, not {self.unit(bus)['last_error']}")


@pytest.fixture(scope="module")
def nodes(tmp_path_factory):
    lab = Lab(tmp_path_factory.mktemp("nodes"))
    try:
        made = Nodes(lab)
        made.become(TEMPS_DEGC, "none", "all are read")
        watch = lab.also_end(Watch(made.daemon))
        yield made
        watch.close()
        assert watch.ended and watch.looks > 0 and watch.wrong == []
        print(f"nodes: {watch.looks} looks at the sensors, none wrong")
    finally:
        lab.end()


def test_a_rebooted_node_is_set_up_again(nodes):
    before = nodes.unit("modules")["requests"]
    nodes.switch_off("canopen")
    nodes.become(CANOPEN, "no_answer", "a node that is off has no temperature")
    nodes.expect_text("modules", "no ")  # heartbeat, or answer to a request
    nodes.switch_on("canopen", canopen_machine())
    nodes.become(CANOPEN, "none", "it is read again")
    assert nodes.unit("modules")["requests"] > before


def test_a_second_node_of_the_same_number_is_noticed(nodes):
    double = nodes.start(canopen_machine())
    nodes.become(CANOPEN, "device_error", "its values are ambiguous")
    nodes.expect_text("modules", "two nodes answer as node 5")
    nodes.stop(double)
    nodes.become(CANOPEN, "none", "one of them is gone")


def test_j1939_error_code_silence_and_another_address(nodes):
    nodes.again("j1939", j1939_machine(open_circuit=1))
    nodes.become(("single",), "open_circuit", "the standard's error code")
    nodes.become(("packets",), "none", "the other channel is well")
    nodes.again("j1939", j1939_machine())  # a fault that is not renewed remains
    nodes.become(J1939, "none", "it is well again")
    nodes.switch_off("j1939")
    nodes.become(J1939, "stale", "nothing is renewed")
    nodes.switch_on("j1939", j1939_machine(address=0x90))
    nodes.become(J1939, "none", "it is known by its NAME")


def test_frames_of_python_can(nodes):
    can = pytest.importorskip("can")
    nodes.switch_off("j1939")
    nodes.become(J1939, "stale", "nothing is left of another address")
    nodes.switch_on("j1939", j1939_machine())
    nodes.become(J1939, "none", "it is at its old address")
    with can.Bus(interface="socketcan", channel="vcan0") as bus:
        bus.send(can.Message(arbitration_id=0x085, is_extended_id=False,
                             data=[0x30, 0x50, 0x01, 0x01, 0x01, 0, 0, 0]))
        nodes.become(("front",), "open_circuit", "an emergency message")
        bus.send(can.Message(arbitration_id=0x085, is_extended_id=False,
                             data=[0, 0, 0, 0x01, 0, 0, 0, 0]))
        nodes.become(("front",), "none", "its reset")
    with can.Bus(interface="socketcan", channel="vcan1") as bus:
        bus.send(can.Message(arbitration_id=0x18EEFF80, is_extended_id=True,
                             data=list(OTHER_NAME.to_bytes(8, "little"))))
        nodes.become(J1939, "no_answer", "somebody else claims the address")
        nodes.expect_text("vehicle", f"address 0x80 was claimed by 0x{OTHER_NAME:016X}")
        bus.send(can.Message(arbitration_id=0x18EAFFFE, is_extended_id=True,
                             data=[0x00, 0xEE, 0x00]))
        bus.send(can.Message(arbitration_id=0x18EEFFFE, is_extended_id=True,
                             data=list(OTHER_NAME.to_bytes(8, "little"))))
        nodes.become(J1939, "none", "the module defends it, the other gives it up")
