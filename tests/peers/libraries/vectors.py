"""Steps per second of other libraries' vectors of 64 arenas, to stand beside those of `speed.py`.

    python vectors.py envpool|gymnasium|pufferlib [--seconds 4]

EnvPool plays its own CoinRun (Procgen, pictures of 64 x 64 pixels) and Ant (MuJoCo). Gymnasium and PufferLib play CartPole, whose own
work is a few lines of Python: what remains is the vector. Each needs an environment of its own, since their requirements differ.
"""

import argparse
import json
import time

import numpy as np

ARENAS, WORKERS = 64, 2


def rate(step, actions, seconds):
    """Steps per second of all arenas, with random actions that are drawn before."""
    begun, steps = time.monotonic(), 0
    while time.monotonic() - begun < seconds:
        for action in actions:
            step(action)
        steps += len(actions) * ARENAS
    return steps / (time.monotonic() - begun)


def drawn(space):
    random = np.random.default_rng(0)
    if hasattr(space, "n"):
        return [random.integers(0, space.n, ARENAS) for _ in range(50)]
    return [random.uniform(-1, 1, (ARENAS, *space.shape)) for _ in range(50)]


def envpool(seconds):
    import envpool

    for name in ["CoinrunHard-v0", "Ant-v4"]:
        envs = envpool.make(name, env_type="gymnasium", num_envs=ARENAS, num_threads=WORKERS)
        envs.reset()
        yield f"EnvPool {name}", rate(envs.step, drawn(envs.action_space), seconds)


def gymnasium(seconds):
    import gymnasium

    for mode in ["sync", "async"]:
        envs = gymnasium.make_vec("CartPole-v1", num_envs=ARENAS, vectorization_mode=mode)
        envs.reset(seed=1)
        yield f"Gymnasium {mode} CartPole-v1", rate(envs.step, drawn(envs.single_action_space), seconds)
        envs.close()


def pufferlib(seconds):
    import gymnasium
    import pufferlib.emulation
    import pufferlib.vector

    def make():
        return pufferlib.emulation.GymnasiumPufferEnv(env_creator=lambda: gymnasium.make("CartPole-v1"))

    for backend, options in [("Serial", {}), ("Multiprocessing", {"num_workers": WORKERS})]:
        envs = pufferlib.vector.make(make, num_envs=ARENAS, backend=getattr(pufferlib.vector, backend), **options)
        envs.reset(seed=1)
        yield f"PufferLib {backend} CartPole-v1", rate(envs.step, drawn(envs.single_action_space), seconds)
        envs.close()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("library", choices=["envpool", "gymnasium", "pufferlib"])
    parser.add_argument("--seconds", type=float, default=4)
    args = parser.parse_args()
    for name, steps in {"envpool": envpool, "gymnasium": gymnasium, "pufferlib": pufferlib}[args.library](args.seconds):
        print(json.dumps({"vectors": name, "steps_per_s": round(steps)}), flush=True)


if __name__ == "__main__":
    main()
