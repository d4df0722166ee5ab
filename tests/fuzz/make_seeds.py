#!/usr/bin/python3
"""Writes the seeds of the fuzz targets from the examples, and their dictionaries from the sources.

    tests/fuzz/make_seeds.py FOLDER [HISTORY.db]

Seeds are FOLDER/seeds/TARGET/NAME, dictionaries FOLDER/dictionaries/TARGET.dict. HISTORY.db, from
the program make_history_seed, is the seed of history_file. Inputs that found bugs are kept in git:
tests/fuzz/seeds/TARGET/found-*.
"""

import importlib
import json
import pathlib
import re
import shutil
import struct
import sys
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
FOLDER = pathlib.Path(sys.argv[1])
EXAMPLE_MODEL = ROOT / "tests/example_terms/model.toml"


def write(target, name, content):
    seed = FOLDER / "seeds" / target / name
    seed.parent.mkdir(parents=True, exist_ok=True)
    seed.write_bytes(content if isinstance(content, bytes) else content.encode())


def bare(path):
    """A TOML file without comments and empty lines, since short inputs mutate better."""
    lines = (re.sub(r"\s*#[^\"]*$", "", line) for line in path.read_text().splitlines())
    return "".join(line + "\n" for line in lines if line.strip())


def example_terms():
    """[(name, text)] for every kind of term."""
    return [(path.stem, path.read_text()) for path in sorted(EXAMPLE_MODEL.parent.glob("*.toml"))
            if path != EXAMPLE_MODEL]


def toml_seeds():
    examples = sorted((ROOT / "config/examples").glob("*.toml"))
    examples += sorted((ROOT / "config/demo").glob("*.toml"))
    models = {path: bare(path) for path in examples if "matrix_um_per_K" in path.read_text()}
    for path, text in models.items():
        write("model_file", f"{path.parent.name}_{path.name}", text)
    for path in examples:
        text = bare(path)
        name = f"{path.parent.name}_{path.name}"
        if path in models:
            continue
        if ("machine" in path.name or "nodes" in path.name) and "[model]" not in text:
            write("machine_file", name, text)
        elif "[model]" in text:
            model = path.parent / re.search(r'\[model\]\s*file = "([^"]+)"', text).group(1)
            write("daemon_config", name, text + "#### model\n" + bare(model))
    write("model_file", "reference_numbers.toml",
          'format = 1\ninputs = ["a_degC", "b_K"]\noutputs = ["z_um", "b_urad"]\n'
          "reference = [20.0, -1e-3]\nmatrix_um_per_K = [[1, -2.5e300], [0.1, 0]]\n"
          "[covariance]\nmatrix_K2 = [[4.0, 1.5], [1.5, 9.0]]\n")
    write("model_file", "names_escaped.toml",
          'format = 1\ninputs = ["\\u00e4 b.c_degC"]\noutputs = ["\\"z_um"]\n'
          'reference = "first_sample"\nmatrix_um_per_K = [[1.0]]\n')
    for name, term in example_terms():
        write("model_file", f"term_{name}.toml", EXAMPLE_MODEL.read_text() + term)
    write("model_file", "course.toml",
          'format = 1\ninputs = ["a_degC", "b_degC"]\noutputs = ["z_um"]\n'
          'reference = "first_sample"\nmatrix_um_per_K = [[1.0, 2.0]]\n'
          '[course]\nruns = ["day.csv"]\nbandwidth = 0.25\n'
          '[[course.group]]\ninputs = ["a_degC"]\n[[course.group]]\ninputs = ["b_degC"]\n'
          '[course.output.z_um]\nphase = ["heating", "turned", "cooling"]\n'
          'since_s = [60.0, 1e3, 2e3]\nrise_K = [[0.1, 0.3], [2.0, 1.0], [1.0, 1.0]]\n'
          'gain = [[1.1, 1.0], [1.2, 0.9], [1.2, 0.8]]\n'
          'gain_sd = [[0.1, 0.3], [0.1, 0.05], [0.1, 0.05]]\n')
    # In the daemon, with sensors and outputs of the short example.
    example = bare(ROOT / "config/examples/modbus_tcp.toml")
    for name, term in example_terms():
        if re.search("oil_degC|spindle_rpm|x_mm", term):
            continue
        model = re.sub(r"(?s)\[guideway.*?(?=^\[cov)", "", EXAMPLE_MODEL.read_text(), flags=re.M) + term
        for old, new in (("a_degC", "column_degC"), ("b_degC", "spindle_degC"), ("c_urad", "x_um")):
            model = model.replace(old, new)
        write("daemon_config", f"term_{name}.toml", example + "#### model\n" + model)
    for name, text in {"deep.toml": "a = " + "[" * 300, "dates.toml":
                       "a = 1979-05-27T07:32:00.999999-07:00\nb = 07:32:00\nc = 0xFFFFFFFFFFFFFFFF\n",
                       "dotted.toml": "a.b.c.d = 1\n[a.b]\n[[a.b.e]]\n'' = {}\n"}.items():
        for target in ("model_file", "daemon_config", "machine_file"):
            write(target, name, text)
    write("machine_file", "thousands_of_unknown_keys.toml",
          'format = 1\n[[canopen_node]]\nname = "n"\ninterface = "vcan0"\n' +
          "".join(f"k{number} = 1\n" for number in range(8000)))


