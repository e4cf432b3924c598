"""The client of the protocol: many arenas of a game in lockstep, as numpy arrays."""

import atexit
import difflib
import enum
import json
import mmap
import os
import shutil
import socket
import struct
import subprocess
import tempfile
import weakref
import zlib

import numpy as np

PROTOCOL = 1

_HELLO, _RESET, _STEP, _CALL, _CLOSE = 1, 2, 3, 4, 5
_STATE, _ANSWER, _BYTES, _ERROR = 10, 11, 12, 255

_DTYPES = {"u8": np.uint8, "i32": np.int32, "u32": np.uint32, "u64": np.uint64, "f32": np.float32}
_FLAGS = ("terminated", "truncated", "success", "legal")
_MAGIC = b"PLAYBOT\0"
# Bytes before the actions in shared memory.
_HEAD = 4096
_HEAD_OF_MESSAGE = struct.Struct("<IB")
_HEAD_OF_STATE = struct.Struct("<IBB")


class PlaybotError(Exception):
    """Something went wrong between this process and the game."""


class ProgramEnded(PlaybotError):
    """The program with the game has ended, or could not be started. Its last lines are in the message."""


class Refused(PlaybotError):
    """The program has refused a request, and nothing has changed. ``arena`` is the arena that it is about, or None."""

    def __init__(self, message, arena=None):
        super().__init__(message)
        self.arena = arena


class Batch:
    """The results of a step: an array for each name, with a row per agent.

    ``observations``, ``rewards``, ``terminated``, ``truncated``, ``success``, ``level``, ``tick``, ``legal``, and with
    ``autoreset="same_step"`` also ``final_observations``. The arrays are views of memory that stays as it is until the
    second step after this one.
    """

    def __init__(self, arrays):
        self.__dict__.update(arrays)
        self.arrays = arrays


# Options of `playbot serve` for a program that the client starts.
_OPTIONS = (
    "arenas", "autoreset", "grayscale", "levels", "observation", "order", "render", "seed", "size", "stack", "threads",
    "transport",
)


def check_options(options):
    """Raise a TypeError for an option that there is not, with the nearest one."""
    for name in options:
        if name not in _OPTIONS:
            near = difflib.get_close_matches(name, _OPTIONS, 1)
            hint = "levels='MODE:0..499' names a mode" if name == "mode" else f"did you mean {near[0]!r}?" if near else ""
            raise TypeError(f"there is no option {name!r}: {hint or 'the options are ' + ', '.join(_OPTIONS)}")


