"""The preset odr finds two definitions of one name in one program."""
import json
import pathlib
import subprocess

SOURCE = pathlib.Path(__file__).resolve().parents[2]
MAIN = """namespace n { struct Gain { double before{0.0}; double after{0.0}; }; Gain first() { return {}; } }
double second();
int main() { return n::first().after + second() > 0.0 ? 1 : 0; }
"""
OTHER = """namespace n { struct %s { double share{0.0}; }; %s other() { return {}; } }
double second() { return n::other().share; }
"""


def link(folder, name):
    """Links two files with the preset's compiler options; the other one defines n::NAME."""
    presets = json.loads((SOURCE / "CMakePresets.json").read_text())["configurePresets"]
    odr = next(preset for preset in presets if preset["name"] == "odr")
    (folder / "main.cpp").write_text(MAIN)
    (folder / "other.cpp").write_text(OTHER % (name, name))
    return subprocess.run(["g++", "-std=c++20", *odr["cacheVariables"]["CMAKE_CXX_FLAGS_DEBUG"].split(),
                           "main.cpp", "other.cpp", "-o", "program"],
                          cwd=folder, capture_output=True, text=True, timeout=120, check=False)


def test_two_names_are_accepted(tmp_path):
    done = link(tmp_path, "Share")
    assert done.returncode == 0, done.stderr


def test_one_name_defined_twice_is_refused(tmp_path):
    done = link(tmp_path, "Gain")
    assert done.returncode != 0
    assert "struct Gain" in done.stderr and "-Werror=odr" in done.stderr