def preset_seeds():
    """Each preset in a configuration of its bus, with its first two channels.

    Further keys of bus and device: tests/example_buses/PROTOCOL.toml.
    """
    for path in sorted((ROOT / "config" / "devices").glob("*.toml")):
        preset = tomllib.loads(path.read_text())
        protocol = ROOT / "tests/example_buses" / (preset["protocol"] + ".toml")
        bus, unit = protocol.read_text().removeprefix("[bus]\n").split("[device]\n")
        channels = [each["channel"] for each in preset["channel"]][:2]
        types = [each["name"] for each in preset.get("thermocouple", [])][:1]
        needed = "".join(f'thermocouple = "{each}"\n' for each in types)
        if "scale" not in preset["device"] and not types:
            needed += "scale = 0.1\n"
        text = ('format = 1\n[model]\nfile = "model.toml"\n[[bus]]\nname = "b"\n' + bus +
                '[[device]]\nname = "d"\nbus = "b"\npreset = "module"\n' + unit + needed)
        for channel in channels:
            text += f'[[sensor]]\nname = "s{channel}"\ndevice = "d"\nchannel = {channel}\n'
        names = json.dumps([f"s{channel}" for channel in channels])
        text += f'[[block]]\nname = "all"\ninput = "t_degC"\nsensors = {names}\n'
        text += '[controller]\nname = "n"\nkind = "dry_run"\n[[axis]]\nname = "z"\n'
        text += 'output = "z_um"\noffset_um_max = 60.0\nrate_um_per_s_max = 0.5\n'
        write("preset_file", path.name, bare(path) + "#### configuration\n" + text)


