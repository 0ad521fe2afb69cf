"""Iterated quadrature in double: an adaptive outer rule over an inner Gauss rule that is split where the integrand breaks.

An integral over two parameters (u, v) for many receivers at once. The inner integral in v is cut at every place that its
integrand has a jump or a kink (found in closed form by the caller), so that pieces are smooth. What is left to the outer rule
are end points of such curves, to which it bisects. Numpy only; knows nothing of light.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Doubles = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

# Gauss-Kronrod 7-15 (QUADPACK, Piessens et al. 1983, qk15), nodes from the outside in.
_KRONROD_NODES = (
    0.991455371120812639206854697526329, 0.949107912342758524526189684047851, 0.864864423359769072789712788640926,
    0.741531185599394439863864773280788, 0.586087235467691130294144691693013, 0.405845151377397166906606412076961,
    0.207784955007898467600689403773245, 0.0,
)  # fmt: skip
_KRONROD_WEIGHTS = (
    0.022935322010529224963732008058970, 0.063092092629978553290700663189204, 0.104790010322250183839876322541518,
    0.140653259715525918745189590510238, 0.169004726639267902826583426598550, 0.190350578064785409913256402421014,
    0.204432940075298892414161999234649, 0.209482141084727828012999174891714,
)  # fmt: skip
_GAUSS_WEIGHTS = (
    0.129484966168869693270611432679082, 0.279705391489276667901467771423780,
    0.381830050505118944950369775488975, 0.417959183673469387755102040816327,
)  # fmt: skip
NODES = np.concatenate([-np.array(_KRONROD_NODES), np.array(_KRONROD_NODES[-2::-1])])
KRONROD = np.concatenate([_KRONROD_WEIGHTS, _KRONROD_WEIGHTS[-2::-1]])
GAUSS = np.zeros(15)
GAUSS[1::2] = [*_GAUSS_WEIGHTS, *_GAUSS_WEIGHTS[-2::-1]]

CHUNK = 400_000  # evaluations of an inner integrand at a time: what stays in the cache
MAX_LEVEL = 44


@dataclass(frozen=True)
class Integral:
    value: Doubles  # (R, C)
    error: Doubles  # (R,), bound on the largest channel's error of the outer rule


def outer(
    inner: Callable[[Integers, Doubles], Doubles], edges: Doubles, relative: float = 1e-6, cost: int = 64, order: int = 0
) -> Integral:
    """Integral over u of `inner(receiver (Q,), u (Q, 15)) -> (Q, 15, C)`, for every receiver, over edges (R, E) ascending.

    Bisects until each interval's error is below `relative` times the receiver's value, or times a hundredth of the largest.
    `cost`: evaluations that one inner integral takes. Intervals begin in two parts, others for another `order`: what falls
    between a rule's last node and its end shows when two orders are compared.
    """
    first = edges[:, :-1] + np.diff(edges) * (0.41 + 0.013 * (order % 17))
    edges = np.sort(np.concatenate([edges, first], axis=1), axis=1)
    receivers = edges.shape[0]
    owner = np.repeat(np.arange(receivers), edges.shape[1] - 1)
    low, high = edges[:, :-1].ravel(), edges[:, 1:].ravel()
    some = high > low
    owner, low, high = owner[some], low[some], high[some]
    total: Doubles | None = None
    error = np.zeros(receivers)
    for level in range(MAX_LEVEL):
        value, bad = _rule(inner, owner, low, high, cost)
        if total is None:
            total = np.zeros((receivers, value.shape[1]))
            magnitude = np.zeros(receivers)
        estimate = total.copy()
        np.add.at(estimate, owner, value)
        magnitude = np.abs(estimate).max(axis=1, initial=0.0)
        allowed = 0.1 * relative * np.maximum(magnitude, 0.01 * magnitude.max(initial=0.0))[owner]
        done = (bad <= allowed) | (level == MAX_LEVEL - 1)
        np.add.at(total, owner[done], value[done])
        np.add.at(error, owner[done], bad[done])
        owner, low, high = owner[~done], low[~done], high[~done]
        if not owner.size:
            break
        middle = (low + high) / 2
        owner = np.concatenate([owner, owner])
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return Integral(total if total is not None else np.zeros((receivers, 1)), error)


def _rule(
    inner: Callable[[Integers, Doubles], Doubles], owner: Integers, low: Doubles, high: Doubles, cost: int
) -> tuple[Doubles, Doubles]:
    values, errors = [], []
    step = max(1, CHUNK // (15 * cost))
    for i in range(0, owner.size, step):
        o, half = owner[i : i + step], (high - low)[i : i + step] / 2
        u = ((low + high)[i : i + step] / 2)[:, None] + half[:, None] * NODES
        g = inner(o, u)
        kronrod = np.einsum("k,qkc->qc", KRONROD, g) * half[:, None]
        gauss = np.einsum("k,qkc->qc", GAUSS, g) * half[:, None]
        spread = np.einsum("k,qkc->qc", KRONROD, np.abs(g - kronrod[:, None] / (2 * half[:, None, None]))) * half[:, None]
        raw = np.abs(kronrod - gauss)
        # QUADPACK's estimate: the Gauss rule's error, to the power that the better rule gains.
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.where(spread > 0, spread * np.minimum(1.0, (200 * raw / spread) ** 1.5), raw)
        values.append(kronrod)
        errors.append(np.maximum(error, 1e-15 * np.abs(kronrod)).max(axis=1))
    if not values:
        return np.zeros((0, 1)), np.zeros(0)
    return np.concatenate(values), np.concatenate(errors)


def split(low: Doubles, high: Doubles, breaks: Doubles, order: int) -> tuple[Integers, Doubles, Doubles]:
    """Gauss nodes on [low, high] cut at `breaks` (..., K; those outside do nothing, NaN neither).

    Returns for the pieces that are not empty: the flat index of the line each belongs to (M,), nodes (M, order), weights.
    """
    inside = np.clip(np.where(np.isnan(breaks), low[..., None], breaks), low[..., None], high[..., None])
    edges = np.sort(np.concatenate([low[..., None], inside, high[..., None]], axis=-1), axis=-1).reshape(
        -1, breaks.shape[-1] + 2
    )
    a, b = edges[:, :-1], edges[:, 1:]
    line, piece = np.nonzero(b > a)
    x, w = np.polynomial.legendre.leggauss(order)
    a, half = a[line, piece], (b - a)[line, piece] / 2
    return line, (a + half)[:, None] + half[:, None] * x, half[:, None] * w
