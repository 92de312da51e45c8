"""Physical tags that meshes give to volumes and faces: what CAD writes and finite elements find again."""

#: faces of a body
CAVITY, CHANNEL, BASE, TIP, OUTER = 11, 12, 13, 14, 15
FACE_NAMES = {CAVITY: "cavity", CHANNEL: "channel", BASE: "base", TIP: "tip", OUTER: "outer"}
#: volumes: BODY + segment index, bottom layers LAYER + segment index; of a cell also its air and its gaps
BODY, LAYER = 100, 300
AIR, GAP = 200, 400