def run_seeds():
    write("run_file", "plain.csv", "# a comment\ntime_s,t1_degC,z_um,spindle_rpm,door_on\n"
          "0,20.0,0,0,1\n1.5,20.25,,1e3,0\n3,nan,-0.125,2000,1\n")
    write("run_file", "crlf.csv", "time_s,t1_degC\r\n0,20\r\n1,21\r\n\r\n")
    write("run_file", "selection.csv", "run.csv@0.5:2\ntime_s,a_K\n0,1\n1,2\n2,3\n")
    write("run_file", "comment_selection.csv", "#r@1:\ntime_s,a b_K\n0,1\n1,2\n")
    write("run_file", "many_problems.csv", "time_s,a_K,b\n" + "x,inf,\"y\"\n" * 120)
    write("run_file", "one_column.csv", "time_s\n-1e308\n0\n1e-320\n1e308\n")
    write("run_file", "german.csv", "\ufeffZeit;T1 [°C];z (µm)\r\n2026-03-01T08:30:00;20,51;0\r\n"
          "2026-03-01T08:30:15;20,6;1,25\r\n;;\r\n")
    write("run_file", "days.csv", "Date,T1 [C],z (mm)\n45992.5,20.5,0.001\n45992.51,20.6,0.0125\n")
    write("run_file", "date_and_clock.csv", "Datum\tUhrzeit\tT [°F]\n31.03.2026\t23:59:50\t68.5\n"
          "01.04.2026\t00:00:05\t69\n")
    write("run_file", "quoted.csv", 'sep=,\n"Timestamp","T, top [°C]",\n'
          '3/14/2026 11:59:30 AM,"20,5",\n3/14/2026 12:00:30 PM,"20,6",\n')
    write("run_file", "units_below.csv", "time;T1;n\ns;°C;rpm\n0;20,5;0\n0,5;NA;1.000\n")
    write("run_file", "unclear.csv", "Time;z;p [bar]\n03/04/2026 08:00;1,234;-\n")
    write("run_file", "wide.csv", ",".join(["time_s"] + [f"t{i}_degC" for i in range(40)]) + "\n" +
          ",".join("0" * 41) + "\n")
    tables = ROOT / "tests/unit/import"
    for path in [*tables.glob("logs/*"), *tables.glob("forms/*/in.*")]:
        write("run_file", "_".join(path.relative_to(tables).parts), path.read_bytes()[:8192])


def request(method, params=None, number=1):
    message = {"jsonrpc": "2.0", "id": number, "method": method}
    if params is not None:
        message["params"] = params
    return json.dumps(message) + "\n"


def socket_seeds():
    for method in ("status", "sensors", "offsets", "timing", "model", "reference", "enable",
                   "disable", "cycle_end", "reload", "controller_state"):
        write("socket_request", method, request(method, {}))
    write("socket_request", "measured_too_far", request("measured", {"axis": "z", "value_um": 900}))
    write("socket_request", "measured", request("measured", {"axis": "z", "value_um": -3.5}))

    # For a model that corrects itself: frequent probings, wrong and then consistent, and cycle
    # ends.
    def probing(value, number=1):
        return request("measured", {"axis": "z", "value_um": value}, number)

    write("socket_request", "probings", "".join(
        probing(value, number) + request("cycle_end", {}) + request("status", {})
        for number, value in enumerate((2.5, 3.0, 80.0, 80.5, -1e-3))))
    write("socket_request", "probing_after_reference",
          probing(9) + request("reference", {}) + probing(-9))
    write("socket_request", "measured_wrong", request("measured", {}) + probing("3") +
          probing(1e308) + probing(None) + request("measured", {"axis": 0, "value_um": 1}))
    write("socket_request", "prove", request("prove", {"axis": "z", "value_um": 5}))
    write("socket_request", "release", request("release", {"axis": "z"}))
    write("socket_request", "accept", request("accept", {"sensor": "bed"}))
    write("socket_request", "wrong_axis", request("prove", {"axis": "q", "value_um": 1e300}))
    write("socket_request", "subscribe", request("subscribe", {"methods": ["status"],
                                                               "period_s": 0.1}))
    write("socket_request", "in_pieces", b'{"jsonrpc":"2.0",\xff"id":"x",\xff"method":"timing"}'
          b'\n\xff{"jsonrpc":"2.0","method":"enable"}\r\n\n')
    write("socket_request", "half", b'{"jsonrpc":"2.0","id":1,"method":"sta')
    write("socket_request", "deep", b'{"jsonrpc":"2.0","id":1,"method":"status","params":' +
          b"[" * 3000 + b"\n")
    write("socket_request", "deep_object", b'{"a":' * 1500 + b"1" + b"}" * 1500 + b"\n")
    write("socket_request", "too_long", b'{"jsonrpc":"2.0","id":1,"method":"' + b"x" * 66000)
    write("socket_request", "kinds", b'[]\n{}\nnull\n"\xc3"\n{"jsonrpc":"2.0","id":[],"method":1}\n'
          b'{"jsonrpc":"2.0","id":1e999,"method":"status"}\n'
          b'{"jsonrpc":"2.0","id":null,"method":"status","params":[]}\n')


