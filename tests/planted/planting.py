"""Copies of the product's sources with planted bugs, each enabled by its number.

The product's own files are not changed. A text that is not found exactly once is an error, so that
the bugs stay at their places when the code changes. {P} stands for "this bug is enabled".
"""

DECLARATION = "namespace thermocomp {\nextern int planted_bug;\n}\n"


def with_bugs(bugs, file, text):
    """The text of `file` with its bugs. bugs: (name, file, original text, replacement)."""
    for number, (name, of_file, old, new) in enumerate(bugs, start=1):
        if of_file != file:
            continue
        if text.count(old) != 1:
            raise SystemExit(f"planting: {name}: found {text.count(old)} times in {file}: {old}")
        switch = f"(::thermocomp::planted_bug == {number})"
        text = text.replace(old, new.replace("{P}", switch))
    if "#pragma once\n" in text:
        return text.replace("#pragma once\n", "#pragma once\n" + DECLARATION, 1)
    return DECLARATION + text


def write_if_new(path, text):
    if path.exists() and path.read_text() == text:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def files_of(bugs):
    return sorted({file for _, file, _, _ in bugs})


def write_copies(bugs, source, output):
    for file in files_of(bugs):
        write_if_new(output / file, with_bugs(bugs, file, (source / file).read_text()))
