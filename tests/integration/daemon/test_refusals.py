"""Configurations that must not start: one message with the reason, and the right exit status."""

import os
import subprocess

import pytest

from lab import BIN, run_tool
from plain_devices import CONFIG, MODEL

GOOD = CONFIG.format(module=1502, controller=1503)
BROKEN = {  # name: (file, text, replacement, words of the message)
    "unknown key": ("config", "rate_hz = 100", "rate_hertz = 100", "rate_hertz"),
    "out of range": ("config", "rate_hz = 100", "rate_hz = 5000", "rate_hz"),
    "not a number": ("config", "offset_um_max = 60.0", "offset_um_max = nan", "offset_um_max"),
    "wrong type": ("config", "scale = 0.01", 'scale = "small"', "scale"),
    "unknown reference": ("config", 'sensors = ["spindle"]', 'sensors = ["spidnle"]', "spidnle"),
    "missing key": ("config", 'encoding = "int16"\n', "", "encoding"),
    "no TOML": ("config", "[loop]", "[loop", "thermocompd.toml:"),
    "model of other shape": ("model", "[[3.0, -1.5]]", "[[3.0]]", "matrix_um_per_K"),
    "model of another format": ("model", "format = 1", "format = 7", "format"),
    "model without a file": ("config", '"model.toml"', '"nosuch.toml"', "nosuch.toml"),
}


def write(folder, config, model=MODEL):
    (folder / "model.toml").write_text(model)
    path = folder / "thermocompd.toml"
    path.write_text(config.replace("@STATE@", f'state_file = "{folder}/state.json"')
                    .replace("@HISTORY@", f'file = "{folder}/history.db"') +
                    f'[socket]\npath = "{folder}/s"\n')
    return path


def run_daemon(path, **more):
    """(exit status, stderr) of a daemon that must end by itself."""
    done = subprocess.run([str(BIN / "thermocompd"), str(path)], capture_output=True, text=True,
                          timeout=60, **more)
    return done.returncode, done.stderr


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_configuration_is_refused_by_daemon_and_check_alike(tmp_path, name):
    where, text, instead, named = BROKEN[name]
    config, model = GOOD, MODEL
    if where == "config":
        assert text in config
        config = config.replace(text, instead, 1)
    else:
        assert text in model
        model = model.replace(text, instead, 1)
    path = write(tmp_path, config, model)
    status, output = run_daemon(path)
    assert status == 2 and named in output, output
    checked, _, found = run_tool("check", path)
    assert checked == 2 and named in found
    problems = [line for line in output.splitlines() if ".toml" in line]
    assert problems and all(line in found for line in problems)
    assert not (tmp_path / "history.db").exists() and not (tmp_path / "state.json").exists()


def test_a_good_configuration_passes_the_check(tmp_path):
    status, out, output = run_tool("check", write(tmp_path, GOOD))
    assert status == 0 and "OK" in out, output


def test_a_missing_file_and_wrong_options_are_usage_errors(tmp_path):
    status, output = run_daemon(tmp_path / "nosuch.toml")
    assert status == 2 and "nosuch.toml" in output
    done = subprocess.run([str(BIN / "thermocompd"), "--nosuch"], capture_output=True, text=True,
                          timeout=60)
    assert done.returncode == 2 and "--nosuch" in done.stderr
    done = subprocess.run([str(BIN / "thermocompd"), "--version"], capture_output=True, text=True,
                          timeout=60)
    assert done.returncode == 0 and done.stdout.strip()


def test_folders_that_cannot_be_written_are_named(tmp_path):
    """Root may write everywhere, so the folder is a file."""
    (tmp_path / "taken").write_text("no folder\n")
    for keys, place in ((f'state_file = "{tmp_path}/taken/state.json"', "taken/state.json"),
                        (f'file = "{tmp_path}/taken/history.db"', "taken/history.db"),
                        (f'path = "{tmp_path}/taken/s"', "taken/s")):
        key = keys.split(" = ")[0]
        path = write(tmp_path, GOOD)
        lines = path.read_text().splitlines()
        # The last match of `file` is the history's; the only `path` there is the socket's.
        index = max(i for i, line in enumerate(lines) if line.startswith(key + " = "))
        lines[index] = keys
        path.write_text("\n".join(lines) + "\n")
        with subprocess.Popen([str(BIN / "thermocompd"), str(path)], stdin=subprocess.DEVNULL,
                              stderr=subprocess.PIPE, text=True) as daemon:
            try:
                _, output = daemon.communicate(timeout=4)
                ended = daemon.returncode
            except subprocess.TimeoutExpired:
                daemon.terminate()
                _, output = daemon.communicate(timeout=60)
                ended = None
        print(key, ended, output)
        assert place in output, output
        assert ended in (None, 1)
        for name in os.listdir(tmp_path):
            if name.startswith(("state.json", "history.db", "s")):
                (tmp_path / name).unlink()