def gateway_seeds():
    for name, fields in {
            "page": ("GET", "/", "localhost:8420", "", "none", "", "", ""),
            "own": ("GET", "/api/status", "[::1]:8420", "http://[::1]:8420", "same-origin", "", "",
                    ""),
            "post": ("POST", "/api/command", "mill.example", "https://mill.example", "", "", "",
                     ""),
            "elsewhere": ("GET", "/api/status", "evil.example", "http://evil.example",
                          "cross-site", "", "", ""),
            "history": ("GET", "/api/history", "10.0.0.5", "", "", "-3600", "1.7e9", "600"),
            "history_wrong": ("PUT", "../x", "[::1", "null", "same-site", "nan", "-1e400", "2.5"),
    }.items():
        write("gateway_request", name, b"\xff".join(field.encode() for field in fields))


def controller_state(session=5, taking=True, applied_um=0.0, cutting=0, number=1):
    return request("controller_state", {
        "session": session, "taking": taking, "applied_um": {"z": applied_um, "y": 1.0},
        "signals": {"z_mm": 10.0, "cutting_on": cutting, "coolant_on": None}}, number).encode()


def bridge_seeds():
    pause = b"\xff"
    write("controller_state", "follows", b"".join(
        controller_state(applied_um=-0.1 * i, number=i) + pause for i in range(6)))
    write("controller_state", "cuts", controller_state() + pause + controller_state(cutting=1))
    write("controller_state", "not_ready", controller_state(taking=False) + pause +
          controller_state(applied_um=None) + pause + controller_state(applied_um=3.5))
    write("controller_state", "two_bridges", controller_state(5) + controller_state(6) +
          3 * pause + controller_state(6) + controller_state(5))
    write("controller_state", "homed_anew", controller_state(applied_um=20.0) + pause +
          controller_state(applied_um=20.0) + pause + controller_state(applied_um=0.0))
    write("controller_state", "out_of_bound", controller_state(applied_um=61.0) + pause +
          controller_state(applied_um=1e9) + controller_state(applied_um=-60.05) + pause)
    write("controller_state", "silent", controller_state() + 8 * pause + controller_state())
    write("controller_state", "wrong", controller_state(0) + controller_state(taking=1) +
          controller_state(applied_um=1e10) + request("controller_state", {}).encode())
    answer = {"jsonrpc": "2.0", "id": 7, "result": {
        "epoch": 3, "anew": False, "mode": "compensating",
        "offsets_um": {"x": -12.5, "y": None, "z": 500.0}}}
    write("bridge_answer", "offsets", json.dumps(answer))
    answer["result"]["offsets_um"] = {"x": 501.0, "z": "1"}
    write("bridge_answer", "no_offsets", json.dumps(answer))
    write("bridge_answer", "refused", json.dumps(
        {"jsonrpc": "2.0", "id": 7, "error": {"code": -32001, "message": "another bridge"}}))
    write("bridge_answer", "deep", "[" * 20)
    write("bridge_answer", "hidden_depth", '{"a":"' + "]" * 30000 + '","id":7,"result":' +
          "[" * 30000 + "]" * 30000 + "}")
    write("bridge_answer", "numbers", struct.pack("<B11d", 7, *range(10), float("nan")))


