"""Modules for reading meshes and factorising, loaded when needed: their places, and the message
without them."""
import pathlib
import shutil
import tomllib

import pytest

from conftest import PROGRAM, run

BIN = pathlib.Path(PROGRAM).parent
MODULE = "thermocomp-gmsh.so"  # reads meshes
FACTORISES = "thermocomp-cholmod.so"


def reads_meshes():
    """True if the build has thermocomp-modelling with `structure`."""
    program = BIN / "thermocomp-modelling"
    return program.exists() and "  structure " in run("--help", program=program).stdout


pytestmark = pytest.mark.skipif(not reads_meshes(), reason="`structure` is not in this build")
CUBE = pathlib.Path(__file__).parent / "cube"  # grows by 1.1 um/K


@pytest.fixture
def alone(tmp_path):
    """The program without modules next to it."""
    (tmp_path / "bin").mkdir()
    return pathlib.Path(shutil.copy(BIN / "thermocomp-modelling", tmp_path / "bin"))


def structure(program, folder, mesh="cube.msh", command="structure"):
    shutil.copytree(CUBE, folder, dirs_exist_ok=True)
    text = (CUBE / "cube.toml").read_text()
    (folder / "cube.toml").write_text(text.replace("cube.msh", mesh))
    (folder / "model.toml").unlink(missing_ok=True)
    out = ["-o", folder / "model.toml"] if command == "structure" else []
    return run(command, folder / "cube.toml", *out, program=program)


def growth_um_per_K(answer, folder):
    assert answer.returncode == 0, answer.stderr
    return tomllib.loads((folder / "model.toml").read_text())["matrix_um_per_K"][0][0]


def output(answer):
    """The message after the progress."""
    assert answer.returncode == 2
    lines = [line for line in answer.stderr.splitlines() if "thermocomp" in line]
    assert len(lines) == 1, answer.stderr
    assert lines[0] == answer.stderr.splitlines()[-1]
    return lines[0]


def test_a_mesh_is_read_from_the_build_tree_and_where_it_is_installed(alone, tmp_path):
    assert growth_um_per_K(structure(BIN / "thermocomp-modelling", tmp_path),
                           tmp_path) == pytest.approx(1.1, rel=1e-9)
    (tmp_path / "lib" / "thermocomp").mkdir(parents=True)
    for module in [MODULE, FACTORISES]:
        shutil.copy(BIN / module, tmp_path / "lib" / "thermocomp")
    assert growth_um_per_K(structure(alone, tmp_path), tmp_path) == pytest.approx(1.1, rel=1e-9)


@pytest.mark.parametrize("command", ["structure", "place"])
def test_a_missing_module_is_one_line_with_the_places_and_the_package(alone, tmp_path, command):
    line = output(structure(alone, tmp_path, command=command))
    for part in [MODULE, f"{tmp_path}/bin", f"{tmp_path}/lib/thermocomp",
                 "package thermocomp-modelling", "libgmsh4.8"]:
        assert part in line


def test_a_load_error_is_one_line_with_file_and_reason(alone, tmp_path):
    module = tmp_path / "bin" / MODULE
    module.write_text("no library")
    assert f"{module}: " in output(structure(alone, tmp_path))
    # A library without the functions for meshes.
    shutil.copy(next(pathlib.Path("/usr/lib").glob("*/libdl.so.2")), module)
    line = output(structure(alone, tmp_path))
    assert str(module) in line and "thermocomp_gmsh_functions" in line


def test_a_text_mesh_needs_only_the_factorisation_module(alone, tmp_path):
    line = output(structure(alone, tmp_path, mesh="cube.inp"))
    for part in [FACTORISES, f"{tmp_path}/bin", f"{tmp_path}/lib/thermocomp",
                 "package thermocomp-modelling", "libcholmod3"]:
        assert part in line
    shutil.copy(BIN / FACTORISES, tmp_path / "bin")
    answer = structure(alone, tmp_path, mesh="cube.inp")
    assert growth_um_per_K(answer, tmp_path) == pytest.approx(1.1, rel=1e-9)
    # A missing mesh file is reported as such.
    absent = structure(alone, tmp_path, mesh="nowhere.msh")
    assert absent.returncode == 2 and "nowhere.msh: no such file" in absent.stderr


def test_nothing_else_needs_the_modules(alone):
    assert run("diagnose", "--help", program=alone).returncode == 0
