"""See fleet_slurm.sh."""
import datetime
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parents[2]
os.environ["OPENBLAS_NUM_THREADS"] = "1"
sys.path[:0] = [str(HERE / path) for path in ("tests/integration/fleet", "bench/series", "bench/measured")]

# ruff: noqa: E402
import numpy as np

import series_type
from departures import PROBE_EVERY_MIN, grown_expansion, measured_data
from fleet_lab import BIN, Store, eventually
from postgres import Postgres, free_port

MACHINES, DAYS, BEGINS, HIDDEN = 20, 11, 7, 5
ALL = MACHINES * (DAYS - 1)  # the last day is still open
NODES = ("n1", "n2")
CONF = """ClusterName=bench
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool_%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd_%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd_%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdTimeout=10
ReturnToService=2
MailProg=/bin/true
NodeName=n1 NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[1]} CPUs=1
NodeName=n2 NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[2]} CPUs=1
PartitionName=main Nodes=ALL Default=YES State=UP
"""


class Cluster:
    """Debian's slurmd runs several nodes per host, each with its own port and folder."""

    def __init__(self, folder):
        self.folder, self.processes = folder, {}
        (folder / "state").mkdir()
        (folder / "munge.key").write_bytes(os.urandom(128))
        (folder / "munge.key").chmod(0o400)
        conf = folder / "slurm.conf"
        conf.write_text(CONF.format(host=socket.gethostname().split(".")[0], folder=folder,
                                    ports=[free_port() for _ in range(3)]))
        os.environ["SLURM_CONF"] = str(conf)
        # Logs what --force overrode: a folder that others may read.
        self.start("munged", "munged", "--foreground", "--force", f"--socket={folder}/munge.socket",
                   f"--key-file={folder}/munge.key", f"--pid-file={folder}/munge.pid",
                   f"--seed-file={folder}/munge.seed", f"--log-file={folder}/munge.log")
        eventually((folder / "munge.socket").exists, "munged opens its socket")
        self.start("slurmctld", "slurmctld", "-D", "-f", conf)
        for node in NODES:
            self.start_node(node)

    def start(self, name, *command):
        with (self.folder / f"{name}.out").open("w") as log:
            self.processes[name] = subprocess.Popen([*map(str, command)], stdin=subprocess.DEVNULL, stdout=log,
                                                    stderr=log)

    def start_node(self, node):
        self.start(node, "unshare", "--pid", "--fork", "--kill-child", "--mount-proc", "slurmd", "-D", "-N", node)
        eventually(lambda: self.ask("sinfo", "-h", "-n", node, "-o", "%T") in ("idle", "mixed", "allocated"),
                   f"{node} is up")

    def kill_node(self, node):
        """Kills its first process and thereby all of it, like a power failure."""
        self.processes[node].kill()
        self.processes[node].wait()

    def ask(self, *command):
        return subprocess.run(command, capture_output=True, text=True).stdout.strip()

    def running(self, *options):
        return self.ask("squeue", "-h", "-r", "-t", "R", "-o", "%i", *options).split()

    def end(self):
        for process in reversed(self.processes.values()):
            process.send_signal(signal.SIGTERM if process.args[0] != "unshare" else signal.SIGKILL)
            process.wait()


def fill(store, folder):
    today = datetime.datetime.now(datetime.timezone.utc).date()
    for number in range(MACHINES):
        store.add(f"mill_{number}")
        machine = series_type.TypeMachine(40000 + number)
        for day in range(DAYS):
            columns = machine.day(day, 24, grown_expansion if number == HIDDEN and day >= BEGINS else None)
            for output in series_type.plant.OUTPUTS:
                columns[output][np.arange(len(columns["time_s"])) % PROBE_EVERY_MIN != 0] = np.nan
            measured_data.write(measured_data.Run("", columns), folder / "day.csv")
            store.fleet("load", f"mill_{number}", folder / "day.csv", "--begin",
                        f"{today - datetime.timedelta(days=DAYS - day)}T00:00:00Z")
    # Counts the writes of each result.
    store.ask("CREATE TABLE written (machine integer, night date);"
              "CREATE FUNCTION note() RETURNS trigger LANGUAGE plpgsql AS "
              "'BEGIN INSERT INTO written VALUES (NEW.machine, NEW.night); RETURN NEW; END';"
              "CREATE TRIGGER note BEFORE INSERT ON fleet.night_result FOR EACH ROW EXECUTE FUNCTION note()")


