"""Compares steps per second of 64 arenas through numpy with those of `playbot bench`, in turns, and prints medians.

    python speed.py [--rounds 5] [--seconds 3] [--case coinrun/vector --case coinrun/raster ...]
"""

import argparse
import json
import statistics
import subprocess
import time

import numpy as np

from playbot.client import Client, find_program

ARENAS = 64
CASES = ["coinrun/vector", "coinrun/raster", "maze2d/vector", "antmaze/vector"]
MODES = {"coinrun": "hard", "maze2d": "medium", "antmaze": "medium"}


def bench(case, seconds):
    words = [find_program(), "bench", "--case", f"sim/{case}", "--seconds", str(seconds), "--arenas", str(ARENAS), "--json"]
    lines = subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()
    return json.loads(lines[0])["steps_per_s"]


def ours(case, seconds):
    game, kind = case.split("/")
    with Client(game, arenas=ARENAS, levels=f"{MODES[game]}:0..63", observation=kind) as client:
        client.reset(seed=1)
        action, random = client.description["action"], np.random.default_rng(0)
        if action["kind"] == "discrete":
            actions = [random.integers(0, action["count"], ARENAS) for _ in range(100)]
        else:
            actions = [random.uniform(-1, 1, (ARENAS, action["count"])).astype(np.float32) for _ in range(100)]
        begun, steps = time.monotonic(), 0
        while time.monotonic() - begun < seconds:
            for step in actions:
                client.step(step)
            steps += len(actions) * ARENAS
        return steps / (time.monotonic() - begun)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=3)
    parser.add_argument("--case", action="append")
    args = parser.parse_args()
    for case in args.case or CASES:
        pairs = [(bench(case, args.seconds), ours(case, args.seconds)) for _ in range(args.rounds)]
        alone, through = (statistics.median(side) for side in zip(*pairs))
        share = statistics.median(ours / bench for bench, ours in pairs)
        print(f"{case}: bench {alone:,.0f}, through numpy {through:,.0f} steps/s, share {share:.2f}", flush=True)


if __name__ == "__main__":
    main()
