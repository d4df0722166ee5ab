"""A thirteenth machine for demo_fleet.py, with its own daemon, uplink and admission: rollout and
rollback of a model. Its day passes 600 times as fast as real time, as in ./demo.sh."""
import csv
import re
import struct
import subprocess
import time

import numpy as np

import measured_data
import series_type
from lab import Lab

FACTOR = 600
PLACES = list(series_type.plant.PLACES)
SIGNALS = ["spindle_rpm", "feed_mm_per_min", "coolant_on"]
AXES = ["z", "y"]
STANDS_MIN = 90
SLEW_UM_PER_S = 30.0  # 0.05 um/s of the machine's time
PROBE_AT, APPLIED_AT, SIGNAL_AT = 40, 10, 20


def entry(list_name, /, **values):
    """An entry of a list of tables; a text that begins with { is itself a table."""
    lines = [f"{key} = {value if isinstance(value, str) and value[0] == '{' else repr(value)}"
             for key, value in values.items()]
    return "\n".join([f"[[{list_name}]]", *lines, ""])


def wide(table, address):
    return f'{{ table = "{table}", address = {address}, encoding = "int32", scale = 0.001 }}'


def buses(sensors_port, controller_port, *, is_machine):
    """Common keys of both ends of the two Modbus connections."""
    text = entry("bus", name="cabinet", kind="modbus_tcp", host="127.0.0.1", port=sensors_port)
    more = {} if is_machine else {"period_s": 0.02}
    text += entry("device", name="module", bus="cabinet", unit=1, encoding="int16", scale=0.01, table="input", **more)
    for i, place in enumerate(PLACES):
        text += entry("channel" if is_machine else "sensor", name=place.removesuffix("_degC"), device="module",
                      address=i)
    text += ('[controller]\nname = "cnc"\nkind = "modbus_tcp"\nhost = "127.0.0.1"\n' f"port = {controller_port}\n"
             'valid_bits = { table = "holding", address = 8, encoding = "uint16" }\n'
             'heartbeat = { table = "holding", address = 9, encoding = "uint16" }\n')
    text += "" if is_machine else "unit = 1\nperiod_s = 0.02\n"
    for i, signal in enumerate(SIGNALS):
        text += entry("controller.signal", name=signal, table="input", address=SIGNAL_AT + i, encoding="uint16")
    for i, axis in enumerate(AXES):
        limits = {} if is_machine else {"offset_um_max": 150.0, "rate_um_per_s_max": SLEW_UM_PER_S}
        text += entry("axis", name=axis, output=f"{axis}_um", offset=wide("holding", 2 * i),
                      applied=wide("input", APPLIED_AT + 2 * i), **limits)
        if is_machine:
            text += entry("controller.signal", name=f"{axis}_probe_um", probe_of=f"{axis}_um", table="input",
                          address=PROBE_AT + 2 * i, encoding="int32", scale=0.001)
    return text


def daemon_config(sensors_port, controller_port):
    blocks = "".join(entry("block", name=name, input=place, sensors=[name])
                     for place, name in ((place, place.removesuffix("_degC")) for place in PLACES))
    return ('format = 1\n@STATE@\n[loop]\nrate_hz = 100\n[model]\nfile = "model.toml"\n'
            '[screening]\nsettle_s = 0.0\nstale_after_s = 2.0\nrate_allowance_K = 100.0\n[smoothing]\nform = "off"\n'
            + buses(sensors_port, controller_port, is_machine=False) + blocks +
            "[compensation]\nenabled_at_first_start = true\nmismatch_um = 20.0\n"
            "[history]\n@HISTORY@\noffsets_period_s = 0.01\ncommit_s = 0.2\n")


def after_standing(day, minutes):
    """Prepends a standstill: a candidate's lags start when it is offered, so the machine must be
    evenly cold then."""
    longer = {name: np.concatenate([np.full(minutes, values[0]), values]) for name, values in day.items()}
    longer["time_s"] = 60.0 * np.arange(len(longer["time_s"]))
    return longer


def quick(model):
    """The model for the machine's accelerated day."""
    return re.sub(r"(?m)^tau_s = \[(.*)\]$", lambda found: "tau_s = [" + ", ".join(
        str(float(tau) / FACTOR) for tau in found[1].split(",")) + "]", model.read_text())


