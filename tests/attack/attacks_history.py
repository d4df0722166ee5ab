"""The history: damaged segments, other versions, broken tables, and what `export` writes onto."""

import contextlib
import os
import sqlite3
import time

from attacks_files import told_by_reload
from registry import attack

BEFORE_UM = -3.0


def recorded(rig, reloads=3):
    """A history of several segments; its path, the daemon ended."""
    if not rig.start(BEFORE_UM):
        return None
    rig.machine.wants_um(-12.0)
    for _ in range(reloads):
        time.sleep(0.5)
        rig.must(told_by_reload(rig) == "", "reload refused")
    time.sleep(0.5)
    rig.daemon.end()
    rig.note_rows()
    return rig.daemon.history


def damaged_copy(rig, history, name, *statements):
    """A copy after these SQL statements."""
    copy = rig.folder / (name.replace(" ", "_") + ".db")
    with contextlib.closing(sqlite3.connect(history)) as base, \
            contextlib.closing(sqlite3.connect(copy)) as other:
        base.backup(other)
        for statement in statements:
            if callable(statement):
                statement(other)
            else:
                other.execute(statement)
        other.commit()
    return copy


def noise(random, table, column, key):
    """Random bytes instead of the first half of a blob."""
    def change(base):
        blob = base.execute(f"SELECT {column} FROM {table} WHERE {key}").fetchone()[0]
        half = len(blob) // 2
        base.execute(f"UPDATE {table} SET {column} = ? WHERE {key}",
                     (random.randbytes(half) + blob[half:],))
    return change


def flip(random, table, column, key):
    """One bit of a row."""
    def change(base):
        blob = bytearray(base.execute(f"SELECT {column} FROM {table} WHERE {key}").fetchone()[0])
        blob[random.randrange(len(blob))] ^= 1 << random.randrange(8)
        base.execute(f"UPDATE {table} SET {column} = ? WHERE {key}", (bytes(blob),))
    return change


def rows_of(run):
    if not run.exists():
        return []
    lines = [line for line in run.read_text(errors="replace").splitlines() if line]
    return [line for line in lines if not line.startswith("#")][1:]


@attack(links=("tcp",), limit_s=90.0)
def damaged_segment(rig):
    """One flipped bit, or a clock once set to 2200, in one of four segments: what is sound comes
    out, the rest is told, exit status 1; nothing is mended in place."""
    history = recorded(rig)
    if history is None:
        return
    run = rig.folder / "run.csv"
    status, said = rig.tool("export", history, "-o", run)
    all_rows = rows_of(run)
    if not rig.must(status == 0 and len(all_rows) > 50, f"export of the whole: {said[:100]}"):
        return
    second = "id = (SELECT id FROM segment ORDER BY id LIMIT 1 OFFSET 1)"
    chunk = "id = (SELECT id FROM chunk WHERE segment = (SELECT id FROM segment ORDER BY id " \
            "LIMIT 1 OFFSET 1) ORDER BY number LIMIT 1)"
    damages = {
        "records": (noise(rig.random, "chunk", "records", chunk),),
        "a bit of the records": (flip(rig.random, "chunk", "records", chunk),),
        "estimator state": (flip(rig.random, "segment", "estimator_state", second),),
        "no chunk": (f"DELETE FROM chunk WHERE {chunk}",),
        "empty records": (f"UPDATE chunk SET records = x'' WHERE {chunk}",),
        "clock of 2200": (f"UPDATE segment SET wall_ns = 7258118400000000000, "
                          f"last_wall_ns = 7258118400000000000 WHERE {second}",),
        "end before its beginning": (f"UPDATE segment SET last_cycle = -5 WHERE {second}",),
    }
    for name, statements in damages.items():
        rig.tries += 1
        copy = damaged_copy(rig, history, name, *statements)
        before = copy.read_bytes()
        for tool, share in (("export", 0.5), ("replay", 0.4)):
            out = rig.folder / (tool + ".csv")
            out.unlink(missing_ok=True)
            status, said = rig.tool(tool, copy, "-o", out)
            # A flipped bit may be one that says another number, or nothing at all.
            rig.must(status == 1 or (status == 0 and name in (
                "a bit of the records", "estimator state", "clock of 2200")),
                     f"{tool}, {name}: exit status {status}")
            if tool == "export":
                rig.must(len(rows_of(out)) > share * len(all_rows),
                         f"{tool}, {name}: {len(rows_of(out))} of {len(all_rows)} rows come out")
        rig.must(copy.read_bytes() == before, f"{name}: the history is written to")
        status, said = rig.tool("history", "check", copy)
        rig.must(status in (0, 1), f"history check, {name}: exit status {status}")


@attack(links=("tcp",), limit_s=60.0)
def history_of_another_version(rig):
    """user_version 0, -1 and the largest, other tables, no tables: no crash. A daemon whose history
    is somebody else's database (0 is what every SQLite file has) leaves it alone and says so."""
    history = recorded(rig, reloads=1)
    if history is None:
        return
    for version in (0, -1, 2**31 - 1, -2**31):
        rig.tries += 1
        copy = damaged_copy(rig, history, f"version {version}",
                            f"PRAGMA user_version = {version}")
        rig.must(rig.tool("export", copy, "-o", rig.folder / "a.csv")[0] is not None,
                 "export hangs")
    for statement in ("DROP TABLE meta", "DROP TABLE segment", "DELETE FROM setup",
                      "UPDATE meta SET value = 'x'", "UPDATE chunk SET number = number * 100000",
                      "UPDATE segment SET period_ns = 0", "UPDATE segment SET period_ns = -1",
                      "UPDATE chunk SET count = 9223372036854775807",
                      "UPDATE segment SET token = -token, run = -run"):
        rig.tries += 1
        copy = damaged_copy(rig, history, "changed", statement)
        for tool in ("export", "replay"):
            rig.must(rig.tool(tool, copy, "-o", rig.folder / "a.csv")[0] is not None,
                     f"{tool} hangs: {statement}")
        copy.unlink()
    with contextlib.closing(sqlite3.connect(history)) as base:
        base.execute(f"PRAGMA user_version = {rig.random.choice((0, -1))}")
    before = history.read_bytes()
    rig.must(not rig.daemon.start(may_refuse=True), "starts on a history that is not its own")
    told = rig.daemon.log_text().splitlines()[-1]
    rig.must(str(history) in told and "version" in told, f'says only "{told}"')
    rig.must(history.read_bytes() == before, "the history that is not its own was changed")
    history.rename(rig.folder / "not_ours.db")
    for other in rig.daemon.folder.glob("history*"):
        other.unlink()
    rig.rows = set()
    rig.machine.wants_um(BEFORE_UM)
    if not rig.restart():
        return
    rig.wait_for_rows(1)
    rig.daemon.end()


@attack(links=("tcp",), limit_s=60.0)
def export_onto_what_is_no_file(rig):
    """A FIFO that nobody reads, a full device, a folder, the history itself."""
    history = recorded(rig, reloads=1)
    if history is None:
        return
    fifo = rig.folder / "fifo"
    os.mkfifo(fifo)
    for target in (fifo, "/dev/full", rig.folder, history):
        rig.tries += 1
        status, _ = rig.tool("export", history, "-o", target, patience_s=20.0)
        rig.must(status is not None, f"export onto {target} hangs")
        rig.must(status != 0, f"export onto {target} is called done")
    rig.note_rows()
