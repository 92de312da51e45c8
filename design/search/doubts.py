"""What to do about a design that the law doubts: warn of it, or refuse it."""

import logging
from collections.abc import Sequence

from pneunet.base.errors import InputError
from pneunet.reduced.rod.laws import SegmentLaw

WARN, REFUSE = "warn", "refuse"
WAYS = (WARN, REFUSE)
log = logging.getLogger(__name__)


def tell_doubts(doubts: Sequence[str], law: SegmentLaw, outside: str) -> None:
    """Say a law's doubts (reduced.rod.prediction.doubts) about a manipulator; InputError where they are
    refused."""
    if outside not in WAYS:
        raise InputError(f"outside = '{outside}' is not known: write {' or '.join(WAYS)}")
    if doubts and outside == REFUSE:
        raise InputError(
            f"refused, because the law '{law.name}' doubts the design: {'; '.join(doubts)} (--outside warn"
            " takes it)"
        )
    for text in doubts:
        log.warning(f"warning: {text}")
