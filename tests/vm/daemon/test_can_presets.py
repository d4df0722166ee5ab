"""Every CAN, CANopen and J1939 preset with its simulated device over real frames: the right
temperature, and each code of the device as the right fault and never as a temperature.

The frames are defined independently of the presets, from the manuals: the request to a module, if
any, the identifier and the bytes of its first channel at 25.0 degC, and those of each code.
"""

import json
import os
import pathlib
import socket
import struct
import subprocess
import time
import tomllib

import pytest

import rig as rigs
from lab import Lab

BIN = pathlib.Path(os.environ["THERMOCOMP_BIN"])
DEVICES = pathlib.Path(__file__).resolve().parents[3] / "config" / "devices"
CANOPEN_BUS, CAN_BUS = "vcan0", "vcan1"
pytestmark = pytest.mark.skipif(not pathlib.Path("/sys/class/net/vcan1").exists(),
                                reason="there is no vcan1 (tests/vm/run_with_can.sh makes one)")

ROOM_DEGC = 25.0
PATIENCE_S = 120.0  # a scan takes 15 s on an idle machine
OPEN, SHORT, RANGE, ERROR = "open_circuit", "short_circuit", "out_of_range", "device_error"
FIRST_NODE, FIRST_ADDRESS = 5, 0x80
MODEL = """format = 1
inputs = ["t_degC"]
outputs = ["z_um"]
reference = [20.0]
matrix_um_per_K = [[1.0]]
"""


def read_object(index, sub):
    return struct.pack("<BHB4x", 0x40, index, sub)


def answer(index, sub, *value):
    return struct.pack("<BHB4s", 0x43 | (4 - len(value)) << 2, index, sub, bytes(value))


def status_object(number):
    return read_object(0x6150, 1), answer(0x6150, 1, number)


AI_STATUS = [("over_range", 2, RANGE), ("over_range", 3, RANGE),
             ("under_range", 4, RANGE), ("under_range", 5, RANGE)]
JUMO = [("channel_error", 1), ("channel_error", 3), ("channel_error", 5), ("over_range", 2),
        ("under_range", 4)]
# name: (required keys, request, frame data at 25 degC,
#        [(event, code, fault, request, data)])
PRESETS = {
    # TPDO 1: 25.0 degC with one decimal, then the status.
    "jumo_cantrans_t": ({"scale": 0.1}, None, bytes([250, 0, 0, 0, 0]), [
        *[(event, code, ERROR if event == "channel_error" else RANGE, None,
           bytes([250, 0, 0, 0, code])) for event, code in JUMO],
        ("open_circuit", None, OPEN, "emergency", bytes([0x30, 0x50, 1, 1, 0x01, 0, 0, 0])),
        ("short_circuit", None, SHORT, "emergency", bytes([0x30, 0x50, 1, 1, 0x02, 0, 0, 0]))]),
    "cia_404_module": ({"scale": 0.1}, read_object(0x9130, 1), answer(0x9130, 1, 250, 0, 0, 0), [
        (event, code, fault, *status_object(code))
        for event, code, fault in [("channel_error", 1, ERROR), *AI_STATUS]]),
    "esd_can_cbx_thermo": ({}, read_object(0x9130, 1), answer(0x9130, 1, 0xA8, 0x61, 0, 0), [
        (event, code, fault, *status_object(code))
        for event, code, fault in [("open_circuit", 1, OPEN), *AI_STATUS]]),
    "axiomatic_axtc4co": ({}, read_object(0x7130, 1), answer(0x7130, 1, 0xA0, 0x12), [
        ("open_circuit", -512, OPEN, read_object(0x7130, 1), answer(0x7130, 1, 0x00, 0xFE)),
        ("channel_error", -1, ERROR, read_object(0x7130, 1), answer(0x7130, 1, 0xFF, 0xFF))]),
    # PGN 65187; its other three channels are at 25 degC too: (25 + 273) / 0.03125 = 0x2540.
    "j1939_exhaust_ports": ({}, None, bytes([0x40, 0x25] * 4), [
        (event, code, fault, None, struct.pack("<H", code) + bytes([0x40, 0x25] * 3))
        for event, code, fault in [
            ("open_circuit", 0xFE00, OPEN), ("open_circuit", 0xFEFF, OPEN),
            ("channel_error", 0xFF00, ERROR), ("channel_error", 0xFFFF, ERROR),
            ("over_range", 0xFB00, RANGE), ("over_range", 0xFDFF, RANGE)]]),
    # Two status bits and 22 of (25 + 16384) / 0.0078125 = 0x200C80, twice; zeros before them.
    "css_canmod_temp": ({}, None, bytes([0, 0, 0x00, 0x32, 0x80, 0x00, 0x32, 0x80]), [
        ("channel_error", 1, ERROR, None, None), ("open_circuit", 2, OPEN, None, None),
        ("over_range", 3, RANGE, None, None)]),
    "peak_mu_thermocouple1": ({}, None, bytes([0x90, 0x01] * 4), []),
}
IDENTIFIERS = {"j1939_exhaust_ports": 0x18FEA300, "css_canmod_temp": 0x002,
               "peak_mu_thermocouple1": 0x100}
