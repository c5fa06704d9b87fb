"""Certificates from an unknown source: quick verdicts, and never a wrong count."""

import dataclasses
import json
import math

import pytest
from deadtime import CertificateError, ContourError, QuasiPolynomial, delay, s
from deadtime.roots import Certificate
from deadtime.roots.certificate._parts import Segment

# Both kinds of parts of the real axis, a root at 0, an open side, two rows.
PROOF = (s**2 * (s + 2.0) + s * (1.0 + 0.3 * s) * delay(0.36)).certify(re=(-3.0, None), im=(0, 12))
HALF_PLANE = (s + 5.0 * delay(0.36)).certify(re=(0, None))

HUGE, DEEP = 10**4000, 900


def nested(depth):
    value = 0
    for _ in range(depth):
        value = [value]
    return value


# What may stand anywhere in a text; numbers as `to_json` writes them and as it does not.
VALUES = [
    *(None, True, False, "", "x", "nan", "inf", "-inf", "0x1p+1023", "-0x1p-1074", "0x0p+0", "12"),
    *("0x1p+99999", -1, 0, 1, 7, 100_000, -100_000, HUGE, -HUGE, 0.5, 1e308),
    *([], {}, [[]], ["0x1p+0"] * 2, ["0x1p+0"] * 2000, [["0x1p+0", "0x1p+900"]] * 50),
    *(nested(DEEP), {"bend": 1}),
]


def places(data, above=()):
    """Every key of parsed JSON, and the first and last index of every list."""
    if isinstance(data, dict):
        inside = data.items()
    elif isinstance(data, list):
        inside = [(k, data[k]) for k in sorted({0, len(data) - 1} & set(range(len(data))))]
    else:
        return
    for key, part in inside:
        yield (*above, key)
        yield from places(part, (*above, key))


def with_value(text, place, value):
    data = json.loads(text)
    part = data
    for key in place[:-1]:
        part = part[key]
    part[place[-1]] = value
    return json.dumps(data)


def believed(text):
    """The count of a certificate that is verified, or None if it is refused."""
    try:
        read = Certificate.from_json(text)
        return read, read.verify()
    except (ValueError, CertificateError):
        return None


@pytest.mark.parametrize("proof", [PROOF, HALF_PLANE], ids=["region", "half plane"])
@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.survey)])
def test_no_value_in_any_field_verifies_a_wrong_count_or_hangs(proof, every):
    text = proof.to_json()
    refused = 0
    for number, place in enumerate(places(json.loads(text))):
        for value in VALUES[number % every :: every]:
            found = believed(with_value(text, place, value))
            if found is None:
                refused += 1
                continue
            read, count = found
            if (read.coefficients, read.delays, read.region) == (
                proof.coefficients,
                proof.delays,
                proof.region,
            ):
                assert count == proof.count, (place, value)
                continue
            h = QuasiPolynomial(read.coefficients, read.delays)
            try:
                assert h.count(*read.region) == count, (place, value)
            except (ContourError, ValueError) as error:  # a root on an edge that is open to it
                pytest.fail(f"{place}, {value}: {error}")
    assert refused > 1000 / every


HOSTILE = [None, "x", 1.5, -1, HUGE, math.nan, (), [], ((),), object()]


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(Certificate)])
@pytest.mark.parametrize("value", HOSTILE, ids=range(len(HOSTILE)))
def test_an_object_with_a_changed_part_is_verified_or_refused(name, value):
    try:
        count = dataclasses.replace(PROOF, **{name: value}).verify()
    except CertificateError:
        return
    # Without a use of the bound it may be left out.
    assert count == PROOF.count


def test_a_huge_scale_is_refused():
    # 2^100000 as a fraction times every coefficient: verify() did not come back.
    with pytest.raises(ValueError, match="scale=100000"):
        Certificate.from_json(with_value(HALF_PLANE.to_json(), ("scale",), 100_000))
    with pytest.raises(CertificateError, match="scale=100000"):
        dataclasses.replace(HALF_PLANE, scale=100_000).verify()


def test_nested_brackets_are_no_recursion_error():
    for text in ("[" * 200_000, '{"format": ' + "[" * 200_000 + "]" * 200_000 + "}"):
        with pytest.raises(ValueError, match="nested"):
            Certificate.from_json(text)


def test_numbers_that_take_too_many_digits_are_refused_with_the_reason():
    h = QuasiPolynomial([[1.0] * 3000], [0.0])
    middle = complex(5e-324, 1e300)
    segment = Segment(middle, complex(5e-324, 2e300), middle, 0, 1 + 0j, 0.0, 0.0)
    contour = dataclasses.replace(HALF_PLANE.contours[0], segments=(segment,))
    false = dataclasses.replace(
        HALF_PLANE,
        coefficients=tuple(map(tuple, h.coefficients.tolist())),
        delays=(0.0,),
        beyond=(0, 1e300),
        contours=(contour,),
    )
    with pytest.raises(CertificateError, match="binary digits"):
        false.verify()


def test_a_boolean_field_accepts_no_text():
    # "false" was read as true.
    place = ("contours", 0, "symmetric")
    with pytest.raises(ValueError, match="symmetric"):
        Certificate.from_json(with_value(HALF_PLANE.to_json(), place, "false"))
