"""Media and emission of a volume's coefficients: fields' own grids where coefficients are sums of fields times constants, else
new grids with the coefficients at the voxels of the fields that they depend on.

A medium has one number a voxel, its extinction times a constant colour. Extinction whose colour varies becomes one medium for
each channel. Scattering with several phase functions becomes one medium for each of them, which is exact, as media add.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ...arrays import Doubles, Floats, Ints
from ...description import CameraVisibility, NodeOutput, Operand, VolumeEmission, VolumeMedium
from ...process_memory import machine_bytes
from ...volumes.volume_grid import LEAF, VOXELS, VolumeGrid
from ..scene.context import Context
from .coefficients import BLACK, Coefficients, Lobe
from .fields import Field, field_named
from .linear_forms import LinearForm, linear_form
from .motion import move_together
from .node_arrays import NodeArrays
from .shaders import density_name

_ROWS = 1 << 10  # leaves that are evaluated at a time
_ALIKE = 1e-5  # relative difference up to which colours of voxels count as one
_LARGEST_ANISOTROPY = float(np.float32(0.999))
_MOST_TILE_LEAVES = 1 << 18  # leaves that tiles may become where several fields are read

_VOXELS_OF_LEAF = np.stack(np.meshgrid(*[np.arange(LEAF)] * 3, indexing="ij"), axis=-1).reshape(VOXELS, 3)


class TooLargeError(Exception):
    """New grids would exceed the limit of memory; the message says by how much."""


@dataclass(frozen=True, eq=False)
class Domain:
    """Where new grids have voxels: leaves and tiles in the index space of a field."""

    base: Field
    leaf_origins: Ints  # (L, 3)
    tile_origins: Ints  # (T, 3)
    tile_sizes: Ints  # (T,)

    @property
    def count(self) -> int:
        return len(self.leaf_origins) * VOXELS + len(self.tile_origins)

    def grid(self, name: str, leaf_values: Floats, tile_values: Floats) -> VolumeGrid:
        """Return a grid of these values, one or three numbers a voxel."""
        width = leaf_values.shape[2:]
        return VolumeGrid(
            name=name,
            grid_class="unknown",
            field_from_index=self.base.grid.field_from_index,
            background=np.zeros(width, np.float32),
            leaf_origins=self.leaf_origins,
            leaf_values=leaf_values,
            tile_origins=self.tile_origins,
            tile_sizes=self.tile_sizes,
            tile_values=tile_values,
            bounds=self.base.grid.bounds,
            active_voxels=self.base.grid.active_voxels,
            nonfinite=0,
            negative=0,
        )


@dataclass(frozen=True, eq=False)
class Piece:
    """Some voxels of a domain: rows of leaves, or all tiles."""

    rows: slice
    is_tiles: bool
    voxels: Doubles  # (n, 3) in index space; centres of tiles


@dataclass(kw_only=True)
class VolumeMaker:
    """Media and emission of one volume."""

    coefficients: Coefficients
    fields: dict[str, Field]
    instances: Doubles  # (N, 4, 4) world_from_group
    path: str
    ctx: Context
    material: str = ""  # path of the bound material
    camera: CameraVisibility = CameraVisibility.SEEN
    placed: list[tuple[Doubles, Field]] = field(default_factory=list)  # matrices of volumes, and the fields that they are of
    _masks: set[str] = field(default_factory=set)  # fields that say only where something is
    _invalid: int = field(default=0)  # values that were not finite

    def media(self) -> Iterator[VolumeMedium]:
        c = self.coefficients
        lobes = [Lobe(lobe.scattering, lobe.anisotropy) for lobe in c.lobes if lobe.scattering != BLACK]
        if not lobes and c.absorption == BLACK:
            return
        operands = [c.absorption, *(lobe.scattering for lobe in lobes)]
        forms = [self._form(operand) for operand in operands]
        if all(form is not None and _is_plain(form, self.fields, {1}) for form in forms):
            yield from self._exact([form for form in forms if form is not None], lobes)
        else:
            yield from self._baked(operands, lobes)

    def emissions(self) -> Iterator[VolumeEmission]:
        emission = self.coefficients.emission
        form = self._form(emission)
        if form is not None and _is_plain(form, self.fields, {1, 3}):
            for name, factor in form.factors.items():
                color = self._color(factor)
                if any(color):
                    found = self.fields[name]
                    yield VolumeEmission(
                        path=self.path, grid=found.grid, emission=color, matrices=self._placed(found), camera=self.camera
                    )
        elif emission != BLACK:
            domain, mask = self._domain([emission], "emission")
            grid = self._new_grid(domain, 3, "emission", lambda piece: self._values(emission, domain, piece, mask))
            color = self._color(np.ones(3))
            yield VolumeEmission(
                path=self.path, grid=grid, emission=color, matrices=self._placed(domain.base), camera=self.camera
            )
        self._note_invalid()

    def _form(self, operand: Operand) -> LinearForm | None:
        return linear_form(operand, self.coefficients.expressions.nodes, self.fields)

    def _color(self, factor: npt.ArrayLike) -> tuple[float, float, float]:
        r, g, b = (np.broadcast_to(factor, 3) * self.coefficients.per_scene_unit).tolist()
        return r, g, b

    def _placed(self, of: Field) -> Doubles:
        found = of.placed(self.instances)
        self.placed.append((found, of))
        return found

    def _exact(self, forms: Sequence[LinearForm], lobes: Sequence[Lobe]) -> Iterator[VolumeMedium]:
        """Yield media of the fields' own grids; `forms`: absorption, then the scattering of each lobe."""
        for name in dict.fromkeys(name for form in forms for name in form.factors):
            found = self.fields[name]
            left = np.broadcast_to(forms[0].factors.get(name, np.zeros(3)), 3)
            scattering: list[tuple[Doubles, Lobe | None]] = [
                (form.factors[name], lobe)
                for form, lobe in zip(forms[1:], lobes, strict=True)
                if np.any(form.factors.get(name, 0.0))
            ]
            for factor, lobe in scattering or [(np.zeros(3), None)]:
                extinction = left + factor
                left = np.zeros(3)
                if not extinction.any():
                    continue
                albedo = np.divide(np.broadcast_to(factor, 3), extinction, out=np.zeros(3), where=extinction > 0)
                yield VolumeMedium(
                    path=self.path,
                    grid=found.grid,
                    extinction=self._color(extinction),
                    albedo=_triple(albedo),
                    anisotropy=0.0 if lobe is None else self._anisotropy(lobe, found, None),
                    droplets=0.0 if lobe is None else self.coefficients.droplets,
                    matrices=self._placed(found),
                    material=self.material,
                    camera=self.camera,
                )

    def _anisotropy(self, lobe: Lobe, base: Field, domain: Domain | None) -> float:
        """Return the constant g of a lobe; where it varies its mean over the voxels, which is reported."""
        form = self._form(lobe.anisotropy)
        if form is not None and form.is_constant:
            value = float(form.constant[0])
        else:
            if domain is None:
                grid = base.grid
                domain = Domain(base, grid.leaf_origins, grid.tile_origins, grid.tile_sizes)
            total = weights = 0.0
            for piece in _pieces(domain):
                arrays = self._arrays(domain, piece)
                weight = arrays.of(lobe.scattering).mean(axis=1, keepdims=True)
                weight, own = np.broadcast_arrays(np.nan_to_num(weight), np.nan_to_num(arrays.of(lobe.anisotropy)))
                total, weights = total + float((weight * own).sum()), weights + float(weight.sum())
            value = total / weights if weights > 0 else 0.0
            message = f"The anisotropy varies, which is not supported: its mean, {value:.3g}, is used."
            self.ctx.warn("material-input", self.path, message)
        inside = min(max(value, -_LARGEST_ANISOTROPY), _LARGEST_ANISOTROPY)
        if inside != value:
            most = f"{_LARGEST_ANISOTROPY:g}"
            message = f"An anisotropy of {value:g} is outside of [-{most}, {most}]: {inside:g} is used."
            self.ctx.warn("out-of-range", self.path, message)
        return inside

    def _baked(self, operands: Sequence[Operand], lobes: Sequence[Lobe]) -> Iterator[VolumeMedium]:
        domain, mask = self._domain(operands, "extinction")
        absorption, *scatterings = operands
        for k in range(max(len(lobes), 1)):

            def coefficients(piece: Piece, k: int = k) -> tuple[Doubles, Doubles]:
                """Return extinction and scattering (n, 3)."""
                absorbed = self._values(absorption, domain, piece, mask) if k == 0 else 0.0
                scattered = self._values(scatterings[k], domain, piece, mask) if scatterings else np.zeros((1, 3))
                return absorbed + scattered, scattered

            g = self._anisotropy(lobes[k], domain.base, domain) if lobes else 0.0
            yield from self._media_of(coefficients, domain, g)
        self._note_invalid()

    def _media_of(
        self, coefficients: Callable[[Piece], tuple[Doubles, Doubles]], domain: Domain, anisotropy: float
    ) -> Iterator[VolumeMedium]:
        color, albedo, is_any = _common_colors(coefficients, domain)
        if not is_any:
            return
        albedos = None
        if albedo is None:
            albedos = self._new_grid(domain, 3, "albedo", lambda piece: _albedo(*coefficients(piece)))
        placed = self._placed(domain.base)
        for channel in range(3) if color is None else (None,):
            density = self._new_grid(
                domain,
                1,
                "extinction",
                lambda piece, c=channel: _one(coefficients(piece)[0], c),  # type: ignore[misc]
            )
            if density.support is None:
                continue
            factor = color if color is not None else np.eye(3)[channel or 0]
            yield VolumeMedium(
                path=self.path,
                grid=density,
                extinction=self._color(factor),
                albedo=(1.0, 1.0, 1.0) if albedo is None else _triple(albedo),
                albedo_grid=albedos,
                anisotropy=anisotropy,
                droplets=self.coefficients.droplets,
                matrices=placed,
                material=self.material,
                camera=self.camera,
            )

    def _domain(self, operands: Sequence[Operand], what: str) -> tuple[Domain, bool]:
        """Return where coefficients are evaluated, and whether only where that field is not 0: where they depend on none."""
        names = self._fields_read(operands)
        if not names:
            name = density_name(self.fields) or next(iter(self.fields))
            message = f"The {what} depends on no field: it applies where the field {name} is not 0."
            self.ctx.warn("material-input", self.path, message)
            self._masks.add(name)
            return domain_of([self.fields[name]]), True
        first = "density" if "density" in names else names[0]
        read = [self.fields[first], *(self.fields[name] for name in names if name != first)]
        if self.ctx.timing.is_open and not move_together([field.motion for field in read], self.ctx.timing):
            message = f"The fields of which its {what} is made move in different ways: it is what they make at the frame, "
            self.ctx.warn("motion", self.path, message + f"and moves with the field {first}.")
        return domain_of(read), False

    def absent_fields(self) -> list[str]:
        """Return the names that the shader reads and no field has, in order of use."""
        return [name for name in self._names_read(self._operands()) if field_named(self.fields, name) is None]

    def fields_read(self) -> set[str]:
        """Return the names of the fields on which media and emission depend."""
        return {*self._fields_read(self._operands()), *self._masks}

    def _operands(self) -> list[Operand]:
        c = self.coefficients
        lobes = [lobe for lobe in c.lobes if lobe.scattering != BLACK]
        return [c.absorption, *(o for lobe in lobes for o in (lobe.scattering, lobe.anisotropy)), c.emission]

    def _fields_read(self, operands: Sequence[Operand]) -> list[str]:
        """Return the names of the fields that operands depend on, in order of use."""
        found = (field_named(self.fields, name) for name in self._names_read(operands))
        return list(dict.fromkeys(one.name for one in found if one is not None))

    def _names_read(self, operands: Sequence[Operand]) -> list[str]:
        """Return the names by which operands read fields, whether or not there are such fields, in order of use."""
        nodes, seen = self.coefficients.expressions.nodes, set[int]()
        left = [operand.node for operand in operands if isinstance(operand, NodeOutput)]
        while left:
            number = left.pop()
            if number not in seen:
                seen.add(number)
                left += [v.node for _, v in nodes[number].inputs if isinstance(v, NodeOutput)]
        read = [dict(nodes[k].inputs).get("geomprop") for k in sorted(seen) if nodes[k].category == "geompropvalue"]
        return list(dict.fromkeys(str(name) for name in read))

    def _arrays(self, domain: Domain, piece: Piece) -> NodeArrays:
        nodes = self.coefficients.expressions.nodes
        values: dict[str, Doubles] = {}
        known: dict[str, Doubles] = {}
        for node in nodes:
            name = str(dict(node.inputs).get("geomprop")) if node.category == "geompropvalue" else ""
            found = field_named(self.fields, name) if name else None
            if found is not None and name not in values:
                if found.name not in known:
                    known[found.name] = _field_values(found, domain, piece)
                values[name] = known[found.name]
        return NodeArrays(nodes, values, self.ctx.rendering_space)

    def _values(self, operand: Operand, domain: Domain, piece: Piece, masked: bool) -> Doubles:
        """Return an operand's values (n, 3) at voxels, at least 0."""
        found = self._arrays(domain, piece).of(operand)
        found = np.broadcast_to(found, (len(piece.voxels), 3)).astype(np.float64)
        bad = ~np.isfinite(found)
        if bad.any():
            self._invalid += int(np.count_nonzero(bad.any(axis=1)))
            found[bad] = 0.0
        if masked:
            found *= _field_values(domain.base, domain, piece).any(axis=1, keepdims=True)
        return np.maximum(found, 0.0)

    def _new_grid(self, domain: Domain, width: int, name: str, values: Callable[[Piece], Doubles]) -> VolumeGrid:
        """Return a grid of new values (n, width) in single precision."""
        limit = self.ctx.settings.max_memory_bytes or machine_bytes() // 2
        if (size := domain.count * 4 * width) > limit:
            raise TooLargeError(f"its {name} needs {size / 1e6:,.0f} MB, and {limit / 1e6:,.0f} MB are allowed")
        shape = () if width == 1 else (width,)
        leaves = np.zeros((len(domain.leaf_origins), VOXELS, *shape), np.float32)
        tiles = np.zeros((len(domain.tile_origins), *shape), np.float32)
        for piece in _pieces(domain):
            made = np.broadcast_to(values(piece), (len(piece.voxels), width))
            if piece.is_tiles:
                tiles[:] = made.reshape(tiles.shape)
            else:
                leaves[piece.rows] = made.reshape(leaves[piece.rows].shape)
        return domain.grid(name, leaves, tiles)

    def _note_invalid(self) -> None:
        if self._invalid:
            message = f"Its shader gives {self._invalid:,} values that are not finite: they are read as 0."
            self.ctx.warn("volume-values", self.path, message)
            self._invalid = 0


