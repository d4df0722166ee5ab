"""A store with thermocomp-fleet and thermocomp-uplink."""

import datetime
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import time

BIN = pathlib.Path(os.environ["THERMOCOMP_BIN"])


class Store:
    """A separate database in a running server."""

    def __init__(self, server, folder, name):
        self.server = server
        self.folder = folder
        self.running = []
        self.name = re.sub(r"\W", "_", name.lower())[:40]
        server.ask(f"DROP DATABASE IF EXISTS {self.name}", conninfo=server.local("postgres"))
        for [role] in server.ask("SELECT rolname FROM pg_roles WHERE rolname LIKE 'machine\\_%'"
                                 " OR rolname LIKE 'person\\_%'", conninfo=server.local("postgres")):
            server.ask(f'DROP ROLE "{role}"', conninfo=server.local("postgres"))
        server.create_database(self.name)
        self.local = server.local(self.name)
        self.fleet("init")

    def fleet(self, *arguments, status=0):
        done = subprocess.run([str(BIN / "thermocomp-fleet"), "--store", self.local, *map(str, arguments)],
                              stdin=subprocess.DEVNULL, capture_output=True, text=True, cwd=self.folder)
        assert done.returncode == status, done.stdout + done.stderr
        return done.stdout + done.stderr

    def ask(self, sql):
        return self.server.ask(sql, conninfo=self.local)

    def value(self, sql):
        return self.server.value(sql, conninfo=self.local)

    def add(self, machine, *options, type="mill"):
        self.fleet("add", machine, "--type", type, "-o", self.folder / f"{machine}.password", *options)
        return self.password(machine)

    def password(self, machine):
        return (self.folder / f"{machine}.password").read_text().strip()

    def remote(self, user, *, tls="sslmode=verify-full", port=None):
        """A network connection."""
        return (f"host=localhost port={port or self.server.port} user={user} dbname={self.name} "
                f"{tls} sslrootcert={self.server.authority}")

    def as_machine(self, machine, sql):
        """(exit status, rows, error)"""
        return self.server.run_sql(sql, conninfo=self.remote(f"machine_{machine}"), password=self.password(machine))

    def add_person(self, name, *groups):
        """A role that logs in over the Unix socket."""
        self.ask(f"CREATE ROLE person_{name} LOGIN; GRANT {', '.join(groups)} TO person_{name}")

    def as_person(self, name, sql):
        return self.server.run_sql(sql, conninfo=self.local.replace("user=postgres", f"user=person_{name}"))


CONFIG = """format = 1
state_file = "{folder}/state.json"
[loop]
rate_hz = 2
[model]
file = "model.toml"
[[bus]]
name = "cabinet"
kind = "modbus_tcp"
host = "127.0.0.1"
[[device]]
name = "module"
bus = "cabinet"
unit = 1
table = "input"
encoding = "int16"
scale = 0.01
[[sensor]]
name = "column"
device = "module"
address = 0
[[sensor]]
name = "spindle"
device = "module"
address = 1
[[block]]
name = "column"
input = "column_degC"
sensors = ["column"]
[[block]]
name = "spindle"
input = "spindle_degC"
sensors = ["spindle"]
[controller]
name = "cnc"
kind = "dry_run"
[[axis]]
name = "z"
output = "z_um"
offset_um_max = 50.0
rate_um_per_s_max = 1.0
[history]
file = "{folder}/history.db"
[socket]
path = "{folder}/status.sock"
"""
MODEL = """format = 1
inputs = ["column_degC", "spindle_degC"]
outputs = ["z_um"]
reference = "first_sample"
matrix_um_per_K = [[3.0, -1.5]]
"""


