"""A stand-in for Godot 4 that loads the library, calls it and answers its calls."""

import subprocess

import numpy as np
from native_build import ROOT

GODOT = ROOT / "engine_adapter" / "godot"
LIBRARY = "libtaichi_soft_godot4.so"
VERSIONS = ("4.1", "4.2", "4.3", "4.4")


class Transform(tuple):
    """Twelve numbers: the rows of the basis, then the origin."""


class Name(str):
    """A StringName."""


def transform(origin=(0, 0, 0), diagonal=(1, 1, 1)):
    x, y, z = diagonal
    return Transform((x, 0, 0, 0, y, 0, 0, 0, z, *origin))


def written(value):
    """Return a value in the format that the stand-in reads."""
    if isinstance(value, bool):
        return f"b{int(value)}"
    if isinstance(value, Transform | tuple):
        kind = "t" if isinstance(value, Transform) else "v"
        return kind + ",".join(repr(float(number)) for number in value)
    if isinstance(value, str):
        return ("n" if isinstance(value, Name) else "s") + value.encode().hex()
    if isinstance(value, list):
        return f"I{np.array(value, dtype=np.int32).tobytes().hex()}"
    if isinstance(value, bytes):
        return f"y{value.hex()}"
    return "-" if value is None else f"{'i' if isinstance(value, int) else 'f'}{value!r}"


def read(words):
    """Parse the next value that the stand-in wrote, and remove its words from the list."""
    word = words.pop(0)
    kind, rest = word[0], word[1:]
    if kind == "[":
        items = []
        while words[0] != "]":
            items.append(read(words))
        words.pop(0)
        return items
    rows = {"I": (np.int32, -1), "2": (np.float32, (-1, 2)), "3": (np.float32, (-1, 3))}
    if kind in rows:
        number, shape = rows[kind]
        return np.frombuffer(bytes.fromhex(rest), dtype=number).reshape(shape)
    return {
        "-": lambda: None,
        "b": lambda: rest == "1",
        "i": lambda: int(rest),
        "f": lambda: float.fromhex(rest),
        "s": lambda: bytes.fromhex(rest).decode(),
        "v": lambda: tuple(float.fromhex(each) for each in rest.split(",")),
        "t": lambda: Transform(float.fromhex(each) for each in rest.split(",")),
        "y": lambda: bytes.fromhex(rest),
    }[kind]()


class Host:
    """A stand-in for Godot that has loaded the library; `started` are the lines that it printed by then."""

    def __init__(self, folder, *options):
        command = [str(folder / "bin" / "fake_host"), str(folder / "bin" / LIBRARY), *options]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.errors, self.started = [], []
        while not self.started or not self.started[-1].startswith("ready"):
            self.started.append(self.line())

    def line(self):
        found = self.process.stdout.readline().rstrip("\n")
        assert found, "the stand-in has ended"
        assert not found.startswith("FAULT"), found
        return found

    def tell(self, *words):
        self.process.stdin.write(" ".join(map(str, words)) + "\n")
        self.process.stdin.flush()

    def ask(self, *words):
        """Send a request. Returns: the answer. Printed errors are in `errors`."""
        self.tell(*words)
        while (found := self.line()).startswith("!"):
            self.errors.append(found[2:])
        return read(found.split(" ")[1:])

    def new(self):
        return Instance(self, self.ask("new"))

    def end(self):
        """Unload the library. Returns: the last lines."""
        self.tell("end")
        found = [self.line(), self.line()]
        assert self.process.wait(timeout=60) == 0
        return found


class Instance:
    """An object of the class SoftWorldNative: its methods are called as scripts call them."""

    def __init__(self, host, number):
        self.host, self.number = host, number

    def __getattr__(self, name):
        return lambda *values: self.host.ask("call", self.number, name, *map(written, values))

    def by_pointers(self, name, *values):
        return self.host.ask("ptrcall", self.number, name, *map(written, values))

    def free(self):
        self.host.ask("free", self.number)


def registered(host):
    """Methods of the class, and how many arguments they take."""
    rows = [row.split() for row in host.started if row.startswith("method ")]
    return {row[1]: int(row[2]) for row in rows}
