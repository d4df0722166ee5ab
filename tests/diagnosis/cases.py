"""Cases with effects hidden by seed; the tool gets only the files."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one thread per job

# ruff: noqa: E402
import json
import multiprocessing
import pathlib
import subprocess
import tempfile
import zlib

NULL_SEED = 50000


def diagnose(program, folder, model=("--model", "model.toml")):
    answer = folder / "answer.json"
    command = [program, "diagnose", *model, "--train", "train_a.csv", "train_b.csv", "--test",
               "test.csv", "--json", str(answer)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError("%s: %s" % (folder, done.stderr))
    return json.loads(answer.read_text())


def same(finding, truth):
    return (finding["cause"], finding["subject"]) == (truth["cause"], truth["subject"])


def summary(answer):
    found = answer["findings"]
    return ", ".join("%s(%s)" % (f["cause"], f["subject"]) for f in found) or answer["verdict"]


def examined(task, make, model=("--model", "model.toml")):
    """@param task  program, folder that keeps the files or None, kind, level, seed, causes
    @param make  writes the files of a case; existing ones are kept
    @return (task, hidden effects, answer)"""
    program, keep, kind, level, seed, causes = task
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(keep or temporary) / ("%d_%d_%s" % (level, seed, "+".join(causes)))
        facts = folder / "truth.json"
        if not facts.exists():
            make(folder, seed, level, causes)
        return task, json.loads(facts.read_text()), diagnose(program, folder, model)


def is_right(truth, answer):
    """True if the only hidden cause with its subject is the first finding, or if nothing is hidden
    and nothing named."""
    if not truth["hidden"]:
        return answer["verdict"] != "effect"
    return bool(answer["findings"]) and same(answer["findings"][0], truth["hidden"][0])


def short_campaign(program, examine, level, causes, nulls, wrong_max):
    """Every cause once, its seed from its name, and some untouched machines.
    @return exit status: 1 if more than wrong_max are wrong or an untouched machine has a finding"""
    tasks = [(program, None, "single", level, zlib.crc32(cause.encode()), [cause])
             for cause in causes]
    tasks += [(program, None, "null", level, NULL_SEED + seed, []) for seed in range(nulls)]
    wrong = invented = 0
    with multiprocessing.Pool(2) as pool:
        for task, truth, answer in pool.imap(examine, tasks):
            if is_right(truth, answer):
                continue
            wrong += bool(truth["hidden"])
            invented += not truth["hidden"]
            print("  seed %d: %s -> %s" % (task[4], ", ".join(
                "%s(%s)" % (t["cause"], t["subject"]) for t in truth["hidden"]) or "nothing",
                summary(answer)))
    print("%d of %d wrong, %d of %d untouched named" % (wrong, len(causes), invented, nulls))
    return 1 if wrong > wrong_max or invented else 0