def results(store):
    """Results of the nights, each written once; then deletes them."""
    assert store.ask("SELECT count(*), count(DISTINCT (machine, night)) FROM written") == [[str(ALL)] * 2]
    # The statistics contain the name of a temporary run file.
    rows = store.ask("SELECT name, night, state, departs, probability, departure, diagnosis IS NULL, "
                     "md5(regexp_replace(statistics, 'runs = [^\n]*', '')) FROM fleet.night_result JOIN fleet.machine ON id = machine ORDER BY 1, 2")
    assert len(rows) == ALL and {row[2] for row in rows} == {"done"}
    assert {row[0] for row in rows if row[3] == "t"} == {f"mill_{HIDDEN}"}
    assert "0 machine-nights" in store.fleet("night", "--slurm", "--nights", DAYS + 1)
    store.ask("TRUNCATE written, fleet.night_result, fleet.series, fleet.minute")
    return rows


def start_night(store, *options):
    night = subprocess.Popen([str(BIN / "thermocomp-fleet"), "--store", store.local, "night", "--nights",
                             str(DAYS + 1), *options], stdin=subprocess.DEVNULL, stdout=sys.stderr, cwd=store.folder,
                             start_new_session=True)
    store.running.append(night)
    return night


def done(store):
    return int(store.value("SELECT count(*) FROM fleet.night_result"))


def timed(store, *options):
    began = time.monotonic()
    assert start_night(store, *options).wait() in (0, 1)  # 1: a machine departs
    return time.monotonic() - began


def disturbed(store, cluster):
    night = start_night(store, "--slurm")
    eventually(lambda: done(store) >= 20, "the first nights are done", 600)
    cancelled = eventually(lambda: cluster.running("-w", NODES[0]), "a task runs")
    subprocess.run(["scancel", *cancelled], check=True)
    eventually(lambda: done(store) >= 60, "more nights are done", 600)
    lost = eventually(lambda: cluster.running("-w", NODES[1]), "a task runs on the other node")
    cluster.kill_node(NODES[1])
    print(f"cancelled {cancelled}, {NODES[1]} died with {lost}", file=sys.stderr)
    eventually(lambda: "down" in cluster.ask("sinfo", "-h", "-n", NODES[1], "-o", "%T"), "the node counts as down")
    cluster.start_node(NODES[1])
    assert night.wait() == 1
    left = ALL - done(store)
    assert 0 < left < ALL  # of the cancelled task
    timed(store, "--slurm")
    return left


def main():
    server = Postgres()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="slurm"))
    folder.chmod(0o755)  # munge requires a socket that everybody can reach
    cluster = store = None
    try:
        server.start()
        cluster = Cluster(folder)
        store = Store(server, folder, "fleet_slurm")
        fill(store, folder)
        slurm_s = timed(store, "--slurm")
        by_slurm = results(store)
        processes_s = timed(store, "-j", "2")
        assert results(store) == by_slurm
        left = disturbed(store, cluster)
        assert results(store) == by_slurm
    finally:
        for night in store.running if store else []:
            if night.poll() is None:
                os.killpg(night.pid, signal.SIGKILL)  # with its sbatch
                night.wait()
        if cluster:
            cluster.end()
        server.end()
        shutil.rmtree(folder, ignore_errors=True)
    print(f"machine_nights {ALL} nights")
    print(f"left_by_cancelled_tasks {left} nights")
    print(f"array {slurm_s:.0f} s")
    print(f"processes {processes_s:.0f} s")


if __name__ == "__main__":
    main()
