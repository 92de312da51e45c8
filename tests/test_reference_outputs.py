"""What was computed before the packages were moved under one name comes out the same."""

import json

from tests import reference_outputs

STORED = json.loads(reference_outputs.STORED.read_text())


#: largest relative difference; figures of held-out designs are small differences of large numbers, which
#: another processor's rounding moves by 5e-9
TOLERANCE = {"free strains": 1e-10, "centrelines": 1e-10, "held-out figures": 1e-7}


def differences(outputs):
    return {
        name: reference_outputs.largest_difference(STORED[name], found) for name, found in outputs.items()
    }


def test_reduced_models():
    found = differences(reference_outputs.reduced_outputs())
    assert all(found[name] < bar for name, bar in TOLERANCE.items()), found


def test_finite_elements():
    found = differences(reference_outputs.finite_element_outputs())
    assert max(found.values()) < 1e-8, found