class Client:
    """A game that another program plays, in ``arenas`` that step together.

    Give ``address`` to connect to a program that serves already (``playbot serve GAME``), or let the client start one:

    - ``game``: its name; it can be left out if the program has one game.
    - ``program``: path of the program, by default ``$PLAYBOT_PROGRAM``, or else ``playbot``.
    - ``levels``, ``order``, ``arenas``, ``autoreset``, ``observation``, ``size``, ``stack``, ``grayscale``, ``render``,
      ``transport``, ``seed``, ``threads``: as in ``playbot serve --help``.
    """

    def __init__(self, game=None, *, program=None, address=None, **options):
        self._program = None
        self._socket = None
        self._memory = None
        self._pid = os.getpid()
        check_options(options)
        try:
            if address is None:
                self._program = Program(game, program, options)
                kind, address = self._program.socket, self._program.address
            else:
                if options or program or game:
                    raise ValueError("a program that serves already has its own game and options: leave yours out")
                kind = "unix" if os.sep in address else "tcp"
            self._connect(kind, address)
            if self._program is not None:
                self._program.forget_folder()
            self.description = self._hello()
            self._lay_out()
        except BaseException:
            self._end()
            raise
        _open.add(self)

    # Steps.

    def reset(self, seed=None, levels=None, arenas=None):
        """Begin episodes, in all arenas or in these, with drawn levels or with a level for each. Return the results."""
        wish = {}
        if seed is not None:
            wish["seed"] = int(seed) % 2**64
        if levels is not None:
            wish["levels"] = [int(level) for level in levels]
        if arenas is not None:
            wish["arenas"] = [int(arena) for arena in arenas]
        return self._state(_RESET, json.dumps(wish).encode())

    def step(self, actions):
        """Play one tick with an action for each agent, and return the results.

        ``actions`` is an array ``[agents]`` of choices, or ``[agents, numbers]`` of numbers, or for a game with both a dict
        of the arrays in ``client.actions``.
        """
        if len(self.actions) == 1:
            (array,) = self.actions.values()
            self._fill(array, actions)
        else:
            for name, array in self.actions.items():
                self._fill(array, actions[name])
        return self._state(_STEP, self._action_bytes)

    def _fill(self, array, actions):
        actions = np.asarray(actions)
        if actions.shape != array.shape:
            raise ValueError(f"actions have the shape {actions.shape}, and {array.shape} is expected: a row for each agent")
        # Numbers that are cut off would be other actions.
        if array.dtype.kind == "i" and actions.dtype.kind not in "iub":
            raise TypeError(f"actions are whole numbers, and these are {actions.dtype}")
        array[...] = actions
        if actions.dtype.itemsize > 4 and array.dtype.kind == "i" and (array != actions).any():
            raise ValueError("an action does not fit into 32 bits")

    # Other calls.

    def hash(self, arena=0):
        """Return the hash of an arena's state, as text. Equal states have equal hashes."""
        return self._call(call="hash", arena=arena)["hash"]

    def save(self, arena=0):
        """Keep the episode of an arena as it is now, and return its number."""
        return self._call(call="save", arena=arena)["saved"]

    def load(self, saved, arena=0):
        """Go on from a kept episode, in any arena. Return the results."""
        return self._state(_CALL, json.dumps({"call": "load", "arena": arena, "saved": saved}).encode())

    def forget(self, saved):
        """Drop a kept episode."""
        self._call(call="forget", saved=saved)

    def render(self, arena=0):
        """Return the picture of an arena, ``[height, width, 3]`` bytes. The program has to draw: ``render=256``."""
        pixels = self._call(call="render", arena=arena)
        image = self.description["observation"].get("image", {})
        height, width = self.description["picture"] or (image.get("height"), image.get("width"))
        return np.frombuffer(pixels, np.uint8).reshape(height, width, 3)

    def record(self, folder):
        """Record all episodes that begin from now on, and return the paths of the recordings."""
        return self._call(call="record", folder=os.fspath(folder))["files"]

    def close(self):
        """End the conversation, and the program if this client has started it."""
        if self._socket is not None and self._pid == os.getpid():
            try:
                self._send(_CLOSE)
            except (PlaybotError, OSError):
                pass
        self._end()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()

    def __del__(self):
        if "_socket" in self.__dict__:
            self.close()

    # The protocol.

    def _connect(self, kind, address):
        if kind == "unix":
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        else:
            host, _, port = address.rpartition(":")
            if not port.isdigit():
                raise PlaybotError(f"{address} is no address: write HOST:PORT, or the path of a socket")
            address = (host, int(port))
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            self._socket.connect(address)
        except OSError as error:
            raise ProgramEnded(f"no program serves at {address}: {error}") from error

    def _hello(self):
        from playbot import __version__

        self._send(_HELLO, json.dumps({"protocol": PROTOCOL, "client": f"playbot-python {__version__}"}).encode())
        kind, content = self._receive()
        if kind != _HELLO:
            raise PlaybotError(f"the program has answered hello with a message of kind {kind}")
        return json.loads(content)

    def _lay_out(self):
        layout = self.description["layout"]
        lines = "".join(
            f"{array['name']} {array['dtype']} {'x'.join(map(str, array['shape']))} {array['offset']}\n"
            for array in layout["actions"] + layout["results"]
        )
        if zlib.crc32(lines.encode()) != self.description["checksum"]:
            raise PlaybotError("the layout of the arrays is damaged, or of another version")
        place = self.description["memory"]
        if place is None:
            actions = bytearray(layout["action_bytes"])
            self._slots = [bytearray(layout["result_bytes"]) for _ in range(2)]
            slots = [(slot, 0) for slot in self._slots]
            self._action_bytes = actions
            at = 0
        else:
            self._map(place)
            actions, at = self._memory, _HEAD
            first = _HEAD + layout["action_bytes"]
            slots = [(self._memory, first + slot * layout["result_bytes"]) for slot in range(2)]
            self._action_bytes = b""
        self.actions = {array["name"]: _view(actions, at, array) for array in layout["actions"]}
        self._batches = [Batch({array["name"]: _view(*slot, array) for array in layout["results"]}) for slot in slots]
        self._turn = 0
        self._head = memoryview(bytearray(6))

    def _map(self, place):
        with open(place["path"], "r+b") as file:
            self._memory = mmap.mmap(file.fileno(), place["bytes"])
        # Its name is taken away, so that nothing is left behind, whatever happens.
        self._call(call="mapped")
        magic, version, checksum = struct.unpack_from("<8sII", self._memory)
        if (magic, version, checksum) != (_MAGIC, PROTOCOL, self.description["checksum"]):
            raise PlaybotError(f"{place['path']} is not the shared memory of this game")

    def _state(self, kind, content):
        try:
            return self._answered_state(kind, content)
        except KeyboardInterrupt:
            # The answer is still to come, and the next one would be taken for it.
            self._end()
            raise

    def _answered_state(self, kind, content):
        self._send(kind, content)
        # A state that lies in shared memory is a message of six bytes.
        head = self._exactly(self._head)
        length, kind, slot = _HEAD_OF_STATE.unpack(head)
        if kind != _STATE:
            self._refuse(kind, bytes(head[5:]) + bytes(self._exactly(memoryview(bytearray(length - 2)))))
        if length == 2:
            return self._batches[slot]
        self._turn = 1 - self._turn
        self._exactly(memoryview(self._slots[self._turn])[: length - 2])
        return self._batches[self._turn]

    def _call(self, **call):
        try:
            self._send(_CALL, json.dumps(call).encode())
            kind, content = self._receive()
        except KeyboardInterrupt:
            self._end()
            raise
        return content if kind == _BYTES else json.loads(content)

    def _send(self, kind, content=b""):
        if self._socket is None:
            raise PlaybotError("the environment is closed")
        if self._pid != os.getpid():
            raise PlaybotError("the environment was made in another process: make one in each")
        try:
            self._socket.sendall(_HEAD_OF_MESSAGE.pack(len(content) + 1, kind) + content)
        except OSError as error:
            # A program that has failed has said why before it left.
            if kind != _CLOSE:
                self._receive()
            raise ProgramEnded(self._last_words()) from error

    def _receive(self):
        length, kind = _HEAD_OF_MESSAGE.unpack(self._exactly(memoryview(bytearray(5))))
        content = bytes(self._exactly(memoryview(bytearray(length - 1))))
        if kind == _ERROR:
            self._refuse(kind, content)
        return kind, content

    def _refuse(self, kind, content):
        if kind != _ERROR:
            raise PlaybotError(f"the program has answered with a message of kind {kind}")
        refusal = json.loads(content)
        if refusal.get("fatal"):
            self._end()
            raise ProgramEnded(refusal["error"])
        raise Refused(refusal["error"], refusal.get("arena"))

    def _exactly(self, buffer):
        rest = buffer
        while rest:
            try:
                count = self._socket.recv_into(rest)
            except ConnectionError:
                count = 0
            if count == 0:
                raise ProgramEnded(self._last_words())
            rest = rest[count:]
        return buffer

    def _last_words(self):
        words = "the program with the game has ended"
        return words if self._program is None else self._program.last_words(words)

    def _end(self):
        _open.discard(self)
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        # Arrays of the caller may still look into the memory: it goes with the last of them.
        self._memory = None
        if self._program is not None and self._pid == os.getpid():
            self._program.end()
            self._program = None


