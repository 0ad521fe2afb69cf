"""Matrices, stored by rows; vectors stand before them."""

from __future__ import annotations

import numpy as np

from .numbers import Inputs, Rows


def square(m: Rows) -> Rows:
    n = {9: 3, 16: 4}[m.shape[1]]
    return m.reshape(-1, n, n)


def flat(m: Rows) -> Rows:
    return m.reshape(len(m), -1)


def transformed(i: Inputs) -> Rows:
    m, v = square(i["mat"]), i["in"]
    homogeneous = v.shape[1] < m.shape[1]
    row = np.hstack([v, np.ones((len(v), 1))]) if homogeneous else v
    return np.einsum("ni,nij->nj", row, m)[:, : v.shape[1]]


def created(i: Inputs, kind: str) -> Rows:
    given = [i[name] for name in ("in1", "in2", "in3", "in4") if name in i]
    if kind == "matrix44" and given[0].shape[1] == 3:
        given = [np.hstack([row, np.full((len(row), 1), float(k == 3))]) for k, row in enumerate(given)]
    return np.hstack(given)


def of_matrices(category: str, i: Inputs, kind: str) -> Rows | None:
    """None where the node is of something else."""
    if category == "creatematrix":
        return created(i, kind)
    if category == "transformmatrix":
        return transformed(i)
    if category == "transpose":
        return flat(square(i["in"]).transpose(0, 2, 1))
    if category == "determinant":
        return np.linalg.det(square(i["in"]))[:, None]
    if category == "invertmatrix":
        return flat(np.asarray(np.linalg.inv(square(i["in"])), np.float64))
    if category not in ("multiply", "divide"):
        return None
    a, b = i["in1"], i["in2"]
    if a.shape[1] > 4 and b.shape[1] > 4:
        second: Rows = square(b) if category == "multiply" else np.asarray(np.linalg.inv(square(b)), np.float64)
        return flat(np.einsum("nij,njk->nik", square(a), second))
    return a * b if category == "multiply" else a / b
