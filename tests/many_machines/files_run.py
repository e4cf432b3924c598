"""Test of docs/how-to/many-machines: the workflow, the Jobs and the array join to the results of one process.

Called by run.sh with the program `playbot`. GitHub, Kubernetes and Slurm are not needed: their commands are started
with the variables that they would set. `gh` and `sbatch` are scripts in place of the real ones.
"""

import copy
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import yaml
from kubernetes_fields import mistakes

FILES = pathlib.Path(__file__).parents[2] / "docs/how-to/many-machines"
GAME, LEVELS, TESTERS = "coinrun", "hard:0..39", "--bot right-jump,random --episodes 2"
FINDINGS = 1
# Seconds after which a command has failed.
LONGEST = 120
REPORTS = ["results.json", "report.html", "junit.xml", "summary.md"]


def check(what, is_so):
    if not is_so:
        sys.exit(f"FAILED: {what}")
    print(f"ok: {what}")


def run(command, folder, variables):
    environment = {**os.environ, **{name: str(value) for name, value in variables.items()}}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=False, timeout=LONGEST)


def program(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    path.chmod(0o755)


def check_same(what, folder, whole):
    check(f"{what}: {', '.join(REPORTS)} are those of one process", all(
        (folder / name).read_bytes() == (whole / name).read_bytes() for name in REPORTS
    ))


def github(folder, playbot, whole):
    text = (FILES / "github-actions.yml").read_text()
    workflow = yaml.safe_load(text)
    jobs = workflow["jobs"]
    check("the workflow has the jobs build, shard and merge", list(jobs) == ["build", "shard", "merge"])
    # `on` is a truth value in the YAML of Python.
    check("it runs on pushes and pull requests", set(workflow[True]) == {"push", "pull_request"})
    check("it waits for what it needs", (jobs["shard"]["needs"], jobs["merge"]["needs"]) == ("build", "shard"))
    variables = {**workflow["env"], "GAME": GAME, "LEVELS": LEVELS, "TEST": TESTERS}
    shards = jobs["shard"]["strategy"]["matrix"]["shard"]
    steps = {step["name"]: step for job in jobs.values() for step in job["steps"] if "name" in step}

    def step(name, at, more):
        words = {}
        for key, value in steps[name].get("env", {}).items():
            expression = re.fullmatch(r"\$\{\{ (.*) \}\}", value)
            words[key] = more[expression[1]] if expression else value
        # The shell of a script on GitHub.
        return run(["bash", "-e", "-c", steps[name]["run"]], at, {**variables, **more.get("env", {}), **words})

    (folder / "bin").mkdir(parents=True)
    shutil.copy(playbot, folder / "bin" / variables["PROGRAM"])
    for index in shards:
        more = {"strategy.job-index": index, "strategy.job-total": len(shards)}
        done = step("Test a shard", folder, more)
        check(f"the step of shard {index} passes, though it has findings", done.returncode == 0)
    wrong = step("Test a shard", folder, {"strategy.job-index": 9, "strategy.job-total": 4})
    check("a shard that cannot be tested turns red", wrong.returncode == 1 and b"9/4" in wrong.stderr)

    joined = step("Join the shards", folder, {})
    check("without earlier results the merge turns red on findings", joined.returncode == FINDINGS)
    check_same("GitHub Actions", folder / "levels", whole)
    summary = folder / "step-summary"
    done = step("Summary", folder, {"env": {"GITHUB_STEP_SUMMARY": summary}})
    check("the summary of the run is summary.md", summary.read_bytes() == (whole / "summary.md").read_bytes())
    check("and the step passes", done.returncode == 0)

    # `gh` has two runs of main: the last one without an artifact, the one before with one.
    gh = """#!/bin/sh
    case "$1 $2" in
        "run list") printf '12\\n11\\n' ;;
        "run download") [ "$3" = 11 ] && [ "$4 $5 $6 $7" = "--name levels --dir before" ] && cp -r "$RESULTS" before ;;
    esac
    """
    program(folder / "tools/gh", gh)
    tools = {"PATH": f"{folder / 'tools'}:{os.environ['PATH']}", "RESULTS": whole, "GITHUB_WORKFLOW": "Levels"}
    fetched = step("Fetch the results of main", folder, {"github.token": "-", "github.base_ref": "main", "env": tools})
    check("earlier results are fetched", fetched.returncode == 0 and (folder / "before/results.json").exists())
    joined = step("Join the shards", folder, {})
    check("a pull request that changes nothing passes, whatever was found before", joined.returncode == 0)
    check("and says that it was compared", b"nothing has changed" in joined.stderr)
    before = folder / "before/results.json"
    before.write_text(re.sub(r'"game_version":\d+', '"game_version":0', before.read_text()))
    joined = step("Join the shards", folder, {})
    check("results of another version are not compared", joined.returncode == FINDINGS)
    used = set(re.findall(r"uses: (\S+)@", text))
    expected = {"actions/checkout", "actions/upload-artifact", "actions/download-artifact", "Swatinem/rust-cache"}
    check("it uses known actions", used == expected)


def fields(documents):
    found = mistakes(documents)
    check("Kubernetes knows all fields, and they fit one another" + "".join(f"; {words}" for words in found), not found)
    planted = {
        "is not known": lambda _, shards: shards["spec"].update(completionsMode="Indexed"),
        "has no restartPolicy": lambda _, shards: shards["spec"]["template"]["spec"].pop("restartPolicy"),
        "completions is '16'": lambda _, shards: shards["spec"].update(completions="16"),
        "restartPolicy Never for its backoffLimitPerIndex": lambda _, shards: shards["spec"].pop("completionMode"),
        "podReplacementPolicy Failed": lambda _, shards: shards["spec"].update(podReplacementPolicy="TerminatingOrFailed"),
        "container that is not there": lambda _, shards: shards["spec"]["template"]["spec"]["containers"][0].update(name="a"),
        "there is no volume": lambda _, shards: shards["spec"]["template"]["spec"].pop("volumes"),
        "nothing sets $LEVELS": lambda settings, _: settings["data"].pop("LEVELS"),
        "ConfigMap.data is": lambda settings, _: settings["data"].update(SHARDS=16),
    }
    for words, plant in planted.items():
        broken = copy.deepcopy(documents)
        plant(broken[0], broken[2])
        check(f"a mistake there is reported: {words}", any(words in reported for reported in mistakes(broken)))


def kubernetes(folder, playbot, whole):
    documents = list(yaml.safe_load_all((FILES / "kubernetes.yaml").read_text()))
    fields(documents)
    settings, claim, shards, merge = documents
    kinds = [document["kind"] for document in documents]
    check("there are settings, a volume and two Jobs", kinds == ["ConfigMap", "PersistentVolumeClaim", "Job", "Job"])
    spec = shards["spec"]
    check("a pod for each shard", str(spec["completions"]) == settings["data"]["SHARDS"])
    check("by its index", spec["completionMode"] == "Indexed")
    pods = [job["spec"]["template"]["spec"] for job in (shards, merge)]
    names = {pod["volumes"][0]["persistentVolumeClaim"]["claimName"] for pod in pods}
    check("all on the volume", names == {claim["metadata"]["name"]})
    containers = [container for pod in pods for container in pod["containers"] + pod.get("initContainers", [])]
    sources = {container["envFrom"][0]["configMapRef"]["name"] for container in containers}
    check("all with the settings", sources == {settings["metadata"]["name"]})
    check("restarted by the Job", {pod["restartPolicy"] for pod in pods} == {"Never"})
    disruption = [{"type": "DisruptionTarget", "status": "True"}]
    for job in (shards, merge):
        [evicted] = [rule for rule in job["spec"]["podFailurePolicy"]["rules"] if "onPodConditions" in rule]
        is_ignored = evicted == {"action": "Ignore", "onPodConditions": disruption}
        check("an eviction does not count", is_ignored and job["spec"]["podReplacementPolicy"] == "Failed")
    [failures] = [rule["onExitCodes"] for rule in spec["podFailurePolicy"]["rules"] if "onExitCodes" in rule]
    check("rules are about its container", failures["containerName"] == pods[0]["containers"][0]["name"])

    program(folder / "bin/playbot", f'#!/bin/sh\nexec "{playbot}" "$@"\n')
    count = 3
    variables = {**settings["data"], "GAME": GAME, "LEVELS": LEVELS, "TEST": TESTERS, "SHARDS": count}
    variables["PATH"] = f"{folder / 'bin'}:{os.environ['PATH']}"
    results = folder / "results"

    def command(container):
        words = container["command"] + container["args"]
        # The folder of the volume, not one of the same name within it.
        return [word.replace("/results/$RUN", f"{results}/$RUN") for word in words]

    [test] = pods[0]["containers"]
    for index in range(count):
        own = {**variables, "JOB_COMPLETION_INDEX": index}
        if index == 1:
            # Its node is emptied: the pod gets a TERM while levels are played, and another pod goes on.
            stopped = subprocess.Popen(
                command(test), env={**os.environ, **{key: str(value) for key, value in own.items()}},
                stderr=subprocess.DEVNULL,
            )
            journal = results / variables["RUN"] / "shards/1/levels.jsonl"
            while not journal.exists() or not journal.read_bytes():
                time.sleep(0.005)
            stopped.send_signal(signal.SIGTERM)
            code = stopped.wait()
            check("a pod that is asked to end ends with 143, its levels written", code == 143 and journal.read_bytes())
        done = run(command(test), folder, own)
        check(f"the pod of shard {index} succeeds, though it has findings", done.returncode == 0)
    wrong = run(command(test), folder, {**variables, "JOB_COMPLETION_INDEX": 0, "GAME": "none"})
    check("wrong usage ends with the code that fails the Job", [wrong.returncode] == failures["values"])
    [wait], [join] = pods[1]["initContainers"], pods[1]["containers"]
    check("the merge waits for all shards", run(command(wait), folder, variables).returncode == 0)
    joined = run(command(join), folder, variables)
    check("the merge fails on findings", joined.returncode == FINDINGS)
    check_same("Kubernetes", results / variables["RUN"], whole)


def slurm(folder, playbot, whole):
    script = FILES / "slurm.sh"
    check("the script is one", run(["bash", "-n", str(script)], None, {}).returncode == 0)
    # Runs the job at once, and keeps the exit codes.
    sbatch = """#!/usr/bin/env bash
    echo "$*" >>calls
    for option; do case "$option" in --array=*) last=${option##*-} ;; --dependency=*) dependency=$option ;; esac; done
    code=0
    if [ -n "${last:-}" ]; then
        for ((task = 0; task <= last; task++)); do
            SLURM_JOB_ID=$((100 + task)) SLURM_ARRAY_TASK_ID=$task SLURM_CPUS_PER_TASK=2 bash "${!#}" >&2 || code=$?
        done
        echo "$code" >shards.code
        echo 100
    else
        [ "$dependency" = --dependency=afterok:100 ] && SLURM_JOB_ID=200 bash "${!#}" >&2 || code=$?
        echo "$code" >merge.code
        echo "200;cluster"
    fi
    """
    program(folder / "bin/sbatch", sbatch)
    variables = {"PLAYBOT": playbot, "GAME": GAME, "LEVELS": LEVELS, "TEST": TESTERS, "SHARDS": 3, "OUT": "runs/out"}
    variables["PATH"] = f"{folder / 'bin'}:{os.environ['PATH']}"
    done = run(["bash", str(script)], folder, variables)
    check("both jobs are handed in", b"job 100, joined in runs/out by job 200\n" in done.stdout)
    check("the shards succeed, though they have findings", (folder / "shards.code").read_text() == "0\n")
    check("the merge fails on findings", (folder / "merge.code").read_text() == f"{FINDINGS}\n")
    check_same("Slurm", folder / "runs/out", whole)
    variables["AGAINST"] = whole
    run(["bash", str(script)], folder, variables)
    check("against the same results it passes", (folder / "merge.code").read_text() == "0\n")
    variables["GAME"] = "none"
    run(["bash", str(script)], folder, variables)
    check("a shard that cannot be tested fails", (folder / "shards.code").read_text() == "3\n")


def slurm_train(folder, playbot, _whole):
    """Two nodes of Ray on this machine, which stand-ins of Slurm's commands start."""
    script = FILES / "slurm-train.sh"
    check("the script is one", run(["bash", "-n", str(script)], None, {}).returncode == 0)
    program(folder / "bin/srun", """#!/usr/bin/env bash
    while [[ "$1" == --* ]]; do shift; done
    if [ "$1" = hostname ]; then echo 127.0.0.1; else exec "$@"; fi
    """)
    program(folder / "bin/scontrol", "#!/bin/sh\nprintf 'node0\\nnode1\\n'\n")
    sources = pathlib.Path(__file__).parents[2] / "plugin/python/src"
    settings = "--algorithm ppo --set arenas=8 --set worlds=2 --set ppo.num_steps=32 --steps"
    variables = {"PLAYBOT": playbot, "PLAYBOT_PYTHON": sys.executable, "PYTHONPATH": sources, "GAME": GAME, "RUN": "run", "PORT": "6380"}
    variables |= {"SLURM_JOB_NODELIST": "node[0-1]", "SLURM_CPUS_PER_TASK": 1, "TRAIN": f"{settings} 2048"}
    variables["PATH"] = f"{folder / 'bin'}:{os.environ['PATH']}"
    # Ray's sockets lie there, whose paths must be short; in its usual folder others would look for this cluster.
    variables["RAY_TMPDIR"] = tempfile.mkdtemp(prefix="pb-")
    done = run(["bash", str(script)], folder, variables)
    check("two nodes train", done.returncode == 0 and b"of 2 workers" in done.stderr)
    again = run(["bash", str(script)], folder, variables)
    check("a job that is queued again sees that all is done", again.returncode == 0 and b"is finished" in again.stderr)
    alone = run([playbot, "train", GAME, *settings.split(), "2048", "--run", "alone"], folder, {})
    same = (folder / "run/metrics.jsonl").read_bytes() == (folder / "alone/metrics.jsonl").read_bytes()
    check("Slurm: the training is that of one process", alone.returncode == 0 and same)
    shutil.rmtree(variables["RAY_TMPDIR"], ignore_errors=True)


def kuberay(folder, playbot, _whole):
    claim, job = yaml.safe_load_all((FILES / "kuberay.yaml").read_text())
    cluster = job["spec"]["rayClusterSpec"]
    groups = [cluster["headGroupSpec"], *cluster["workerGroupSpecs"]]
    check("all pods have one image", len({group["template"]["spec"]["containers"][0]["image"] for group in groups}) == 1)
    [volume] = groups[0]["template"]["spec"]["volumes"]
    check("the run lies on the volume", volume["persistentVolumeClaim"]["claimName"] == claim["metadata"]["name"])
    limits = [group["template"]["spec"]["containers"][0]["resources"]["limits"]["cpu"] for group in groups[1:]]
    processors = sum(int(cpu) * group["replicas"] for cpu, group in zip(limits, groups[1:]))
    check("as many workers as processors", job["spec"]["entrypoint"].count(f"--workers {processors}") == 2)
    # Only the place and the sizes differ here.
    entry = job["spec"]["entrypoint"].replace("/runs/", f"{folder}/").replace("--cluster ray", "--cluster processes")
    entry = entry.replace(f"--workers {processors}", "--workers 2").replace("arenas=512", "arenas=8 --set worlds=2 --steps 2048")
    program(folder / "bin/playbot", f'#!/bin/sh\nexec "{playbot}" "$@"\n')
    variables = {"PATH": f"{folder / 'bin'}:{os.environ['PATH']}"}
    for what, words in [("begins", b"of 2 workers"), ("goes on", b"is finished")]:
        done = run(["sh", "-c", entry], folder, variables)
        check(f"KubeRay: the training {what}", done.returncode == 0 and words in done.stderr)


def main():
    playbot = str(pathlib.Path(sys.argv[1]).resolve())
    folder = pathlib.Path(tempfile.mkdtemp(prefix="playbot-many-machines-"))
    whole = folder / "whole"
    one = [playbot, "test", GAME, "--levels", LEVELS, *TESTERS.split(), "--out", str(whole)]
    check("one process has findings", run(one, folder, {}).returncode == FINDINGS)
    for of_one in (github, kubernetes, slurm, slurm_train, kuberay):
        own = folder / of_one.__name__
        own.mkdir()
        of_one(own, playbot, whole)
    shutil.rmtree(folder)


if __name__ == "__main__":
    main()
