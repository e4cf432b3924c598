"""Rules of Kubernetes for the documents in kubernetes.yaml.

Kubernetes itself is not needed. Names, types and rules are those of its API reference, for v1 ConfigMap, v1
PersistentVolumeClaim and batch/v1 Job, as far as the documents use them: another field is a mistake until it is added.
"""

import re

# A `!` marks fields that must be there, a tuple has all allowed values, and a list has the form of its items.
NAME = re.compile(r"[a-z0-9]([-a-z0-9]{0,61}[a-z0-9])?")
QUANTITY = re.compile(r"[1-9]\d*(m|[kMGT]|[KMGT]i)?")
PATH = re.compile(r"/[^:]*")
TEXTS = "names with texts"
META = {"name!": NAME}
CONTAINER = {
    "name!": NAME,
    "image!": str,
    "command": [str],
    "args": [str],
    "envFrom": [{"configMapRef!": {"name!": NAME}}],
    "resources": {"requests": {"cpu": QUANTITY, "memory": QUANTITY}, "limits": {"cpu": QUANTITY, "memory": QUANTITY}},
    "volumeMounts": [{"name!": NAME, "mountPath!": PATH}],
}
POD = {
    # A Job has no pods that are always restarted.
    "restartPolicy!": ("Never", "OnFailure"),
    "terminationGracePeriodSeconds": int,
    "initContainers": [CONTAINER],
    "containers!": [CONTAINER],
    "volumes": [{"name!": NAME, "persistentVolumeClaim!": {"claimName!": NAME}}],
}
RULE = {
    "action!": ("Ignore", "FailJob", "FailIndex", "Count"),
    "onExitCodes": {"containerName": NAME, "operator!": ("In", "NotIn"), "values!": [int]},
    "onPodConditions": [{"type!": str, "status!": ("True", "False", "Unknown")}],
}
JOB = {
    "completionMode": ("Indexed", "NonIndexed"),
    "completions": int,
    "parallelism": int,
    "backoffLimit": int,
    "backoffLimitPerIndex": int,
    "activeDeadlineSeconds": int,
    "podReplacementPolicy": ("Failed", "TerminatingOrFailed"),
    "podFailurePolicy": {"rules!": [RULE]},
    "template!": {"spec!": POD},
}
CLAIM = {
    "accessModes!": [("ReadWriteOnce", "ReadOnlyMany", "ReadWriteMany", "ReadWriteOncePod")],
    "resources!": {"requests!": {"storage!": QUANTITY}},
}
KINDS = {
    "ConfigMap": {"apiVersion!": ("v1",), "kind!": str, "metadata!": META, "data!": TEXTS},
    "PersistentVolumeClaim": {"apiVersion!": ("v1",), "kind!": str, "metadata!": META, "spec!": CLAIM},
    "Job": {"apiVersion!": ("batch/v1",), "kind!": str, "metadata!": META, "spec!": JOB},
}


def of_fields(value, wanted, at):
    """Returns mistakes in names and types."""
    if isinstance(wanted, dict):
        if not isinstance(value, dict):
            return [f"{at} has no fields"]
        fields = {name.rstrip("!"): field for name, field in wanted.items()}
        missing = [name[:-1] for name in wanted if name.endswith("!") and name[:-1] not in value]
        wrong = [f"{at} has no {name}" for name in missing]
        wrong += [f"{at}.{name} is not known" for name in value if name not in fields]
        known = [name for name in value if name in fields]
        return wrong + [words for name in known for words in of_fields(value[name], fields[name], f"{at}.{name}")]
    if isinstance(wanted, list):
        if not isinstance(value, list) or not value:
            return [f"{at} is no list, or an empty one"]
        return [words for index, item in enumerate(value) for words in of_fields(item, wanted[0], f"{at}[{index}]")]
    if isinstance(wanted, tuple):
        fits = value in wanted
    elif isinstance(wanted, re.Pattern):
        fits = isinstance(value, str) and wanted.fullmatch(value)
    elif wanted is TEXTS:
        fits = isinstance(value, dict) and all(isinstance(text, str) for text in [*value, *value.values()])
    else:
        # YAML's `true` is a number to Python; the least number of all fields here is 0.
        fits = type(value) is wanted and (wanted is not int or value >= 0)
    return [] if fits else [f"{at} is {value!r}"]


