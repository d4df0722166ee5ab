"""Every fuzz target has seeds, including every example of its kind."""
import pathlib
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    history = folder / "history.db"
    history.write_bytes(bytes(200))
    subprocess.run(["/usr/bin/python3", "-B", ROOT / "tests/fuzz/make_seeds.py", folder, history],
                   check=True, timeout=60)
    return folder


def names(folder):
    return {path.name for path in folder.iterdir()}


def test_every_target_has_seeds(made):
    targets = {path.stem for path in (ROOT / "tests/fuzz").glob("*.cpp")}
    assert names(made / "seeds") == targets
    dictionaries = {path.stem for path in (made / "dictionaries").iterdir()}
    assert dictionaries and dictionaries <= targets


@pytest.mark.parametrize("kind, target", [("daemon", "daemon_config"), ("model", "model_file"),
                                          ("device", "preset_file")])
def test_every_example_is_a_seed(made, kind, target):
    examples = ROOT / "config/examples"
    expected = {
        "daemon": {f"examples_{path.name}" for path in examples.glob("*.toml")
                   if "\n[model]\n" in path.read_text()},
        "model": {f"examples_{path.name}" for path in examples.glob("*.toml")
                  if "\nmatrix_um_per_K" in path.read_text()},
        "device": names(ROOT / "config/devices"),
    }[kind]
    assert expected and expected <= names(made / "seeds" / target)


def test_only_inputs_that_were_found_are_kept():
    kept = {path.name for path in (ROOT / "tests/fuzz/seeds").glob("*/*")}
    assert kept and all(name.startswith("found-") for name in kept)
