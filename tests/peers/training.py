"""Benchmark of PPO from end to end, ours and PyTorch with EnvPool in turn: playing and learning, in steps per second.

Both play 64 arenas of CoinRun, or 16 ants, with the same networks, rollouts, epochs and minibatches on the same cores.
EnvPool plays the official Procgen and MuJoCo; its ant has no maze. Ours also normalises rewards.
"""

import argparse
import json
import resource
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import envpool
import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

import report
from learning import machine
from networks import impala, mlp, nature

EPOCHS, MINIBATCHES, STEPS = 3, 8, 256
SECONDS = 20.0


@dataclass
class Case:
    """One comparison: EnvPool's task, the image network if there is one, and the words for our `bench`."""

    task: str
    arenas: int
    encoder: object
    ours: list


def bench_words(case, arenas, *settings):
    words = ["bench", "--case", case, "--arenas", str(arenas), "--seconds", str(SECONDS), "--json"]
    for setting in (f"ppo.num_steps={STEPS}", *settings):
        words += ["--set", setting]
    return words


CASES = {
    "ppo/impala": Case("CoinrunHard-v0", 64, impala, bench_words("train/coinrun/raster", 64, "ppo.cnn=Impala()")),
    "ppo/nature": Case(
        "CoinrunHard-v0", 64, lambda: nature(256), bench_words("train/coinrun/raster", 64, "ppo.cnn=Nature(feature:256)")
    ),
    "ppo/ant": Case("Ant-v4", 16, None, bench_words("train/antmaze/vector", 16)),
}


class Agent(nn.Module):
    """Actor and critic: two layers of 200 each, over images' features or a vector."""

    def __init__(self, case, env):
        super().__init__()
        self.encoder = case.encoder() if case.encoder else None
        space = env.action_space
        self.discrete = hasattr(space, "n")
        inputs = 256 if self.encoder else env.observation_space.shape[0]
        outputs = int(space.n) if self.discrete else space.shape[0]
        self.actor, self.critic = mlp(inputs, [200, 200], outputs, nn.ReLU), mlp(inputs, [200, 200], 1, nn.ReLU)
        self.log_std = None if self.discrete else nn.Parameter(torch.zeros(outputs))
        if self.encoder:
            self.encoder.to(memory_format=torch.channels_last)

    def forward(self, obs):
        x = self.encoder(obs.contiguous(memory_format=torch.channels_last).float() / 255) if self.encoder else obs
        head, value = self.actor(x), self.critic(x).squeeze(1)
        if self.discrete:
            return torch.distributions.Categorical(logits=head, validate_args=False), value
        return torch.distributions.Normal(head, self.log_std.exp(), validate_args=False), value


def log_prob(dist, action):
    found = dist.log_prob(action)
    return found.sum(1) if found.dim() == 2 else found


def entropy(dist):
    found = dist.entropy()
    return found.sum(1) if found.dim() == 2 else found


