"""The measured spindle run, served to the daemon over a bus, with the required offsets.

The simulated devices show every row for a period. The daemon's offset at its end must be the
negative of the model's prediction for that row, relative to the first row, as computed by
`thermocomp predict` from the file, within the resolution of the registers."""

import csv
import dataclasses
import json
import time
import tomllib
import typing

import numpy as np

from lab import DATA, first_cycle_s, read_columns, replay, run_tool

RUN = DATA / "spindle_46h" / "hours_00_32.csv"
MODEL = DATA / "spindle_46h" / "static_model.toml"
MISSING = f"the measured spindle run is not there: {RUN}"
SENSORS = 16
AXES = 5
# Long enough for the daemon to take its reference before the second row.
FIRST_ROW_S = 3.0
# Resolution of the controller's registers. The history has offsets with all digits.
OFFSET_RESOLUTION_UM = 0.001
# Effect of another order of additions: some 16 terms of 100 um in doubles.
ARITHMETIC_UM = 1e-11
# An event is stamped by another thread than the cycle's.
EVENT_S = 0.2


def is_here():
    return RUN.exists() and MODEL.exists()


@dataclasses.dataclass
class Bus:
    """Configuration texts and temperature encoding of a bus."""
    name: str
    machine: str  # of thermocomp-sim: bus, device, controller
    daemon: str  # of thermocompd: the same
    place: typing.Callable  # index of a sensor -> keys of its value's place
    offset: typing.Callable  # index of an axis -> value of the key `offset`
    applied: typing.Callable
    transmitted: typing.Callable  # temperatures -> as received
    half_step_K: typing.Callable  # temperatures -> largest error of a received one
    whole_rows: bool = True  # one answer has temperatures of one row only


def as_float32(temps):
    return temps.astype(np.float32).astype(float)


def float32_half_step_K(temps):
    return float(np.spacing(np.float32(np.max(np.abs(temps))))) / 2


MODBUS_DEVICE = """
[[device]]
name = "module"
bus = "sensors"
unit = 3
table = "input"
encoding = "float32"
"""
MODBUS_PLACES = """
valid_bits = { table = "holding", address = 10, encoding = "uint16" }
heartbeat = { table = "holding", address = 11, encoding = "uint16" }
[[controller.signal]]
name = "spindle_rpm"
table = "input"
address = 10
encoding = "uint16"
"""


def modbus_bus(kind, order, sensors, controller):
    """`sensors` and `controller`: pairs of address keys, simulator's and daemon's."""
    def texts(who, conversion, cycle):
        return (f'[[bus]]\nname = "sensors"\nkind = "{kind}"\n{sensors[who]}\n' +
                MODBUS_DEVICE + f'word_order = "{order}"\nperiod_s = {conversion}\n' +
                f'[controller]\nname = "cnc"\nkind = "{kind}"\n{controller[who]}\n{cycle}' +
                MODBUS_PLACES)

    def number(table, i):
        return f'{{ table = "{table}", address = {2 * i}, encoding = "int32", scale = 0.001 }}'

    return Bus(kind, texts(0, 0.001, ""), texts(1, 0.01, "period_s = 0.005\n"),
               lambda i: f"address = {2 * i}", lambda i: number("holding", i),
               lambda i: number("input", i), as_float32, float32_half_step_K)


def can_bus(interface, controller_interface):
    """Four temperatures per frame of 16-bit numbers; two offsets per frame."""
    def offset(i, first_id):
        return (f"{{ id = {first_id + i // 2}, start_bit = {32 * (i % 2)}, length_bits = 32, "
                "scale = 0.001 }")

    def texts(conversion, cycle):
        return (f'[[bus]]\nname = "sensors"\nkind = "can"\ninterface = "{interface}"\n'
                f'[[device]]\nname = "module"\nbus = "sensors"\n{conversion}'
                f'[controller]\nname = "cnc"\nkind = "can"\ninterface = "{controller_interface}"\n'
                f'period_s = {cycle}\n'
                "valid_bits = { id = 0x202, start_bit = 32, length_bits = 8 }\n"
                "heartbeat = { id = 0x202, start_bit = 40, length_bits = 8 }\n"
                '[[controller.signal]]\nname = "spindle_rpm"\nid = 0x302\nstart_bit = 32\n'
                "length_bits = 16\nsigned = false\n")

    def place(i):
        return (f"id = {0x181 + i // 4}\nstart_bit = {16 * (i % 4)}\nlength_bits = 16\n"
                "scale = 0.001\noffset_degC = 25.0")

    return Bus("can", texts("period_s = 0.02\n", 0.02), texts("", 0.01), place,
               lambda i: offset(i, 0x200), lambda i: offset(i, 0x300),
               lambda temps: np.rint((temps - 25.0) / 0.001) * 0.001 + 25.0,
               lambda temps: 0.0005 + 1e-12, whole_rows=False)


def axis_text(bus, i, more=""):
    return (f'[[axis]]\nname = "ch{i + 1}"\noutput = "ch{i + 1}_um"\n{more}'
            f"offset = {bus.offset(i)}\napplied = {bus.applied(i)}\n")