def answer_seeds():
    sensor = {"name": "bed", "bus": "cabinet", "blocks": ["bed"], "fault": "none", "raw_degC": 21.0,
              "smoothed_degC": 21.0, "age_s": 0.1, "suspected": None}
    answer = {"mode": "compensating", "mode_since_s": 65.0, "enabled": True, "reasons": ["at_bound"],
              "version": "1", "uptime_s": 70.0, "cycle": {"count": 7000, "rate_hz": 100.0},
              "axes": [{"name": "z", "unit": "um", "displacement": -3.0, "target": 3.0, "offset": 3.0,
                        "applied": None, "driven": True}],
              "inputs": [{"name": "bed_degC", "temp_degC": 22.0, "good": True}],
              "sensors": [dict(sensor, name=name) for name in ("bed", "床前", "床后", "a b", "a_b")],
              "buses": [{"name": "cabinet", "kind": "can", "connected": False, "last_error": "x"}],
              "events": [{"number": 1, "wall_s": 1.0, "kind": "command", "text": "\x1b]0;x\x07"}],
              "controller": {"online": True}, "history": {"enabled": False}, "warnings": ["w"]}
    write("daemon_answer", "all", json.dumps(answer))
    write("daemon_answer", "deep", json.dumps({"result": 0}).replace("0", "[" * 30000 + "]" * 30000))
    write("daemon_answer", "types", json.dumps({"axes": {"a": 1}, "mode": 5, "reasons": 7,
                                                "sensors": [1, None], "events": [[]]}))


def state_seeds():
    state = {"format": 1, "program": "thermocomp", "enabled": True,
             "reference_degC": {"bed_degC": 20.5, "spindle_degC": 21},
             "model_reference_degC": {"bed_degC": 20.0}, "reference_signals": {"spindle_rpm": 0},
             "offset_um": {"z": -12.25}, "temp_degC": {"bed_degC": 21.5},
             "held_degC": {"t1_degC": 24.5}, "held_signals": {"spindle_rpm": 1200.0},
             "correction": {"z.gain1": 1.125, "z.gain1_sd": 0.0625, "z.gain1_used": 1.0,
                            "z.bias_um": -0.5, "z.phase": 2}}
    write("state_file", "good", json.dumps(state, indent=2))
    write("state_file", "newer", json.dumps(dict(state, format=2)))
    write("state_file", "format_large", json.dumps(dict(state, format=1e300)))
    write("state_file", "enabled_number", json.dumps(dict(state, enabled=1)))
    write("state_file", "no_number", json.dumps(dict(state, offset_um={"z": None})))
    write("state_file", "deep", "[" * 5000)
    write("state_file", "empty", "")


def piece(wrapping, body, delay=0, halves=False):
    head = wrapping | delay << 2 | (0x80 if halves else 0)
    return bytes([head, len(body)]) + body


def modbus_seeds():
    """Line, then exchanges: kind, table, address, count - 1, pieces (see modbus_answer.cpp)."""
    framed, for_request, hang_up = 1, 2, 3
    read = bytes([0, 3, 0, 0, 1])  # two input registers
    words = bytes([4, 0, 210, 1, 4])
    bits = bytes([0, 0, 5, 0, 9])  # ten coils
    for serial in (0, 1):
        line = bytes([serial])
        name = "rtu" if serial else "tcp"

        def put(what, content):
            write("modbus_answer", f"{name}_{what}", line + content)

        put("read", read + bytes([1]) + piece(for_request, words))
        put("bits", bits + bytes([1]) + piece(for_request, bytes([2, 0x55, 0x01])))
        put("halves", read + bytes([1]) + piece(for_request, words, halves=True))
        put("wrong_length", read + bytes([1]) + piece(for_request, words[:-1]))
        put("late", (read + bytes([1]) + piece(for_request, words, delay=5)) * 2)
        put("nothing", read + bytes([0]) + read + bytes([1]) + piece(for_request, words))
        put("twice", read + bytes([2]) + piece(for_request, words) + piece(for_request, words) +
            read + bytes([0]))
        put("hang_up", read + bytes([1]) + piece(hang_up, words))
        put("exception", read + bytes([1]) + piece(framed, bytes([1, 0x84, 2])))
        put("exception_0", read + bytes([1]) + piece(framed, bytes([1, 0x84, 0])))
        put("exception_200", (read + bytes([1]) + piece(framed, bytes([1, 0x84, 200]))) * 2)
        put("other_unit", read + bytes([2]) + piece(framed, bytes([2, 4]) + words) +
            piece(for_request, words))
        put("rubbish", read + bytes([1]) + piece(0, bytes(range(60)), halves=True))
        put("write", bytes([2, 7, 0, 1]) + bytes([1]) + piece(for_request, bytes([0, 7, 0, 2])))
        put("coil", bytes([3, 7, 0, 1]) + bytes([1]) + piece(for_request, bytes([0, 7, 0xFF, 0])))
        put("longest", bytes([0, 3, 0, 0, 124]) + bytes([1]) +
            piece(for_request, bytes([250]) + bytes(250)))