class Ppo:
    """PPO in its common form, with all tensors made once."""

    def __init__(self, case):
        threads = torch.get_num_threads()
        self.env = envpool.make(case.task, env_type="gymnasium", num_envs=case.arenas, num_threads=threads)
        self.agent = Agent(case, self.env)
        self.adam = torch.optim.Adam(self.agent.parameters(), lr=3e-4, eps=1e-5)
        first, _ = self.env.reset()
        self.obs = self.tensor(first)
        rows = (STEPS, case.arenas)
        self.seen = torch.empty(*rows, *self.obs.shape[1:], dtype=self.obs.dtype)
        space = self.env.action_space
        self.actions = torch.empty(*rows, dtype=torch.int64) if hasattr(space, "n") else torch.empty(*rows, *space.shape)
        self.log_probs, self.values, self.rewards, self.dones = (torch.empty(rows) for _ in range(4))

    @staticmethod
    def tensor(obs):
        return torch.from_numpy(obs) if obs.dtype == np.uint8 else torch.from_numpy(obs.astype(np.float32))

    @torch.inference_mode()
    def play(self):
        for step in range(STEPS):
            dist, value = self.agent(self.obs)
            action = dist.sample()
            self.seen[step], self.actions[step], self.values[step] = self.obs, action, value
            self.log_probs[step] = log_prob(dist, action)
            chosen = action.numpy()
            obs, reward, terminated, truncated, _ = self.env.step(chosen.astype(np.int32 if chosen.ndim == 1 else np.float64))
            self.rewards[step] = torch.from_numpy(reward)
            self.dones[step] = torch.from_numpy(terminated | truncated)
            self.obs = self.tensor(obs)
        _, last = self.agent(self.obs)
        advantages, following = torch.empty_like(self.rewards), torch.zeros_like(last)
        for step in reversed(range(STEPS)):
            goes_on = 1 - self.dones[step]
            delta = self.rewards[step] + 0.999 * last * goes_on - self.values[step]
            following = delta + 0.999 * 0.95 * goes_on * following
            advantages[step], last = following, self.values[step]
        return advantages

    def learn(self, advantages):
        flat = lambda x: x.reshape(-1, *x.shape[2:])
        seen, actions, old = flat(self.seen), flat(self.actions), flat(self.log_probs)
        advantages, values = flat(advantages), flat(self.values)
        returns = advantages + values
        rows = len(old)
        for _ in range(EPOCHS):
            for part in torch.randperm(rows).split(rows // MINIBATCHES):
                dist, value = self.agent(seen[part])
                gain = advantages[part]
                gain = (gain - gain.mean()) / (gain.std() + 1e-8)
                ratio = (log_prob(dist, actions[part]) - old[part]).exp()
                policy_loss = torch.max(-gain * ratio, -gain * ratio.clamp(0.8, 1.2)).mean()
                near = values[part] + (value - values[part]).clamp(-0.2, 0.2)
                value_loss = 0.5 * torch.max((value - returns[part]) ** 2, (near - returns[part]) ** 2).mean()
                loss = policy_loss + 0.5 * value_loss - 0.01 * entropy(dist).mean()
                self.adam.zero_grad(set_to_none=True)
                loss.backward()
                nn.utils.clip_grad_norm_(self.agent.parameters(), 0.5)
                self.adam.step()


def theirs(name):
    """Steps per second, the share of the time that playing takes, and MiB, of one process."""
    ppo = Ppo(CASES[name])
    ppo.learn(ppo.play())
    begin, play_s, updates = time.perf_counter(), 0.0, 0
    while time.perf_counter() - begin < SECONDS:
        start = time.perf_counter()
        advantages = ppo.play()
        play_s += time.perf_counter() - start
        ppo.learn(advantages)
        updates += 1
    seconds = time.perf_counter() - begin
    steps = updates * ppo.rewards.numel()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"steps_per_s": steps / seconds, "play_share": play_s / seconds, "peak_rss_mib": memory}


def run(words):
    return json.loads(subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True).stdout.splitlines()[-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("playbot", help="the built program")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--case", default="", help="only cases whose names contain this")
    parser.add_argument("--json", type=Path, help="file for all measurements")
    parser.add_argument("--write", type=Path, help="document that gets the tables")
    parser.add_argument("--theirs", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.theirs:
        print(json.dumps(theirs(args.theirs)))
        return
    cases = [name for name in CASES if args.case in name]
    found = {name: {"ours": [], "theirs": []} for name in cases}
    for number in range(args.rounds):
        for name in cases:
            found[name]["ours"].append(run([args.playbot, *CASES[name].ours]))
            found[name]["theirs"].append(run([sys.executable, __file__, args.playbot, "--theirs", name]))
            mine, other = (found[name][who][-1] for who in ("ours", "theirs"))
            print(f"round {number + 1}: {name}: ours {mine}, PyTorch {other}", flush=True)
    text = markdown(found)
    print(f"\n{text}")
    if args.json:
        args.json.write_text(json.dumps({"machine": machine(), "found": found}, indent=1))
    if args.write:
        report.put(args.write, f"training{report.suffix()}", text)


PARTS = ["simulate", "observe", "infer", "record", "gather", "learn"]


def markdown(found):
    """Returns the medians, and the shares of our time."""
    rows, parts = [], []
    for name, measured in found.items():
        middle = lambda who, key: statistics.median(one[key] for one in measured[who])
        (mine, other), (small, large) = ([middle(who, key) for who in ("ours", "theirs")]
                                         for key in ("steps_per_s", "peak_rss_mib"))
        rows.append([f"`{name}`", str(len(measured["ours"])), f"{mine:,.0f}", f"{other:,.0f}", f"{mine / other:.2f}",
                     f"{small:,.0f}", f"{large:,.0f}"])
        ours = measured["ours"]
        times = [report.number(statistics.median(one["us_per_step"][part] for one in ours)) for part in PARTS]
        parts.append([f"`{name}`", *times, f"{100 * middle('ours', 'idle_share'):.0f} %"])
    header = ["case", "rounds", "ours, steps/s", "PyTorch", "ours / PyTorch", "ours, MiB", "PyTorch, MiB"]
    return "\n".join([
        f"{machine()}, PyTorch {torch.__version__}, EnvPool {envpool.__version__}, medians of rounds in turn:", "",
        report.table(header, rows), "",
        "Where our time goes, in microseconds per step of both threads together:", "",
        report.table(["case", *PARTS, "idle"], parts),
    ])


if __name__ == "__main__":
    main()
