"""Headers of libraries not linked cannot be included: planted includes must not compile."""
import json
import os
import pathlib
import re
import shlex
import subprocess

import pytest

SOURCE = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ["THERMOCOMP_BUILD"])
COMMANDS = BUILD / "compile_commands.json"


@pytest.fixture(scope="module")
def commands():
    if not COMMANDS.exists():
        pytest.skip("this build tells no compile commands")
    found = {}
    for each in json.loads(COMMANDS.read_text(encoding="utf-8")):
        found[each["file"]] = each
        if "/Unity/" in each["file"]:  # several files of a target, compiled as one
            together = pathlib.Path(each["file"]).read_text(encoding="utf-8")
            found.update({file: each for file in re.findall(r'#include "(.*\.cpp)"', together)})
    return found


def compile_beside(commands, file, header, folder):
    """Compiles a file that includes `header`, with the include folders of `file`."""
    words = shlex.split(commands[str(SOURCE / file)]["command"])
    compiler = next(word for word in words if word.endswith(("c++", "g++", "clang++")))
    kept, takes_next = [], False
    for word in words:
        if takes_next or word.startswith(("-I", "-std=")):
            kept.append(word)
        elif word == "-isystem":
            kept.append(word)
        takes_next = word == "-isystem"
    planted = folder / "planted.cpp"
    planted.write_text(f'#include "{header}"\n', encoding="utf-8")
    return subprocess.run([compiler, *kept, "-fsyntax-only", planted], capture_output=True,
                          text=True, timeout=120, check=False)


@pytest.mark.parametrize("file, header", [
    ("estimator/axes/axis_bank.cpp", "drivers/bus.hpp"),
    ("drivers/modbus/connection.cpp", "drivers/can/can_socket.hpp"),
    ("drivers/sensors/can_source.cpp", "drivers/modbus/connection.hpp"),
    ("drivers/can/canopen/canopen_node.cpp", "drivers/can/j1939/j1939_line.hpp"),
    ("config/daemon/daemon_config.cpp", "drivers/sensors/make_source.hpp"),
    ("daemon/cycle/cycle.cpp", "config/daemon/daemon_config.hpp"),
    ("daemon/history/reading/history_reader.cpp", "daemon/history/writing/history_store.hpp"),
    ("daemon/socket/status_client.cpp", "daemon/cycle/cycle.hpp"),
    ("simulator/plant/simulate.cpp", "daemon/cycle/cycle.hpp"),
])
def test_a_header_of_a_library_that_is_not_linked_is_not_found(commands, tmp_path, file, header):
    assert (SOURCE / header).exists()
    result = compile_beside(commands, file, header, tmp_path)
    assert result.returncode == 1
    assert f"{header}: No such file" in result.stderr or f"'{header}' file not found" in result.stderr


@pytest.mark.parametrize("file, header", [
    ("estimator/axes/axis_bank.cpp", "estimator/types.hpp"),
    ("drivers/sensors/can_source.cpp", "drivers/can/can_socket.hpp"),
    ("daemon/cycle/cycle.cpp", "drivers/bus.hpp"),
])
def test_one_that_is_linked_is_found(commands, tmp_path, file, header):
    result = compile_beside(commands, file, header, tmp_path)
    assert result.returncode == 0, result.stderr