FAULTS = {"open_circuit": OPEN, "short_circuit": SHORT, "over_range": RANGE, "under_range": RANGE,
          "channel_error": ERROR}
CODE_LISTS = {"open_circuit_codes": "open_circuit", "short_circuit_codes": "short_circuit",
              "over_range_codes": "over_range", "under_range_codes": "under_range",
              "error_codes": "channel_error"}


def preset_files(*protocols):
    files = {path.stem: tomllib.loads(path.read_text()) for path in DEVICES.glob("*.toml")}
    return {name: preset for name, preset in files.items() if preset["protocol"] in protocols}


def first_channel(preset):
    return preset["channel"][0]


def test_every_preset_and_each_of_its_codes_is_tested_here():
    presets = preset_files("can", "canopen", "j1939")
    assert sorted(presets) == sorted(PRESETS)
    for name, preset in presets.items():
        channel = first_channel(preset)
        listed = {(event, code) for source in (preset["device"], channel, channel.get("status", {}))
                  for key, event in CODE_LISTS.items() for code in source.get(key, [])}
        tested = {(event, code) for event, code, *_ in PRESETS[name][3]}
        assert listed <= tested, name


def toml(head, **keys):
    return head + "\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items())


class Plan:
    """The simulated devices, their values, and the daemon's configuration."""

    def __init__(self):
        self.machine = "format = 1\n" + toml("[[bus]]", name="plain", kind="can", interface=CAN_BUS)
        self.devices = ""
        self.sensors = {}  # name: (device, channel, expected fault)
        self.units = {}    # (preset, event, code): number of the node
        for protocol in ("canopen", "j1939"):
            for name, preset in preset_files(protocol).items():
                for case in [(None, None, None), *PRESETS[name][3]]:
                    self.add_node(protocol, name, preset, *case[:3])
        for name, preset in preset_files("can").items():
            self.add_plain(name, preset)
        self.shown = {f"s{self.units[case]}_1": shown for case, shown in SHOWN.items()}

    def add_node(self, protocol, name, preset, event, code, fault):
        number = FIRST_NODE + len(self.units)
        self.units[name, event, code] = number
        where = {"interface": CANOPEN_BUS if protocol == "canopen" else CAN_BUS}
        identity = {"node" if protocol == "canopen" else "address":
                    number if protocol == "canopen" else FIRST_ADDRESS + number}
        keys = PRESETS[name][0]
        self.machine += toml(f"[[{protocol}_node]]", name=f"n{number}", preset=name,
                             period_s=0.2, **where, **identity, **keys)
        for channel in preset["channel"]:
            self.machine += toml(f"[[{protocol}_node.channel]]", column="body_degC",
                                 channel=channel["channel"])
        if event:
            named = {} if code is None else {"code": code}
            self.machine += toml(f"[[{protocol}_node.event]]", kind=event, channel=1, **named)
        self.devices += toml("[[device]]", name=f"d{number}", bus=protocol, preset=name,
                             **identity, **keys)
        for i, channel in enumerate(preset["channel"]):
            self.sensors[f"s{number}_{channel['channel']}"] = (
                f"d{number}", channel["channel"], fault if i == 0 and event else None)

    def add_plain(self, name, preset):
        """Codes on different channels, since identifiers are fixed by the manual."""
        self.machine += toml("[[device]]", name=name, bus="plain", preset=name, period_s=0.2)
        self.devices += toml("[[device]]", name=name, bus="can", preset=name)
        cases = [None, *PRESETS[name][3]]
        for i, channel in enumerate(preset["channel"]):
            number = channel["channel"]
            case = cases[i] if i < len(cases) else None
            self.machine += toml("[[channel]]", name=f"{name}{number}", device=name,
                                 column="body_degC", channel=number)
            if case:
                self.machine += toml("[[event]]", kind=case[0], target=f"{name}{number}", at_s=0.0,
                                     duration_s=1e9, code=case[1])
            self.sensors[f"{name}_{number}"] = (name, number, case[2] if case else None)
        assert len(cases) <= len(preset["channel"])

    def configuration(self, folder):
        (folder / "model.toml").write_text(MODEL)
        text = 'format = 1\n[model]\nfile = "model.toml"\n'
        for kind, interface in (("canopen", CANOPEN_BUS), ("j1939", CAN_BUS), ("can", CAN_BUS)):
            more = {"sdo_timeout_s": 5.0} if kind == "canopen" else {}
            text += toml("[[bus]]", name=kind, kind=kind, interface=interface, **more)
        text += self.devices
        text += "".join(toml("[[sensor]]", name=name, device=device, channel=channel)
                        for name, (device, channel, _) in self.sensors.items())
        text += toml("[[block]]", name="all", input="t_degC", sensors=list(self.sensors))
        text += '[controller]\nname = "none"\nkind = "dry_run"\n'
        text += toml("[[axis]]", name="z", output="z_um", offset_um_max=60.0, rate_um_per_s_max=0.5)
        path = folder / "thermocompd.toml"
        path.write_text(text)
        return path


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    lab = Lab(tmp_path_factory.mktemp("presets"))
    try:
        made = Plan()
        made.path = made.configuration(lab.folder)
        run = lab.folder / "run.csv"
        run.write_text(f"time_s,body_degC\n0,{ROOM_DEGC}\n1,{ROOM_DEGC}\n")
        lab.also_end(rigs.Simulated(lab.folder, made.machine, run))
        yield made
    finally:
        lab.end()