def _is_plain(form: LinearForm, fields: dict[str, Field], widths: set[int]) -> bool:
    """Return whether a form is a sum of fields with these numbers a voxel, times factors that are not negative."""
    return (
        not form.constant.any()
        and all(fields[name].grid.width in widths and not fields[name].is_velocity for name in form.factors)
        and all((factor >= 0).all() for factor in form.factors.values())
    )


def _triple(values: Doubles) -> tuple[float, float, float]:
    r, g, b = np.broadcast_to(values, 3).tolist()
    return r, g, b


def _pieces(domain: Domain) -> Iterator[Piece]:
    for start in range(0, len(domain.leaf_origins), _ROWS):
        rows = slice(start, min(start + _ROWS, len(domain.leaf_origins)))
        voxels = (domain.leaf_origins[rows, None, :] + _VOXELS_OF_LEAF).reshape(-1, 3)
        yield Piece(rows, False, voxels.astype(np.float64))
    if len(domain.tile_origins):
        yield Piece(slice(None), True, domain.tile_origins + (domain.tile_sizes[:, None] - 1) / 2)


def _field_values(field: Field, domain: Domain, piece: Piece) -> Doubles:
    """Return a field's values (n, width) at voxels of a domain."""
    grid = field.grid
    shape = (len(piece.voxels), grid.width)
    if _is_alike(field, domain):
        own = grid.tile_values if piece.is_tiles else grid.leaf_values[piece.rows]
        return own.reshape(shape).astype(np.float64)
    if shares_space(field, domain.base) and not piece.is_tiles:
        return grid.values_at(piece.voxels.astype(np.int64)).reshape(shape).astype(np.float64)
    index_from_base = np.linalg.inv(field.group_from_index) @ domain.base.group_from_index
    points = piece.voxels @ index_from_base[:3, :3].T + index_from_base[:3, 3]
    return grid.sample(points).reshape(shape)


