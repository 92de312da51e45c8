"""What was computed before the packages were moved under one name comes out the same."""

import json

from tests import reference_outputs

STORED = json.loads(reference_outputs.STORED.read_text())


def largest_difference(outputs):
    return reference_outputs.largest_difference({name: STORED[name] for name in outputs}, outputs)


def test_reduced_models():
    assert largest_difference(reference_outputs.reduced_outputs()) < 1e-10


def test_errors_of_the_law():
    assert largest_difference(reference_outputs.errors()) < 1e-8


def test_finite_elements():
    assert largest_difference(reference_outputs.finite_element_outputs()) < 1e-8
