"""Games of several agents, for PettingZoo."""

import numpy as np
from pettingzoo import ParallelEnv

from playbot.envs import action_space, actions_of, connect, mask_of, observation_space


class Parallel(ParallelEnv):
    """An arena in which all agents act at the same time.

    Agents have the names of their seats in the game. ``reset(options={"level": 7})`` plays that level. For the other options
    see ``playbot.Client``.
    """

    metadata = {"render_modes": ["rgb_array"], "is_parallelizable": True}

    def __init__(self, game=None, *, render_mode=None, **options):
        self.render_mode = render_mode
        self.client = None
        self.client = connect(game, {"arenas": 1, "autoreset": "disabled"}, options, render_mode)
        description = self.client.description
        self.metadata = {**self.metadata, "name": description["game"], "render_fps": description["tick_hz"]}
        seats = description["seats"]
        if len(seats) != description["agents"]:
            seats = [f"agent_{agent}" for agent in range(description["agents"])]
        self.possible_agents = list(seats)
        self.agents = []
        self.observation_spaces = {agent: observation_space(description) for agent in seats}
        self.action_spaces = {agent: action_space(description) for agent in seats}

    def observation_space(self, agent):
        """Return the space of an agent's observation."""
        return self.observation_spaces[agent]

    def action_space(self, agent):
        """Return the space of an agent's action."""
        return self.action_spaces[agent]

    def reset(self, seed=None, options=None):
        """Begin an episode, on the level of ``options`` if it names one. Others are ignored, as PettingZoo wants it."""
        level = (options or {}).get("level")
        batch = self.client.reset(seed, None if level is None else [level])
        self.agents = list(self.possible_agents)
        return self._of_agents(batch.observations), self._infos(batch)

    def step(self, actions):
        """Play one tick. An agent whose episode is over needs no action; each other one does."""
        missing = [agent for agent in self.agents if agent not in actions]
        if missing:
            raise ValueError(f"there is no action for {', '.join(missing)}")
        # Those of the last step, for agents whose episode is over: the game does not look at them.
        rows = {name: array.copy() for name, array in self.client.actions.items()}
        for row, agent in enumerate(self.possible_agents):
            if agent in actions:
                action = actions_of(self.client, actions[agent])
                for name in rows:
                    rows[name][row] = action[name] if isinstance(action, dict) else action
        batch = self.client.step(rows if len(rows) > 1 else next(iter(rows.values())))
        seen, infos = self._of_agents(batch.observations), self._infos(batch)
        rewards = {agent: float(batch.rewards[row]) for row, agent in self._rows()}
        terminated = {agent: bool(batch.terminated[row]) for row, agent in self._rows()}
        truncated = {agent: bool(batch.truncated[row]) for row, agent in self._rows()}
        self.agents = [agent for agent in self.agents if not (terminated[agent] or truncated[agent])]
        return seen, rewards, terminated, truncated, infos

    def render(self):
        """Return the picture of this tick, ``[height, width, 3]`` bytes; None without ``render_mode="rgb_array"``."""
        return self.client.render() if self.render_mode else None

    def close(self):
        """End the game."""
        if self.client is not None:
            self.client.close()

    def _rows(self):
        return [(row, agent) for row, agent in enumerate(self.possible_agents) if agent in self.agents]

    def _of_agents(self, array):
        return {agent: np.array(array[row]) for row, agent in self._rows()}

    def _infos(self, batch):
        infos = {
            agent: {"level": int(batch.level[row]), "tick": int(batch.tick[row]), "success": bool(batch.success[row])}
            for row, agent in self._rows()
        }
        if self.client.description["action"]["kind"] != "continuous":
            for row, agent in self._rows():
                infos[agent]["action_mask"] = mask_of(self.client.description, batch.legal[row])
        return infos