def of_rules(spec, names, at):
    """Returns mistakes in the handling of failed pods."""
    policy = spec.get("podFailurePolicy")
    wrong = []
    never = spec["template"]["spec"]["restartPolicy"] == "Never"
    if policy and not (never and spec.get("podReplacementPolicy", "Failed") == "Failed"):
        wrong.append(f"{at} needs restartPolicy Never and podReplacementPolicy Failed for its podFailurePolicy")
    for rule in policy["rules"] if policy else []:
        codes = rule.get("onExitCodes")
        if (codes is None) == ("onPodConditions" not in rule):
            wrong.append(f"{at} has a rule that needs either onExitCodes or onPodConditions")
        if rule["action"] == "FailIndex" and "backoffLimitPerIndex" not in spec:
            wrong.append(f"{at} has FailIndex without backoffLimitPerIndex")
        if codes and codes.get("containerName", names[0]) not in names:
            wrong.append(f"{at} has a rule for a container that is not there")
        values = codes["values"] if codes else []
        if values != sorted(set(values)) or any(code > 255 for code in values):
            wrong.append(f"{at} has exit codes that are not in order, or twice, or too large")
        if codes and codes["operator"] == "In" and 0 in values:
            wrong.append(f"{at} takes the exit code 0 for a failure")
    return wrong


def of_job(spec, settings, claims, at):
    """Returns mismatches within a Job, or with the documents beside it."""
    pod = spec["template"]["spec"]
    containers = pod.get("initContainers", []) + pod["containers"]
    names = [container["name"] for container in containers]
    wrong = [f"{at} has two containers of one name"] if len(set(names)) < len(names) else []
    is_indexed = spec.get("completionMode") == "Indexed"
    if is_indexed and not ("completions" in spec and "parallelism" in spec):
        wrong.append(f"{at} is Indexed, and needs completions and parallelism")
    if "backoffLimitPerIndex" in spec and not (is_indexed and pod["restartPolicy"] == "Never"):
        wrong.append(f"{at} needs Indexed and restartPolicy Never for its backoffLimitPerIndex")
    wrong += of_rules(spec, names, at)
    volumes = {volume["name"]: volume["persistentVolumeClaim"]["claimName"] for volume in pod.get("volumes", [])}
    wrong += [f"{at}: there is no claim {claim}" for claim in volumes.values() if claim not in claims]
    for container in containers:
        mounts = [mount["name"] for mount in container.get("volumeMounts", [])]
        wrong += [f"{at}: there is no volume {name}" for name in mounts if name not in volumes]
        known = {"JOB_COMPLETION_INDEX"} if is_indexed else set()
        for source in container.get("envFrom", []):
            name = source["configMapRef"]["name"]
            known |= set(settings.get(name, {}))
            wrong += [] if name in settings else [f"{at}: there is no ConfigMap {name}"]
        script = "\n".join(container.get("command", []) + container.get("args", []))
        used = re.findall(r"\$\{?([A-Z][A-Z0-9_]*)", script)
        wrong += [f"{at}: nothing sets ${name}" for name in used if name not in known]
        # Kubernetes reads `$$` as `$`, and `$(NAME)` before the shell does.
        if re.search(r"\$\$|\$\([A-Za-z_]\w*\)", script):
            wrong.append(f"{at}: Kubernetes changes the script before a shell reads it")
    return wrong


def mistakes(documents):
    """Returns descriptions of all parts that Kubernetes would refuse or misread."""
    wrong = []
    for document in documents:
        kind = document.get("kind")
        wrong += of_fields(document, KINDS[kind], kind) if kind in KINDS else [f"{kind} is no kind that is known"]
    if wrong:
        return wrong
    of_kind = {kind: [document for document in documents if document["kind"] == kind] for kind in KINDS}
    settings = {one["metadata"]["name"]: one["data"] for one in of_kind["ConfigMap"]}
    claims = {one["metadata"]["name"] for one in of_kind["PersistentVolumeClaim"]}
    # Pods on several machines write to it.
    modes = [one["spec"]["accessModes"] for one in of_kind["PersistentVolumeClaim"]]
    wrong += ["a claim is not ReadWriteMany" for mode in modes if "ReadWriteMany" not in mode]
    for job in of_kind["Job"]:
        wrong += of_job(job["spec"], settings, claims, job["metadata"]["name"])
    return wrong
