"""scripts/check_includes.py finds planted include cycles, and only those."""
import os
import subprocess

import pytest

PROGRAM = os.path.join(os.path.dirname(__file__), "..", "..", "scripts", "check_includes.py")


def run(root, *options):
    return subprocess.run([PROGRAM, "--root", str(root), *options], capture_output=True, text=True,
                          timeout=60, check=False)


def write(root, path, *included):
    file = root / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("".join(f'#include "{name}"\n' for name in included), encoding="utf-8")


@pytest.fixture
def tree(tmp_path):
    """Three folders that include downwards: daemon -> drivers -> estimator."""
    write(tmp_path, "estimator/types.hpp")
    write(tmp_path, "drivers/link.hpp", "estimator/types.hpp")
    write(tmp_path, "drivers/link.cpp", "drivers/link.hpp")
    write(tmp_path, "daemon/cycle.cpp", "drivers/link.hpp")
    (tmp_path / "scripts").mkdir()
    assert run(tmp_path, "--write").returncode == 0
    return tmp_path


def test_a_tree_that_reads_downwards_passes(tree):
    result = run(tree)
    assert result.returncode == 0, result.stdout
    assert "4 files, 3 folders, 0 wrong" in result.stdout


def test_the_levels_are_drawn_highest_first(tree):
    text = (tree / "scripts" / "include_levels.md").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.startswith("| ") and "`" in line]
    assert rows == ["| 3 | `daemon` |", "| 2 | `drivers` |", "| 1 | `estimator` |"]


def test_a_circle_of_two_files_of_one_folder_is_found_and_named(tree):
    write(tree, "drivers/port.hpp", "drivers/link.hpp")
    write(tree, "drivers/link.cpp", "drivers/link.hpp", "drivers/port.hpp")
    result = run(tree)
    assert result.returncode == 1
    assert "units in a circle: drivers/link drivers/port" in result.stdout
    assert "drivers/link.cpp includes drivers/port.hpp" in result.stdout
    assert "folders in a circle" not in result.stdout


def test_a_circle_of_folders_is_found_where_no_file_is_in_one(tree):
    write(tree, "estimator/report.hpp", "drivers/names.hpp")
    write(tree, "drivers/names.hpp")
    result = run(tree)
    assert result.returncode == 1
    assert "folders in a circle: drivers estimator" in result.stdout
    assert "units in a circle" not in result.stdout


def test_a_header_beside_the_file_is_found_as_the_compiler_finds_it(tree):
    write(tree, "drivers/port.hpp", "link.hpp")
    write(tree, "drivers/link.cpp", "drivers/link.hpp", "drivers/port.hpp")
    result = run(tree)
    assert result.returncode == 1
    assert "units in a circle: drivers/link drivers/port" in result.stdout


def test_a_folder_and_its_own_room_in_a_circle_are_found(tree):
    write(tree, "drivers/can/socket.hpp", "drivers/link.hpp")
    write(tree, "drivers/names.hpp", "drivers/can/socket.hpp")
    result = run(tree)
    assert result.returncode == 1
    assert "folders in a circle: drivers drivers/can" in result.stdout


def test_a_drawing_that_is_not_current_is_found(tree):
    write(tree, "config/units.hpp", "estimator/types.hpp")
    result = run(tree)
    assert result.returncode == 1
    assert "the levels in scripts/include_levels.md are not those of the tree" in result.stdout
