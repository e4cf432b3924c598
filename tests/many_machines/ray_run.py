"""Test of Ray with workers that are killed half-way: no level is lost, and none is played twice.

Called by run.sh with the program `playbot`. It runs `playbot test --cluster ray` with three workers. Of one shard it kills the worker and the program together, as a machine that goes down does; of a second one only the program; of a
third one only the worker. The joined results must be those of one process, byte for byte. Works on Linux, which has the processes in
/proc.
"""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

LEVELS, FIRST_TO_LAST, SHARDS, WORKERS = 140, "hard:0..139", 7, 3
TEST = ["--bot", "random,right-jump"]
# Failures of the deterministic bot become files that are joined, too.
MORE = ["--episodes", "4", "--seed", "3", "--keep-failures"]
# A shard is killed when this many of its levels are whole.
AT_WORK = 4
# The killed processes of each shard.
KILLS = {0: "worker and program", 1: "program", 2: "worker"}
LONGEST = 300.0
SOURCES = str(pathlib.Path(__file__).parents[2] / "plugin/python/src")


def whole_lines(journal):
    """Returns the levels that are whole in a shard's journal."""
    try:
        text = journal.read_bytes()
    except OSError:
        return []
    return text[: text.rfind(b"\n") + 1].splitlines()


def processes(shard):
    """Returns the program that tests a shard, and the worker of Ray that started it."""
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            words = (entry / "cmdline").read_bytes().split(b"\0")
            parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            is_worker = (pathlib.Path("/proc") / str(parent) / "cmdline").read_bytes().startswith(b"ray::")
        except OSError:
            continue
        if is_worker and str(shard).encode() in words:
            return int(entry.name), parent
    return None


def kill(pid):
    os.kill(pid, signal.SIGKILL)


def kill_half_way(out, driver):
    """Kills each of the shards in `KILLS` once, and returns the levels that were whole then, by shard."""
    kept = {}
    end = time.monotonic() + LONGEST
    while len(kept) < len(KILLS):
        if driver.poll() is not None:
            sys.exit(f"the test ended before all were killed: only shards {sorted(kept)} were")
        if time.monotonic() > end:
            sys.exit("the shards are not at work")
        time.sleep(0.01)
        for index in KILLS.keys() - kept.keys():
            folder = out / "shards" / str(index)
            journal = folder / "levels.jsonl"
            if not AT_WORK <= len(whole_lines(journal)) < LEVELS // SHARDS:
                continue
            # The folder is named as the script hands it over.
            found = processes(folder)
            if found is None:
                continue
            program, worker = found
            kept[index] = whole_lines(journal)
            if "worker" in KILLS[index]:
                kill(worker)
            if "program" in KILLS[index]:
                try:
                    kill(program)
                except ProcessLookupError:
                    # It went with its worker.
                    pass
            print(f"shard {index}: killed its {KILLS[index]} when {len(kept[index])} of {LEVELS // SHARDS} levels were done")
    return kept


def check(what, is_so):
    if not is_so:
        sys.exit(f"FAILED: {what}")
    print(f"ok: {what}")


def files(folder):
    """Returns all results of a test, but for the shards and the journal, whose order is that of the threads."""
    paths = (path for path in folder.rglob("*") if path.is_file())
    names = {str(path.relative_to(folder)): path for path in paths}
    own = {"levels.jsonl", "test.json"}
    return {name: path.read_bytes() for name, path in names.items() if name not in own and not name.startswith("shards/")}


def main():
    playbot = sys.argv[1]
    folder = pathlib.Path(tempfile.mkdtemp(prefix="playbot-ray-"))
    whole, out = folder / "whole", folder / "joined"
    one = [playbot, "test", "coinrun", "--levels", FIRST_TO_LAST, *TEST, *MORE, "--out", str(whole)]
    started = time.monotonic()
    code = subprocess.run(one, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode
    print(f"one process: exit code {code}, {time.monotonic() - started:.1f} s")
    call = [playbot, "test", "coinrun", "--levels", FIRST_TO_LAST, *TEST, *MORE, "--out", str(out)]
    call += ["--cluster", "ray", "--workers", str(WORKERS), "--shards", str(SHARDS)]
    environment = {**os.environ, "PLAYBOT_PYTHON": sys.executable, "PYTHONPATH": SOURCES, "RAY_ADDRESS": "local"}
    started = time.monotonic()
    log = folder / "log"
    with open(log, "wb") as file:
        driver = subprocess.Popen(call, stdout=file, stderr=file, cwd=folder, env=environment)
        try:
            kept = kill_half_way(out, driver)
            ended = driver.wait(LONGEST)
        finally:
            # Its workers end with it.
            driver.terminate()
            driver.wait()
    print(f"{SHARDS} shards on {WORKERS} workers: exit code {ended}, {time.monotonic() - started:.1f} s; see {log}")
    check("the exit code is that of one process", ended == code)
    journals = {index: whole_lines(out / "shards" / str(index) / "levels.jsonl") for index in range(SHARDS)}
    for index, lines in kept.items():
        check(f"shard {index} went on behind its {len(lines)} levels", journals[index][: len(lines)] == lines)
    played = [json.loads(line)["index"] for lines in journals.values() for line in lines]
    check(f"each of {LEVELS} levels is there, and none twice", sorted(played) == list(range(LEVELS)))
    joined, single = files(out), files(whole)
    findings = [name for name in single if name.startswith("findings/")]
    check(f"the same {len(single)} files, {len(findings)} of them findings", findings and joined.keys() == single.keys())
    for name in sorted(single.keys() - set(findings)):
        check(f"{name}: {len(single[name])} bytes, equal to those of one process", joined[name] == single[name])
    check("the findings are equal, too", joined == single)
    again = subprocess.run([*call, "--resume"], cwd=folder, capture_output=True, env=environment, check=False)
    check("the same call on finished shards changes nothing", again.returncode == code and files(out) == single)
    shutil.rmtree(folder)


if __name__ == "__main__":
    main()
