"""What to do about a design that the law doubts: warn of it, or refuse it."""

from pneunet.base.errors import InputError
from pneunet.reduced import doubts

WARN, REFUSE = "warn", "refuse"
OUTSIDE = (WARN, REFUSE)


def told_doubts(manipulator, pressure, law, outside, say):
    """The law's doubts (lines of text) about a manipulator at a pressure (MPa) or several, said once;
    InputError where refused."""
    if outside not in OUTSIDE:
        raise InputError(f"outside = '{outside}' is not known: write {' or '.join(OUTSIDE)}")
    found = doubts(manipulator, pressure, law)
    if found and outside == REFUSE:
        raise InputError(
            f"refused, because the law '{law.name}' doubts the design: {'; '.join(found)} (--outside warn"
            " takes it)"
        )
    for text in found:
        say(f"warning: {text}")
    return found