def _is_alike(field: Field, domain: Domain) -> bool:
    """Return whether a field has the leaves and tiles of a domain."""
    grid = field.grid
    return shares_space(field, domain.base) and (
        np.array_equal(grid.leaf_origins, domain.leaf_origins)
        and np.array_equal(grid.tile_origins, domain.tile_origins)
        and np.array_equal(grid.tile_sizes, domain.tile_sizes)
    )


def shares_space(a: Field, b: Field) -> bool:
    return a is b or bool(np.allclose(a.group_from_index, b.group_from_index, rtol=1e-9, atol=0.0))


def domain_of(fields: Sequence[Field]) -> Domain:
    """Return the leaves and tiles of the first field, with those of others on its index space.

    Where other fields may vary within a tile, tiles become leaves.
    """
    base = fields[0]
    grid = base.grid
    plain = Domain(base, grid.leaf_origins, grid.tile_origins, grid.tile_sizes)
    if all(_is_alike(field, plain) for field in fields):
        return plain
    together = [field.grid for field in fields if shares_space(field, base)]
    origins = [own.leaf_origins for own in together]
    for own in together:
        sizes = own.tile_sizes.astype(np.int64)
        if int(((sizes // LEAF) ** 3).sum()) > _MOST_TILE_LEAVES:
            raise TooLargeError(f"the tiles of its grid {own.name!r} would become too many voxels")
        for origin, size in zip(own.tile_origins, sizes.tolist(), strict=True):
            steps = np.arange(0, size, LEAF)
            origins.append(origin + np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3))
    every = np.unique(np.concatenate(origins).astype(np.int32), axis=0)
    return Domain(base, every, np.zeros((0, 3), np.int32), np.zeros(0, np.int32))


def _common_colors(
    coefficients: Callable[[Piece], tuple[Doubles, Doubles]], domain: Domain
) -> tuple[Doubles | None, Doubles | None, bool]:
    """Return the colour of all voxels' extinction with a largest channel of 1, their albedo, and whether there is any.

    None where it varies.
    """
    color = albedo = None
    varies = [False, False]
    for piece in _pieces(domain):
        extinction, scattering = coefficients(piece)
        largest = extinction.max(axis=1, keepdims=True)
        there = np.flatnonzero(largest[:, 0] > 0)
        if not len(there):
            continue
        own = _albedo(extinction, scattering)
        if color is None or albedo is None:
            first = there[np.argmax(largest[there, 0])]
            color, albedo = extinction[first] / largest[first], own[first]
        varies[0] |= bool((np.abs(extinction - largest * color) > _ALIKE * largest).any())
        varies[1] |= bool((np.abs(own - albedo) * (extinction > 0) > _ALIKE).any())
    return None if varies[0] else color, None if varies[1] else albedo, color is not None


def _albedo(extinction: Doubles, scattering: Doubles) -> Doubles:
    return np.divide(
        np.broadcast_to(scattering, extinction.shape), extinction, out=np.zeros(extinction.shape), where=extinction > 0
    )


def _one(extinction: Doubles, channel: int | None) -> Doubles:
    """Return one channel (n, 1) of extinctions, their largest if `channel` is None."""
    return extinction.max(axis=1, keepdims=True) if channel is None else extinction[:, channel][:, None]
