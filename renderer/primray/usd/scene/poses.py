"""Transforms of the prims of a group: local ones collected by the walk, and multiplied together at the end.

A stage of a million prims has about as many matrices: multiplying them one at a time would take half as long as reading them.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pxr import Gf

from ...arrays import Doubles

ROOT = 0  # the pose of the group itself
_APART = -1  # parent of a pose that resets the transform stack
_TOGETHER = 1 << 14  # transforms kept as USD's objects, which are several times as large, before they are packed


class Poses:
    def __init__(self) -> None:
        self._begin()

    def _begin(self) -> None:
        self._recent: list[Gf.Matrix4d] = [Gf.Matrix4d(1.0)]
        self._older: list[bytes] = []
        self._above = array("i", [_APART])
        self._depths = array("i", [0])
        self._products: Doubles | None = None

    def add(self, local: Gf.Matrix4d, above: int, *, resets: bool = False) -> int:
        """Add a local transform below the pose `above`, or below nothing where it resets the stack; return the new pose's
        number."""
        if len(self._recent) == _TOGETHER:
            self._older.append(b"".join(self._recent))
            self._recent = []
        self._products = None
        self._recent.append(local)
        self._above.append(_APART if resets else above)
        self._depths.append(0 if resets else self._depths[above] + 1)
        return len(self._above) - 1

    def at(self, pose: int) -> Doubles:
        """Return group_from_prim (4, 4) of one pose, column-vector; for a few of them while others are still added."""
        product = self._local(pose)
        chain = [product]
        while (pose := self._above[pose]) != _APART:
            chain.append(self._local(pose))
        product = chain.pop()
        while chain:
            product = _after(chain.pop(), product)
        return np.ascontiguousarray(product[0].T)

    def of(self, poses: Sequence[int]) -> Doubles:
        """Return group_from_prim (K, 4, 4) of many poses, column-vector."""
        products = self.every()
        columns = np.empty((len(poses), 4, 4))
        for start in range(0, len(poses), _TOGETHER):
            chosen = np.asarray(poses[start : start + _TOGETHER], np.intp)
            columns[start : start + _TOGETHER] = products[chosen].transpose(0, 2, 1)
        return columns

    def taken(self, poses: Sequence[int]) -> Doubles:
        """Return `of` these poses, and forget all of them."""
        found = self.of(poses)
        self._begin()
        return found

    def local(self, pose: int) -> Doubles:
        """Return a pose's local transform (4, 4), row-vector as USD has it."""
        local: Doubles = self._local(pose)[0]
        return local

    def put(self, pose: int, local: Gf.Matrix4d) -> None:
        """Replace a pose's local transform."""
        self._products = None
        block, at = divmod(pose, _TOGETHER)
        if block == len(self._older):
            self._recent[at] = local
            return
        matrices = np.frombuffer(self._older[block], np.float64).reshape(-1, 4, 4).copy()
        matrices[at] = np.array(local, np.float64)
        self._older[block] = matrices.tobytes()

    def every(self) -> Doubles:
        """Return the products of all poses (N, 4, 4), row-vector."""
        if self._products is None:
            self._products = self._multiplied()
        return self._products

    def _local(self, pose: int) -> Doubles:
        block, at = divmod(pose, _TOGETHER)
        if block < len(self._older):
            return np.frombuffer(self._older[block], np.float64).reshape(-1, 4, 4)[at : at + 1]
        return np.array(self._recent[at], np.float64)[None]

    def _multiplied(self) -> Doubles:
        products = np.frombuffer(bytearray().join([*self._older, *self._recent]), np.float64).reshape(-1, 4, 4)
        above, depths = np.array(self._above, np.intp), np.array(self._depths)
        order = np.argsort(depths, kind="stable")
        for level in np.split(order, np.flatnonzero(np.diff(depths[order])) + 1)[1:]:
            products[level] = _after(products[level], products[above[level]])
        return products


def _after(local: npt.NDArray[np.float64], above: npt.NDArray[np.float64]) -> Doubles:
    """Return (K, 4, 4) products of USD's row-vector matrices, with the bits of Gf.Matrix4d's."""
    with np.errstate(invalid="ignore", over="ignore"):
        product = local[:, :, 0:1] * above[:, 0:1, :]
        for k in range(1, 4):
            product += local[:, :, k : k + 1] * above[:, k : k + 1, :]
    return product