def machine_text(bus):
    channels = (f'[[channel]]\nname = "t{i + 1}"\ndevice = "module"\n{bus.place(i)}\n'
                for i in range(SENSORS))
    return ("format = 1\n" + bus.machine + "".join(axis_text(bus, i) for i in range(AXES)) +
            "".join(channels))


NO_SMOOTHING = 'form = "off"\nperiod_s = 0.0\n'
RATE_UM_PER_S = 1000.0
# The first start of each test.
ENABLED = "[compensation]\nenabled_at_first_start = true\n"
AMPLE = f"offset_um_max = 500.0\nrate_um_per_s_max = {RATE_UM_PER_S}\n"


def daemon_text(bus, rate_hz=500, smoothing=NO_SMOOTHING, model=MODEL, limits=AMPLE,
                more=""):
    sensors = (f'[[sensor]]\nname = "t{i + 1}"\ndevice = "module"\n{bus.place(i)}\n'
               f'[[block]]\nname = "t{i + 1}"\ninput = "t{i + 1}_degC"\nsensors = ["t{i + 1}"]\n'
               for i in range(SENSORS))
    # The accelerated run must pass screening.
    return (f'format = 1\n@STATE@\n[loop]\nrate_hz = {rate_hz}\n[model]\nfile = "{model}"\n' +
            bus.daemon + "".join(axis_text(bus, i, limits) for i in range(AXES)) +
            "".join(sensors) +
            "[screening]\nsettle_s = 0.0\nrate_K_per_s_max = 1e6\nrate_allowance_K = 100.0\n[smoothing]\n" +
            smoothing + ENABLED + more +
            "[history]\n@HISTORY@\noffsets_period_s = 0.01\ncommit_s = 0.5\n")


def write_replay_file(path, rows, row_period_s):
    """Writes the run's first rows; the first one lasts FIRST_ROW_S. Returns its number of repetitions."""
    repeats = round(FIRST_ROW_S / row_period_s)
    with RUN.open(newline="") as text:
        lines = list(csv.reader(text))[:rows + 1]
    header, first, others = lines[0], lines[1], lines[2:]
    with path.open("w", newline="") as text:
        out = csv.writer(text, lineterminator="\n")
        out.writerow(header)
        for i, line in enumerate([first] * repeats + others):
            out.writerow([15 * i] + line[1:])
    return repeats


def predicted_um(folder, rows, reference_degC):
    """(rows, axes): predicted displacement, relative to the reference temperatures (SENSORS,): those of the
    first row, unless a busy machine connected later."""
    out = folder / "predicted.csv"
    status, _, output = run_tool("predict", "--model", MODEL, RUN, "-o", out)
    assert status == 0, output
    columns = read_columns(out)
    predicted = np.column_stack([columns[f"ch{i + 1}_predicted_um"] for i in range(AXES)])[:rows]
    first_degC = temps_degC({name: values[:1] for name, values in read_columns(RUN).items()})[0]
    return predicted + (first_degC - reference_degC) @ matrix_um_per_K().T


def temps_degC(columns):
    return np.column_stack([columns[f"t{i + 1}_degC"] for i in range(SENSORS)])


def offsets_um(columns, part):
    return np.column_stack([columns[f"ch{i + 1}_{part}_um"] for i in range(AXES)])


def matrix_um_per_K():
    return np.array(tomllib.loads(MODEL.read_text())["matrix_um_per_K"])


def bound_um(bus, temps):
    """Per axis: sum |P| times the temperature error, now and at the reference."""
    return 2.0 * np.sum(np.abs(matrix_um_per_K()), axis=1) * bus.half_step_K(temps) + ARITHMETIC_UM


@dataclasses.dataclass
class Agreement:
    """Agreement of the offsets at one place."""
    place: str
    rows: int
    settled: int
    bound_um: np.ndarray
    largest_um: np.ndarray

    def __str__(self):
        def numbers(values):
            return " ".join(f"{value:.7f}" for value in values)
        return (f"{self.place}: {self.settled} of {self.rows} rows settled, "
                f"bound {numbers(self.bound_um)} um, largest {numbers(self.largest_um)} um")


def compensating(history, times_s):
    """(times,): no change of mode within EVENT_S, and the mode was "compensating": a busy machine can
    delay the controller's answers until the daemon holds its offsets. times_s: CLOCK_MONOTONIC."""
    status, output, error = run_tool("events", "--json", history)
    assert status == 0, error
    wall_s = times_s + time.time() - time.monotonic()
    follows = np.zeros(len(times_s), dtype=bool)
    for event in json.loads(output)["events"]:
        if event["kind"] == "mode":
            follows[wall_s >= event["wall_s"] - EVENT_S] = False
            if event["code"] == "compensating":
                follows[wall_s >= event["wall_s"] + EVENT_S] = True
        if event["kind"] in ("mode", "fault", "recovery"):
            print(f"{event['wall_s'] - wall_s[0]:.3f} s: {event['kind']} {event['what']}")
    return follows


