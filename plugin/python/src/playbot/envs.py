"""Environments of Gymnasium."""

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

from playbot.client import Client

# The games of the program `playbot`; those of other programs go by `playbot/Game-v0`.
_GAMES = ("coinrun", "ant") + tuple(
    game + kind for game in ("maze2d", "antmaze") for kind in ("", "-sighted", "-mapped", "-placed")
)


def register():
    """Register ``playbot/coinrun-v0`` and the like, and ``playbot/Game-v0`` with ``game=...`` and ``program=...``.

    ``import playbot`` does it where Gymnasium is installed, and so does ``gymnasium.make("playbot:playbot/coinrun-v0")``.
    """
    entry = {"entry_point": "playbot.envs:Env", "vector_entry_point": "playbot.envs:VectorEnv"}
    for game in _GAMES:
        gym.register(f"playbot/{game}-v0", kwargs={"game": game}, **entry)
    gym.register("playbot/Game-v0", **entry)


_MODES = {
    "next_step": AutoresetMode.NEXT_STEP,
    "same_step": AutoresetMode.SAME_STEP,
    "disabled": AutoresetMode.DISABLED,
}


def observation_space(description):
    """Return the space of an agent's observation: numbers, or pictures ``[channels, height, width]``."""
    seen = description["observation"]
    if seen["kind"] == "image":
        return spaces.Box(0, 255, tuple(seen["shape"]), np.uint8)
    return spaces.Box(-np.inf, np.inf, (len(seen["names"]),), np.float32)


def action_space(description):
    """Return the space of an agent's action: one choice, several, numbers from -1 to 1, or choices and numbers."""
    action = description["action"]
    if action["kind"] == "discrete":
        return spaces.Discrete(action["count"])
    if action["kind"] == "continuous":
        return spaces.Box(-1.0, 1.0, (action["count"],), np.float32)
    choices = spaces.MultiDiscrete(action["choices"])
    if action["numbers"] == 0:
        return choices
    return spaces.Dict({"choices": choices, "numbers": spaces.Box(-1.0, 1.0, (action["numbers"],), np.float32)})


def actions_of(client, actions):
    """Return actions of a space of ``action_space`` in the form of ``Client.step``."""
    if isinstance(actions, dict) and len(client.actions) == 1:
        (name,) = client.actions
        return actions[name]
    return actions


def connect(game, wanted, options, render_mode=None):
    """Return a client with the options ``wanted``, which a program that serves already has to have.

    With a ``render_mode`` it draws for people, unless agents see pictures.
    """
    if render_mode and options.get("observation", "vector") == "vector":
        options = {"render": 256, **options}
    if "address" not in options:
        return Client(game, **wanted, **options)
    client = Client(game, **options)
    has = {name: client.description[name] for name in wanted}
    if has != wanted:
        client.close()
        raise ValueError(f"the program at {options['address']} serves {has}, and {wanted} is wanted")
    return client


def connect_alone(game, wanted, options, render_mode):
    """Return a client as ``connect`` does, of a game with one agent in each arena."""
    if render_mode not in (None, "rgb_array"):
        raise ValueError(f"render_mode is {render_mode!r}: there is None, and 'rgb_array'")
    client = connect(game, wanted, options, render_mode)
    description = client.description
    if description["agents"] != wanted["arenas"]:
        client.close()
        raise ValueError(f"{description['game']} has {description['agents']} agents: see playbot.pettingzoo")
    return client


def check_keys(options, known):
    """Raise a ValueError for an option of ``reset`` that there is not."""
    unknown = set(options or {}) - set(known)
    if unknown:
        raise ValueError(f"reset has no options {sorted(unknown)}: there are {', '.join(known)}")
    return options or {}


def mask_of(description, legal):
    """Return masks in the form that ``Discrete.sample(mask=...)`` takes: 1 for each legal option."""
    action = description["action"]
    options = action["count"] if action["kind"] == "discrete" else sum(action.get("choices", ()))
    return legal[..., :options].astype(np.int8)


class Env(gym.Env):
    """A game of one agent, in one arena.

    ``reset(options={"level": 7})`` plays that level; otherwise levels are drawn, from the seed of the last reset that had
    one. ``info`` has ``level``, ``tick``, ``success``, and for choices ``action_mask``. A recording of everything begins with
    ``env.unwrapped.client.record(folder)``. For the options see ``playbot.Client``.
    """

    metadata = {"render_modes": ["rgb_array"]}

    def __init__(self, game=None, *, render_mode=None, **options):
        self.render_mode = render_mode
        self.client = None
        self.client = connect_alone(game, {"arenas": 1, "autoreset": "disabled"}, options, render_mode)
        description = self.client.description
        self.metadata = {**self.metadata, "render_fps": description["tick_hz"]}
        self.observation_space = observation_space(description)
        self.action_space = action_space(description)

    def reset(self, *, seed=None, options=None):
        """Begin an episode, and return its first observation."""
        super().reset(seed=seed)
        level = check_keys(options, ["level"]).get("level")
        batch = self.client.reset(seed, None if level is None else [level])
        return batch.observations[0].copy(), self._info(batch)

    def step(self, action):
        """Play one tick."""
        action = actions_of(self.client, action)
        if isinstance(action, dict):
            action = {name: np.asarray(part)[None] for name, part in action.items()}
        else:
            action = np.asarray(action)[None]
        batch = self.client.step(action)
        terminated, truncated = bool(batch.terminated[0]), bool(batch.truncated[0])
        return batch.observations[0].copy(), float(batch.rewards[0]), terminated, truncated, self._info(batch)

    def render(self):
        """Return the picture of this tick, ``[height, width, 3]`` bytes; None without ``render_mode="rgb_array"``."""
        return self.client.render() if self.render_mode else None

    def close(self):
        """End the game."""
        if self.client is not None:
            self.client.close()

    def _info(self, batch):
        info = {"level": int(batch.level[0]), "tick": int(batch.tick[0]), "success": bool(batch.success[0])}
        if self.client.description["action"]["kind"] != "continuous":
            info["action_mask"] = mask_of(self.client.description, batch.legal[0])
        return info


