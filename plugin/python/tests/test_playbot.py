"""Tests of the package against real games. ``PLAYBOT_PROGRAM`` names the program, and ``PLAYBOT_PONG`` one with Pong."""

import glob
import os
import signal
import subprocess
import sys
import time

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence

import playbot
from playbot.client import Client

EASY = "easy:0..99"


@pytest.mark.parametrize(
    "game, options",
    [
        ("coinrun", {"levels": EASY}),
        ("coinrun", {"levels": EASY, "observation": "raster", "stack": 2}),
        ("maze2d-sighted", {}),
        ("antmaze-sighted", {}),
    ],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_environments_pass_the_checker_of_gymnasium(game, options):
    env = playbot.make(game, render_mode="rgb_array", **options)
    check_env(env, skip_render_check=True)
    assert env.render().shape[2] == 3 and env.render().any()
    env.close()


def test_two_environments_are_equivalent():
    one, other = (playbot.make("coinrun", levels=EASY) for _ in range(2))
    one.action_space.seed(3)
    assert data_equivalence(one.reset(seed=5), other.reset(seed=5))
    for _ in range(300):
        action = one.action_space.sample()
        left, right = one.step(action), other.step(action)
        assert data_equivalence(left, right)
        if left[2] or left[3]:
            assert data_equivalence(one.reset(), other.reset())
    one.close()
    other.close()


def test_gymnasium_makes_them_by_name():
    env = gym.make("playbot:playbot/coinrun-v0", levels=EASY)
    seen, _ = env.reset(seed=1)
    other = playbot.make("coinrun", levels=EASY)
    assert np.array_equal(seen, other.reset(seed=1)[0])
    env.close()
    other.close()
    envs = gym.make_vec("playbot/Game-v0", num_envs=3, vectorization_mode="vector_entry_point", game="coinrun")
    assert envs.reset(seed=1)[0].shape[0] == 3
    envs.close()


def rollout(steps=200, arenas=4, **options):
    with Client("coinrun", levels="hard:0..99", arenas=arenas, **options) as client:
        random = np.random.default_rng(0)
        seen = [{name: array.copy() for name, array in client.reset(seed=5).arrays.items()}]
        for _ in range(steps):
            batch = client.step(random.integers(0, 15, arenas))
            seen.append({name: array.copy() for name, array in batch.arrays.items()})
        return seen, [client.hash(arena) for arena in range(arenas)]


def test_transports_and_threads_give_the_same_bytes():
    wanted, hashes = rollout()
    for options in [{"transport": "unix"}, {"transport": "tcp"}, {"threads": 1}]:
        seen, others = rollout(**options)
        assert others == hashes
        for left, right in zip(wanted, seen):
            assert all(np.array_equal(left[name], right[name]) for name in left), options


def test_a_vector_is_many_single_environments():
    levels = [3, 7, 11]
    envs = playbot.make_vec("coinrun", num_envs=3, levels="hard:0..99")
    assert envs.metadata["autoreset_mode"] == gym.vector.AutoresetMode.NEXT_STEP
    seen, _ = envs.reset(options={"levels": levels})
    singles = [playbot.make("coinrun", levels="hard:0..99") for _ in levels]
    for row, (env, level) in enumerate(zip(singles, levels)):
        assert np.array_equal(env.reset(options={"level": level})[0], seen[row])
    running = set(range(3))
    for step in range(300):
        action = [8, 8, step % 15]
        seen, rewards, terminated, truncated, infos = envs.step(np.array(action))
        for row in list(running):
            one = singles[row].step(action[row])
            assert np.array_equal(one[0], seen[row]) and one[1] == rewards[row]
            assert (one[2], one[3]) == (terminated[row], truncated[row]) and infos["level"][row] == levels[row]
            if one[2] or one[3]:
                running.discard(row)
    assert len(running) < 3, "no episode has ended"
    envs.close()
    [env.close() for env in singles]


def test_the_same_step_brings_the_last_observation_and_the_next_episode():
    envs = playbot.make_vec("coinrun", num_envs=2, levels=EASY, autoreset="same_step")
    envs.reset(seed=1)
    for _ in range(1500):
        seen, _, terminated, truncated, infos = envs.step(np.full(2, 8))
        ended = terminated | truncated
        if ended.any():
            row = int(np.flatnonzero(ended)[0])
            assert np.array_equal(infos["_final_obs"], ended)
            assert infos["final_obs"][row].shape == seen[row].shape
            assert not np.array_equal(infos["final_obs"][row], seen[row])
            break
    else:
        pytest.fail("no episode has ended")
    envs.close()


def test_views_are_not_copied_and_stay_for_one_step_more():
    envs = playbot.make_vec("coinrun", num_envs=8, levels=EASY, copy=False)
    envs.reset(seed=1)
    first = envs.step(np.full(8, 8))[0]
    kept = first.copy()
    envs.step(np.full(8, 8))
    assert np.array_equal(first, kept)
    envs.step(np.full(8, 8))
    assert not np.array_equal(first, kept) and not first.flags.owndata
    envs.close()


def test_an_arena_goes_on_from_a_kept_state():
    with Client("coinrun", levels="hard:0..9", arenas=2) as client:
        client.reset(levels=[3, 4])
        for _ in range(20):
            client.step(np.full(2, 8))
        saved, before = client.save(0), client.hash(0)
        after = [client.step(np.full(2, 2)).observations[0].copy() for _ in range(5)]
        assert client.load(saved, 1).tick[1] == 20 and client.hash(1) == before
        again = [client.step(np.full(2, 2)).observations[1].copy() for _ in range(5)]
        assert np.array_equal(after, again)
        client.forget(saved)
        with pytest.raises(playbot.Refused, match="nothing is kept"):
            client.load(saved)


def test_recordings_of_a_client_replay(tmp_path):
    with Client("coinrun", levels=EASY, arenas=4) as client:
        client.reset(seed=1)
        files = client.record(tmp_path / "demos")
        random = np.random.default_rng(1)
        client.reset()
        for _ in range(400):
            client.step(random.integers(0, 15, 4))
    program = os.environ["PLAYBOT_PROGRAM"]
    for file in files:
        verified = subprocess.run([program, "demo", "verify", file], capture_output=True, text=True)
        assert verified.returncode == 0, verified.stderr


def test_wrong_actions_name_the_arena_and_change_nothing():
    with Client("coinrun", levels=EASY, arenas=3) as client:
        with pytest.raises(playbot.Refused, match="send a reset first"):
            client.step(np.zeros(3, np.int32))
        client.reset(seed=1)
        before = client.hash(2)
        with pytest.raises(playbot.Refused, match="action 99 is outside") as refused:
            client.step(np.array([0, 0, 99]))
        assert refused.value.arena == 2 and client.hash(2) == before
        with pytest.raises(ValueError, match=r"the shape \(2,\), and \(3,\) is expected"):
            client.step(np.zeros(2, np.int32))
        with pytest.raises(TypeError, match="whole numbers"):
            client.step(np.zeros(3))
        client.step(np.zeros(3, np.int32))
    with Client("antmaze-sighted", arenas=2) as client:
        client.reset()
        actions = np.zeros((2, 8), np.float32)
        actions[1, 3] = np.nan
        with pytest.raises(playbot.Refused, match="NaN") as refused:
            client.step(actions)
        assert refused.value.arena == 1


def test_what_is_not_there_is_named():
    with pytest.raises(playbot.ProgramEnded, match="did you mean `coinrun`"):
        playbot.make("coinrum")
    with pytest.raises(playbot.ProgramEnded, match="PLAYBOT_PROGRAM"):
        playbot.make("coinrun", program="/no/such/program")
    with pytest.raises(playbot.ProgramEnded, match="no program serves"):
        Client(address="/no/such/socket")


def test_wrong_options_are_named_before_a_program_is_started():
    with pytest.raises(TypeError, match="did you mean 'levels'"):
        playbot.make("coinrun", levelz=EASY)
    with pytest.raises(TypeError, match="names a mode"):
        playbot.make("coinrun", mode="hard")
    with pytest.raises(ValueError, match="there are next_step, same_step, disabled"):
        playbot.make_vec("coinrun", autoreset="never")
    env = playbot.make("coinrun", levels=EASY)
    with pytest.raises(ValueError, match="reset has no options"):
        env.reset(options={"stage": 7})
    env.close()
    env.close()


def test_each_arena_may_have_a_seed_of_its_own():
    envs = playbot.make_vec("coinrun", num_envs=3, levels=EASY)
    levels = [envs.reset(seed=seeds)[1]["level"] for seeds in ([1, 2, 3], [1, 5, 3])]
    assert levels[0][0] == levels[1][0] and levels[0][2] == levels[1][2] and levels[0][1] != levels[1][1]
    with pytest.raises(ValueError, match="2 seeds for 3 arenas"):
        envs.reset(seed=[1, 2])
    envs.close()


def test_a_server_that_is_there_already_serves_an_environment(tmp_path):
    words = [os.environ["PLAYBOT_PROGRAM"], "serve", "coinrun", "--arenas", "2", "--listen", str(tmp_path / "socket")]
    server = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    server.stdout.readline()
    address = str(tmp_path / "socket")
    with pytest.raises(ValueError, match="serves {'arenas': 2, 'autoreset': 'next_step'}"):
        playbot.make(address=address)
    envs = playbot.make_vec(address=address, num_envs=2)
    assert envs.reset()[0].shape[0] == 2
    envs.close()
    server.terminate()
    assert server.wait() == 143


def left_behind():
    return glob.glob("/dev/shm/playbot-*")


def test_a_program_that_dies_is_told_and_leaves_nothing():
    client = Client("coinrun", levels=EASY, arenas=2)
    client.reset(seed=1)
    process = client._program._process
    process.send_signal(signal.SIGKILL)
    with pytest.raises(playbot.ProgramEnded, match="has ended"):
        for _ in range(10):
            client.step(np.zeros(2, np.int32))
    client.close()
    assert left_behind() == []


@pytest.mark.parametrize("end", ["os._exit(1)", "raise KeyboardInterrupt", "os.kill(os.getpid(), 9)"])
def test_a_client_that_dies_ends_its_program(end):
    code = (
        "import os, sys, numpy as np; from playbot.client import Client\n"
        "client = Client('coinrun', levels='easy:0..9', arenas=2); client.reset()\n"
        f"print(client._program._process.pid, flush=True); client.step(np.zeros(2, np.int32)); {end}"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.returncode != 0
    program = int(ended.stdout)
    for _ in range(100):
        if not os.path.exists(f"/proc/{program}/exe"):
            break
        time.sleep(0.05)
    else:
        pytest.fail(f"the program {program} plays on alone")
    assert left_behind() == []


@pytest.mark.skipif("PLAYBOT_PONG" not in os.environ, reason="PLAYBOT_PONG names no program")
def test_a_game_of_two_agents_passes_the_test_of_pettingzoo():
    from pettingzoo.test import parallel_api_test, parallel_seed_test

    from playbot.pettingzoo import Parallel

    def make():
        return Parallel(program=os.environ["PLAYBOT_PONG"])

    env = make()
    assert len(env.possible_agents) == 2
    parallel_api_test(env, num_cycles=300)
    env.close()
    parallel_seed_test(make)
    with pytest.raises(ValueError, match="playbot.pettingzoo"):
        playbot.make(program=os.environ["PLAYBOT_PONG"])


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_recordings_become_a_data_set_of_minari_and_come_back(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "sets"))
    pytest.importorskip("minari")
    from playbot.minari import episodes_of, from_minari, to_minari

    program = os.environ["PLAYBOT_PROGRAM"]
    for game, levels in [("coinrun", "easy:0..4"), ("maze2d", "umaze:0..1")]:
        recording = tmp_path / f"{game}.demo"
        words = [program, "record", game, "--levels", levels, "--noise", "0.1", "--out", str(recording)]
        recorded = subprocess.run(words, capture_output=True, text=True)
        assert recorded.returncode == 0, recorded.stderr
        kept = episodes_of(recording)
        dataset = to_minari(recording, f"test/{game}-v0")
        assert dataset.total_episodes == len(kept) and dataset.total_steps == sum(len(e["rewards"]) for e in kept)
        for episode, has in zip(kept, dataset.iterate_episodes()):
            assert np.array_equal(np.float32(has.rewards), np.float32(episode["rewards"]))
            assert np.array_equal(np.array(episode["actions"], has.actions.dtype), has.actions)
            assert bool(has.terminations[-1]) == ("Terminated" in str(episode["end"]))
        back = episodes_of(from_minari(f"test/{game}-v0", tmp_path / "back" / game))
        # The episode that the recording begins in is followed by those of the data set.
        for one, other in zip(kept, back[-len(kept) :]):
            assert (one["actions"], one["rewards"], one["level"]) == (other["actions"], other["rewards"], other["level"])
    with pytest.raises(playbot.PlaybotError, match="the observations of the data set are"):
        from_minari("test/maze2d-v0", tmp_path / "other", game="maze2d-sighted")


def test_an_interrupted_step_ends_the_conversation(monkeypatch):
    with playbot.Client("coinrun", levels="easy:0..9", arenas=2) as client:
        client.reset(seed=1)
        exactly = client._exactly
        monkeypatch.setattr(client, "_exactly", lambda buffer: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            client.step(np.zeros(2, np.int32))
        monkeypatch.setattr(client, "_exactly", exactly)
        # The answer to that step would be taken for the next one.
        with pytest.raises(playbot.PlaybotError, match="closed"):
            client.reset()


def test_actions_that_do_not_fit_are_refused_and_not_cut():
    with playbot.Client("coinrun", levels="easy:0..9", arenas=2) as client:
        client.reset(seed=1)
        with pytest.raises(ValueError, match="32 bits"):
            client.step(np.array([0, 2**32 + 3]))


def test_a_program_that_is_none_is_said_and_leaves_nothing(tmp_path):
    before = left_behind()
    text = tmp_path / "text"
    text.write_text("no program")
    text.chmod(0o755)
    with pytest.raises(playbot.ProgramEnded, match="cannot be started"):
        playbot.Client("coinrun", program=str(text))
    assert left_behind() == before
