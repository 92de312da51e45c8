"""Physical tags that meshes give to volumes and faces: what CAD writes and finite elements find again."""

import numpy as np

#: faces of a body
CAVITY, CHANNEL, BASE, TIP, OUTER = 11, 12, 13, 14, 15
FACE_NAMES = {CAVITY: "cavity", CHANNEL: "channel", BASE: "base", TIP: "tip", OUTER: "outer"}
#: volumes: BODY + segment index, bottom layers LAYER + segment index; of a cell also its air and its gaps
BODY, LAYER = 100, 300
AIR, GAP = 200, 400


def is_volume(tags: np.ndarray) -> np.ndarray:
    """Whether each tag is a volume's."""
    return np.isin(tags, (AIR, GAP)) | np.isin(tags // 100 * 100, (BODY, LAYER))


def is_face(tags: np.ndarray) -> np.ndarray:
    """Whether each tag is a face's."""
    return np.isin(tags, list(FACE_NAMES))
