"""Test of trainings on Ray: the same bytes as one process, with 1, 2 and 4 workers, of which some are killed half-way.

Called by run.sh with the program `playbot`. The last training runs on three hosts, if network namespaces can be made: each has an address
of its own and a node of Ray, one of which is killed. Works on Linux, which has the processes in /proc.
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

TRAIN = ["coinrun", "--algorithm", "ppo", "--set", "arenas=16", "--set", "worlds=4", "--set", "ppo.num_steps=64"]
STEPS = 65536
LONGEST = 300.0
SOURCES = str(pathlib.Path(__file__).parents[2] / "plugin/python/src")
RAY = [sys.executable, "-m", "ray.scripts.scripts"]


def check(what, is_so):
    if not is_so:
        sys.exit(f"FAILED: {what}")
    print(f"ok: {what}", flush=True)


def environment():
    return {**os.environ, "PLAYBOT_PYTHON": sys.executable, "PYTHONPATH": SOURCES, "RAY_ADDRESS": "local", "RAY_AUTH_MODE": "disabled"}


def call(playbot, run, more):
    return [playbot, "train", *TRAIN, "--steps", str(STEPS), "--run", str(run), *more]


def results(run):
    """The metrics and all checkpoints of a run."""
    files = [run / "metrics.jsonl", *sorted((run / "checkpoints").rglob("*"))]
    return {str(file.relative_to(run)): file.read_bytes() for file in files if file.is_file()}


def updates(run):
    try:
        return (run / "metrics.jsonl").read_bytes().count(b"\n")
    except OSError:
        return 0


def processes():
    """Each process with its words and its parent."""
    found = {}
    for entry in pathlib.Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / "cmdline").read_bytes().split(b"\0")
                found[int(entry.name)] = (words, int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1]))
            except OSError:
                pass
    return found


def workers(playbot):
    """The programs that play for a training, each with the process of Ray that started it."""
    of_all = processes()
    is_worker = lambda words: words[:2] == [playbot.encode(), b"work"]  # noqa: E731
    return [(process, parent) for process, (words, parent) in of_all.items() if is_worker(words)]


def train(folder, playbot, name, more, at_work=None, prefix=()):
    """Trains, and calls `at_work` once after some updates. Returns what was said."""
    run, log = folder / name, folder / f"{name}.log"
    started = time.monotonic()
    with open(log, "wb") as file:
        training = subprocess.Popen([*prefix, *call(playbot, run, more)], stdout=file, stderr=file, cwd=folder, env=environment())
        try:
            while training.poll() is None and time.monotonic() - started < LONGEST:
                time.sleep(0.02)
                if at_work and updates(run) >= 8:
                    at_work()
                    at_work = None
        finally:
            training.kill()
            training.wait()
    said = log.read_text(errors="replace")
    if training.returncode != 0 or at_work:
        sys.exit(f"FAILED: {name} ended with {training.returncode} after {updates(run)} updates:\n{said}")
    line = [line for line in said.splitlines() if " rollouts of " in line]
    print(f"{name}: {time.monotonic() - started:.1f} s. {' '.join(line)}", flush=True)
    return said


def kill_two(playbot):
    """Kills the program of one worker, and the worker of another one."""
    found = workers(playbot)
    check(f"{len(found)} workers are at work", len(found) == 4)
    os.kill(found[0][0], signal.SIGKILL)
    os.kill(found[1][1], signal.SIGKILL)


def shell(*words):
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise OSError(f"{' '.join(words)}: {done.stderr.strip()}")


class Hosts:
    """Network namespaces on one bridge, each with a node of Ray; the first is the head and has no processors for workers."""

    def __init__(self, folder, count):
        self.names = [f"playbot-host{number}" for number in range(count)]
        self.folder, self.nodes = folder, []

    def __enter__(self):
        self.__exit__()
        shell("ip", "link", "add", "playbot-br", "type", "bridge")
        shell("ip", "link", "set", "playbot-br", "up")
        for number, name in enumerate(self.names):
            shell("ip", "netns", "add", name)
            shell("ip", "link", "add", f"pb{number}", "type", "veth", "peer", "name", "eth0", "netns", name)
            shell("ip", "link", "set", f"pb{number}", "master", "playbot-br", "up")
            shell("ip", "-n", name, "addr", "add", f"10.213.7.{number + 1}/24", "dev", "eth0")
            shell("ip", "-n", name, "link", "set", "eth0", "up")
            shell("ip", "-n", name, "link", "set", "lo", "up")
        return self

    def inside(self, number):
        return ["ip", "netns", "exec", self.names[number]]

    def start(self, number):
        where = [f"--node-ip-address=10.213.7.{number + 1}", "--block", "--disable-usage-stats"]
        if number == 0:
            where += ["--head", "--port=6379", "--num-cpus=0", "--include-dashboard=false", f"--temp-dir={self.folder}/ray"]
        else:
            where += ["--address=10.213.7.1:6379", "--num-cpus=2"]
        log = open(self.folder / f"node{number}.log", "wb")
        words = [*self.inside(number), *RAY, "start", *where]
        self.nodes.append(subprocess.Popen(words, stdout=log, stderr=log, env=environment(), start_new_session=True))

    def wait(self):
        ask = "import ray, sys; ray.init(address='10.213.7.1:6379', log_to_driver=False, logging_level='ERROR'); " \
              "sys.exit(int(ray.cluster_resources().get('CPU', 0)) < 2 * int(sys.argv[1]))"
        end = time.monotonic() + 60
        while time.monotonic() < end:
            words = [*self.inside(0), sys.executable, "-c", ask, str(len(self.names) - 1)]
            if subprocess.run(words, capture_output=True, env=environment(), check=False).returncode == 0:
                return
            time.sleep(0.5)
        sys.exit("FAILED: the nodes of Ray do not find one another; their words are in node*.log")

    def kill(self, number):
        """Ends all processes of a host at once, as a power cut does."""
        found = subprocess.run(["ip", "netns", "pids", self.names[number]], capture_output=True, text=True, check=False)
        for process in found.stdout.split():
            try:
                os.kill(int(process), signal.SIGKILL)
            except ProcessLookupError:
                pass

    def __exit__(self, *_):
        for number, name in enumerate(self.names):
            self.kill(number)
            subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)
            subprocess.run(["ip", "link", "del", f"pb{number}"], capture_output=True, check=False)
        subprocess.run(["ip", "link", "del", "playbot-br"], capture_output=True, check=False)
        for node in self.nodes:
            node.wait()


def on_hosts(folder, playbot, single):
    """Trains with the workers on two hosts, one of which is lost."""
    try:
        with Hosts(folder, 3) as hosts:
            for number in range(3):
                hosts.start(number)
            hosts.wait()
            cluster = ["--cluster", "10.213.7.1:6379", "--workers", "2"]
            said = train(folder, playbot, "hosts", cluster, lambda: hosts.kill(2), hosts.inside(0))
            check("a lost host is noticed", "lost" in said)
            check("three hosts, one of them lost: the same bytes", results(folder / "hosts") == single)
    except (OSError, FileNotFoundError) as error:
        print(f"!! SKIPPED: hosts in network namespaces: {error}", flush=True)


def main():
    playbot = str(pathlib.Path(sys.argv[1]).resolve())
    folder = pathlib.Path(tempfile.mkdtemp(prefix="pb-"))
    train(folder, playbot, "one", [])
    single = results(folder / "one")
    check(f"{len(single)} files of one process", len(single) > 3)
    for count in (1, 2):
        train(folder, playbot, f"ray{count}", ["--cluster", "ray", "--workers", str(count)])
        check(f"{count} workers: the same bytes", results(folder / f"ray{count}") == single)
    said = train(folder, playbot, "killed", ["--cluster", "ray", "--workers", "4"], lambda: kill_two(playbot))
    check("two were lost and replaced", "2 workers were lost and replaced" in said)
    check("4 workers, two of them killed: the same bytes", results(folder / "killed") == single)
    check("no worker is left", not workers(playbot))
    on_hosts(folder, playbot, single)
    last = json.loads((folder / "one" / "metrics.jsonl").read_text().splitlines()[-1])
    check("the training was one", last["step"] == STEPS)
    shutil.rmtree(folder)


if __name__ == "__main__":
    main()