class Mill:
    """Its folder replaces /etc and /var/lib."""

    def __init__(self, lab, programs, workshop, folder, day, model):
        self.programs, self.workshop, self.folder = programs, workshop, folder
        workshop.fleet("add", "mill_12", "--type", "mill", "--hall", 2, "--central", "-o", folder / "uplink.password")
        (folder / "approvers").mkdir()
        self.key = folder / "maria.key"
        for command in (["genpkey", "-algorithm", "ed25519", "-out", self.key],
                        ["pkey", "-in", self.key, "-pubout", "-out", folder / "approvers/maria.pem"]):
            subprocess.run(["openssl", *command], check=True)
        run = folder / "day.csv"
        measured_data.write(measured_data.Run("", after_standing(day, STANDS_MIN)), run)
        (folder / "model.toml").write_text(quick(model))
        self.machine = lab.simulator("format = 1\n" + buses(0, 0, is_machine=True), "--replay", run,
                                     "--time-factor", FACTOR, "--start-on-heartbeat", "--stay")
        self.daemon = lab.daemon(daemon_config(self.machine.port("cabinet"), self.machine.port("cnc")))
        common = f'format = 1\nmachine = "mill_12"\noffer = "{folder}/offer.json"\n'
        (folder / "uplink.toml").write_text(
            common + f'store = "host=localhost port={workshop.server.port} dbname=fleet '
            f'sslrootcert={workshop.server.authority}"\n'
            'password_file = "uplink.password"\n'
            f'history = ["{self.daemon.history}"]\nsteps = "steps.json"\ncpu_percent_max = 100\n')
        (folder / "releases.toml").write_text(common + f'config = "{self.daemon.config}"\nfolder = "."\n'
                                              'approvers = "approvers"\n')
        self.daemon.start().wait_for_mode("compensating")

    def left_um(self):
        """Remaining displacement at the tool, one value per axis: Modbus, read input registers."""
        with self.machine.connect("cnc") as link, link.makefile("rb") as answer:
            link.sendall(struct.pack(">HHHBBHH", 1, 0, 6, 1, 4, PROBE_AT, 2 * len(AXES)))
            return [0.001 * nm for nm in struct.unpack(f">{len(AXES)}i", answer.read(9 + 4 * len(AXES))[9:])]

    def probe(self, times):
        """Probes every ten minutes of its time; RMS over the axes [um]."""
        squares = []
        for _ in range(times):
            time.sleep(600 / FACTOR)
            for axis, left_um in zip(AXES, self.left_um()):
                status, _, problem = self.daemon.cli("measured", axis, f"{left_um:.3f}")
                assert status == 0, problem
                squares.append(left_um ** 2)
        return (sum(squares) / len(squares)) ** 0.5

    def admit(self):
        """Runs uplink and `admit`, as timers do every few minutes; returns their output."""
        self.daemon.committed()
        printed = ""
        for command, good in ((["thermocomp-uplink", "--once", "uplink.toml"], (0,)),
                              (["thermocomp", "admit", "releases.toml"], (0, 1)),
                              (["thermocomp-uplink", "--once", "uplink.toml"], (0,))):
            done = subprocess.run([str(self.programs / command[0]), *command[1:]], cwd=self.folder, text=True,
                                  stdin=subprocess.DEVNULL, capture_output=True)
            assert done.returncode in good, done.stderr
            printed += done.stdout
        return printed

    def offer(self, model, note):
        offered = self.folder / "offered.toml"
        offered.write_text(quick(model))
        return self.workshop.fleet("offer", "mill_12", offered, "--note", note).split()[1].rstrip(":")

    def order(self, what, release):
        return self.workshop.fleet(what, release, "--key", self.key)

    def largest_rate_um_per_s(self):
        """Largest rate of the offsets sent, between two records."""
        run = self.folder / "sent.csv"
        assert self.daemon.cli("export", self.daemon.history, "-o", run)[0] == 0
        with run.open() as file:
            rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
        sent = {axis: [(float(row["time_s"]), float(row[f"{axis}_offset_um"])) for row in rows
                       if row[f"{axis}_offset_um"]] for axis in AXES}
        return max(abs(b - a) / (t1 - t0) for each in sent.values() for (t0, a), (t1, b) in zip(each, each[1:]))


def show(programs, workshop, folder, day, own, better, strange):
    """own, better, strange: model files for a machine in real time."""
    folder.mkdir()
    lab = Lab(folder)
    try:
        mill = Mill(lab, programs, workshop, folder, day, own)
        mill.probe(4)
        release = mill.offer(better, "its sisters and its own day")
        print(mill.admit().strip())
        print(f"its own fit, in use, leaves {mill.probe(14):.1f} um at 14 probings, which score the candidate:")
        print(mill.admit().strip(), "(within two hours by the clock, so they count as one)")
        print(mill.order("approve", release).strip())
        print(mill.admit().strip())
        mill.probe(1)
        print(f"the promoted model leaves {mill.probe(8):.1f} um at 8 probings")
        print(mill.order("rollback", release).strip())
        print(mill.admit().strip())
        mill.probe(8)
        mill.offer(strange, "meant for mill_5")
        print(mill.admit().strip())
        mill.daemon.committed()
        largest_um_per_s = mill.largest_rate_um_per_s()
        verdict = "no jump" if largest_um_per_s <= 1.01 * SLEW_UM_PER_S else "A JUMP"
        print(f"offsets changed by at most {largest_um_per_s:.1f} um/s, slew rate {SLEW_UM_PER_S:.0f} um/s: {verdict}")
        mill.daemon.end()
    finally:
        lab.end()
