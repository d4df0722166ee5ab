"""Replaces the outputs in docs/first_machine.md by the programs' current ones.

    THERMOCOMP=build/release/bin/thermocomp THERMOCOMP_SOURCE=. write_first_machine.py

Runs the devices of foreign_machine.py on ports 5020 and 5021 and two days of the simulated machine.
"""
import pathlib
import re
import subprocess
import sys
import tempfile

from conftest import PROGRAM, SOURCE, run
from test_init import HERE, NAMES, converse, eventually, listens, running

DOCUMENT = SOURCE / "docs" / "first_machine.md"
PORTS = 5020, 5021


def block(text):
    plain = re.sub("\033\\[[0-9;]*m", "", text.replace("\r", ""))  # without colours
    return "```\n" + plain.rstrip() + "\n```\n"


def printed(folder, *arguments):
    """A command as typed in the folder, with its output."""
    answer = subprocess.run([PROGRAM, *map(str, arguments)], cwd=folder, text=True, timeout=120,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    typed = "thermocomp " + " ".join(map(str, arguments))
    return f"$ {typed}\n{answer.stdout}"


def shortened(text):
    """The first, the middle and the last line of a move in steps."""
    lines = text.splitlines()
    moves = [at for at, line in enumerate(lines) if re.match(r"axis \w+: sent", line)]
    shown = {moves[0], moves[len(moves) // 2], moves[-1]}
    short = []
    for at, line in enumerate(lines):
        if at not in moves or at in shown:
            short.append(line)
        elif at - 1 in shown:
            short.append("...")
    return "\n".join(short) + "\n"


def first_outputs(folder):
    config = folder / "thermocompd.toml"
    answers = [f"tcp:127.0.0.1:{PORTS[0]}", "", "wago_750_458", NAMES,
               "holding:float32/CDAB:1:100,102", "motor room", f"tcp:127.0.0.1:{PORTS[1]}", "",
               "spindle_rpm=input:26:uint16", ""]
    status, shown = converse(["init", config], answers)
    assert status == 0, shown
    socket = ["--socket", "status.sock"]
    with running(config):
        eventually(lambda: run("--socket", "status.sock", "sensors",
                               cwd=folder).stdout.count("  good") == 5, "readings have arrived")
        first = printed(folder, *socket, "sensors")
        eventually(lambda: run("--socket", "status.sock", "prove", "z", "0.1",
                                           cwd=folder).returncode == 0, "the axis is in step")
        first += "\n" + shortened(printed(folder, *socket, "prove", "z", "5"))
    return first.replace(str(folder) + "/", "")


def model_outputs(folder):
    (folder / "machine.toml").symlink_to(SOURCE / "config" / "examples" / "machine.toml")
    text = ""
    for day, seed in {"monday": 1, "tuesday": 2, "friday": 5}.items():
        text += printed(folder, "simulate", "machine.toml", "--seed", seed, "-o", f"{day}.csv")
    text += "\n" + printed(folder, "fit", "monday.csv", "tuesday.csv", "--outputs", "z_um", "-o",
                           "fitted.toml")
    text += "\n" + printed(folder, "predict", "--model", "fitted.toml", "friday.csv", "-o",
                           "predicted.csv")
    return text


def fill(text, name, output):
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    return text[:text.index(begin) + len(begin)] + block(output) + text[text.index(end):]


def main():
    machine = subprocess.Popen([sys.executable, HERE / "foreign_machine.py", *map(str, PORTS)],
                               stderr=subprocess.DEVNULL)
    try:
        eventually(lambda: all(map(listens, PORTS)), "the devices listen")
        with tempfile.TemporaryDirectory(prefix="tc") as name:
            folder = pathlib.Path(name)
            (folder / "devices").symlink_to(SOURCE / "config" / "devices")
            first = first_outputs(folder)
            model = model_outputs(folder)
    finally:
        machine.kill()
        machine.wait(30)
    text = DOCUMENT.read_text()
    for part, output in (("first", first), ("model", model)):
        text = fill(text, part, output)
    DOCUMENT.write_text(text)
    print(f"{DOCUMENT}: filled, by {PROGRAM}")


if __name__ == "__main__":
    main()
