"""check-odr.sh finds two definitions of one name, though no program links both files."""
import pathlib
import subprocess

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "check-odr.sh"
FIRST = "namespace n { struct Gain { double before{0.0}; double after{0.0}; }; Gain first() { return {}; } }\n"
OTHER = "namespace n { struct %s { double share{0.0}; }; %s other() { return {}; } }\n"
TYPES = ["-flto", "-ffat-lto-objects"]


def check(folder, name, options):
    """The script over two libraries; the other one defines n::NAME."""
    (folder / "first.cpp").write_text(FIRST)
    (folder / "other.cpp").write_text(OTHER % (name, name))
    for part in ("first", "other"):
        subprocess.run(["g++", "-std=c++20", "-O2", *options, "-c", f"{part}.cpp"], cwd=folder, check=True)
        subprocess.run(["ar", "rc", f"lib{part}.a", f"{part}.o"], cwd=folder, check=True)
    return subprocess.run([SCRIPT, folder], capture_output=True, text=True, timeout=120, check=False)


def test_two_names_are_accepted(tmp_path):
    done = check(tmp_path, "Share", TYPES)
    assert done.returncode == 0, done.stderr
    assert "2 libraries" in done.stdout


def test_one_name_defined_twice_is_refused(tmp_path):
    done = check(tmp_path, "Gain", TYPES)
    assert done.returncode == 1
    assert "struct Gain" in done.stderr and "-Werror=odr" in done.stderr


def test_a_library_without_types_is_refused(tmp_path):
    done = check(tmp_path, "Gain", [])
    assert done.returncode == 2
    assert "carries no types" in done.stderr
