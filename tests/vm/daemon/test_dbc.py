"""thermocompd with signals by name from a DBC file; the frames are python3-canmatrix's, classic and
FD on one interface, sent by python3-can. Needs vcan0 (tests/vm/run_with_can.sh makes it)."""

import pathlib
import random
import sys

import pytest

from lab import SOURCE, eventually

sys.path.insert(0, str(SOURCE / "tests" / "integration" / "can"))
import frames_of  # noqa: E402

pytestmark = pytest.mark.skipif(not pathlib.Path("/sys/class/net/vcan0").exists(),
                                reason="there is no vcan0 (tests/vm/run_with_can.sh makes one)")

DBC = SOURCE / "tests" / "integration" / "can" / "every_kind.dbc"
STALE_AFTER_S = 1.0
# sensor: message, signal. Both byte orders, signed and not, floats, pages, nested pages, FD.
SENSORS = {"column": ("INTEL_16", "Column"), "spindle": ("INTEL_16", "Spindle"),
           "front": ("MOTOROLA_16", "Front"), "oil": ("MOTOROLA_16", "Oil"),
           "float": ("FLOATS", "IntelFloat"), "page0": ("PAGES", "P0Second"),
           "page1": ("PAGES", "P1First"), "page9": ("PAGES", "P9Float"),
           "nested": ("NESTED", "Low"), "far": ("LONG_MIXED", "B455"),
           "double": ("LONG_MIXED", "D360"), "bank7": ("LONG_PAGES", "K7B"),
           "bank200": ("LONG_PAGES", "K200B")}
CONFIG = f"""
format = 1
@STATE@
[model]
file = "model.toml"
[[bus]]
name = "body"
kind = "can"
interface = "vcan0"
dbc = "{DBC}"
[[device]]
name = "module"
bus = "body"
[screening]
settle_s = 0.0
rate_allowance_K = 1000.0
stale_after_s = {STALE_AFTER_S}
[smoothing]
form = "off"
[[block]]
name = "body"
input = "body_degC"
sensors = ["column"]
[controller]
name = "none"
kind = "dry_run"
[[axis]]
name = "z"
output = "z_um"
offset_um_max = 100.0
rate_um_per_s_max = 1.0
[history]
@HISTORY@
""" + "".join(f'[[sensor]]\nname = "{name}"\ndevice = "module"\nmessage = "{message}"\n'
              f'signal = "{signal}"\n' + ('counter = "Alive"\n' if message == "INTEL_16" else "")
              for name, (message, signal) in SENSORS.items())
MODEL = """
format = 1
inputs = ["body_degC"]
outputs = ["z_um"]
reference = [20.0]
matrix_um_per_K = [[1.0]]
"""


class Module:
    """Sends what canmatrix encodes, on every page that the sensors need."""

    def __init__(self, bus):
        self.bus = bus
        self.matrix = frames_of.load(DBC)
        self.alive = 0

    def send(self, temps_degC, counting=True):
        """Returns what each sensor then shows: its signal's nearest value."""
        self.alive += counting
        shown, frames = {}, {}
        for sensor, (message, name) in SENSORS.items():
            frame = self.matrix.frame_by_name(message)
            signal = frame.signal_by_name(name)
            raw = (temps_degC[sensor] - float(signal.offset)) / float(signal.factor)
            raw = frames_of.nearest_raw(signal, raw)
            shown[sensor] = raw * float(signal.factor) + float(signal.offset)
            pages = self.pages(frame, signal)
            raws = frames.setdefault((message, tuple(sorted(pages.items()))), dict(pages))
            raws[name] = raw
        for (message, _), raws in frames.items():
            if message == "INTEL_16":
                raws["Alive"] = self.alive % 256
            self.put(self.matrix.frame_by_name(message), raws)
        return shown

    @staticmethod
    def pages(frame, signal):
        """The multiplexors' numbers at which the frame has the signal."""
        if signal.name == "Low":
            return {"Outer": 2, "Inner": 20}
        if signal.mux_val is None:
            return {}
        muxer = next(each for each in frame.signals if each.is_multiplexer)
        return {muxer.name: signal.mux_val}

    def put(self, frame, raws):
        import can
        data = bytes(frame.signals_to_bytes(raws))
        self.bus.send(can.Message(arbitration_id=frame.arbitration_id.id, data=data,
                                  is_extended_id=bool(frame.arbitration_id.extended),
                                  is_fd=frame.size > 8))


@pytest.fixture
def module():
    import can
    with can.Bus(interface="socketcan", channel="vcan0", fd=True) as bus:
        yield Module(bus)


def start(lab):
    (lab.folder / "model.toml").write_text(MODEL)
    daemon = lab.daemon(CONFIG).start()
    eventually(lambda: daemon.status()["buses"][0]["connected"], "the bus is there")
    return daemon


def readings(daemon):
    return {each["name"]: each for each in daemon.call("sensors")["sensors"]}


def differs(daemon, shown):
    """Sensors that do not show what was sent."""
    now = readings(daemon)
    return [name for name, value in shown.items()
            if now[name]["raw_degC"] is None or abs(now[name]["raw_degC"] - value) > 1e-6]


def test_named_signals_of_every_kind_arrive_as_canmatrix_sent_them(lab, module):
    daemon = start(lab)
    chance = random.Random(11)
    for _ in range(20):
        temps = {sensor: chance.uniform(-20.0, 60.0) for sensor in SENSORS}
        shown = module.send(temps)
        eventually(lambda shown=shown: not differs(daemon, shown), f"{shown} is shown")
    assert daemon.status()["buses"][0]["units"][0]["bad_frames"] == 0
    daemon.end()


def test_a_reading_whose_counter_stands_still_grows_stale_and_comes_back(lab, module):
    daemon = start(lab)
    temps = dict.fromkeys(SENSORS, 25.0)

    def sent(counting, check):
        def send_and_look():
            module.send(temps, counting)
            return check(readings(daemon))
        return send_and_look

    eventually(sent(True, lambda now: now["column"]["fault"] == "none"), "a reading")
    temps = dict.fromkeys(SENSORS, 35.0)
    module.send(temps, counting=False)
    eventually(sent(False, lambda now: now["column"]["fault"] == "stale"), "it is stale")
    now = readings(daemon)
    assert abs(now["front"]["raw_degC"] - 35.0) < 0.1, "a message without a counter goes on"
    assert daemon.status()["buses"][0]["units"][0]["bad_frames"] == 0
    eventually(sent(True, lambda now: now["column"]["fault"] == "none" and
                    abs(now["column"]["raw_degC"] - 35.0) < 0.1), "it is back")
    daemon.end()