def can_seeds():
    def message(kind, number, data, length=None):
        whole = 64 if kind & 64 else 8
        return (bytes([kind]) + struct.pack("<HB", number, len(data) if length is None else length) +
                data.ljust(whole, b"\0"))

    two = bytes([1, 2]) + struct.pack("<HBB", 0x100, 0, 15) + bytes([3]) + struct.pack(
        "<HBB", 0x101, 7, 31)
    write("can_frames", "frames", two + message(0, 0x100, b"\x10\x02" * 4) +
          message(0, 0x101, bytes(8)) + b"\x80" + message(1, 0x100, b"\1"))
    write("can_frames", "sets", two + message(0, 0x100, bytes([16, 2, 0, 0, 0, 0, 0, 5])) +
          message(0, 0x101, bytes([1, 0, 0, 0, 0, 0, 0, 5])) +
          message(0, 0x101, bytes([2, 0, 0, 0, 0, 0, 0, 6])) + message(0, 0x100, bytes(7)))
    errors = b"".join(message(2, kind, bytes([0, state]))
                      for kind, state in ((0x40, 0), (0x100, 0), (4, 0x30), (4, 0x0C), (4, 0x40)))
    write("can_frames", "errors", two + errors)
    write("can_frames", "stamps", two + message(16, 0x100, bytes(8)) + bytes(16) +
          message(48, 0x100, bytes(8)) + b"\xff" * 24)
    write("can_frames", "odd_sizes", two + message(8, 0x100, bytes(8), 255) + b"\x08" +
          message(4, 0x100, bytes(8)))
    far = bytes([0, 16 + 2]) + struct.pack("<HBB", 0x100, 40, 15)
    write("can_frames", "fd", far + message(64, 0x100, bytes(range(64))) +
          message(64, 0x100, bytes(12)) + message(0, 0x100, bytes(8)))
    paged = bytes([0, 32]) + struct.pack("<HBBBBB", 0x100, 8, 15, 0, 2, 3)
    write("can_frames", "pages", paged + message(0, 0x100, bytes([2] * 8)) +
          message(0, 0x100, bytes(8)))
    # kind, start, length, identifier, scale, offset, sentinels, multiplexors, bytes and the frame
    write("can_signal", "intel", bytes([2, 0, 16, 0, 1, 3, 100, 0, 0, 8]) + bytes(range(8)) +
          bytes(16))
    write("can_signal", "motorola", bytes([1, 7, 32, 0, 1, 3, 100, 0, 0, 8]) + bytes(range(24)))
    write("can_signal", "float", bytes([0x84, 0, 64, 0, 1]) + struct.pack("<dd", 0.5, -1.0) +
          bytes([1]) + struct.pack("<qB", -1, 3) + bytes([0, 8]) + struct.pack("<d", 12.5) +
          bytes(16))
    write("can_signal", "fd", bytes([34, 100, 63, 0, 1, 3, 100, 0, 0, 64]) + bytes(range(80)))
    write("can_signal", "pages", bytes([2, 8, 16, 0, 1, 3, 100, 0, 2, 0, 4, 0, 1, 2, 5, 7, 1, 1, 1,
                                        1, 1, 8]) + bytes(range(24)))
    write("modbus_registers", "int16", bytes([3, 0, 0, 120, 1]) + struct.pack("<qBH", 32767, 2, 210))
    for encoding in range(6):
        write("modbus_registers", f"encoding_{encoding}", bytes([2, encoding + 6, 9, 100, 0]) +
              struct.pack("<d", 20.5) + struct.pack("<dH", 1e9, 0xFF))
    write("modbus_registers", "any_scale", bytes([3, 0x80 + 5]) + struct.pack("<dd", 1e-300, 1e300) +
          bytes(30))


