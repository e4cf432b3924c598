"""Trains PPO of another library on a game's state vectors, and prints the mean return of the last 200 episodes.

    python train.py sb3|rllib|cleanrl --seed 1 --steps 737280 [--file PATH of CleanRL's ppo.py]
    python train.py sb3 --game maze2d --levels umaze:0..9 --steps 16384
    python train.py rllib --program target/release/foreign_breakout --game breakout --levels default:0..3 --steps 16384

The settings are those of assets/experiments/coinrun.ron: 64 arenas of 128 steps, 8 minibatches, 3 epochs, two hidden layers of 200.
CleanRL's own file runs unchanged but for `gymnasium.make`, with settings on its command line.
"""

import argparse
import collections
import json
import os
import re
import subprocess
import sys
import tempfile
import time

ARENAS, STEPS, MINIBATCHES, EPOCHS = 64, 128, 8, 3
RATE, GAMMA, LAMBDA, ENTROPY, CLIP = 5e-4, 0.99, 0.95, 0.003, 0.2
LAST = 200


def sb3(game, seed, steps):
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback

    from playbot.sb3 import Vector

    class Returns(BaseCallback):
        def __init__(self):
            super().__init__()
            self.last = collections.deque(maxlen=LAST)

        def _on_step(self):
            self.last.extend(info["episode"]["r"] for info in self.locals["infos"] if "episode" in info)
            return True

    envs = Vector(num_envs=ARENAS, **game)
    policy = {"net_arch": [200, 200], "activation_fn": torch.nn.ReLU}
    learner = PPO(
        "MlpPolicy", envs, n_steps=STEPS, batch_size=ARENAS * STEPS // MINIBATCHES, n_epochs=EPOCHS, learning_rate=RATE,
        gamma=GAMMA, gae_lambda=LAMBDA, ent_coef=ENTROPY, clip_range=CLIP, policy_kwargs=policy, seed=seed, device="cpu",
    )
    returns = Returns()
    learner.learn(steps, callback=returns)
    envs.close()
    return returns.last


def rllib(game, seed, steps):
    import gymnasium
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig

    import playbot  # noqa: F401, registers the environments

    config = (
        PPOConfig()
        .environment("playbot/Game-v0", env_config=game)
        .env_runners(
            num_env_runners=0, num_envs_per_env_runner=ARENAS, rollout_fragment_length=STEPS,
            gym_env_vectorize_mode=gymnasium.VectorizeMode.VECTOR_ENTRY_POINT,
        )
        .training(
            lr=RATE, gamma=GAMMA, lambda_=LAMBDA, entropy_coeff=ENTROPY, clip_param=CLIP, use_kl_loss=False,
            train_batch_size=ARENAS * STEPS, minibatch_size=ARENAS * STEPS // MINIBATCHES, num_epochs=EPOCHS,
            vf_loss_coeff=0.5, vf_clip_param=float("inf"), grad_clip=0.5,
        )
        .rl_module(model_config=DefaultModelConfig(fcnet_hiddens=[200, 200], fcnet_activation="relu", vf_share_layers=False))
        .reporting(metrics_num_episodes_for_smoothing=LAST)
        .debugging(seed=seed, log_level="ERROR")
    )
    learner = config.build_algo()
    result = {}
    for _ in range(-(-steps // (ARENAS * STEPS))):
        result = learner.train()
    returns = [result["env_runners"]["episode_return_mean"]]
    learner.stop()
    return returns


# CleanRL's file with another `make`, which also notes the returns: newer versions of Gymnasium do not tell them to it.
RUN = """
import runpy, sys
import gymnasium
import playbot

class Noted(gymnasium.Wrapper):
    def reset(self, **options):
        self.sum = 0.0
        return self.env.reset(**options)

    def step(self, action):
        step = self.env.step(action)
        self.sum += step[1]
        if step[2] or step[3]:
            print("return", self.sum, flush=True)
        return step

gymnasium.make = lambda *_, **__: Noted(playbot.make(**GAME))
sys.argv = [FILE] + WORDS
runpy.run_path(FILE, run_name="__main__")
"""


def cleanrl(game, seed, steps, file):
    if not file:
        sys.exit("--file names CleanRL's cleanrl/ppo.py, or cleanrl/ppo_continuous_action.py for numbers as actions")
    words = [
        "--seed", str(seed), "--total-timesteps", str(steps), "--num-envs", "8", "--num-steps", str(ARENAS * STEPS // 8),
        "--num-minibatches", str(MINIBATCHES), "--update-epochs", str(EPOCHS), "--learning-rate", str(RATE),
        "--gamma", str(GAMMA), "--gae-lambda", str(LAMBDA), "--ent-coef", str(ENTROPY), "--no-anneal-lr", "--no-cuda",
    ]
    code = f"GAME, FILE, WORDS = {game!r}, {os.path.abspath(file)!r}, {words!r}\n{RUN}"
    with tempfile.TemporaryDirectory() as folder:
        ran = subprocess.run([sys.executable, "-W", "ignore", "-c", code], cwd=folder, capture_output=True, text=True)
    if ran.returncode:
        sys.exit(ran.stderr)
    return [float(number) for number in re.findall(r"^return (\S+)", ran.stdout, re.M)[-LAST:]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("library", choices=["sb3", "rllib", "cleanrl"])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=737_280)
    parser.add_argument("--file")
    parser.add_argument("--game", default="coinrun")
    parser.add_argument("--levels", default="hard:0..63")
    parser.add_argument("--program")
    args = parser.parse_args()
    begun = time.monotonic()
    game = {"game": args.game, "levels": args.levels, "program": args.program}
    if args.library == "cleanrl":
        returns = cleanrl(game, args.seed, args.steps, args.file)
    else:
        returns = {"sb3": sb3, "rllib": rllib}[args.library](game, args.seed, args.steps)
    # No episode may have ended.
    mean = sum(returns) / len(returns) if returns else None
    print(json.dumps({
        "library": args.library, "game": args.game, "seed": args.seed, "steps": args.steps, "return": mean and round(mean, 3),
        "seconds": round(time.monotonic() - begun, 1),
    }))


if __name__ == "__main__":
    main()
