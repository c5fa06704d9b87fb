"""The entries of the gallery by citation key; `Problem` describes the fields."""

from typing import Any, Final

from deadtime.roots import ParametricQuasiPolynomial, QuasiPolynomial, delay, parameters, s

a, g, kappa1, Kd, Kp, Kv, T, tau, Td, w = parameters("a g kappa1 Kd Kp Kv T tau Td w")

_EIGHT_DELAYS = QuasiPolynomial(
    [
        [0.0, -1.8, 0.001, 0.0, 0.0, -12.8, 0.0, 1.7, 0.2],
        [29.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 6.7, 0.0, 0.0, 0.0, -1.1, 0.0, 1.0, 0.0],
        [0.0, 19.3, 2.1, 0.0, -8.7, 0.0, 0.0, 0.0, 0.0],
        [7.2, -1.4, 0.0, 0.0, 0.1, 0.0, 0.8, 0.0, 0.0],
        [0.0, 25.2, 0.0, -0.9, 0.2, 0.15, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1.5, -0.1, 0.04, 0.03, 0.0, 0.0, 0.0, 0.0, 0.0],
        [51.7, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    ],
    [0.0, 4.61, 8.52, 10.33, 13.32, 18.52, 19.9, 23.35, 24.99],
)
_FOUR_DELAYS = QuasiPolynomial(
    [
        [2.1, 5.0, 0.0, 0.2, 1.0],
        [0.0, -2.1, 0.0, 0.0, 0.5],
        [0.0, 0.0, 3.2, 0.0, 0.3],
        [0.0, 0.0, 1.2, 0.0, 0.0],
        [3.0, 0.0, 0.0, 0.0, 0.0],
    ],
    [0.0, 1.5, 2.2, 4.3, 6.3],
)
_CLOSED_LOOP = QuasiPolynomial(
    [
        [0.8700000000000001, -3.926, 2.28, 1.0],
        [0.2719870000000002, 2.3080524000000002, 2.881628, 0.032600000000000004],
        [-1.0861762400000001, 0.007912800000000109, -0.013040000000000001, 0.0],
        [-0.00485984, -0.0026080000000000005, 0.0, 0.0],
    ],
    [0.0, 1.0, 2.0, 3.0],
)
_ROUTER = QuasiPolynomial(
    [
        [0.0, 2.149535673425344, 4.593826426069139, 1.0],
        [1.1296874999999997, 2.1314858490566033, 0.0, 0.0],
    ],
    [0.0, 0.246],
)
_CAR_RING = (
    s**10
    + (4.0 * s**8 + 5.0 * s**9) * delay(0.4)
    + (6.400000000000001 * s**6 + 16.0 * s**7 + 10.0 * s**8) * delay(0.8)
    + s**4
    * (5.120000000000001 + 19.200000000000003 * s + 24.000000000000004 * s**2 + 10.0 * s**3)
    * delay(1.2)
    + s**2
    * (
        2.0480000000000005
        + 10.240000000000002 * s
        + 19.200000000000003 * s**2
        + 16.0 * s**3
        + 5.0 * s**4
    )
    * delay(1.6)
    + s
    * (2.0480000000000005 + 5.120000000000001 * s + 6.400000000000001 * s**2 + 4.0 * s**3 + s**4)
    * delay(2.0)
)
_SIXFOLD = QuasiPolynomial(
    [
        [12.83018215625941, 27.19317049536409, 4.426741511734373, 1.0],
        [13.258371728434515, 2.064893843038612, 0.08545585091640695, 0.0],
    ],
    [0.0, 0.66],
)
_CIRCUIT = QuasiPolynomial(
    [
        [330000000.0, 1540000.0, 2200.0, 1.0],
        [49000000.0, -47638.888888888876, -83.33333333333334, 0.0],
        [-45500000.0, -15833.333333333336, 4.9961419753086425, -0.0055941358024691355],
        [3000000.0, -5555.555555555555, 1.5624999999999996, 1.6075102880658458e-05],
    ],
    [0.0, 1.0, 2.0, 3.0],
)
_TWO_STATES = QuasiPolynomial(
    [[11.0, 6.0, 1.0], [-3.7859999999999987, -1.3299999999999998, 0.0], [0.10041, 0.0, 0.0]],
    [0.0, 1.0, 2.0],
)
_QPMR = (
    'T. Vyhlidal and P. Zitek, "QPmR - Quasi-polynomial root-finder: algorithm update and '
    'examples", in Delay Systems: From Theory to Numerics and Applications, Springer '
    "(2014), example "
)
_QUADROTOR = (
    'S. Armah and S. Yi, "Analysis of time delays in quadrotor systems and design of '
    'control", in Time Delay Systems: Theory, Numerics, Applications, and Experiments, '
    "Springer (2017)"
)
_TDS_CONTROL = (
    'P. Appeltans and W. Michiels, "Analysis and controller-design of time-delay systems '
    'using TDS-CONTROL: a tutorial and manual" (2023), example '
)


def _member(family: ParametricQuasiPolynomial | QuasiPolynomial, **values: float) -> dict[str, Any]:
    # For a type checker, s plus a parameter is a QuasiPolynomial.
    assert isinstance(family, ParametricQuasiPolynomial)
    return {"family": family, "values": values, "h": family.at(**values)}


ENTRIES: Final[dict[str, dict[str, Any]]] = {
    "vyhlidal2014-1": {
        "title": "Integrator with dead time",
        "reference": _QPMR + "1",
        "h": s + delay(1.0),
        "base_delay": 1.0,
        "rightmost": complex(-0.31813150520476413, 1.3372357014306895),
        "region": ((-10.0, 2.0), (0.0, 30.0)),
        "count": 5,
    },
    "vyhlidal2009": {
        "title": "Retarded, eight delays, degree 8",
        "reference": (
            'T. Vyhlidal and P. Zitek, "Mapping based algorithm for large-scale '
            'computation of quasi-polynomial zeros", IEEE Transactions on Automatic '
            "Control 54(1) (2009), 171-177"
        ),
        "h": _EIGHT_DELAYS,
        "base_delay": 0.01,
        "rightmost": (2.425236932116968 + 0j),
        "region": ((-4.5, 2.5), (0.0, 100.0)),
        "count": 401,
    },
    "vyhlidal2014-3": {
        "title": "Neutral, four delays, degree 4",
        "reference": _QPMR + "3",
        "h": _FOUR_DELAYS,
        "base_delay": 0.1,
        "rightmost": complex(0.9100066128666843, 1.5566934977882543),
        "region": ((-10.0, 2.0), (0.0, 100.0)),
        "count": 101,
    },
    "armah2017": {
        "title": "Height of a quadrotor under proportional control",
        "reference": _QUADROTOR,
        **_member(s + Kp * delay(Td), Kp=2.0, Td=0.36),
        "base_delay": 0.36,
        "rightmost": complex(-1.515361660344816, 3.100547959071834),
        "region": ((-12.0, 2.0), (0.0, 100.0)),
        "count": 6,
        "published": {"largest stable gain": "Kp Td < pi/2"},
    },
    "armah2017-pv": {
        "title": "Height of a quadrotor under proportional-velocity control",
        "reference": _QUADROTOR,
        **_member(s + (Kp + Kv * s) * delay(Td), Kp=2.0, Kv=0.3, Td=0.36),
        "base_delay": 0.36,
        "rightmost": (-3.3167803221473853 + 0j),
        "region": ((-12.0, 2.0), (0.0, 100.0)),
        "count": 7,
        "published": {"chains": "strongly stable for |Kv| < 1, along Re s = log|Kv| / Td"},
    },
    "appeltans2023-2.6": {
        "title": "Neutral, stable for its delays but not strongly",
        "reference": _TDS_CONTROL + "2.6",
        **_member(-0.25 + s + (1 / 3 - 0.75 * s) * delay(1.0) + 0.5 * s * delay(T), T=2.0),
        "base_delay": 1.0,
        "rightmost": None,
        "region": ((-0.9, 0.2), (0.0, 200.0)),
        "count": 64,
        "published": {
            "stability": "exponentially stable for T = 2, not for some T as close as one likes"
        },
    },
    "appeltans2023-2.9": {
        "title": "Neutral closed loop, three commensurate delays",
        "reference": _TDS_CONTROL + "2.9",
        "h": _CLOSED_LOOP,
        "base_delay": 1.0,
        "rightmost": complex(-0.28448043673259954, 0.21784497571362862),
        "region": ((-4.0, 0.5), (0.0, 100.0)),
        "count": 18,
        "published": {"spectral abscissa": "-0.2845"},
    },
    "appeltans2023-2.12": {
        "title": "Smith predictor with a wrong delay",
        "reference": _TDS_CONTROL + "2.12",
        "h": 3.0 + 1.5 * s + (2.0 + 0.5 * s) * delay(1.0) - (2.0 + 0.5 * s) * delay(1.5),
        "base_delay": 0.5,
        "rightmost": complex(-0.31399773579383705, 3.5322397083324475),
        "region": ((-6.0, 1.0), (0.0, 100.0)),
        "count": 25,
    },
    "shayer2000": {
        "title": "Two coupled neurons at rest",
        "reference": (
            'L. P. Shayer and S. A. Campbell, "Stability, bifurcation, and multistability '
            'in a system of two coupled neurons with multiple time delays", SIAM Journal '
            "on Applied Mathematics 61(2) (2000), 673-700; numbers of the demo of "
            "DDE-BIFTOOL"
        ),
        "h": s**2 + s + 0.25 - 2.34 * delay(0.4) + (1.0 + 2.0 * s) * delay(1.5) + delay(3.0),
        "base_delay": 0.1,
        "rightmost": (0.30886599775839146 + 0j),
        "region": ((-4.0, 2.0), (0.0, 60.0)),
        "count": 31,
    },
    "mackey1977": {
        "title": "Blood cell production at its fixed point 1",
        "reference": (
            'M. C. Mackey and L. Glass, "Oscillation and chaos in physiological control '
            'systems", Science 197 (1977), 287-289; beta = 2, gamma = 1, n = 10'
        ),
        **_member(s + 1.0 + 4.0 * delay(tau), tau=2.0),
        "base_delay": 2.0,
        "rightmost": complex(0.3876354872437999, 1.2118561767972347),
        "region": ((-4.0, 2.0), (0.0, 100.0)),
        "count": 32,
        "published": {"stability": "tau < arccos(-1/4) / sqrt(15)"},
    },
    "humphries2012": {
        "title": "Two state-dependent delays, linearised",
        "reference": (
            'A. R. Humphries, O. A. DeMasi, F. M. G. Magpantay and F. Upham, "Dynamics of '
            'a delay differential equation with multiple state-dependent delays", Discrete '
            "and Continuous Dynamical Systems A 32 (2012); gamma = 4.75, kappa2 = 2.3, a1 "
            "= 1.3, a2 = 6"
        ),
        **_member(s + 4.75 + kappa1 * delay(1.3) + 2.3 * delay(6.0), kappa1=3.0),
        "base_delay": 0.1,
        "rightmost": complex(-0.04372270002152987, 2.445928303324472),
        "region": ((-3.0, 1.0), (0.0, 60.0)),
        "count": 58,
    },
    "yanchuk2009": {
        "title": "Oscillator with delayed feedback",
        "reference": (
            'S. Yanchuk and P. Perlikowski, "Delay and periodicity", Physical Review E 79 '
            "(2009), 046221; numbers of the demo of DDE-BIFTOOL"
        ),
        **_member(s**2 + 0.05 * s + 0.6 - 0.1 * delay(tau), tau=10.0),
        "base_delay": 10.0,
        "rightmost": complex(-0.05853882728396005, 0.6529582504746142),
        "region": ((-1.0, 0.5), (0.0, 20.0)),
        "count": 33,
    },
    "hollot2001": {
        "title": "Router queue with a PI controller",
        "reference": (
            'C. V. Hollot, V. Misra, D. Towsley and W. Gong, "On designing improved '
            'controllers for AQM routers supporting TCP flows", IEEE INFOCOM (2001); N = '
            "60, C = 3750, R0 = 0.246"
        ),
        "h": _ROUTER,
        "base_delay": 0.246,
        "rightmost": (-0.5342050694043399 + 0j),
        "region": ((-25.0, 2.0), (0.0, 200.0)),
        "count": 4,
    },
    "insperger2011": {
        "title": "Regenerative chatter in turning",
        "reference": (
            "T. Insperger and G. Stepan, Semi-Discretization for Time-Delay Systems, "
            "Springer (2011); zeta = 0.02, w = 0.1"
        ),
        **_member(s**2 + 0.04 * s + 1.0 + w * (1.0 - delay(tau)), w=0.1, tau=7.853981633974),
        "base_delay": 7.853981633974,
        "rightmost": complex(-0.07001734176507844, 1.1113316847099577),
        "region": ((-1.5, 0.5), (0.0, 30.0)),
        "count": 39,
    },
    "stepan1989": {
        "title": "Inverted pendulum, delayed PD control",
        "reference": (
            "G. Stepan, Retarded Dynamical Systems: Stability and Characteristic "
            "Functions, Longman (1989)"
        ),
        **_member(s**2 - 1.0 + (Kp + Kd * s) * delay(tau), Kp=1.8, Kd=1.2, tau=0.6),
        "base_delay": 0.6,
        "rightmost": complex(0.04098848531188674, 1.1043453516722588),
        "region": ((-12.0, 2.0), (0.0, 100.0)),
        "count": 11,
        "published": {"stabilisable": "for tau < sqrt(2)"},
    },
    "orosz2006": {
        "title": "Five cars on a ring with reaction time",
        "reference": (
            'G. Orosz and G. Stepan, "Subcritical Hopf bifurcations in a car-following '
            'model with reaction-time delay", Proceedings of the Royal Society A 462 '
            "(2006); alpha = 1, V' = 0.8, tau = 0.4"
        ),
        "h": _CAR_RING,
        "base_delay": 0.4,
        "rightmost": complex(0.10849685831586656, 0.7886612690947454),
        "region": ((-8.0, 2.0), (0.0, 40.0)),
        "count": 13,
    },
    "mazanti2021": {
        "title": "Dominant root of multiplicity 6",
        "reference": (
            'G. Mazanti, I. Boussaada and S.-I. Niculescu, "Multiplicity-induced-dominancy '
            'for delay-differential equations of retarded type", Journal of Differential '
            "Equations 286 (2021); numbers of the examples of qpmr"
        ),
        "h": _SIXFOLD,
        "base_delay": 0.66,
        "rightmost": complex(-6.000082273549885, 0.012094129984670025),
        "region": ((-15.0, 1.0), (0.0, 60.0)),
        "count": 8,
        "published": {
            "dominant root": "multiplicity 6 near -6.021; rounding of the coefficients splits it"
        },
    },
    "wright1955": {
        "title": "Wright's equation at its critical gain",
        "reference": (
            'E. M. Wright, "A non-linear difference-differential equation", Journal fuer '
            "die reine und angewandte Mathematik 194 (1955), 66-87"
        ),
        **_member(s + a * delay(1.0), a=1.5707963267948966),
        "base_delay": 1.0,
        "rightmost": 1.5707963267948966j,
        "region": ((-8.0, 2.0), (0.0, 60.0)),
        "count": 10,
        "published": {"stability": "0 < a < pi/2", "rightmost": "i pi/2 for a = pi/2"},
    },
    "bellen1999": {
        "title": "Partial element equivalent circuit",
        "reference": (
            'A. Bellen, N. Guglielmi and A. E. Ruehli, "Methods for linear systems of '
            'circuit delay differential equations of neutral type", IEEE Transactions on '
            "Circuits and Systems I 46 (1999), 212-216"
        ),
        "h": _CIRCUIT,
        "base_delay": 1.0,
        "rightmost": complex(-0.7376376608499178, 3.132894888428825),
        "region": ((-6.0, 2.0), (0.0, 100.0)),
        "count": 48,
    },
    "yi2007": {
        "title": "Two states, one delay, by the matrix Lambert W function",
        "reference": (
            'S. Yi, P. W. Nelson and A. G. Ulsoy, "Delay differential equations via the '
            "matrix Lambert W function and bifurcation analysis: application to machine "
            'tool chatter", Mathematical Biosciences and Engineering 4 (2007), 355-368'
        ),
        "h": _TWO_STATES,
        "base_delay": 1.0,
        "rightmost": (-1.0118752332460632 + 0j),
        "region": ((-6.0, 2.0), (0.0, 100.0)),
        "count": 23,
    },
    "olgac1994": {
        "title": "Delayed resonator, acceleration feedback",
        "reference": (
            'after N. Olgac and B. T. Holm-Hansen, "A novel active vibration absorption '
            'technique: delayed resonator", Journal of Sound and Vibration 176 (1994), '
            "93-104"
        ),
        **_member(s**2 * (1.0 + g * delay(tau)) + 0.08 * s + 1.0, g=0.6, tau=0.8),
        "base_delay": 0.8,
        "rightmost": complex(-0.12219189670693335, 0.7818454278384551),
        "region": ((-4.0, 2.0), (0.0, 150.0)),
        "count": 20,
        "published": {"chains": "strongly stable for |g| < 1, along Re s = log|g| / tau"},
    },
    "boussaada2016": {
        "title": "Double root at the origin that dominates",
        "reference": (
            'I. Boussaada and S.-I. Niculescu, "Characterizing the codimension of zero '
            'singularities for time-delay systems", Acta Applicandae Mathematicae 145 '
            "(2016); the simplest of its kind"
        ),
        "h": s - 1.0 + delay(1.0),
        "base_delay": 1.0,
        "rightmost": 0j,
        "multiplicity": 2,
        "region": ((-6.0, 1.0), (0.0, 60.0)),
        "count": 11,
        "published": {"dominant root": "0, of multiplicity 2"},
    },
}
