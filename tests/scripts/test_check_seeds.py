"""The seeds of the fuzz targets are those of today's examples, and the check finds one that is not."""
import pathlib
import shutil
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]


def check(root):
    return subprocess.run(["/usr/bin/python3", str(root / "tests/fuzz/make_seeds.py"), "--check"],
                          capture_output=True, text=True, timeout=60, check=False)


def test_the_seeds_are_those_of_the_examples():
    done = check(ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


def test_an_example_without_a_seed_is_found(tmp_path):
    for folder in ("config", "tests/fuzz", "tests/example_buses", "tests/example_terms",
                   "tests/integration/can"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    assert check(tmp_path).returncode == 0
    examples = tmp_path / "config/examples"
    shutil.copy(examples / "travel.toml", examples / "another.toml")
    done = check(tmp_path)
    assert done.returncode == 1
    assert done.stdout == ("tests/fuzz/seeds/daemon_config/examples_another.toml: missing or old; "
                           "run tests/fuzz/make_seeds.py\n")
