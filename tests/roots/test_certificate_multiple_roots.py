"""Certificates next to roots of high multiplicity, written and verified by Taylor polynomials."""

import dataclasses

import pytest
from ball_certificate import ball_count
from deadtime import CertificateError, ContourError, delay, s


def real_root(m):
    return (s + 1) ** m * (s + 2.0 * delay(0.5))


def pair_of_roots(m):
    return (s**2 + 1) ** m * (s + 3 + delay(0.5))


@pytest.mark.parametrize(
    ("m", "distance"),
    [
        (3, 1e-3),
        pytest.param(3, 1e-9, marks=pytest.mark.survey),
        *(
            pytest.param(*one, marks=[pytest.mark.survey, pytest.mark.long])
            for one in [(3, 1e-6), (4, 1e-4), (6, 1e-2), (6, 1e-4)]
        ),
    ],
)
def test_edges_beside_multiple_roots(m, distance):
    # The bound on g'' alone asks for segments as short as distance^(m/2): their search ran out.
    for h, left in ((real_root(m), -1), (pair_of_roots(m), 0)):
        inside, outside = (
            h.certify(re=(left + off, 1), im=(-3, 3)) for off in (-distance, distance)
        )
        for proof in (inside, outside):
            assert proof.verify() == proof.count == ball_count(proof)
            assert sum(len(contour.segments) for contour in proof.contours) < 1000
        assert inside.count - outside.count == (m if left else 2 * m)


@pytest.mark.parametrize(("m", "distance"), [(3, 1e-6), (3, 1e-9), (4, 1e-4), (6, 1e-2)])
def test_the_real_axis_beside_a_multiple_root(m, distance):
    proof = real_root(m).certify(re=(-1 + distance, 1), im=(0, 3))
    assert proof.verify() == proof.count == 1


@pytest.mark.parametrize(("m", "distance"), [(4, 1e-8), (6, 1e-6), (9, 1e-5)])
def test_an_edge_too_close_for_double_double_is_refused_with_the_place(m, distance):
    with pytest.raises(ContourError, match=r"a root lies on the contour near -0\.99"):
        real_root(m).certify(re=(-1 + distance, 1), im=(-3, 3))


def test_false_claims_beside_a_multiple_root_fail():
    proof = real_root(3).certify(re=(-1 + 1e-6, 1), im=(-3, 3))
    (path,) = proof.contours
    # The path ends on the real axis, beside the root.
    at = len(path.segments) - 2
    chosen = path.segments[at]
    assert 1e-8 < abs(chosen.end - chosen.start) < 1e-6
    for change in (
        {"slope": 0.5 * chosen.slope},
        {"error": 0.0},
        {"value": chosen.value * (1 + 1e-9)},
        {"reference": 1 - chosen.reference, "slope": 0.9 * chosen.slope},
    ):
        segments = list(path.segments)
        segments[at] = dataclasses.replace(chosen, **change)
        contour = dataclasses.replace(path, segments=tuple(segments))
        with pytest.raises(CertificateError):
            dataclasses.replace(proof, contours=(contour,)).verify()
    # One segment in place of three: a step too long for its neighbours' slope.
    first, last = path.segments[at - 1], path.segments[at + 1]
    longer = dataclasses.replace(chosen, start=first.start, end=last.end)
    segments = (*path.segments[: at - 1], longer, *path.segments[at + 2 :])
    contour = dataclasses.replace(path, segments=segments)
    with pytest.raises(CertificateError):
        dataclasses.replace(proof, contours=(contour,)).verify()