class VectorEnv(gym.vector.VectorEnv):
    """A game of one agent, in many arenas that step together.

    After the last step of an episode, ``autoreset="next_step"`` (the default, as in Gymnasium) ignores one action of that
    arena and shows the first observation of the next episode; with ``"same_step"`` the last step shows it, and
    ``infos["final_obs"]`` has the last one, while level and tick are those of the next; with ``"disabled"`` the arena waits for
    ``reset(options={"reset_mask": mask})``. ``reset(options={"levels": [...]})`` names a level for each arena.

    Observations are copied, unless ``copy=False``: then they are views of shared memory, which change with the second step
    after theirs. For the other options see ``playbot.Client``.
    """

    metadata = {"render_modes": ["rgb_array"]}

    def __init__(self, game=None, *, num_envs=64, autoreset="next_step", copy=True, render_mode=None, **options):
        self.render_mode = render_mode
        self.client = None
        autoreset = str(getattr(autoreset, "name", autoreset)).lower()
        if autoreset not in _MODES:
            raise ValueError(f"autoreset is {autoreset!r}: there are {', '.join(_MODES)}")
        self.client = connect_alone(game, {"arenas": num_envs, "autoreset": autoreset}, options, render_mode)
        description = self.client.description
        self.num_envs = num_envs
        self.metadata = {
            **self.metadata,
            "render_fps": description["tick_hz"],
            "autoreset_mode": _MODES[description["autoreset"]],
        }
        self.single_observation_space = observation_space(description)
        self.single_action_space = action_space(description)
        self.observation_space = gym.vector.utils.batch_space(self.single_observation_space, num_envs)
        self.action_space = gym.vector.utils.batch_space(self.single_action_space, num_envs)
        self._copies = copy
        self._has_masks = description["action"]["kind"] != "continuous"
        self._all = np.ones(num_envs, np.bool_)

    def reset(self, *, seed=None, options=None):
        """Begin episodes, and return their first observations."""
        options = check_keys(options, ["levels", "reset_mask"])
        mask, seeds = options.get("reset_mask"), None
        arenas = None if mask is None else np.flatnonzero(mask)
        if seed is not None and not isinstance(seed, (int, np.integer)):
            seeds = list(seed)
            if len(seeds) != self.num_envs:
                raise ValueError(f"{len(seeds)} seeds for {self.num_envs} arenas: give one for each, or one for all")
            seed = seeds[0]
        super().reset(seed=seed)
        batch = self.client.reset(seed, options.get("levels"), arenas)
        if seeds is not None and arenas is None and options.get("levels") is None:
            for arena, own in enumerate(seeds):
                if own is not None:
                    batch = self.client.reset(own, arenas=[arena])
        return self._seen(batch.observations), self._infos(batch)

    def step(self, actions):
        """Play one tick with an action for each arena."""
        batch = self.client.step(actions_of(self.client, actions))
        terminated, truncated = batch.terminated.copy(), batch.truncated.copy()
        infos = self._infos(batch)
        if "final_observations" in batch.arrays:
            ended = terminated | truncated
            if ended.any():
                final = np.full(self.num_envs, None, object)
                for row in np.flatnonzero(ended):
                    final[row] = batch.final_observations[row].copy()
                infos["final_obs"], infos["_final_obs"] = final, ended
        return self._seen(batch.observations), batch.rewards.astype(np.float64), terminated, truncated, infos

    def render(self):
        """Return a picture of each arena; None without ``render_mode="rgb_array"``."""
        if self.render_mode is None:
            return None
        return tuple(self.client.render(arena) for arena in range(self.num_envs))

    def close_extras(self, **_):
        """End the game."""
        if self.client is not None:
            self.client.close()

    def _seen(self, observations):
        return observations.copy() if self._copies else observations

    def _infos(self, batch):
        infos = {"level": batch.level.copy(), "tick": batch.tick.copy(), "success": batch.success.copy()}
        if self._has_masks:
            infos["action_mask"] = mask_of(self.client.description, batch.legal)
        return {**infos, **{"_" + name: self._all for name in infos}}
