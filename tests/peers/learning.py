"""Benchmark of learning steps of this project and of PyTorch in turn, on the same cores.

The networks, sizes and losses are the same; ours also make a step of Adam. PyTorch has its best settings: channels last,
one thread per core, and an allocator that keeps its memory (set by `run`).
"""

import argparse
import json
import platform
import re
import statistics
import subprocess
import time
from pathlib import Path

import torch
from torch.nn import functional as F

import report
from networks import Skills, impala, mlp, nature

# Seconds for which a case is timed in a round, after the warm-up.
SECONDS = 3.0


def image_case(make, batch, step):
    net = make().to(memory_format=torch.channels_last)
    pixels = torch.randint(0, 256, (batch, 3, 64, 64), dtype=torch.uint8)
    pixels = pixels.contiguous(memory_format=torch.channels_last)
    with torch.no_grad():
        target = torch.randn_like(net(pixels.float() / 255))

    def run():
        x = pixels.float() / 255
        if step:
            net.zero_grad(set_to_none=True)
            F.mse_loss(net(x), target).backward()
        else:
            with torch.inference_mode():
                net(x).sum().item()

    return run


def mlp_case(batch):
    net, x, target = mlp(37, [200, 200], 8), torch.randn(batch, 37), torch.randn(batch, 8)

    def run():
        net.zero_grad(set_to_none=True)
        F.mse_loss(net(x), target).backward()

    return run


def skill_case():
    net, states, actions = Skills(29, 8), torch.randn(10, 50, 29), torch.randn(10, 50, 8)

    def run():
        net.zero_grad(set_to_none=True)
        net.loss(states, actions).backward()

    return run


# Names are those of our benchmark.
CASES = {
    "features/impala/64": lambda: image_case(impala, 64, False),
    "step/impala/64": lambda: image_case(impala, 64, True),
    "step/impala/256": lambda: image_case(impala, 256, True),
    "step/impala/2048": lambda: image_case(impala, 2048, True),
    "features/nature/64": lambda: image_case(nature, 64, False),
    "step/nature/64": lambda: image_case(nature, 64, True),
    "step/nature/256": lambda: image_case(nature, 256, True),
    "step/nature/2048": lambda: image_case(nature, 2048, True),
    "step/mlp-37-200-200-8/64": lambda: mlp_case(64),
    "step/mlp-37-200-200-8/512": lambda: mlp_case(512),
    "step/skill": skill_case,
}


def theirs(case):
    """Milliseconds of the median repetition."""
    run = CASES[case]()
    begin = time.perf_counter()
    while time.perf_counter() - begin < 1.0:
        run()
    times = []
    begin = time.perf_counter()
    while time.perf_counter() - begin < SECONDS or len(times) < 3:
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return 1e3 * statistics.median(times)


def ours(bench, case):
    """Milliseconds of the middle of criterion's estimate."""
    words = [bench, "--bench", "--exact", case, "--noplot", "--warm-up-time", "1", "--measurement-time", str(SECONDS)]
    printed = subprocess.run([*words, "--sample-size", "10"], capture_output=True, text=True, check=True).stdout
    found = re.search(r"time:\s+\[\S+ \S+ (\S+) (\S+) ", printed)
    if not found:
        raise SystemExit(f"the benchmark has no case {case}: {printed}")
    return float(found[1]) * {"ns": 1e-6, "µs": 1e-3, "us": 1e-3, "ms": 1.0, "s": 1e3}[found[2]]


def machine():
    names = re.findall(r"model name\s*:\s*(.+)", Path("/proc/cpuinfo").read_text())
    return f"{names[0] if names else platform.processor()}, {torch.get_num_threads()} cores{report.limit()}"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bench", help="the built benchmark `training` of playbot_learner")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--case", action="append", help="only cases whose names contain this (repeatable)")
    parser.add_argument("--json", type=Path, help="file for all times")
    parser.add_argument("--write", type=Path, help="document that gets the table")
    args = parser.parse_args()
    cases = [case for case in CASES if not args.case or any(word in case for word in args.case)]
    times = {case: {"ours": [], "theirs": []} for case in cases}
    for number in range(args.rounds):
        for case in cases:
            times[case]["ours"].append(ours(args.bench, case))
            times[case]["theirs"].append(theirs(case))
            print(f"round {number + 1}: {case}: ours {times[case]['ours'][-1]:.2f} ms, "
                  f"PyTorch {times[case]['theirs'][-1]:.2f} ms", flush=True)
    text = markdown(times)
    print(f"\n{text}")
    if args.json:
        args.json.write_text(json.dumps({"machine": machine(), "torch": torch.__version__, "times": times}, indent=1))
    if args.write:
        report.put(args.write, f"learning{report.suffix()}", text)


def markdown(times):
    """Returns the medians, and their case."""
    rounds = len(next(iter(times.values()))["ours"])
    rows = []
    for case, found in times.items():
        mine, other = (statistics.median(found[who]) for who in ("ours", "theirs"))
        rows.append([f"`{case}`", report.number(mine), report.number(other), f"{other / mine:.2f}"])
    what = f"Milliseconds on {machine()}, PyTorch {torch.__version__}, medians of {rounds} rounds in turn:"
    return f"{what}\n\n{report.table(['case', 'ours', 'PyTorch', 'PyTorch / ours'], rows)}"


if __name__ == "__main__":
    main()