def agreement_in_history(bus, folder, history, rows, repeats, row_log, rate_hz, wanted):
    """Compares the last recorded cycle before the next row became visible. A row is settled if all
    its temperatures, and none of another row, had been read in that cycle, the daemon compensated and
    the slew limit did not limit the offset (after several rows at once). The number of settled rows
    depends on how busy this machine is."""
    run = folder / "exported.csv"
    status, _, output = run_tool("export", history, "-o", run)
    assert status == 0, output
    exported = read_columns(run)
    status, replayed, output = replay(history, folder / "replayed.csv")
    assert status == 0, output
    print(output.strip())
    times_s = np.array(replayed["time_s"]) + first_cycle_s(history)
    read = temps_degC(exported)
    assert len(times_s) == len(read)
    file_columns = {name: values[:rows] for name, values in read_columns(RUN).items()}
    temps = temps_degC(file_columns)
    arriving = bus.transmitted(temps)
    offsets = offsets_um(exported, "offset")
    log = read_columns(row_log)
    assert len(log["row"]) == rows + repeats - 1
    visible_s = 1e-9 * np.array(log[next(name for name in log if name != "row")])
    ends = np.searchsorted(times_s, visible_s[repeats:]) - 1
    ends = np.append(ends, len(times_s) - 1)  # the last row stays until the end
    settled = np.all(np.abs(read[ends] - arriving) < 1e-9, axis=1)
    steps = np.abs(offsets[ends] - offsets[ends - 1])
    settled &= np.all(steps < 0.9 * RATE_UM_PER_S / rate_hz, axis=1)
    settled &= compensating(history, times_s)[ends]
    differences = np.abs(offsets[ends] - wanted)[settled]
    return Agreement(f"{bus.name}, computed", rows, int(np.sum(settled)), bound_um(bus, temps),
                     np.max(differences, axis=0))


def agreement_at_controller(bus, truth, rows, repeats, wanted):
    """Compares the offsets that the simulated controller applied when the next row came: those of
    this row or, on a busy machine, of a recent one; none before the reference was taken."""
    # The simulator records a row when the next one comes: only their order matters.
    applied = offsets_um(read_columns(truth), "offset")[repeats - 1:]
    assert len(applied) == rows
    file_columns = {name: values[:rows] for name, values in read_columns(RUN).items()}
    bound = bound_um(bus, temps_degC(file_columns)) + OFFSET_RESOLUTION_UM / 2
    settled = 0
    largest = np.zeros(AXES)
    for i in range(rows):
        difference = np.abs(applied[i] - wanted[i])
        if np.all(difference <= bound):
            settled += 1
            largest = np.maximum(largest, difference)
        elif bus.whole_rows and (settled or np.any(applied[i])):
            past = wanted[max(0, i - 100):i + 1]
            late = np.abs(past - applied[i]) <= bound
            assert np.all(np.any(late, axis=0)), (
                f"row {i}: {applied[i]} is not the offset of any row up to it: {wanted[i]}")
    return Agreement(f"{bus.name}, applied by the controller", rows, settled, bound, largest)


def replay_spindle(lab, bus, rows, row_period_s, rate_hz=500, tick_ms=1):
    """Serves the run's rows over the bus and asserts both agreements."""
    run = lab.folder / "spindle.csv"
    repeats = write_replay_file(run, rows, row_period_s)
    row_log, truth = lab.folder / "rows.csv", lab.folder / "truth.csv"
    simulator = lab.simulator(machine_text(bus), "--replay", run, "--row-period-ms",
                              1000 * row_period_s, "--row-log", row_log, "--truth", truth,
                              "--start-on-heartbeat", "--settle-s", 1, "--tick-ms", tick_ms)
    daemon = lab.daemon(daemon_text(bus, rate_hz))
    daemon.config.write_text(with_ports(daemon.config.read_text(), simulator.ready))
    daemon.start()
    simulator.wait(60 + 3 * (FIRST_ROW_S + rows * row_period_s))
    status = daemon.status()
    missed = status["cycle"]["missed"]
    reference_degC = np.array([entry["reference_degC"] for entry in status["inputs"]])
    daemon.end()
    wanted = -predicted_um(lab.folder, rows, reference_degC)
    agreements = [agreement_in_history(bus, lab.folder, daemon.history, rows, repeats, row_log,
                                       rate_hz, wanted),
                  agreement_at_controller(bus, truth, rows, repeats, wanted)]
    print(f"row period {1000 * row_period_s:g} ms, {rate_hz} Hz, {missed} cycles missed")
    for agreement in agreements:
        print(agreement)
        assert np.all(agreement.largest_um <= agreement.bound_um), str(agreement)
        assert agreement.settled >= rows / 2, "this machine is too busy: " + str(agreement)


def with_ports(text, ready):
    """Replaces @NAME@ by the simulator's port for the bus NAME."""
    for name, port in ready["ports"].items():
        text = text.replace(f"@{name}@", str(port))
    return text
