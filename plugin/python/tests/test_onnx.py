"""Exported policies under onnxruntime, beside the examples in their policy files. ``PLAYBOT_PROGRAM`` names the program."""

import json
import os
import struct
import subprocess

import numpy as np
import pytest

onnxruntime = pytest.importorskip("onnxruntime")

EXAMPLES = 1000
TOLERANCE = 1e-5
DTYPES = {"F32": "<f4", "F64": "<f8", "U8": "u1"}

SIZES = "num_steps: 16, minibatches: 2, epochs: 4, lr: 0.01, hidden: [16, 16]"
KINDS = {
    "choices": ("coinrun", "easy:0..3", f'algorithm: "ppo", ppo: ({SIZES}, norm_obs: true)'),
    "numbers": ("maze2d", "umaze:0..3", f'algorithm: "ppo", ppo: ({SIZES}, activation: Tanh)'),
    "squashed": ("maze2d", "umaze:0..3", 'algorithm: "sac", sac: (hidden: [16, 16], learning_starts: 64, random_start: false)'),
    "memory": ("coinrun", "easy:0..3", f'algorithm: "ppo", ppo: ({SIZES}, memory: Gru(hidden: 6))'),
    "pictures": (
        "coinrun",
        "easy:0..3",
        "observation: Raster, image: (width: 24, height: 24), "
        f'algorithm: "ppo", ppo: ({SIZES}, cnn: Impala(channels: [4, 6], feature: 16))',
    ),
}


def program(folder, *words):
    done = subprocess.run([os.environ["PLAYBOT_PROGRAM"], *words], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, f"{words}: {done.stderr}"
    return done.stderr


def policy_file(path):
    """Reads a policy file by its documented form: arrays by name, and the description."""
    data = path.read_bytes()
    (length,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + length])
    description = json.loads(header.pop("__metadata__")["playbot"])
    arrays = {}
    for name, entry in header.items():
        start, end = (8 + length + offset for offset in entry["data_offsets"])
        arrays[name] = np.frombuffer(data[start:end], DTYPES[entry["dtype"]]).reshape(entry["shape"])
    return description, arrays


def near(name, found, expected):
    assert found.shape == expected.shape, name
    assert np.ptp(expected) > 1e-4 or name == "log_std", f"{name} is the same for all observations"
    assert np.all(np.abs(found - expected) <= TOLERANCE * np.maximum(1, np.abs(expected))), name


def run(path, inputs):
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    wanted = {entry.name for entry in session.get_inputs()}
    names = [entry.name for entry in session.get_outputs()]
    given = {name: value for name, value in inputs.items() if name in wanted}
    return dict(zip(names, session.run(names, given))), session


def exported(folder, *source):
    program(folder, "policy", "export", *source, "--examples", str(EXAMPLES), "--out", "bot.policy")
    words = program(folder, "policy", "export", "--policy", "bot.policy", "--format", "onnx", "--out", "bot.onnx")
    return policy_file(folder / "bot.policy"), words


def observations(description, arrays):
    image = description["policy"].get("image")
    if image is None:
        return arrays["examples.obs"]
    return arrays["examples.obs"].reshape(-1, image["channels"], image["height"], image["width"])


@pytest.mark.parametrize("kind", KINDS)
def test_onnxruntime_gives_what_the_policy_gives(tmp_path, kind):
    game, levels, settings = KINDS[kind]
    mode = levels.split(":")[0]
    experiment = f'(game: "{game}", train: "{levels}", test: "{mode}:8..9", steps: 512, arenas: 8, worlds: 2, {settings})'
    (tmp_path / "small.ron").write_text(experiment)
    program(tmp_path, "train", "--experiment", "small.ron", "--run", "run")
    (description, arrays), _ = exported(tmp_path, "--run", "run")
    assert len(arrays["examples.obs"]) == description["examples"] == EXAMPLES
    inputs = {"observation": observations(description, arrays)}
    if kind == "memory":
        inputs["memory"] = np.zeros((EXAMPLES, 6), np.float32)
    outputs, session = run(tmp_path / "bot.onnx", inputs)
    head = arrays["examples.head"]
    if kind in ("numbers", "squashed"):
        near("mean", outputs["mean"], head)
        near("log_std", outputs["log_std"], arrays["examples.log_std"])
        near("action", outputs["action"], np.tanh(head) if kind == "squashed" else head)
    else:
        near("log_probabilities", outputs["log_probabilities"], head)
        assert np.array_equal(outputs["action"], head.argmax(axis=1))
    if kind != "squashed":
        near("value", outputs["value"][:, None], arrays["examples.value"])
    if kind == "memory":
        assert outputs["memory_after"].shape == (EXAMPLES, 6) and outputs["memory_after"].any()
    metadata = session.get_modelmeta().custom_metadata_map
    assert metadata["game"] == game and json.loads(metadata["observations"]) == description["card"]["observations"]


def test_a_policy_with_skills_plays_with_its_prior(tmp_path):
    program(tmp_path, "record", "coinrun", "--levels", "easy:0..3", "--out", "a.demo")
    settings = ["skills.latent=3", "skills.epochs=2", "skills.hidden=[16]", "skills.encoder_hidden=8", "demos=a.demo"]
    sets = [word for setting in settings for word in ("--set", setting)]
    program(tmp_path, "learn-skills", "coinrun", "--out", "skills.safetensors", *sets)
    (_, arrays), words = exported(tmp_path, "--skills", "skills.safetensors", "coinrun", *sets)
    assert "its prior written to bot.prior.onnx" in words
    observation, noise = arrays["examples.obs"], np.zeros((EXAMPLES, 3), np.float32)
    drawn, session = run(tmp_path / "bot.prior.onnx", {"observation": observation, "noise": noise})
    near("skill", drawn["skill"], arrays["examples.prior_mean"])
    assert session.get_modelmeta().custom_metadata_map["skill_interval"] == "8"
    outputs, _ = run(tmp_path / "bot.onnx", {"observation": observation, "skill": arrays["examples.z"]})
    near("log_probabilities", outputs["log_probabilities"], arrays["examples.head"])
    assert np.array_equal(outputs["action"], arrays["examples.head"].argmax(axis=1))
