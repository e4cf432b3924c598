"""Recordings as data sets of Minari, and back.

A recording holds actions and no observations. They are brought back by playing the actions again, and the rewards have to
be those that were recorded. A data set keeps the level of each episode in its options, so that its actions can be played
again, too.
"""

import json
import os
import subprocess

import minari
import numpy as np
from minari.data_collector import EpisodeBuffer

from playbot.client import Client, PlaybotError, find_program
from playbot.envs import action_space, actions_of, observation_space


def episodes_of(recording, program=None):
    """Return the episodes of a recording as dicts: ``game``, ``mode``, ``level``, ``end``, ``actions``, ``rewards``."""
    words = [find_program(program), "demo", "show", os.fspath(recording), "--json", "--actions"]
    shown = subprocess.run(words, capture_output=True, text=True)
    if shown.returncode:
        raise PlaybotError(shown.stderr.strip())
    return [json.loads(line) for line in shown.stdout.splitlines()]


def to_minari(recordings, dataset_id, *, program=None, description=None, author=None, **options):
    """Play recordings of one game again, and return them as a new data set, ``namespace/name-v0``.

    ``options`` are those of ``playbot.Client``, such as ``observation="raster"``. An episode that was cut off counts as
    truncated.
    """
    recordings = [recordings] if isinstance(recordings, (str, os.PathLike)) else list(recordings)
    buffers, client = [], None
    try:
        for recording in recordings:
            for episode in episodes_of(recording, program):
                refuse_unplayable(recording, episode)
                if client is None:
                    levels = f"{episode['mode']}:0..0"
                    options = {"autoreset": "disabled", "levels": levels, **options}
                    client = Client(episode["game"], program=program, **options)
                buffers.append(_played(client, recording, episode, len(buffers)))
    finally:
        if client is not None:
            client.close()
    if not buffers:
        raise PlaybotError("the recordings have no episodes")
    about = client.description
    return minari.create_dataset_from_buffers(
        dataset_id,
        buffers,
        observation_space=observation_space(about),
        action_space=action_space(about),
        algorithm_name="playbot recordings",
        description=description or f"{about['game']}, mode {about['mode']}, version {about['game_version']} of its rules",
        author=author,
        data_format="arrow",
    )


def refuse_unplayable(recording, episode):
    """Raise an error for episodes whose levels a client cannot name."""
    which = f"{recording}, episode {episode['episode']}"
    if episode["level_file"] is not None:
        raise PlaybotError(f"{which}: its level is a file, and a data set keeps numbers of levels alone")
    if "randomised" in episode:
        raise PlaybotError(f"{which}: its level has drawn values, which a client cannot set")


def _played(client, recording, episode, number):
    batch = client.reset(levels=[episode["level"]])
    observations, rewards, kind = [batch.observations[0].copy()], [], client.description["action"]["kind"]
    for tick, (action, recorded) in enumerate(zip(episode["actions"], episode["rewards"])):
        batch = client.step(actions_of(client, _row(action, kind)))
        if np.float32(recorded) != batch.rewards[0]:
            raise PlaybotError(
                f"{recording}, episode {episode['episode']}, tick {tick}: the reward is {batch.rewards[0]}, and {recorded} was "
                "recorded: `playbot demo verify` says more"
            )
        observations.append(batch.observations[0].copy())
        rewards.append(recorded)
    steps = len(rewards)
    ends = np.zeros((2, steps), np.bool_)
    ends[0 if "Terminated" in str(episode["end"]) else 1, -1] = True
    dtype = {"discrete": np.int64, "continuous": np.float32}.get(kind)
    actions = np.array(episode["actions"], dtype) if dtype else _columns(episode["actions"])
    return EpisodeBuffer(
        id=number, options={"level": episode["level"], "mode": episode["mode"], "game": episode["game"]},
        observations=np.stack(observations), actions=actions, rewards=np.array(rewards, np.float32).tolist(),
        terminations=ends[0].tolist(), truncations=ends[1].tolist(),
    )


def _row(action, kind):
    if kind == "discrete":
        return np.array([action], np.int32)
    if kind == "continuous":
        return np.array([action], np.float32)
    return {name: np.array([part]) for name, part in action.items()}


def _columns(actions):
    choices = np.array([action["choices"] for action in actions], np.int64)
    numbers = np.array([action["numbers"] for action in actions], np.float32)
    return {"choices": choices, "numbers": numbers} if numbers.size else choices


def from_minari(dataset, folder, *, game=None, program=None, levels=None, **options):
    """Play the actions of a data set, record them into ``folder``, and return the path of the recording.

    ``dataset`` is a data set or its name. Its observations and rewards have to come out again, or the first tick that differs
    is named. Episodes without options are played on the levels ``levels``, one for each.
    """
    if isinstance(dataset, str):
        dataset = minari.load_dataset(dataset)
    episodes = list(dataset.iterate_episodes())
    places = [_place(dataset, episode, number, game, levels) for number, episode in enumerate(episodes)]
    games = {(name, mode) for name, mode, _ in places}
    if len(games) != 1:
        raise PlaybotError(f"a recording is of one game and mode, and the data set has {sorted(games)}")
    ((name, mode),) = games
    with Client(name, program=program, autoreset="disabled", levels=f"{mode}:0..0", **options) as client:
        for space, has, wants in [
            ("observations", dataset.observation_space, observation_space(client.description)),
            ("actions", dataset.action_space, action_space(client.description)),
        ]:
            if has != wants:
                raise PlaybotError(f"the {space} of the data set are {has}, and those of {name} are {wants}")
        # An episode is recorded from its beginning, so there has to be one first.
        client.reset(levels=[places[0][2]])
        (file,) = client.record(folder)
        for number, (episode, (_, _, level)) in enumerate(zip(episodes, places)):
            _replayed(client, number, episode, level)
    return file


def _place(dataset, episode, number, game, levels):
    kept = (dataset.storage.get_episode_metadata([number]) if hasattr(dataset, "storage") else iter([{}]))
    kept = next(iter(kept)).get("options") or {}
    if isinstance(kept, str):
        kept = json.loads(kept)
    if "level" in kept:
        return game or kept["game"], kept["mode"], int(kept["level"])
    if levels is None or game is None:
        raise PlaybotError(f"episode {number} does not say its level: name game=\"...\" and levels=(\"MODE\", [0, 1, ...])")
    mode, numbers = levels
    return game, mode, int(numbers[number])


def _replayed(client, number, episode, level):
    kind = client.description["action"]["kind"]
    seen = client.reset(levels=[level]).observations[0]
    for tick in range(len(episode.rewards)):
        if not np.array_equal(seen, episode.observations[tick]):
            raise PlaybotError(f"episode {number}, tick {tick}: the game does not show what the data set has")
        action = (
            {name: part[tick] for name, part in episode.actions.items()}
            if isinstance(episode.actions, dict)
            else episode.actions[tick]
        )
        if kind == "mixed" and not isinstance(action, dict):
            action = {"choices": action}
        batch = client.step(actions_of(client, _row(action, kind)))
        if np.float32(episode.rewards[tick]) != batch.rewards[0]:
            raise PlaybotError(
                f"episode {number}, tick {tick}: the game's reward is {batch.rewards[0]}, and that of the data set is "
                f"{episode.rewards[tick]}"
            )
        seen = batch.observations[0]
    if not np.array_equal(seen, episode.observations[-1]):
        raise PlaybotError(f"episode {number}: the game ends otherwise than the data set")