def bus_seeds():
    """Seeds of the protocol decoders, from bus_seeds/PROTOCOL.py."""
    for path in sorted((HERE / "bus_seeds").glob("*.py")):
        maker = importlib.import_module(f"bus_seeds.{path.stem}")
        for name, content in maker.seeds():
            write(f"{path.stem}_bus", name, content)


def eds_seeds():
    sheet = (ROOT / "config/examples/two_channel_module.eds").read_text()
    write("eds_file", "module.eds", sheet)
    write("eds_file", "twice.eds", sheet + "\n[1017]\nParameterName=again\n")
    write("eds_file", "orphan.eds", "[7130sub1]\nParameterName=a\nDataType=0x0003\n")
    write("eds_file", "compact.eds", "[7130]\nParameterName=PV\nObjectType=0x8\nDataType=3\n"
          "CompactSubObj=4\n[7130Name]\nNrOfEntries=1\n2=Spindle\n")
    write("eds_file", "broken.eds", "a=1\n[]\n[1017\nb\n=c\n[1017]\nDataType=017\n")


def dbc_seeds():
    write("dbc_file", "every_kind.dbc",
          (ROOT / "tests/integration/can/every_kind.dbc").read_bytes())
    write("dbc_file", "examples_can_dbc.dbc", (ROOT / "config/examples/can_dbc.dbc").read_bytes())


