"""The relay between a training and its workers, which are actors of Ray.

A message has the form that `playbot_train::cluster::wire` describes: the length of the rest, 32 bits; a byte with its kind; the number of
the worker, 32 bits; its content. The lowest byte comes first.
"""

import collections
import json
import os
import queue
import re
import struct
import subprocess
import sys
import threading

from playbot.cluster.start import report, start

PROTOCOL = 1
ALL = 2**32 - 1
HELLO, SETUP, WEIGHTS, PLAY, PLAYED, LOST, FAILED = 1, 2, 3, 4, 5, 6, 7
# Length, kind and worker.
HEAD = "<IBI"
# Of what a program says, this much is kept.
LAST_WORDS = 4000


def write(stream, kind, worker, content):
    stream.write(struct.pack(HEAD, len(content) + 5, kind, worker))
    stream.write(content)
    stream.flush()


def read(stream):
    """The next message as kind, worker and content; None at the end."""
    head = stream.read(struct.calcsize(HEAD))
    if len(head) < struct.calcsize(HEAD):
        return None
    length, kind, worker = struct.unpack(HEAD, head)
    content = stream.read(length - 5)
    return (kind, worker, content) if len(content) == length - 5 else None


def first_words(error):
    """What an error of Ray says, without colours: its first line, or the last one of an actor that could not begin."""
    lines = re.sub("\x1b\\[[0-9;]*m", "", str(error)).strip().splitlines() or [type(error).__name__]
    return lines[-1 if "creation task" in lines[0] else 0].strip()


class Died(Exception):
    """The program of a worker has ended."""


class Worker:
    """An actor: the program with the verb `work`."""

    def __init__(self, program, folder):
        try:
            # Level files are named from there.
            os.chdir(folder)
        except OSError:
            pass
        pipe = subprocess.PIPE
        self.process = subprocess.Popen([program, "work"], stdin=pipe, stdout=pipe, stderr=pipe)
        self.words = collections.deque(maxlen=LAST_WORDS)
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self):
        for line in self.process.stderr:
            self.words.extend(line)

    def give(self, kind, content):
        self._write(kind, content)

    def play(self, content):
        self._write(PLAY, content)
        answer = read(self.process.stdout)
        if answer is None:
            self._fail()
        return answer[2]

    def _write(self, kind, content):
        try:
            write(self.process.stdin, kind, 0, content)
        except OSError:
            self._fail()

    def _fail(self):
        code = self.process.wait()
        raise Died(f"its program ended with exit code {code}: {bytes(self.words).decode(errors='replace').strip()}")


class Relay:
    def __init__(self, program, workers, out, events):
        import ray

        self.ray = ray
        # Its code travels along, so that the machines of workers need Ray and the program alone.
        ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])
        self.program, self.out = program, out
        self.actor = ray.remote(num_cpus=1, max_restarts=0)(Worker)
        # Newest setup and weights, which a replacement needs, too.
        self.given = {}
        self.events = events
        # A new number for each actor, so that answers of those that are gone are known.
        self.lives = [0] * workers
        self.actors = [self.new_actor() for _ in range(workers)]

    def new_actor(self):
        return self.actor.remote(self.program, os.getcwd())

    def run(self):
        write(self.out, HELLO, ALL, json.dumps({"protocol": PROTOCOL, "workers": len(self.actors)}).encode())
        while (event := self.events.get()) is not None:
            kind, worker, content = event
            if kind in (SETUP, WEIGHTS):
                # It travels once to each machine.
                self.given[kind] = self.ray.put(content)
                for actor in self.actors:
                    actor.give.remote(kind, self.given[kind])
            elif kind == PLAY:
                self.play(worker, content)
            elif kind == PLAYED:
                self.answer(*worker, content)

    def play(self, worker, content):
        life = self.lives[worker]
        # Orders with states are large, too.
        reference = self.actors[worker].play.remote(content)
        reference.future().add_done_callback(lambda done: self.events.put((PLAYED, (worker, life), done)))

    def answer(self, worker, life, done):
        error = done.exception()
        if life != self.lives[worker]:
            return
        if error is None:
            write(self.out, PLAYED, worker, done.result())
            return
        died = getattr(error, "cause", None)
        # The class has travelled, too.
        why = str(died) if type(died).__name__ == Died.__name__ else f"Ray says: {first_words(error)}"
        self.lives[worker] += 1
        try:
            self.ray.kill(self.actors[worker])
        except Exception:  # noqa: BLE001, it is gone, in whatever way Ray says so
            pass
        self.actors[worker] = self.new_actor()
        for kind, content in sorted(self.given.items()):
            self.actors[worker].give.remote(kind, content)
        write(self.out, LOST, worker, why.encode())


def relay(args):
    # What Ray prints must not come between the messages.
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    source, events, is_there = sys.stdin.buffer, queue.Queue(), threading.Event()

    def listen():
        while (message := read(source)) is not None:
            events.put(message)
        if not is_there.is_set():
            # The training is gone, and Ray may try to reach a cluster for minutes.
            os._exit(0)
        events.put(None)

    threading.Thread(target=listen, daemon=True).start()
    report("starting Ray, or joining its cluster; that can take half a minute")
    try:
        processors = start(args.address, args.workers)
        workers = args.workers or processors
        if workers > processors:
            report(f"the cluster has {processors} processors for {workers} workers: the others wait until there are more")
        relayed = Relay(args.program, workers, out, events)
        is_there.set()
        relayed.run()
    except BrokenPipeError:
        # The training is gone.
        return 0
    except Exception as error:  # noqa: BLE001, whatever Ray raises ends the training with these words
        try:
            write(out, FAILED, ALL, f"{type(error).__name__}: {error}".encode())
        except OSError:
            pass
        return 2
    finally:
        import ray

        ray.shutdown()
    return 0
