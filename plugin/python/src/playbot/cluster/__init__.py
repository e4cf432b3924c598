"""Workers on many machines, by Ray, for `playbot train --cluster` and `playbot test --cluster`.

These verbs start this module themselves, as `python -m playbot.cluster`. `relay` passes the messages of a training on to actors of Ray,
each of which runs the program with the verb `work`; `test` runs a task for each shard of a test. Both replace what is lost.
"""
