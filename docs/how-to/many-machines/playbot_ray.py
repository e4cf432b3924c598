#!/usr/bin/env python3
"""Tests levels on a Ray cluster: a task for each shard, then the results joined.

    pip install ray
    python playbot_ray.py --program target/release/playbot --game coinrun --levels hard:0..9999 \\
        --bot search,random --shards 16 --out runs/test -- --episodes 5

What stands behind `--` is handed to `playbot test` as it is. Run it in a folder that all machines of the cluster have under
the same path, such as one on NFS: program, policies, level files and --out are read and written there. Without a cluster, Ray
starts workers on this machine; `--address auto` joins one that runs.

A task whose worker or machine dies is started again by Ray, on any machine, and goes on with `--resume` behind the last level
that is whole in the shard's folder. The same call goes on after this script itself was killed. Exit codes are those of
`playbot test`: 0 all is well, 1 findings, 2 something failed, 3 wrong usage.
"""

import argparse
import ctypes
import os
import pathlib
import shlex
import signal
import subprocess
import sys
import time

import ray

try:
    import fcntl
except ImportError:  # Windows has no such locks; there a second process is refused instead.
    fcntl = None

# Exit codes of the program.
PASSED, FINDINGS, FAILED, USAGE, STOPPED = 0, 1, 2, 3, 130
# Seconds between two looks at the progress.
LOOK = 2.0
# Of what a program that failed has said, this much is printed.
LAST_WORDS = 4000
PR_SET_PDEATHSIG = 1


class Interrupted(Exception):
    """The program was killed or stopped; it can go on."""


def arguments():
    parser = argparse.ArgumentParser(
        description=__doc__.split("\n")[0], epilog="What stands behind -- is handed to `playbot test` as it is."
    )
    parser.add_argument("--program", required=True, help="the program with the game")
    parser.add_argument("--game", required=True, help="name of the game")
    parser.add_argument("--levels", required=True, help="levels, as mode:first..last or files:pattern")
    parser.add_argument("--bot", help="bots, separated by commas")
    parser.add_argument("--policy", action="append", default=[], help="policy file; may be given several times")
    parser.add_argument("--shards", type=int, required=True, help="number of shards; some for each worker")
    parser.add_argument("--out", required=True, help="folder for the joined results; the shards are in OUT/shards")
    parser.add_argument("--against", help="folder of earlier results to compare with")
    parser.add_argument("--cpus", type=int, default=1, help="cores of a task, and threads of its program (%(default)s)")
    parser.add_argument("--retries", type=int, default=10, help="times that a shard is tried again (%(default)s)")
    parser.add_argument("--address", help="Ray cluster, such as auto; workers on this machine if none is named")
    parser.add_argument("--workers", type=int, help="cores that Ray may use here, without --address; all of them")
    parser.add_argument("test", nargs="*", metavar="-- ...", help="more options of `playbot test`")
    args = parser.parse_args()
    for name in ("shards", "cpus"):
        if getattr(args, name) < 1:
            parser.error(f"--{name} must be at least 1")
    if os.sep in args.program or os.path.exists(args.program):
        # A name without a folder is looked for in PATH, on each machine.
        args.program = str(pathlib.Path(args.program).resolve())
    return args


def test_command(args, index):
    """The call that tests one shard, or goes on with it."""
    command = [args.program, "test", args.game, "--levels", args.levels]
    if args.bot:
        command += ["--bot", args.bot]
    for policy in args.policy:
        command += ["--policy", policy]
    command += ["--shard", f"{index}/{args.shards}", "--threads", str(args.cpus)]
    return command + args.test + ["--resume", "--out", str(shard_folder(args.out, index))]


def shard_folder(out, index):
    return pathlib.Path(out) / "shards" / str(index)


def dies_with(parent):
    """What a child runs first, so that it does not outlive a worker that is killed. On Linux; elsewhere `wait_for` helps."""
    libc = ctypes.CDLL(None, use_errno=True) if sys.platform == "linux" else None

    def prepare():
        if libc:
            libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
            if os.getppid() != parent:
                os._exit(STOPPED)

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


def play(command, folder, where):
    """Tests a shard. It is called again, perhaps elsewhere, when its worker was lost or it raised `Interrupted`."""
    folder = pathlib.Path(where) / folder
    wait_for(folder)
    options = {} if os.name == "nt" else {"preexec_fn": dies_with(os.getpid())}
    done = subprocess.run(
        command, cwd=where, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, **options
    )
    words = done.stderr.decode(errors="replace")[-LAST_WORDS:]
    if done.returncode < 0 or done.returncode == STOPPED:
        raise Interrupted(f"{shlex.join(command)} was stopped ({done.returncode}):\n{words}")
    return done.returncode, words


def levels_done(args):
    """Levels that are finished in all shards."""
    count = 0
    for index in range(args.shards):
        try:
            count += (shard_folder(args.out, index) / "levels.jsonl").read_bytes().count(b"\n")
        except OSError:
            pass
    return count


def report(words):
    print(words, file=sys.stderr, flush=True)


def test_shards(args):
    """Tests all shards. The exit code is `PASSED` if all of them are there."""
    retries = {"max_retries": args.retries, "retry_exceptions": [Interrupted]}
    task = ray.remote(num_cpus=args.cpus, **retries)(play)
    where = os.getcwd()
    commands = [test_command(args, index) for index in range(args.shards)]
    folders = [str(shard_folder(args.out, index)) for index in range(args.shards)]
    running = {task.remote(command, folder, where): index for index, (command, folder) in enumerate(zip(commands, folders))}
    worst = PASSED
    reported = None
    while running:
        ready, _ = ray.wait(list(running), timeout=LOOK)
        for reference in ready:
            index = running.pop(reference)
            try:
                code, words = ray.get(reference)
            except ray.exceptions.RayError as error:
                code, words = FAILED, f"given up after {args.retries} retries: {error}"
            if code not in (PASSED, FINDINGS):
                report(f"shard {index}/{args.shards} failed with exit code {code}: {shlex.join(commands[index])}\n{words}")
                worst = max(worst, code)
        progress = f"{args.shards - len(running)} of {args.shards} shards, {levels_done(args)} levels"
        if progress != reported:
            report(progress)
            reported = progress
    return worst


def main():
    args = arguments()
    out = pathlib.Path(args.out)
    if (out / "results.json").exists() and not (out / "shards").exists():
        report(f"{out} has results that are not of this script: choose another --out")
        return USAGE
    started = time.monotonic()
    if args.address:
        ray.init(address=args.address, log_to_driver=False)
    else:
        ray.init(num_cpus=args.workers, include_dashboard=False, log_to_driver=False)
    code = test_shards(args)
    ray.shutdown()
    if code != PASSED:
        report("not all shards are tested: mend what is said above, and call this again to go on")
        return code
    report(f"{args.shards} shards in {time.monotonic() - started:.1f} s")
    merge = [args.program, "report", "merge", "--force", "--out", args.out]
    merge += ["--against", args.against] if args.against else []
    merge += [str(shard_folder(args.out, index)) for index in range(args.shards)]
    return subprocess.run(merge, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
