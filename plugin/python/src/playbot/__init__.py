"""Bevy games as environments.

``make`` gives a Gymnasium environment, ``make_vec`` many of them in lockstep. The game is a program: ``playbot`` itself, or
any program with playbot's command line. It runs beside Python, and its arrays lie in shared memory.

- ``playbot.client``: the protocol, over numpy alone.
- ``playbot.envs``: environments of Gymnasium.
- ``playbot.pettingzoo``: games of several agents.
- ``playbot.minari``: recordings as data sets, and back.
- ``playbot.sb3``: vectors for Stable-Baselines3.
- ``playbot.cluster``: workers of trainings and tests on many machines, which the program starts by itself.
"""

import importlib
import importlib.util

from playbot.client import Client, PlaybotError, ProgramEnded, Refused

__all__ = ["Client", "PlaybotError", "ProgramEnded", "Refused", "make", "make_vec"]
__version__ = "0.1.0"


def __getattr__(name):
    """Import the modules that need other libraries when they are asked for: ``playbot.sb3`` and the like."""
    if name in ("envs", "minari", "pettingzoo", "sb3"):
        return importlib.import_module(f"playbot.{name}")
    raise AttributeError(f"module 'playbot' has no attribute {name!r}")


def make(game=None, **options):
    """Return a Gymnasium environment of one arena: ``playbot.envs.Env``, which names the options."""
    from playbot.envs import Env

    return Env(game, **options)


def make_vec(game=None, num_envs=64, **options):
    """Return a Gymnasium vector of ``num_envs`` arenas: ``playbot.envs.VectorEnv``, which names the options."""
    from playbot.envs import VectorEnv

    return VectorEnv(game, num_envs=num_envs, **options)


if importlib.util.find_spec("gymnasium"):
    from playbot.envs import register

    register()
