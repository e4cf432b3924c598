"""Vectors for Stable-Baselines3."""

import time

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from playbot.envs import action_space, connect_alone, mask_of, observation_space


class Vector(VecEnv):
    """A game of one agent in many arenas, as Stable-Baselines3 wants them: the last step of an episode shows the first
    observation of the next one, and ``infos[i]["terminal_observation"]`` has the last one.

    Actions are one choice, several, or numbers. For the options see ``playbot.Client``.
    """

    def __init__(self, game=None, num_envs=64, **options):
        self.render_mode = "rgb_array" if options.get("render") else None
        self.client = connect_alone(game, {"arenas": num_envs, "autoreset": "same_step"}, options, self.render_mode)
        description = self.client.description
        super().__init__(num_envs, observation_space(description), action_space(description))
        self._actions = self._levels = self._masks = None
        self._begun = time.monotonic()
        self._returns, self._lengths = np.zeros(num_envs), np.zeros(num_envs, np.int64)

    def reset(self):
        """Begin episodes in all arenas, with the seed that was set by ``seed``, if one was."""
        seed = self._seeds[0]
        self._reset_seeds()
        self._returns[:], self._lengths[:] = 0, 0
        batch = self.client.reset(seed)
        self._note(batch)
        return batch.observations.copy()

    def step_async(self, actions):
        """Take the actions of the next step."""
        self._actions = actions

    def step_wait(self):
        """Play the step."""
        batch = self.client.step(self._actions)
        rewards, done = batch.rewards.copy(), batch.terminated | batch.truncated
        self._returns += rewards
        self._lengths += 1
        infos = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(done):
            infos[row] = {
                "terminal_observation": batch.final_observations[row].copy(),
                "TimeLimit.truncated": bool(batch.truncated[row] and not batch.terminated[row]),
                "is_success": bool(batch.success[row]),
                "level": int(self._levels[row]),
                "episode": {
                    "r": float(self._returns[row]),
                    "l": int(self._lengths[row]),
                    "t": round(time.monotonic() - self._begun, 6),
                },
            }
            self._returns[row], self._lengths[row] = 0, 0
        self._note(batch)
        return batch.observations.copy(), rewards, done, infos

    def action_masks(self):
        """Return the legal actions of each arena, as MaskablePPO of sb3-contrib asks for them."""
        return self._masks

    def _note(self, batch):
        self._levels = batch.level.copy()
        self._masks = mask_of(self.client.description, batch.legal).astype(bool)

    def close(self):
        """End the game."""
        self.client.close()

    def get_images(self):
        """Return a picture of each arena, if ``render`` gives them a size."""
        return [self.client.render(arena) for arena in range(self.num_envs)]

    def get_attr(self, attr_name, indices=None):
        """Return an attribute of this vector, for each arena."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name, value, indices=None):
        """Set an attribute of this vector."""
        setattr(self, attr_name, value)

    def env_method(self, method_name, *args, indices=None, **kwargs):
        """Call a method of this vector, for each arena."""
        if method_name == "action_masks":
            return [self._masks[row] for row in self._get_indices(indices)]
        return [getattr(self, method_name)(*args, **kwargs) for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class, indices=None):
        """Return false for each arena: it is no environment of its own."""
        return [False for _ in self._get_indices(indices)]
