"""Physical tags that meshes give to volumes and faces: what CAD writes and finite elements find again."""

#: faces of a body; of further pressure groups see `cavity_tags`
CAVITY, CHANNEL, BASE, TIP, OUTER = 11, 12, 13, 14, 15
FACE_NAMES = {CAVITY: "cavity", CHANNEL: "channel", BASE: "base", TIP: "tip", OUTER: "outer"}
_OF_A_GROUP, MOST_GROUPS = 10, 9
#: volumes: BODY + segment index, bottom layers LAYER + segment index; of a cell also its air and its gaps
BODY, LAYER = 100, 300
AIR, GAP = 200, 400
#: of a body, so that the tags of volumes keep apart
MOST_SEGMENTS = AIR - BODY


def cavity_tags(group: int) -> tuple[int, int]:
    """(chambers' walls, channel's wall) of a pressure group's cavity; groups count from 1."""
    return CAVITY + _OF_A_GROUP * (group - 1), CHANNEL + _OF_A_GROUP * (group - 1)


#: largest tag of a face
LAST_FACE = cavity_tags(MOST_GROUPS)[1]


def face_names(groups: int) -> dict[int, str]:
    """tag -> name of the faces of a body with so many pressure groups."""
    names = FACE_NAMES.copy()
    for group in range(2, groups + 1):
        names |= {tag: f"{name}_{group}" for tag, name in zip(cavity_tags(group), ("cavity", "channel"))}
    return names
