"""`python -m playbot.cluster relay|test`, which the program calls."""

import argparse
import sys


def parser():
    both = argparse.ArgumentParser(add_help=False)
    both.add_argument("--program", required=True, help="the program with the game, on the machines of the workers")
    both.add_argument("--address", help="the cluster, such as ray://head:10001; if none is named, that of this machine or a new one")
    both.add_argument("--workers", type=int, help="number of workers; as many as there are processors")
    main = argparse.ArgumentParser(prog="python -m playbot.cluster", description=__doc__)
    verbs = main.add_subparsers(dest="verb", required=True)
    verbs.add_parser("relay", parents=[both], help="pass the messages of a training on to workers")
    test = verbs.add_parser("test", parents=[both], help="test the shards of a test")
    test.add_argument("--shards", type=int, required=True, help="number of shards")
    test.add_argument("--out", required=True, help="folder of the shards, which all machines have under the same path")
    test.add_argument("--retries", type=int, default=10, help="times that a shard is tried again (%(default)s)")
    test.add_argument("words", nargs="+", metavar="-- ...", help="the words of the test, from its verb on")
    return main


def main():
    args = parser().parse_args()
    try:
        import ray  # noqa: F401, so that what is missing is said in words
    except ImportError as error:
        print(f"Ray is not there ({error}): install it with `pip install 'playbot[ray]'`", file=sys.stderr)
        return 3
    if args.verb == "relay":
        from playbot.cluster.relay import relay

        return relay(args)
    from playbot.cluster.shards import test_shards

    return test_shards(args)


if __name__ == "__main__":
    sys.exit(main())
