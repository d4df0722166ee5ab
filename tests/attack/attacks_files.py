"""Files: configuration, model, state and history as a careless or hostile hand leaves them."""

import json
import os
import time

import watch
from process import eventually
from registry import attack

BEFORE_UM = -3.0
LOG_MAX_BYTES = 1 << 20
MEMORY_MORE_MB = 150.0
DEEP = 50_000


def told_by_reload(rig):
    """The error of a reload, "" if it was taken; an answer that is no JSON breaks a rule."""
    try:
        rig.daemon.call("reload")
    except watch.Refused as refused:
        return str(refused)
    except ValueError:
        rig.broke("the answer is no valid JSON")
    except OSError as error:
        rig.must(not rig.daemon.alive(), f"no answer to reload: {error}")
        return "no answer"
    return ""


def reload_refused(rig, path, text):
    """`text` instead of the file: refused by the daemon, by `check`, by a daemon that starts; the
    running one goes on as before."""
    good = path.read_bytes()
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    began = time.monotonic()
    rig.must(told_by_reload(rig) != "", "reload takes it")
    if rig.daemon.alive():
        rig.daemon.hang_up()
    status, _ = rig.tool("check", rig.daemon.config)
    rig.must(status == 2, f"check: exit status {status}")
    time.sleep(max(0.3, min(3.0, 1.5 * (time.monotonic() - began))))
    path.write_bytes(good)
    return rig.daemon.alive()


def goes_on(rig):
    if not rig.daemon.alive():
        return
    rig.must(told_by_reload(rig) == "", "the good file is not taken any more")
    rig.follows_again()
    rig.note_rows()


def deep_texts(good):
    return [good + "\n[" + ".".join("a" * DEEP) + "]\n",
            ".".join("a" * DEEP) + " = 1\n" + good,
            "x = " + "[" * DEEP + "]" * DEEP + "\n" + good,
            "x = " + "{a=" * DEEP + "1" + "}" * DEEP + "\n" + good,
            good + "\n[[" + ".".join("a" * DEEP) + "]]\n",
            good + "\n[x]\ny = {" + ".".join("b" * DEEP) + " = 1}\n"]


@attack(links=("tcp", "bridge"), limit_s=90.0)
def deep_key_paths(rig):
    """Tables, keys, arrays and inline tables 50,000 deep in configuration and model."""
    if not rig.start(BEFORE_UM):
        return
    rig.machine.wants_um(-20.0)
    path = rig.random.choice((rig.daemon.config, rig.daemon.folder / "model.toml"))
    texts = deep_texts(path.read_text())
    rig.random.shuffle(texts)
    for text in texts:
        rig.tries += 1
        if not reload_refused(rig, path, text):
            return
    goes_on(rig)


@attack(links=("tcp",), limit_s=120.0)
def model_of_60_MB(rig):
    """Refused in time for everybody else, and its memory given back."""
    if not rig.start(BEFORE_UM):
        return
    model = rig.daemon.folder / "model.toml"
    before_MB = rig.daemon.memory_MB()
    numbers = ", ".join("20.25" for _ in range(8_600_000))
    reload_refused(rig, model, model.read_text().replace('"first_sample"', f"[{numbers}]"))
    if rig.daemon.alive():
        more_MB = rig.daemon.memory_MB() - before_MB
        rig.must(more_MB < MEMORY_MORE_MB, f"{more_MB:.0f} MB more memory is kept afterwards")
    goes_on(rig)


@attack(links=("tcp",), limit_s=120.0)
def half_a_million_unknown_keys(rig):
    """An answer and a log that a person can read."""
    if not rig.start(BEFORE_UM):
        return
    path = rig.random.choice((rig.daemon.config, rig.daemon.folder / "model.toml"))
    before = rig.daemon.log.stat().st_size
    keys = "".join(f"k{i} = 1\n" for i in range(500_000))
    reload_refused(rig, path, keys + path.read_text())
    grown = rig.daemon.log.stat().st_size - before
    rig.must(grown < LOG_MAX_BYTES, f"the log has grown by {grown / 1e6:.0f} MB")
    goes_on(rig)


