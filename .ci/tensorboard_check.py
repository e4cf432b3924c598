"""Checks that TensorBoard reads from a run's event file exactly what its metrics.jsonl and timing.jsonl say.

Usage: tensorboard_check.py RUN..., with the package `tensorboard` installed.
"""

import json
import math
import pathlib
import struct
import sys

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator


def logged(run):
    """The curves of the text files: {tag: [(step, value)]}, values rounded to 32 bits as event files hold them."""
    curves = {}
    for name in ("metrics.jsonl", "timing.jsonl"):
        for line in (run / name).read_text().splitlines():
            entries = json.loads(line)
            for tag in filter(lambda key: "/" in key, entries):
                value = math.nan if entries[tag] is None else entries[tag]
                curves.setdefault(tag, []).append((entries["step"], struct.unpack("f", struct.pack("f", value))[0]))
    return curves


def shown(run):
    """The same curves as TensorBoard sees them."""
    accumulator = EventAccumulator(str(run / "tensorboard"), size_guidance={"scalars": 0})
    accumulator.Reload()
    tags = accumulator.Tags()["scalars"]
    return {tag: [(event.step, event.value) for event in accumulator.Scalars(tag)] for tag in tags}


def same(a, b):
    return a == b or (math.isnan(a[1]) and math.isnan(b[1]) and a[0] == b[0])


def check(run):
    expected, found = logged(run), shown(run)
    assert expected, f"{run}: nothing was logged, so nothing was checked"
    assert expected.keys() == found.keys(), f"{run}: tags differ: {sorted(expected.keys() ^ found.keys())}"
    for tag, curve in expected.items():
        assert len(curve) == len(found[tag]), f"{run}: {tag}: {len(curve)} points, TensorBoard has {len(found[tag])}"
        for point, other in zip(curve, found[tag]):
            assert same(point, other), f"{run}: {tag}: {point}, TensorBoard has {other}"
    print(f"{run}: {len(expected)} metrics, {sum(map(len, expected.values()))} values, all as logged")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    for argument in sys.argv[1:]:
        check(pathlib.Path(argument))
