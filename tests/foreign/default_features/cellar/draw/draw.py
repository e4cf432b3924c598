"""Writes the rooms of the game, in `assets`: those of `rooms.txt`, and others that it draws by their number."""

import collections, json, pathlib, random, struct, uuid, zlib

WIDTH, HEIGHT, SIDE, ROOMS = 11, 9, 16, 240
THINGS = {"P": "Walker", "k": "Key", "d": "Door", "E": "Exit"}
UIDS = {letter: 10 + number for number, letter in enumerate(THINGS)}
HERE = pathlib.Path(__file__).parent
ASSETS = HERE.parent / "assets"

def steps(rows):
    """Returns the length of the shortest path from the start to the exit, or nothing."""
    cells = {(x, y): letter for y, row in enumerate(rows) for x, letter in enumerate(row)}
    start = next(at for at, letter in cells.items() if letter == "P")
    first = (start, frozenset(), frozenset())
    known, queue = {first: 0}, collections.deque([first])
    while queue:
        state = queue.popleft()
        (x, y), keys, doors = state
        if cells[x, y] == "E":
            return known[state]
        for at in [(x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]:
            letter = cells[at]
            if letter in "#^" or letter == "d" and at not in doors and len(keys) == len(doors):
                continue
            then = (at, keys | {at} if letter == "k" else keys, doors | {at} if letter == "d" else doors)
            if then not in known:
                known[then] = known[state] + 1
                queue.append(then)

def room(number):
    """Draws a room with a path of 10 steps or more."""
    dice = random.Random(number)
    while True:
        inner = [dice.choices(".#^", (7, 3, 1))[0] for _ in range((WIDTH - 2) * (HEIGHT - 2))]
        doors = dice.randrange(3)
        for at, letter in zip(dice.sample(range(len(inner)), 2 + 2 * doors), "PE" + "kd" * doors):
            inner[at] = letter
        lines = ["".join(inner[row * (WIDTH - 2):][:WIDTH - 2]) for row in range(HEIGHT - 2)]
        rows = ["#" * WIDTH, *(f"#{line}#" for line in lines), "#" * WIDTH]
        if (steps(rows) or 0) >= 10:
            return rows

def iid(*parts):
    return str(uuid.uuid5(uuid.NAMESPACE_URL, "/".join(map(str, parts))))

def tile(letter):
    return dict(tilesetUid=1, x=SIDE * list(THINGS).index(letter), y=0, w=SIDE, h=SIDE)

def entity(name, x, y, letter):
    return dict(__identifier=THINGS[letter], __grid=[x, y], __pivot=[0, 0], __tags=[], __tile=tile(letter), __smartColor="#BE4A2F",
                __worldX=None, __worldY=None, iid=iid(name, x, y), width=SIDE, height=SIDE, defUid=UIDS[letter], px=[SIDE * x, SIDE * y],
                fieldInstances=[])

def layer(name, kind, number, uid, csv, entities):
    return dict(__identifier=kind, __type=kind, __cWid=WIDTH, __cHei=HEIGHT, __gridSize=SIDE, __opacity=1, __pxTotalOffsetX=0,
                __pxTotalOffsetY=0, __tilesetDefUid=None, __tilesetRelPath=None, iid=iid(name, kind), levelId=number, layerDefUid=uid,
                pxOffsetX=0, pxOffsetY=0, visible=True, optionalRules=[], intGridCsv=csv, autoLayerTiles=[], seed=number,
                overrideTilesetUid=None, gridTiles=[], entityInstances=entities)

def level(number, name, rows):
    csv = [".#^".find(letter) if letter in "#^" else 0 for row in rows for letter in row]
    entities = [entity(name, x, y, letter) for y, row in enumerate(rows) for x, letter in enumerate(row) if letter in THINGS]
    layers = [layer(name, "Entities", number, 3, [], entities), layer(name, "IntGrid", number, 4, csv, [])]
    return dict(identifier=name, iid=iid(name), uid=100 + number, worldX=number * WIDTH * SIDE, worldY=0, worldDepth=0, pxWid=WIDTH * SIDE,
                pxHei=HEIGHT * SIDE, __bgColor="#262B44", bgColor=None, useAutoIdentifier=False, bgRelPath=None, bgPos=None, bgPivotX=0.5,
                bgPivotY=0.5, __smartColor="#ADADB5", __bgPos=None, externalRelPath=None, fieldInstances=[], layerInstances=layers,
                __neighbours=[])

def project(levels):
    kinds = [("wall", "#8B9BB4"), ("pit", "#A22633")]
    values = [dict(value=at + 1, identifier=name, color=colour, tile=None, groupUid=0) for at, (name, colour) in enumerate(kinds)]
    entity_defs = [dict(
        identifier=name, uid=UIDS[letter], tags=[], exportToToc=False, allowOutOfBounds=False, doc=None, width=SIDE, height=SIDE,
        resizableX=False, resizableY=False, minWidth=None, maxWidth=None, minHeight=None, maxHeight=None, keepAspectRatio=False,
        tileOpacity=1, fillOpacity=1, lineOpacity=1, hollow=False, color="#BE4A2F", renderMode="Tile", showName=True, tilesetId=1,
        tileRenderMode="FitInside", tileRect=tile(letter), uiTileRect=None, nineSliceBorders=[], maxCount=0, limitScope="PerLevel",
        limitBehavior="MoveLastOne", pivotX=0, pivotY=0, fieldDefs=[]) for letter, name in THINGS.items()]
    layer_defs = [dict(
        __type=kind, identifier=kind, type=kind, uid=uid, doc=None, uiColor=None, gridSize=SIDE, guideGridWid=0, guideGridHei=0,
        displayOpacity=1, inactiveOpacity=1, hideInList=False, hideFieldsWhenInactive=False, canSelectWhenInactive=True,
        renderInWorldView=True, pxOffsetX=0, pxOffsetY=0, parallaxFactorX=0, parallaxFactorY=0, parallaxScaling=True, requiredTags=[],
        excludedTags=[], autoTilesKilledByOtherLayerUid=None, uiFilterTags=[], useAsyncRender=False, intGridValues=grid,
        intGridValuesGroups=[], autoRuleGroups=[], autoSourceLayerDefUid=None, tilesetDefUid=None, tilePivotX=0, tilePivotY=0,
        biomeFieldUid=None) for kind, uid, grid in [("Entities", 3, []), ("IntGrid", 4, values)]]
    tiles = dict(__cWid=len(THINGS), __cHei=1, identifier="Things", uid=1, relPath="things.png", embedAtlas=None, pxWid=SIDE * len(THINGS),
                 pxHei=SIDE, tileGridSize=SIDE, spacing=0, padding=0, tags=[], tagsSourceEnumUid=None, enumTags=[], customData=[],
                 savedSelections=[], cachedPixelData=None)
    definitions = dict(layers=layer_defs, entities=entity_defs, tilesets=[tiles], enums=[], externalEnums=[], levelFields=[])
    return dict(iid=iid("cellar"), jsonVersion="1.5.3", appBuildId=473703, nextUid=1000, identifierStyle="Capitalize", toc=[],
                worldLayout="LinearHorizontal", worldGridWidth=256, worldGridHeight=256, defaultLevelWidth=WIDTH * SIDE,
                defaultLevelHeight=HEIGHT * SIDE, defaultPivotX=0, defaultPivotY=0, defaultGridSize=SIDE, defaultEntityWidth=SIDE,
                defaultEntityHeight=SIDE, bgColor="#262B44", defaultLevelBgColor="#262B44", minifyJson=True, externalLevels=False,
                exportTiled=False, simplifiedExport=False, imageExportMode="None", exportLevelBg=True, pngFilePattern=None, backupOnSave=False,
                backupLimit=10, backupRelPath=None, levelNamePattern="Room_%idx", tutorialDesc=None, customCommands=[], flags=[],
                defs=definitions, levels=levels, worlds=[], dummyWorldIid=iid("world"))

def picture():
    """Draws a walker, a key, a door and an exit."""
    colour = {"P": (0, 149, 233), "k": (254, 231, 97), "d": (184, 111, 80), "E": (99, 199, 77)}
    shape = {"P": lambda x, y: (x - 7.5) ** 2 + (y - 7.5) ** 2 < 40,
             "k": lambda x, y: (x - 4) ** 2 + (y - 8) ** 2 < 10 or (x > 4 and y == 8) or (x in (11, 13) and 8 < y < 11),
             "d": lambda x, y: x % 5 != 4, "E": lambda x, y: y >= 15 - x}
    lines = (b"\0" + b"".join(bytes((*colour[t], 255 * shape[t](x, y))) for t in THINGS for x in range(SIDE)) for y in range(SIDE))
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", SIDE * len(THINGS), SIDE, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"".join(lines))) + chunk(b"IEND", b"")

drawn = [text.splitlines() for text in (HERE / "rooms.txt").read_text().strip().split("\n\n")]
rooms = [(name, rows) for name, *rows in drawn] + [(f"Room_{number}", room(number)) for number in range(len(drawn), ROOMS)]
for name, rows in rooms:
    assert steps(rows) and len(rows) == HEIGHT and all(len(row) == WIDTH for row in rows), name
levels = [level(number, name, rows) for number, (name, rows) in enumerate(rooms)]
(ASSETS / "cellar.ldtk").write_text(json.dumps(project(levels), separators=(",", ":")) + "\n")
(ASSETS / "things.png").write_bytes(picture())