@attack(links=("tcp",), limit_s=90.0)
def files_that_are_none(rig):
    """Configuration or model is a device without an end, a FIFO, a folder, a link to itself."""
    rig.daemon.limit_as = 3 << 30
    if not rig.start(BEFORE_UM):
        return
    path = rig.random.choice((rig.daemon.config, rig.daemon.folder / "model.toml"))
    good = path.with_suffix(".good")
    path.rename(good)
    for kind in ("fifo", "folder", "loop", "zero", "random", "none"):
        rig.tries += 1
        if kind == "fifo":
            os.mkfifo(path)
        elif kind == "folder":
            path.mkdir()
        elif kind != "none":
            path.symlink_to({"loop": path, "zero": "/dev/zero", "random": "/dev/urandom"}[kind])
        asked = time.monotonic()
        rig.daemon.hang_up()
        answered = eventually(lambda: rig.daemon.status()["mode"] or not rig.daemon.alive(), 10.0)
        rig.must(answered, f"nobody is answered after a reload of a {kind}")
        if kind == "fifo" and not answered:
            with open(os.open(path, os.O_RDWR | os.O_NONBLOCK), "wb") as end:
                end.write(b"x")
        time.sleep(max(0.0, 0.3 - (time.monotonic() - asked)))
        if kind == "folder":
            path.rmdir()
        elif kind != "none":
            path.unlink()
        if not rig.daemon.alive():
            break
    good.rename(path)
    goes_on(rig)


@attack(links=("tcp",), limit_s=60.0)
def broken_toml(rig):
    """Configuration and model with bytes flipped, lines moved and numbers changed, by the hundred:
    whatever is taken keeps the axis within slew and bound."""
    if not rig.start(BEFORE_UM):
        return
    paths = (rig.daemon.config, rig.daemon.folder / "model.toml")
    good = [path.read_bytes() for path in paths]
    numbers = ("1e300", "-1e300", "nan", "inf", "-1", "0", "9223372036854775807", "1e-300", "[]",
               '""', "true", "0x7fffffffffffffff")
    end = time.monotonic() + 5.0
    while time.monotonic() < end and rig.daemon.alive():
        rig.tries += 1
        which = rig.random.randrange(2)
        text = bytearray(good[which])
        if rig.random.random() < 0.4:
            for _ in range(rig.random.randint(1, 3)):
                text[rig.random.randrange(len(text))] = rig.random.randrange(256)
        else:
            lines = text.split(b"\n")
            at = rig.random.randrange(len(lines))
            key = lines[at].split(b"=")[0]
            if key.strip() in (b"offset_um_max", b"rate_um_per_s_max", b"file", b"path",
                               b"state_file"):
                continue  # then the bound would be another one, or other files would be written
            lines[at] = key + b"= " + rig.random.choice(numbers).encode()
            text = b"\n".join(lines)
        paths[which].write_bytes(text)
        if b"bound" in text or told_by_reload(rig):
            paths[which].write_bytes(good[which])
    for path, text in zip(paths, good):
        path.write_bytes(text)
    goes_on(rig)


PLACES = ("state", "history", "socket", "model", "config")


@attack(links=("tcp",), limit_s=90.0)
def one_file_for_two(rig):
    """Two of state, history, socket, model and configuration are the same file, by name or by a
    link: refused by `check`, and nothing of it is written over."""
    rig.daemon.other |= {"model": str(rig.daemon.folder / "model.toml")}
    for i, first in enumerate(PLACES):
        for second in PLACES[i + 1:]:
            if (first, second) == ("model", "config"):
                continue  # one file for both is refused for its keys
            rig.tries += 1
            one_pair(rig, first, second)


def one_pair(rig, first, second):
    """`first` is set to the file of `second`."""
    daemon = rig.daemon
    for file in daemon.folder.iterdir():
        if file.name != "model.toml":
            file.unlink()
    if daemon.socket.exists() or daemon.socket.is_symlink():
        daemon.socket.unlink()
    paths = {"state": daemon.state, "history": daemon.history, "socket": daemon.socket,
             "model": daemon.folder / "model.toml", "config": daemon.config}
    text = daemon.write_config()
    other = paths[second]
    if rig.random.random() < 0.5 and second in ("model", "config"):
        other = daemon.folder / "link"
        other.symlink_to(paths[second])
    text = text.replace(f'"{paths[first]}"', f'"{other}"')
    daemon.config.write_text(text)
    kept = {name: paths[name].read_bytes() for name in ("model", "config")}
    status, _ = rig.tool("check", daemon.config)
    rig.must(status == 2, f"check finds nothing wrong with {first} = {second}")
    started = daemon.start(wait=False) and eventually(
        lambda: rig.manager.ready.is_set() or not daemon.alive(), 10.0)
    if daemon.alive():
        rig.must(not started, f"starts with {first} = {second}")
        time.sleep(0.4)
        daemon.end()
    elif daemon.process.returncode in (1, 2):
        daemon.ends_expected = True
    else:
        rig.ended += 1
        rig.broke(f"{first} = {second} ends it with {daemon.process.returncode}")
    for name, content in kept.items():
        rig.must(paths[name].is_file() and paths[name].read_bytes() == content,
                 f"{first} = {second}: the {name} is written over")


