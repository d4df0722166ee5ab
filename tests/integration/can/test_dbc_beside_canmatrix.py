"""Our decoding of DBC files and frames, compared with python3-canmatrix, which encodes them."""

import os
import pathlib
import random
import subprocess

import pytest

import frames_of

HERE = pathlib.Path(__file__).resolve().parent
DBC_VALUES = os.environ.get("DBC_VALUES", "dbc_values")
FRAMES = 10_000
NO_MESSAGE = "VECTOR__INDEPENDENT_SIG_MSG"


def decoded(dbc, frames):
    run = subprocess.run([DBC_VALUES, str(dbc)], input="".join(f.text + "\n" for f in frames),
                         capture_output=True, text=True, timeout=200)
    assert run.returncode == 0, run.stderr
    for line in run.stdout.splitlines():
        message, *signals = line.split("\t")
        yield message, {name: (int(raw), value)
                        for name, raw, value in (each.split(" ") for each in signals)}


def differences(matrix, frames, results):
    found = []
    for frame, (message, values) in zip(frames, results, strict=True):
        signals = {each.name: each for each in matrix.frame_by_name(frame.message).signals}
        if message != frame.message or values.keys() != frame.raw.keys():
            found.append((frame, message, values))
            continue
        for name, (raw, value) in values.items():
            wanted = frames_of.raw_bits(signals[name], frame.raw[name])
            if raw != wanted or not frames_of.same(float(value), frame.value[name], signals[name],
                                                   frame.raw[name]):
                found.append((frame.text, name, raw, wanted, value, frame.value[name]))
    return found


def frames_of_matrix(matrix, count, seed):
    chance = random.Random(seed)
    kinds = [each for each in matrix.frames if each.name != NO_MESSAGE]
    return [frames_of.random_frame(chance.choice(kinds), chance) for _ in range(count)]


def test_ten_thousand_random_frames_are_decoded_as_canmatrix_encoded_them():
    dbc = HERE / "every_kind.dbc"
    matrix = frames_of.load(dbc)
    frames = frames_of_matrix(matrix, FRAMES, seed=7)
    signals = sum(len(each.signals) for each in matrix.frames if each.name != NO_MESSAGE)
    assert signals >= 40
    found = differences(matrix, frames, decoded(dbc, frames))
    values = sum(len(each.raw) for each in frames)
    print(f"\n{signals} signals, {len(frames)} frames ({sum(f.fd for f in frames)} FD), {values} "
          f"values: {len(found)} differences")
    assert not found, found[:5]
    assert {each.name for frame in matrix.frames for each in frame.signals} - {"Nowhere"} == {
        name for frame in frames for name in frame.raw}, "every signal has been in a frame"


@pytest.mark.parametrize("planted", ["0|16@1- (0.1,0)", "7|16@0- (0.1,0)"])
def test_a_file_with_one_changed_bit_differs(planted, tmp_path):
    original = (HERE / "every_kind.dbc").read_text()
    dbc = tmp_path / "moved.dbc"
    dbc.write_text(original.replace(planted, {"0": "1", "7": "6"}[planted[0]] + planted[1:], 1))
    assert dbc.read_text() != original
    matrix = frames_of.load(HERE / "every_kind.dbc")
    frames = frames_of_matrix(matrix, 200, seed=8)
    assert differences(matrix, frames, decoded(dbc, frames))


def test_a_file_that_canmatrix_has_written_means_the_same(tmp_path):
    import canmatrix.formats
    matrix = frames_of.load(HERE / "every_kind.dbc")
    written = tmp_path / "written.dbc"
    with written.open("wb") as out:
        canmatrix.formats.dump(matrix, out, "dbc", dbcExportEncoding="utf8")
    frames = frames_of_matrix(matrix, 1000, seed=9)
    found = differences(matrix, frames, decoded(written, frames))
    assert not found, found[:5]


def test_a_broken_file_is_refused_with_file_line_and_rule(tmp_path):
    dbc = tmp_path / "broken.dbc"
    dbc.write_text((HERE / "every_kind.dbc").read_text().replace("0|64@1-", "8|64@1-"))
    run = subprocess.run([DBC_VALUES, str(dbc)], input="", capture_output=True, text=True,
                         timeout=60)
    line = 1 + dbc.read_text().splitlines().index(
        ' SG_ I64 : 8|64@1- (1,0) [0|0] "" HOST')
    assert run.returncode == 2
    assert f"{dbc}:{line}: I64 = 8|64: must end within the 8 bytes of WHOLE_INTEL" in run.stderr
