"""What may stand in the place of any file, and is none of them."""

from typing import Any

import numpy as np

Random = np.random.Generator
#: bytes, or what is no regular file: ("pipe",), ("folder",), ("link", where to), ("size", bytes), ("none",)
Content = bytes | tuple


def pick(random: Random, things: Any) -> Any:
    return things[int(random.integers(len(things)))]


STRANGE = {
    "a pipe": ("pipe",),
    "a folder": ("folder",),
    "a device": ("link", "/dev/zero"),
    "a link to itself": ("link", "LINK"),
    "3 GB": ("size", 3 << 30),
    "nothing there": ("none",),
    "empty": b"",
    "zeros": b"\0" * 5000,
    "a picture": b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 10,
    "an archive": b"PK\x03\x04" + bytes(range(256)) * 10,
    "a program": b"\x7fELF" + bytes(range(256)),
}


def strange(random: Random) -> tuple[Content, str]:
    if random.random() < 0.3:
        return b"\0" + random.bytes(int(random.integers(1, 3000))), "random bytes"
    what = pick(random, sorted(STRANGE))
    return STRANGE[what], what