def _view(memory, at, array):
    dtype = np.dtype(_DTYPES[array["dtype"]])
    count = int(np.prod(array["shape"]))
    view = np.frombuffer(memory, dtype, count, at + array["offset"]).reshape(array["shape"])
    return view.view(np.bool_) if array["name"] in _FLAGS else view


def find_program(program=None):
    """Return the path of a program with games: ``program``, or that of ``PLAYBOT_PROGRAM``, or ``playbot``."""
    found = program or os.environ.get("PLAYBOT_PROGRAM") or "playbot"
    path = shutil.which(os.fspath(found))
    if path is None:
        raise ProgramEnded(
            f"there is no program {found}: name one with program=..., or with PLAYBOT_PROGRAM, such as "
            "target/release/playbot"
        )
    return path


class Program:
    """A program that serves a game to this process alone."""

    def __init__(self, game, program, options):
        path = find_program(program)
        self._folder = tempfile.mkdtemp(prefix="playbot-")
        words = [path, "serve"] + ([game] if game else []) + ["--once"]
        if options.get("transport") != "tcp":
            words += ["--listen", os.path.join(self._folder, "socket")]
        for name, value in options.items():
            flag = "--" + name.replace("_", "-")
            if value is True:
                words.append(flag)
            elif value is not None and value is not False:
                # Gymnasium's own names of the modes are values of an enumeration.
                value = str(value.name if isinstance(value, enum.Enum) else value)
                words += [flag, value.lower().replace("_", "-") if name == "autoreset" else value]
        # Other programs of a terminal hear Ctrl-C too: this one ends when its client leaves.
        self._words = tempfile.TemporaryFile()
        try:
            self._process = subprocess.Popen(
                words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=self._words, start_new_session=True
            )
        except OSError as error:
            self._words.close()
            self.forget_folder()
            raise ProgramEnded(f"{path} cannot be started: {error}") from error
        line = self._process.stdout.readline()
        try:
            begun = json.loads(line)
        except ValueError:
            words = self.last_words(f"{path} has not begun to serve")
            self.end()
            raise ProgramEnded(words) from None
        self.address, self.socket = begun["address"], begun["socket"]

    def forget_folder(self):
        """Remove the folder of the socket, which nobody else connects to."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def last_words(self, words):
        """Return these words, the exit code, and the last lines of the program."""
        try:
            code = self._process.wait(timeout=5)
            words += f", by signal {-code}" if code < 0 else f", with exit code {code}"
        except subprocess.TimeoutExpired:
            pass
        self._words.seek(0, os.SEEK_END)
        self._words.seek(max(0, self._words.tell() - 2000))
        lines = self._words.read().decode(errors="replace").strip().splitlines()
        lines = "\n".join(line for line in lines if not line.endswith("is connected"))
        return f"{words}:\n{lines}" if lines else words

    def end(self):
        """Wait for the end of the program, which follows that of its client."""
        try:
            self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()
        self._words.close()
        shutil.rmtree(self._folder, ignore_errors=True)


_open = weakref.WeakSet()


@atexit.register
def _close_all():
    for client in list(_open):
        client.close()