# Displayed raw value of a first channel: (preset, event, code): bytes, reason.
SHOWN = {
    ("jumo_cantrans_t", None, None): ("FA 00 00 00 00", ""),
    ("jumo_cantrans_t", "over_range", 2): ("FA 00 00 00 02", "its status is 0x02"),
    ("esd_can_cbx_thermo", None, None): ("A8 61 00 00, status 00", ""),
    ("esd_can_cbx_thermo", "open_circuit", 1): ("A8 61 00 00, status 01",
                                                "its status is 0x01"),
    ("axiomatic_axtc4co", "open_circuit", -512): ("00 FE", "the device's code for it"),
    ("j1939_exhaust_ports", "open_circuit", 0xFE00): ("00 FE 40 25 40 25 40 25",
                                                      'the standard\'s "error"'),
    ("j1939_exhaust_ports", "channel_error", 0xFFFF): ("FF FF 40 25 40 25 40 25",
                                                       'the standard\'s "not available"'),
}


def scan(path):
    done = subprocess.run([BIN / "thermocomp", "scan", path, "--json", "--listen", "5"],
                          capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode in (0, 1), done.stderr
    return {channel["sensor"]: channel for bus in json.loads(done.stdout)["buses"]
            for device in bus["devices"] for channel in device["channels"]}


def test_every_preset_gives_the_temperature_and_each_code_its_fault(plan):
    """A slow machine may need several scans, but no scan may show a code as a temperature."""
    missing = dict(plan.sensors)
    end = time.monotonic() + PATIENCE_S
    while missing:
        seen = scan(plan.path)
        for name, (_, _, fault) in plan.sensors.items():
            channel = seen[name]
            if fault:
                assert channel["temp_degC"] is None, (name, fault, channel)
            elif channel["temp_degC"] is not None:
                assert channel["temp_degC"] == pytest.approx(ROOM_DEGC, abs=0.05), (name, channel)
            if channel["fault"] == (fault or "none"):
                missing.pop(name, None)
                # The bytes, and the reason why they are not a temperature.
                assert channel["raw"] and bool(channel["why"]) == bool(fault), (name, channel)
                if name in plan.shown:
                    assert (channel["raw"], channel["why"]) == plan.shown[name]
        shown = {name: (fault, seen[name]) for name, (_, _, fault) in missing.items()}
        assert time.monotonic() < end, f"never shown: {shown}"


def test_the_text_for_a_person_has_the_bytes_too(plan):
    done = subprocess.run([BIN / "thermocomp", "scan", plan.path, "--bus", "j1939"],
                          capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 1, done.stderr
    line = "PGN 65187 byte 1  00 FE 40 25 40 25 40 25  -> open_circuit"
    assert line in done.stdout and 'the standard\'s "error"' in done.stdout, done.stdout


def frames(interface, sent=None):
    """Frames of an interface, with identifiers as displayed; `sent` is repeated, in case the
    first was missed."""
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as link:
        link.bind((interface,))
        link.settimeout(0.5)
        end = time.monotonic() + PATIENCE_S
        send_at = 0.0
        while time.monotonic() < end:
            if sent and time.monotonic() >= send_at:
                send_at = time.monotonic() + 0.5
                link.send(struct.pack("=IB3x8s", sent[0], len(sent[1]), sent[1]))
            try:
                identifier, size, data = struct.unpack("=IB3x8s", link.recv(16))
            except TimeoutError:
                continue
            yield identifier & 0x1FFFFFFF, data[:size]


def expect(interface, identifier, data, sent=None):
    seen = set()
    for came, bytes_ in frames(interface, sent):
        if came == identifier:
            seen.add(bytes_.hex(" "))
            if bytes_ == data:
                return
    raise AssertionError(f"0x{identifier:X}: {data.hex(' ')} never came, but {seen}")


def look_at_node(number, asked, data):
    if asked == "emergency":
        expect(CANOPEN_BUS, 0x080 + number, data)
    elif asked:
        expect(CANOPEN_BUS, 0x580 + number, data, (0x600 + number, asked))
    else:
        # A node that is not started sends no TPDOs.
        expect(CANOPEN_BUS, 0x180 + number, data, (0, bytes([1, number])))


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_the_bytes_are_where_the_manual_has_them(plan, name):
    _, asked, data, codes = PRESETS[name]
    for event, code, _, code_asked, code_data in [(None, None, None, asked, data), *codes]:
        if name in ("css_canmod_temp", "peak_mu_thermocouple1"):
            continue
        number = plan.units[name, event, code]
        if name in IDENTIFIERS:
            expect(CAN_BUS, IDENTIFIERS[name] + FIRST_ADDRESS + number, code_data)
        else:
            look_at_node(number, code_asked, code_data)
    if name == "peak_mu_thermocouple1":
        expect(CAN_BUS, 0x100, data)
        expect(CAN_BUS, 0x101, data)
    if name == "css_canmod_temp":  # channels 1 to 4: good, and the three codes
        expect(CAN_BUS, 0x002, bytes([0, 0, 0x00, 0x32, 0x80, 0x01, 0x32, 0x80]))
        expect(CAN_BUS, 0x003, bytes([0, 0, 0x02, 0x32, 0x80, 0x03, 0x32, 0x80]))
