"""Networks, policies and options as command-line arguments and JSON, and back."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from typing import Annotated, Literal, TypeAlias, get_args

from deadtime._base.bounds import Bounds
from deadtime.links.udp.controller import ControllerOptions
from deadtime.links.udp.delays import Constant, Delays, LogNormal, Normal, ShiftedGamma
from deadtime.links.udp.network import Bursts, Network
from deadtime.links.udp.plant_options import PlantOptions
from deadtime.links.udp.policies import DropLate, HoldThenZero, JitterBuffer, NewestWins, Policy
from deadtime.links.udp.relay import RelayOptions

#: Names of delays and policies in options.
DelaysName: TypeAlias = Literal["normal", "gamma", "lognormal"]
PolicyName: TypeAlias = Literal["newest", "drop-late", "hold", "jitter-buffer"]
DELAYS, POLICIES = get_args(DelaysName), get_args(PolicyName)

#: Numbers that options give.
FROM_ZERO, FROM_ONE = Bounds(0.0), Bounds(1.0)

KINDS = {"constant": Constant, "normal": Normal, "gamma": ShiftedGamma, "lognormal": LogNormal}

#: Shortest delay of a distribution that has one, as a share of the mean.
LEAST = 0.8


def delays_of(kind: DelaysName, mean: float, deviation: float) -> Delays:
    """One-way delays of this kind; constant ones without deviation."""
    if kind not in DELAYS:
        raise ValueError(f"delays of kind {kind!r} do not exist: give one of {', '.join(DELAYS)}")
    if deviation == 0.0:
        return Constant(mean)
    if mean == 0.0 and kind != "normal":
        raise ValueError(
            f"{kind} delays with a mean of {mean} s cannot have a standard deviation of "
            f"{deviation} s: give a longer mean"
        )
    if kind == "normal":
        return Normal(mean, deviation)
    return (ShiftedGamma if kind == "gamma" else LogNormal)(LEAST * mean, mean, deviation)


def network_of(
    kind: DelaysName = "gamma",
    delay: Annotated[float, FROM_ZERO] = 0.05,
    jitter: Annotated[float, FROM_ZERO] = 0.0,
    loss: Annotated[float, FROM_ZERO] = 0.0,
    burst: Annotated[float, FROM_ONE] = 1.0,
    duplication: Annotated[float, FROM_ZERO] = 0.0,
    ordered: bool = False,
) -> Network:
    """One direction of a network, from the numbers of options.

    Parameters
    ----------
    delay : float
        Mean one-way delay, s.
    jitter : float
        Standard deviation of the one-way delay, s.
    kind : {"gamma", "normal", "lognormal"}
        Distribution of the one-way delay.

        Delays of the first and the last kind begin at 0.8 of the mean.
    loss : float
        Share of the packets that are lost.
    burst : float
        Mean length of a burst of losses.

        In packets; 1 for independent losses.
    duplication : float
        Share of the packets that arrive twice.
    ordered : bool
        Keep the order of the packets, so that no packet overtakes another.

    Examples
    --------
    >>> from deadtime.links.udp import network_of
    >>> network_of("normal", delay=0.05, jitter=0.01).delay
    Normal(mean=0.05, deviation=0.01)
    """
    return Network(
        delay=delays_of(kind, delay, jitter),
        loss=loss if burst == 1.0 else Bursts.of(loss, burst),
        duplication=duplication,
        ordered=ordered,
    )


def policy_of(name: PolicyName = "newest", number: float | None = None) -> Policy:
    """The policy of this name.

    Parameters
    ----------
    name : {"newest", "drop-late", "hold", "jitter-buffer"}
        What the plant does with late commands.
    number : float, optional
        Parameter of the policy: largest age in s (drop-late), number of samples (hold), or constant
        age in s (jitter-buffer).
    """
    if name not in POLICIES:
        raise ValueError(f"the policy {name!r} does not exist: give one of {', '.join(POLICIES)}")
    if name == "newest":
        if number is not None:
            raise ValueError(f"the policy 'newest' has no parameter: leave {number:g} out")
        return NewestWins()
    if number is None:
        what = "a number of samples" if name == "hold" else "a time in s"
        raise ValueError(f"the policy {name!r} needs {what}")
    if name == "hold":
        if not number.is_integer():
            raise ValueError(f"the policy 'hold' needs a whole number of samples, not {number:g}")
        return HoldThenZero(int(number))
    return (DropLate if name == "drop-late" else JitterBuffer)(number)


def network_text(network: Network) -> str:
    """A network as JSON, for `network_from`."""
    words = asdict(network)
    for kind, made in KINDS.items():
        if type(network.delay) is made:
            words["delay"]["kind"] = kind
    if isinstance(words["delay"], dict) and "kind" not in words["delay"]:
        raise ValueError(f"the delays {network.delay} cannot be passed to another process")
    return json.dumps(words)


def network_from(text: str) -> Network:
    """The network of a text from `network_text`."""
    try:
        words = json.loads(text)
        if isinstance(words["delay"], dict):
            kind = words["delay"].pop("kind")
            words["delay"] = KINDS[kind](**words["delay"])
        if isinstance(words["loss"], dict):
            words["loss"] = Bursts(**words["loss"])
        words["blackouts"] = tuple((start, stop) for start, stop in words["blackouts"])
        return Network(**words)
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{text!r} does not describe a network: {error}") from None


def policy_words(policy: Policy) -> tuple[PolicyName, float | None]:
    """Name and number of a policy, for `policy_of`."""
    if isinstance(policy, NewestWins):
        return "newest", None
    if isinstance(policy, HoldThenZero):
        return "hold", float(policy.samples)
    if isinstance(policy, DropLate):
        return "drop-late", policy.older_than
    if isinstance(policy, JitterBuffer):
        return "jitter-buffer", policy.delay
    raise ValueError(f"{policy} cannot be passed to another process")


def arguments_of(options: ControllerOptions | RelayOptions | PlantOptions) -> list[str]:
    """The options as arguments of ``python -m deadtime.links.udp <part>``."""
    arguments = []
    for field in fields(options):
        name, value = field.name.replace("_", "-"), getattr(options, field.name)
        if value is None or value is False:
            continue
        if field.name == "policy":
            word, number = policy_words(value)
            arguments += ["--policy", word]
            arguments += [] if number is None else ["--policy-number", str(number)]
        elif value is True:
            arguments += [f"--{name}"]
        elif isinstance(value, Network):
            arguments += [f"--{name}", network_text(value)]
        elif field.name == "doubles":
            arguments += ["--doubles", *map(str, value)]
        elif isinstance(value, tuple):
            host, port = value
            to = "to" if isinstance(options, RelayOptions) and name == "controller" else name
            arguments += [f"--{to}", f"{host}:{port}"]
        else:
            # As one argument: a negative number would be parsed as another option.
            arguments += [f"--{name}={value}"]
    return arguments
