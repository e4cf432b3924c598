"""The shards of a test, a task of Ray each.

A task whose worker or machine dies is started again by Ray, on any machine, and goes on with `--resume` behind the last level that is whole
in the shard's folder. The program joins the shards.
"""

import ctypes
import os
import pathlib
import shlex
import signal
import subprocess
import sys

from playbot.cluster.start import report, start

try:
    import fcntl
except ImportError:  # Windows has no such locks; there a second process is refused instead.
    fcntl = None

# Exit codes of the program; the last three after the signals INT, TERM and HUP.
PASSED, FINDINGS, FAILED, STOPPED = 0, 1, 2, (130, 143, 129)
# Seconds between two looks at the progress.
LOOK = 2.0
# Of what a program that failed has said, this much is printed.
LAST_WORDS = 4000
PR_SET_PDEATHSIG = 1


class Interrupted(Exception):
    """The program was killed or stopped; it can go on."""


def shard_folder(out, index):
    return pathlib.Path(out) / "shards" / str(index)


def command(args, index):
    """The call that tests one shard, or goes on with it."""
    shard = ["--shard", f"{index}/{args.shards}", "--threads", "1", "--resume", "--out", str(shard_folder(args.out, index))]
    return [args.program, *args.words, *shard]


def dies_with(parent):
    """What a child runs first, so that it does not outlive a worker that is killed. On Linux; elsewhere `wait_for` helps."""
    libc = ctypes.CDLL(None, use_errno=True) if sys.platform == "linux" else None

    def prepare():
        if libc:
            libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
            if os.getppid() != parent:
                os._exit(STOPPED[0])

    return prepare


def wait_for(folder):
    """Waits until no other process writes into the folder: a task that Ray gave up may still run on another machine."""
    try:
        with open(folder / "levels.jsonl", "r+b") as journal:
            if fcntl:
                fcntl.flock(journal, fcntl.LOCK_EX)
    except OSError:
        # There is none yet, or a file system without locks.
        pass


def play(words, folder, where):
    """Tests a shard. It is called again, perhaps elsewhere, when its worker was lost or it raised `Interrupted`."""
    wait_for(pathlib.Path(where) / folder)
    options = {} if os.name == "nt" else {"preexec_fn": dies_with(os.getpid())}
    done = subprocess.run(
        words, cwd=where, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, **options
    )
    said = done.stderr.decode(errors="replace")[-LAST_WORDS:]
    if done.returncode < 0 or done.returncode in STOPPED:
        raise Interrupted(f"{shlex.join(words)} was stopped ({done.returncode}):\n{said}")
    return done.returncode, said


def levels_done(args):
    """Levels that are finished in all shards."""
    count = 0
    for index in range(args.shards):
        try:
            count += (shard_folder(args.out, index) / "levels.jsonl").read_bytes().count(b"\n")
        except OSError:
            pass
    return count


def test_shards(args):
    """Tests all shards. The exit code is `PASSED` if all of them are there."""
    import ray

    try:
        start(args.address, args.workers)
    except Exception as error:  # noqa: BLE001, whatever Ray raises is told in one line
        report(f"Ray cannot be reached: {type(error).__name__}: {error}")
        return FAILED
    # Its code travels along, so that the machines of workers need Ray and the program alone.
    ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])
    retries = {"max_retries": args.retries, "retry_exceptions": [Interrupted]}
    task = ray.remote(num_cpus=1, **retries)(play)
    calls = [command(args, index) for index in range(args.shards)]
    running = {
        task.remote(call, str(shard_folder(args.out, index)), os.getcwd()): index for index, call in enumerate(calls)
    }
    worst = PASSED
    reported = None
    while running:
        ready, _ = ray.wait(list(running), timeout=LOOK)
        for reference in ready:
            index = running.pop(reference)
            try:
                code, said = ray.get(reference)
            except ray.exceptions.RayError as error:
                code, said = FAILED, f"given up after {args.retries} retries: {error}"
            if code not in (PASSED, FINDINGS):
                report(f"shard {index}/{args.shards} failed with exit code {code}: {shlex.join(calls[index])}\n{said}")
                worst = max(worst, code)
        progress = f"{args.shards - len(running)} of {args.shards} shards, {levels_done(args)} levels"
        if progress != reported:
            report(progress)
            reported = progress
    ray.shutdown()
    return worst