def history_seeds(history):
    # kind, detail, cycle, index, time, value: see chunk_codec.hpp
    records = bytes([0, 0, 0, 0, 2, 0x62, 0x34, 0x40]) + bytes([0, 0, 2, 0, 2, 0])
    write("history_chunk", "readings", bytes([0, 2, 0]) + records)
    write("history_chunk", "every_kind", bytes([0, 9, 0]) +
          b"".join(bytes([kind, 1, 2, 1, 4, 0x71, 0x3F]) for kind in range(9)))
    write("history_chunk", "inputs", bytes([1, 1]) + struct.pack("<d", 20.5) + bytes([2, 0]) +
          bytes([4, 1, 1]) + bytes(64 * 8))
    write("history_rows", "good", b"")
    for kind in range(7):
        write("history_rows", f"edit_{kind}", bytes([kind, 0, 1, 0, 2, 5, 9, 200, 0, 1, 7, 7, 7]))
    records = bytes([2, 0, 4]) + b"".join(
        struct.pack("<BBBBBB", kind, 2, 0, 2, 20, 5) for kind in (0, 1, 5, 6))
    write("history_rows", "records", records)
    for column in range(10):
        write("history_rows", f"segment_{column}", bytes([0, 0, column, 0xFF]) + b"\xff" * 7 + b"\x7f")
    if history:
        data = pathlib.Path(history).read_bytes()
        write("history_file", "good.db", data)
        write("history_file", "cut.db", data[: len(data) // 2])
        write("history_file", "header.db", data[:100])
        write("history_file", "no_history", "time_s,a_K\n0,1\n")


def dictionary(folder, name, words):
    lines = []
    for word in sorted(words):
        text = "".join(c if 32 <= ord(c) < 127 and c not in '"\\' else "\\x%02x" % ord(c)
                       for c in word)
        lines.append(f'"{text}"\n')
    (folder / f"{name}.dict").write_text("".join(lines))


def literals(*patterns):
    words = set()
    for pattern in patterns:
        for path in ROOT.glob(pattern):
            words.update(re.findall(r'"([A-Za-z_][A-Za-z_0-9]{1,40})"', path.read_text()))
    return words


def listed(path, entry):
    """Names from a list of ENTRY(name, ...)."""
    return set(re.findall(rf"\b{entry}\((\w+),", (ROOT / path).read_text()))


def dictionaries(folder):
    folder.mkdir(parents=True, exist_ok=True)
    toml = {"[[", "]]", " = ", "true", "false", "nan", "-inf", "1e300", '"""', "0x", "{ ", " }", "\n[",
            "\\u0000", "1979-05-27T07:32:00Z"}
    model = literals("config/model/model_file.cpp", "config/model/model_tables.cpp", "estimator/model/terms/*.cpp", "config/text/units.cpp")
    dictionary(folder, "model_file", toml | model)
    buses = literals("config/buses/*.cpp", "config/sections/*.cpp", "drivers/**/*_config.hpp")
    buses |= listed("drivers/sensors/bus_config.hpp", "BUS")
    dictionary(folder, "daemon_config", toml | model | {"#### model\n"} | buses |
               literals("config/daemon/daemon_config.cpp"))
    dictionary(folder, "preset_file", toml | {"#### configuration\n"} | buses)
    dictionary(folder, "machine_file", toml | buses | literals("simulator/files/*_file.cpp") |
               listed("simulator/plant/field_node_config.hpp", "NODE"))
    dictionary(folder, "dbc_file", {'BA_ "VFrameFormat" BO_ ', 'BA_DEF_ BO_ "VFrameFormat" ENUM ', "@1+",
                            "BO_ 385 NODE: 8 A\n", "BS_:", "BU_:", "CM_ ", "NS_ :", "VAL_ ", "@0-",
                            "SG_MUL_VAL_ 385 T P 0-1;", "SIG_VALTYPE_ 385 T : 1;", "4294967295",
                            ' SG_ T m1M : 0|8@1+ (1,0) [0|0] "" B\n', "1e308"})
    dictionary(folder, "eds_file", {"[7130sub1]", "[7130]", "[7130Name]", "ParameterName=", "ObjectType=0x8",
                            "DataType=0x0003", "CompactSubObj=", "0xFE", "; ", "\r\n"})
    dictionary(folder, "run_file", {"time_s", "_degC", "_um", ",", "nan", "inf", "1e308", "1e-320", "\r\n",
                            "# ", "@", ":", "-0", ";", "\t", "Zeit", "Time [s]", "Date",
                            " [°C]", " (mm)", " [µm]", "\xb0", "08:30:00", "2026-03-01T08:30:00Z",
                            "03/04/2026", "31.03.2026 23:59:50", "1,234", "1.234,5", "20,5",
                            "45992.5", "sep=;", '"', "NA", " PM", "\xef\xbb\xbf"})
    dictionary(folder, "socket_request", {'{"jsonrpc":"2.0","id":1,"method":"', '"params":{', "}\n", "\xff",
                                  "\r\n", "1e999", "null", '\\ud800'} |
               literals("daemon/methods/operator_methods.cpp", "daemon/socket/*.cpp"))
    dictionary(folder, "controller_state", {'{"jsonrpc":"2.0","id":1,"method":"controller_state",',
                                    '"params":{', "}}\n", "\xff", "1e9", "null", "true",
                                    '"z_mm"', '"cutting_on"', '"z"'} |
               literals("daemon/methods/bridge_methods.cpp"))
    dictionary(folder, "bridge_answer", {"1e308", "null", "true", '"x"'} |
               literals("linuxcnc/messages.cpp"))
    dictionary(folder, "daemon_answer", {"1e308", "null", "true", "_0x20", "\\u202e"} |
               literals("cli/observe/*.cpp", "gateway/texts/*.cpp", "gateway/feed/*.cpp"))
    dictionary(folder, "state_file", {"1e300", "null", "\\ud800", '{"'} |
               literals("daemon/state/state_file.cpp"))
    dictionary(folder, "history_file", {"SQLite format 3", "thco", "segment", "chunk", "setup", "meta"})


def main():
    shutil.rmtree(FOLDER / "seeds", ignore_errors=True)
    toml_seeds()
    preset_seeds()
    run_seeds()
    socket_seeds()
    gateway_seeds()
    answer_seeds()
    bridge_seeds()
    state_seeds()
    modbus_seeds()
    can_seeds()
    bus_seeds()
    eds_seeds()
    dbc_seeds()
    history_seeds(sys.argv[2] if len(sys.argv) > 2 else None)
    dictionaries(FOLDER / "dictionaries")


main()