@attack(links=("tcp",), limit_s=60.0)
def history_path_that_leads_nowhere(rig):
    """A loop of links, a folder, a FIFO, a device: no crash, and the rest goes on or is refused."""
    for kind in ("loop", "long loop", "folder", "fifo", "/dev/full", "/dev/null"):
        rig.tries += 1
        for file in rig.daemon.folder.glob("history*"):
            if file.is_dir() and not file.is_symlink():
                file.rmdir()
            else:
                file.unlink()
        history = rig.daemon.history
        if kind == "loop":
            history.symlink_to(history)
        elif kind == "long loop":
            other = history.with_name("history_other.db")
            history.symlink_to(other)
            other.symlink_to(history)
        elif kind == "folder":
            history.mkdir()
        elif kind == "fifo":
            os.mkfifo(history)
        else:
            history.symlink_to(kind)
        rig.tool("check", rig.daemon.config)
        if rig.daemon.start(may_refuse=True):
            time.sleep(1.0)
            rig.must(rig.daemon.alive(), f"{kind}: the daemon has ended "
                     f"with {rig.daemon.process.poll()}")
            rig.must(not rig.daemon.alive() or not rig.daemon.status()["history"]["working"] or
                     history.is_file(), f"{kind}: says that the history works")
            if rig.daemon.alive():
                rig.must(rig.daemon.end(), f"{kind}: does not end well")
        elif rig.daemon.alive():
            rig.broke(f"{kind}: hangs in its start")
            rig.daemon.kill()


ESCAPES = ("\\u001b[2J", "\\u202e", "\\u0007", "\\u009b31m", "\\u2066", "\\n")


@attack(links=("tcp",), limit_s=60.0)
def escapes_in_names(rig):
    """Names with control and bidi characters are refused, or never reach a terminal as they are."""
    if not rig.start(BEFORE_UM):
        return
    good = rig.daemon.config.read_text()
    for escape in ESCAPES:
        rig.tries += 1
        for name in ('"column"', '"z"', '"cabinet"', '"cnc"'):
            text = good.replace(f"name = {name}", f"name = {name[:-1]}{escape}\"")
            if name == '"column"':
                text = text.replace('sensors = ["column"]', f'sensors = ["column{escape}"]')
            rig.daemon.config.write_text(text)
            outputs = [rig.tool("check", rig.daemon.config)[1]]
            told_by_reload(rig)
            if rig.daemon.alive():
                outputs += [rig.tool("--socket", rig.daemon.socket, each)[1]
                            for each in ("status", "sensors")]
            raw = json.loads(f'"{escape}"')[0]
            rig.must(raw == "\n" or not any(raw in output for output in outputs),
                     f"{escape} comes out as it is")
    rig.must(not any(json.loads(f'"{escape}"')[0] in rig.daemon.log_text() for escape in ESCAPES
                     if escape != "\\n"), "escapes come into the log")
    rig.daemon.config.write_text(good)
    goes_on(rig)


@attack(links=("tcp",), limit_s=90.0)
def million_columns(rig):
    """`fit`, `group` and `diagnose` on a file of a million columns end soon, and say why."""
    run = rig.folder / "wide.csv"
    names = ",".join(f"t{i}_degC" for i in range(1_000_000))
    with run.open("w") as file:
        file.write("time_s,z_um," + names + "\n")
        for i in range(3):
            file.write(f"{i},0.{i}," + ",".join(["20.5"] * 1_000_000) + "\n")
    model = rig.machine.folder / "model.toml"
    model.write_text(model.read_text().replace("column_degC", "t1_degC")
                     .replace("spindle_degC", "t2_degC"))
    fitted = rig.folder / "fitted.toml"
    for arguments in (("group", run), ("fit", run, "--outputs", "z_um", "-o", fitted),
                      ("diagnose", "--model", model, "--train", run, "--test", run)):
        rig.tries += 1
        status, _ = rig.tool(*arguments, patience_s=30.0)
        rig.must(status is not None, f"{arguments[0]} is not done after 30 s")
