"""What both kinds of work need of Ray."""

import os
import sys


def report(words):
    print(words, file=sys.stderr, flush=True)


def start(address, workers):
    """Joins the cluster with this address, or that in RAY_ADDRESS. Without one, it joins that of this machine, or starts one of so
    many processors. Returns the number of processors."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    import ray

    quiet = {"log_to_driver": False, "logging_level": "ERROR"}
    address = address or os.environ.get("RAY_ADDRESS") or "auto"
    try:
        if address == "local":
            raise ConnectionError
        ray.init(address=address, **quiet)
    except ConnectionError:
        if address not in ("auto", "local"):
            raise
        ray.init(address="local", num_cpus=workers, include_dashboard=False, **quiet)
    return max(1, int(ray.cluster_resources().get("CPU", 1)))
