"""Counts the layouts of CoinRun's levels without any code of the workspace.

The levels are drawn from the rules of Procgen's generator, and compared with those of the original program in
game/tests/fixtures/coinrun. Layouts are compared as texts: tiles, coin, saws, crates and enemies, without pictures.
With the program `playbot`, its verb `levels` has to count the same. It needs Python alone.

    python3 .ci/coinrun_layouts.py [PLAYBOT]
"""

import json
import random
import subprocess
import sys
from pathlib import Path

LEVELS = Path(__file__).parent.parent / "game/tests/fixtures/coinrun/coinrun_levels.jsonl"
SIZE = 64


def generator(seed):
    """Returns 32-bit outputs of an mt19937 that is seeded with one number, as C++'s is."""
    state = [seed]
    for index in range(1, 624):
        state.append((1812433253 * (state[-1] ^ (state[-1] >> 30)) + index) & 0xFFFFFFFF)
    outputs = random.Random()
    outputs.setstate((3, (*state, 624), None))
    return lambda: outputs.getrandbits(32)


def draw(mode, seed):
    """Returns the level of a mode and a seed, as the fixtures describe it."""
    is_hard = mode == "hard"
    output = generator(seed)

    def below(count):
        return output() % count

    # The offset of the background, the background, and a start that the original draws and does not use.
    output()
    background = below(62)
    output()
    output()
    if is_hard:
        agent, theme = below(5), below(6)
    else:
        background, agent, theme = 0, 0, 0
    rows = [["."] * SIZE for _ in range(SIZE)]
    saws, crates, enemies, crate_sprites, enemy_sprites = [], [], [], [], []

    def column(x, height):
        for y in range(height):
            rows[y][x] = "=" if y == height - 1 else "#"

    def enemy(x, y):
        enemies.append([x, y, 1 if below(2) == 1 else -1])
        enemy_sprites.append(below(9))

    for x in range(SIZE):
        rows[0][x] = "="
    for i in range(SIZE):
        rows[i][0] = rows[i][SIZE - 1] = rows[SIZE - 1][i] = "#"

    difficulty = below(3) + 1
    sections = below(difficulty) + difficulty
    danger = below(3)
    third = difficulty // 3
    x, y = 5, 1
    for _ in range(sections):
        if x + 15 >= SIZE:
            break
        climb = min(below(4) + 1 + third, 5)
        if y >= 20 or (y >= 5 and below(2) == 1):
            climb = -climb
        width = below(2 * difficulty) + 3 + third
        y = max(1, y + climb)
        if width > 7 and y > 3 and below(20) >= difficulty:
            left, right = below(3) + 1, below(3) + 1
            gap = min(width - left - right, 7)
            right = width - left - gap
            for bank in [*range(x, x + left), *range(x + width - right, x + width)]:
                column(bank, y)
            lava = below(y - 3) + 1
            for pit in range(x + left, x + left + gap):
                if danger == 0:
                    for height in range(1, lava + 1):
                        rows[height][pit] = "^" if height == lava else "~"
                elif danger == 1:
                    saws.append([pit, 1])
                else:
                    enemy(pit, 1)
            offset, length = 0, 0
            if gap == 5:
                offset, length = 1 + below(2), 1 + below(2)
            elif gap == 6:
                offset, length = 2 + below(2), 1 + below(2)
            elif gap == 7:
                offset, behind = 2 + below(2), 2 + below(2)
                length = 7 - offset - behind
            for platform in range(length):
                rows[y - 1][x + left + offset + platform] = "="
        else:
            for ground in range(x, x + width):
                column(ground, y)
            taken = []
            if below(10) < 2 * difficulty and width > 3:
                taken.append(x + below(width - 2) + 1)
                saws.append([taken[-1], y])
            if below(10) < difficulty and width > 3 and is_hard:
                taken.append(x + below(width - 2) + 1)
                enemy(taken[-1], y)
            for _ in range(2):
                pile = x + below(width - 2) + 1
                if below(2) == 1 and pile not in taken:
                    for height in range(below(3) + 1):
                        crates.append([pile, y + height])
                        crate_sprites.append(below(4))
        if rows[y][x - 1] not in "#=":
            rows[y][x - 1] = "|"
        x += width
        rows[y][x] = "|"
    column(x, y)
    rows[y][x] = "C"
    for behind in range(x + 1, SIZE):
        for height in range(SIZE):
            rows[height][behind] = "#"
    return {
        "mode": mode, "seed": seed, "coin": [x, y], "background": background, "agent_theme": agent,
        "ground_theme": theme, "saws": saws, "crates": crates, "enemies": enemies, "crate_sprites": crate_sprites,
        "enemy_sprites": enemy_sprites, "rows": ["".join(row) for row in rows],
    }


def layout(mode, seed):
    """Returns all of a level that play meets, as a text."""
    level = draw(mode, seed)
    return json.dumps([level[part] for part in ["coin", "saws", "crates", "enemies", "rows"]])


def check_fixtures():
    for line in LEVELS.read_text().splitlines():
        wanted = json.loads(line)
        drawn = draw(wanted["mode"], wanted["seed"])
        assert drawn == wanted, f"{wanted['mode']}:{wanted['seed']} is another level than that of the original"


def layouts(levels):
    """Returns the layouts of a range such as hard:0..63, by level."""
    mode, ends = levels.split(":")
    first, last = map(int, ends.split(".."))
    return {level: layout(mode, level) for level in range(first, last + 1)}


def count(levels, among):
    """Returns what `playbot levels` counts: layouts, levels among others, and groups of equal levels."""
    found = layouts(levels)
    others = [set(layouts(other).values()) for other in among]
    groups = {}
    for level, text in found.items():
        groups.setdefault(text, []).append(level)
    return {
        "layouts": len(groups),
        "equal": [group for group in groups.values() if len(group) > 1],
        "among": [[level for level, text in found.items() if text in other] for other in others],
    }


CASES = [
    ("hard:0..1087", []),
    ("hard:64..127", ["hard:0..63", "easy:0..499"]),
    ("hard:64..1087", ["hard:0..63", "easy:0..499"]),
    ("hard:38000..39599", ["hard:0..63", "easy:0..499"]),
]


def main():
    check_fixtures()
    for levels, among in CASES:
        counted = count(levels, among)
        known = set().union(*counted["among"])
        most = max(map(len, counted["equal"]), default=1)
        new = {text for level, text in layouts(levels).items() if level not in known}
        print(f"{levels}: {counted['layouts']} layouts, one of them {most} times; {len(known)} levels among {among}, "
              f"the others have {len(new)} layouts")
        if len(sys.argv) < 2:
            continue
        options = [word for other in among for word in ("--among", other)]
        command = [sys.argv[1], "levels", "coinrun", "--levels", levels, "--layouts-only", "--json", *options]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        assert ended.returncode in (0, 1), ended.stderr
        ours = json.loads(ended.stdout)
        assert ours["layouts"] == counted["layouts"], (levels, ours["layouts"], counted["layouts"])
        assert sorted(ours["equal"]) == sorted(counted["equal"]), f"{levels}: other groups"
        assert [other["levels"] for other in ours["among"]] == counted["among"], f"{levels}: others among {among}"
        print("  as the verb counts")


if __name__ == "__main__":
    main()