class Machine:
    """A machine with a history and an uplink."""

    def __init__(self, store, name, *, history=None, more="", connection=""):
        self.store = store
        self.name = name
        self.folder = store.folder / name
        self.folder.mkdir()
        (self.folder / "thermocompd.toml").write_text(CONFIG.format(folder=self.folder))
        (self.folder / "model.toml").write_text(MODEL)
        self.history = self.folder / "history.db"
        if history:
            shutil.copyfile(history, self.history)
        store.add(name)
        self.log = self.folder / "uplink.log"
        self.process = None
        self.configure(connection or store.remote(f"machine_{name}"), more)

    def configure(self, connection, more=""):
        (self.folder / "uplink.toml").write_text(
            f'format = 1\nmachine = "{self.name}"\nstore = "{connection}"\n'
            f'password_file = "{self.store.folder}/{self.name}.password"\n'
            f'history = ["{self.history}"]\ncpu_percent_max = 100\nperiod_s = 1\n{more}')

    def record(self, hours_ago, hours, *, probings_per_h=2.0, clock=()):
        """Extends the history; returns the additions: {"probings": ..., "events": ...}. Written in
        memory, since hours of commits to a disk take minutes."""
        with tempfile.TemporaryDirectory(dir="/dev/shm") as memory:
            file = pathlib.Path(memory) / "history.db"
            if self.history.exists():
                shutil.copyfile(self.history, file)
            done = subprocess.run([str(BIN / "record_history"), str(self.folder / "thermocompd.toml"), str(file),
                                   str(time.time() - 3600 * hours_ago), str(hours), "1", str(probings_per_h),
                                   *map(str, clock)], stdin=subprocess.DEVNULL, capture_output=True, text=True)
            assert done.returncode == 0, done.stderr
            copy = self.history.with_suffix(".new")
            shutil.copyfile(file, copy)
            copy.rename(self.history)  # an uplink may be reading
        return json.loads(done.stdout)

    def send(self, status=0):
        """Runs until all is sent; returns the uplink's output."""
        done = subprocess.run([str(BIN / "thermocomp-uplink"), "--once", str(self.folder / "uplink.toml")],
                              stdin=subprocess.DEVNULL, capture_output=True, text=True)
        assert done.returncode == status, done.stderr
        return done.stderr

    def start(self):
        with self.log.open("a") as log:
            self.process = subprocess.Popen([str(BIN / "thermocomp-uplink"), str(self.folder / "uplink.toml")],
                                            stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        self.store.running.append(self.process)
        return self

    def end(self):
        if self.process:
            self.process.terminate()
            assert self.process.wait(30) == 0, self.log.read_text()
            self.process = None

    def recorded(self):
        """{beginning of 10 s [s since 1970]: {column: mean}} from the exported run file; without probings."""
        run = self.folder / "run.csv"
        done = subprocess.run([str(BIN / "thermocomp"), "export", str(self.history), "-o", str(run)],
                              stdin=subprocess.DEVNULL, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        means, header, wall = {}, None, None
        for line in run.open():
            line = line.rstrip("\n")
            expected = re.match(r"# ([\d.]+) s: wall time (\S+)Z$", line)
            if expected:
                at = datetime.datetime.fromisoformat(expected[2]).replace(tzinfo=datetime.timezone.utc)
                wall = at.timestamp() - float(expected[1])
            elif line.startswith("#"):
                continue
            elif header is None:
                header = line.split(",")
            else:
                values = dict(zip(header, (float(value) if value else math.nan for value in line.split(","))))
                begin = int((wall + values["time_s"] + 1e-4) // 10 * 10)
                for name, value in values.items():
                    if name not in ("time_s", "z_um", "z_measured_um") and not math.isnan(value):
                        total = means.setdefault(begin, {}).setdefault(name, [0.0, 0])
                        total[0] += value
                        total[1] += 1
        return {begin: {name: total / count for name, (total, count) in row.items()} for begin, row in means.items()}

    def taken(self):
        columns = self.store.value(f"SELECT array_to_string(columns, ' ') FROM fleet.setup JOIN fleet.machine "
                                   f"ON id = machine WHERE name = '{self.name}' ORDER BY number LIMIT 1").split()
        rows = self.store.ask(f"SELECT extract(epoch FROM at)::bigint, array_to_string(value, ' ', 'nan') "
                              f"FROM fleet.sample JOIN fleet.machine ON id = machine WHERE name = '{self.name}'")
        means = {int(at): dict(zip(columns, map(float, values.split()))) for at, values in rows}
        assert len(means) == len(rows)
        return means

    def count(self, table):
        return int(self.store.value(f"SELECT count(*) FROM fleet.{table} JOIN fleet.machine ON id = machine "
                                    f"WHERE name = '{self.name}'"))

    def progress(self):
        """(rows sent, refused, repeated) as counted by the uplink."""
        [row] = self.store.ask(f"SELECT sent, refused, repeated FROM fleet.uplink JOIN fleet.machine "
                               f"ON id = machine WHERE name = '{self.name}'")
        return tuple(map(int, row))


def eventually(check, what, patience_s=60):
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        value = check()
        if value:
            return value
        time.sleep(0.05)
    raise AssertionError("never happened: " + what)
