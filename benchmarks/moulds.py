"""Moulds of random castable bodies: are they closed, can they be pulled, do they leave the body?"""

import numpy as np

from pneunet.base.errors import InputError
from pneunet.geometry.parameters import ONE_SIDED, PASSIVE, TWISTING, Manipulator, Segment

BODIES = 20


def random_body(number):
    """A body of one to three short segments with dimensions of their own: both kinds and passive ones,
    rolled, with one or two pressure groups."""
    rng = np.random.default_rng(number)
    while True:
        width = rng.uniform(10, 16)
        channel = dict(channel_width=rng.uniform(2.0, 3.0), channel_height=rng.uniform(1.6, 2.4))
        core = dict(width=width, roof=rng.uniform(0.8, 2.0), base_thickness=rng.uniform(1.5, 3.0), **channel)
        floors = (channel["channel_height"] / 2, rng.uniform(0.0, 1.0) * channel["channel_height"] / 2, 0.0)
        segments, group, count = [], 1, rng.integers(1, 4)
        for i in range(count):
            kind = rng.choice([ONE_SIDED, TWISTING, PASSIVE], p=[0.5, 0.4, 0.1])
            group += bool(i and segments[-1].chambers and rng.random() < 0.4 and group == 1)
            rolled = dict(roll=int(rng.choice([0, 90, 180, 270], p=[0.55, 0.15, 0.15, 0.15])), group=group)
            try:
                if kind == PASSIVE:
                    s = Segment(PASSIVE, 90.0, 0, plain_length=rng.uniform(6, 15), **core, **rolled)
                else:
                    s = Segment(
                        str(kind),
                        float(rng.choice([90.0, rng.uniform(40, 140)])),
                        int(rng.integers(1, 4)),
                        chamber_height=rng.uniform(4, 7),
                        cavity_thickness=rng.uniform(1.5, 2.5),
                        wall=rng.uniform(0.8, 1.5),
                        gap=rng.uniform(0.8, 2.0),
                        cavity_floor=float(rng.choice(floors)),
                        end_margin=rng.uniform(2.5, 4.0),
                        **core,
                        **rolled,
                    )
                segments.append(s)
            except InputError:
                break
        try:
            if len(segments) == count:
                return Manipulator(tuple(segments))
        except InputError:
            continue


def moulds():
    """Share of moulds that are closed, manifold and free of undercut; largest difference of the bodies that
    they leave from the CAD's, over its volume."""
    from pneunet.geometry.cad.moulds import body_part, mould_parts
    from pneunet.geometry.moulds.parameters import Moulds
    from pneunet.geometry.moulds.part import cast

    fine, count, worst, details = 0, 0, 0.0, []
    for number in range(BODIES):
        body = random_body(number)
        parameters = Moulds(shrinkage=0.0, bed_length=60.0 if number % 4 == 0 else 220.0, port=1.5)
        told = [(s.kind, round(s.angle), s.chambers, s.roll, s.group) for s in body.segments]
        try:
            parts = list(mould_parts(body, parameters))
            whole = body_part(body, parameters, ports=False).manifold()
        except InputError as error:
            details.append(f"{number} {told}: {error}")
            count += 1
            worst = float("inf")
            continue
        for part in parts:
            count += 1
            try:
                part.check()
                fine += 1
            except InputError as error:
                details.append(f"{number} {told}: {error}")
        left = cast(parts)
        off = ((left - whole).volume() + (whole - left).volume()) / whole.volume()
        worst = max(worst, off)
        print(f"  body {number}: {len(parts)} moulds, {told}, off by {off:.1e}", flush=True)
    return {"moulds_watertight": fine / count, "mould_volume_rel": worst}, {
        "moulds": count,
        "failed": details,
    }
