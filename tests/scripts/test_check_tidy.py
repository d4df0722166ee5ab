"""clang-tidy with the rules of .clang-tidy finds planted defects in every folder with code."""
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

SOURCE = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCE / "scripts"))
from check_includes import CODE  # noqa: E402

CLEAN = """class Shape {
 public:
  Shape() = default;
  Shape(const Shape&) = delete;
  Shape& operator=(const Shape&) = delete;
  virtual ~Shape() = default;
  virtual int sides() const = 0;
};
"""
PLANTS = {
    "readability-identifier-naming": "int BadlyNamed() { return 1; }\n",
    "modernize-use-override": "class Square : public Shape {\n public:\n"
                              "  virtual int sides() const { return 4; }\n};\n",
    "modernize-use-nullptr": "inline int* nowhere() { return 0; }\n",
    "cppcoreguidelines-pro-type-member-init": "struct Pair {\n  int first;\n  int second;\n};\n"
                                              "inline int sum() {\n  Pair pair;\n"
                                              "  return pair.first + pair.second;\n}\n",
    "readability-function-size": "inline int long_one(int x) {\n" + "  x += 1;\n" * 80
                                 + "  return x;\n}\n",
    "misc-definitions-in-headers": "int defined_in_a_header() { return 1; }\n",
    "bugprone-integer-division": "inline double half(int x) { return x / 2; }\n",
}


def run_tidy(folder, header_folder, code):
    """Output for a header in `header_folder`, checked through a file that includes it."""
    if shutil.which("clang-tidy") is None:
        pytest.skip("clang-tidy is not installed")
    header = folder / header_folder / "planted.hpp"
    header.parent.mkdir(parents=True)
    header.write_text("#pragma once\n" + CLEAN + code, encoding="utf-8")
    unit = folder / "planted.cpp"
    unit.write_text(f'#include "{header_folder}/planted.hpp"\n', encoding="utf-8")
    return subprocess.run(
        ["clang-tidy", f"--config-file={SOURCE / '.clang-tidy'}", "-quiet", unit, "--",
         "-std=c++20", f"-I{folder}"], capture_output=True, text=True, timeout=120, check=False)


def test_clean_code_passes(tmp_path):
    result = run_tidy(tmp_path, "estimator", "")
    assert result.returncode == 0, result.stdout


@pytest.mark.parametrize("check", PLANTS)
def test_a_planted_error_is_found_by_its_name(tmp_path, check):
    result = run_tidy(tmp_path, "estimator", PLANTS[check])
    assert result.returncode != 0
    assert re.search(rf"planted\.hpp:\d+:\d+: error: .*\[{check}[,\]]", result.stdout), result.stdout


@pytest.mark.parametrize("folder", CODE)
def test_headers_of_every_folder_with_code_are_looked_at(tmp_path, folder):
    result = run_tidy(tmp_path, folder, PLANTS["modernize-use-nullptr"])
    assert "[modernize-use-nullptr" in result.stdout, result.stdout


def test_the_script_looks_at_every_folder_with_code():
    text = (SOURCE / "scripts" / "check-tidy.sh").read_text(encoding="utf-8")
    assert set(re.search(r"folders=\(([a-z\s]+)\)", text).group(1).split()) == set(CODE)
