"""Maps of heights: read from files, generated from a spectrum, levelled and smoothed.

A map is an `xarray.DataArray` of heights in m over ``x`` and ``y``; its attribute
``note`` records what was done to it.
"""

from __future__ import annotations

import io
import math
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import ArrayLike
from scipy import fft

from stickslip.arrays import Array
from stickslip.errors import SMALLEST, InputError, instance, refused, shown, whole
from stickslip.io import files
from stickslip.io.table_files import DAMAGED
from stickslip.io.table_text import as_utf8, find_layout
from stickslip.model.quantities import read_value
from stickslip.surface.halfspace import wave_numbers
from stickslip.words import engineering, percent

Length = float | str
"""A length in m, or a text with its unit."""

LARGEST_FILE = 1_000_000_000  # bytes
FEWEST_NODES = 32  # along an axis
_ALIKE = 1e-3  # relative difference up to which two spacings are taken for equal
_BEGINS_ROW = re.compile(r'\s*"?(?:[-+.\d]|nan\b)', re.I)
_HEADER = re.compile(
    r'[#\s"]*(?:([^\W\d][\w ]*?)["\s]*[:=;,\t]|([^\W\d]\w*)\s)[\s"]*(.+?)["\s;,]*'
)
_NAMES = {
    "width": "width",
    "height": "depth",
    "value units": "unit",
    "unit": "unit",
    "units": "unit",
    "spacing": "spacing",
    "cellsize": "spacing",
    "nodata_value": "hole",
    "xy calibration": "spacing",
    "breite": "width",
    "höhe": "depth",
    "werteinheiten": "unit",
}
"""Keys of headers that Gwyddion and geographic information systems write."""


def length_of(place: str, value: Length) -> float:
    """Return a length in m, given as a number or as a text with a unit."""
    return read_value(place, value, "m", "0.5 um")


def as_map(height: Array, spacing: ArrayLike) -> xr.DataArray:
    """Return heights in m as a map with coordinates. Several spacings may be given.

    Raises `InputError` if the heights are too few, the same everywhere, or have holes,
    or if the spacings differ.
    """
    try:
        given = np.asarray(height)
    except ValueError:  # rows of different lengths
        given = np.asarray("")
    if given.dtype.kind not in "fiu":
        raise refused("height", height, "must be an array of real numbers")
    values = given.astype(float)
    if values.ndim != 2 or min(values.shape) < FEWEST_NODES:
        raise InputError(
            f"height: has the shape {shown(values.shape)}; must have two dimensions of "
            f"{FEWEST_NODES} nodes or more"
        )
    if holes := int(np.count_nonzero(~np.isfinite(values))):
        raise InputError(
            f"height: {holes} nodes ({percent(holes / values.size)}) have no height; "
            "fill these holes where the map was made, or cut out a part without holes"
        )
    steps = np.ravel(spacing).astype(float)
    shortest, longest = float(steps.min()), float(steps.max())
    if longest > (1.0 + _ALIKE) * shortest:
        raise InputError(
            f"spacing: {engineering(shortest, 'm')} and {engineering(longest, 'm')}: "
            "pixels must be square; resample the map to one spacing"
        )
    if np.ptp(values) < SMALLEST:
        raise InputError("height: is the same everywhere; a rough surface is needed")
    found = xr.DataArray(values, dims=("x", "y"), name="height")
    for name, size in zip("xy", values.shape, strict=True):
        along = float(steps[0]) * np.arange(size)
        found[name] = (name, along, {"units": "m", "long_name": name})
    return found.assign_attrs(units="m", long_name="height", note="")


def spacing_of(height: xr.DataArray) -> float:
    """Return the spacing of the nodes of a map, in m."""
    return float(height["x"][1] - height["x"][0])


def levelled(height: xr.DataArray) -> xr.DataArray:
    """Return a map without its mean height and, if that makes its opposite edges agree
    better, without its tilt; the note records it.
    """
    flat = height.to_numpy() - float(height.mean())
    x, y = (np.arange(n) - (n - 1) / 2.0 for n in flat.shape)
    along = float(np.polyfit(x, flat.mean(axis=1), 1)[0])
    across = float(np.polyfit(y, flat.mean(axis=0), 1)[0])
    plane = np.add.outer(along * x, across * y)
    if _mismatch(flat - plane) >= _mismatch(flat):
        return height.copy(data=flat)
    tilt = math.hypot(along, across) / spacing_of(height)
    notes = height.attrs.get("note", ""), f"a tilt of {1e3 * tilt:.3g} mrad was removed"
    note = "; ".join(filter(None, notes))
    return height.copy(data=flat - plane).assign_attrs(note=note)


def _mismatch(values: Array) -> float:
    """Return the sum of the squared differences between opposite edges of a map."""
    jumps = values[0] - values[-1], values[:, 0] - values[:, -1]
    return sum(float((jump**2).sum()) for jump in jumps)


def low_pass(height: xr.DataArray, length: Length) -> xr.DataArray:
    """Return a map without the waves shorter than a length.

    Raises `InputError` if the length is not positive, or longer than the map.

    Examples
    --------
    >>> rough = ss.surface.self_affine(
    ...     rq="1 um", hurst=0.8, roll_off="40 um", cut_off="5 um", nodes=64
    ... )
    >>> float(ss.surface.low_pass(rough, "10 um").std() < rough.std())
    1.0
    """
    instance("height", height, xr.DataArray, "a map, as surface.read returns it")
    shortest = length_of("length", length)
    if shortest > min(height.shape) * spacing_of(height):
        raise refused("length", length, "is longer than the map; give a shorter one")
    values = height.to_numpy()
    wave = np.hypot(*wave_numbers(values.shape, spacing_of(height)))
    kept = fft.rfft2(values) * (wave <= 2.0 * np.pi / shortest)
    return height.copy(data=fft.irfft2(kept, s=values.shape))


def mean_waves(height: xr.DataArray) -> tuple[float, float]:
    """Return the mean wavelengths (m) of the heights of a map and of its short waves:
    ``2 pi`` times the ratios of rms height to slope and of rms slope to curvature.
    """
    values = height.to_numpy()
    wave = np.hypot(*wave_numbers(values.shape, spacing_of(height)))
    power = np.abs(fft.rfft2(values)) ** 2
    power[0, 0] = 0.0
    heights, slopes, curvatures = (float((power * wave**n).sum()) for n in (0, 2, 4))
    return (
        2.0 * math.pi * math.sqrt(heights / slopes),
        2.0 * math.pi * math.sqrt(slopes / curvatures),
    )


def correlation_length(height: xr.DataArray) -> float:
    """Return the correlation length of heights, in m: the distance at which their
    autocorrelation, averaged over both axes, has fallen to 0.2, as for Sal of ISO
    25178-2.
    """
    values = height.to_numpy()
    power = np.abs(fft.rfft2(values - values.mean())) ** 2
    alike = fft.irfft2(power, s=values.shape)
    half = min(values.shape) // 2
    mean = 0.5 * (alike[:half, 0] + alike[0, :half])
    return spacing_of(height) * float(np.argmax(mean < 0.2 * alike[0, 0]))


def self_affine(
    *,
    rq: Length,
    hurst: float,
    roll_off: Length,
    cut_off: Length,
    nodes: int = 512,
    seed: int = 1,
) -> xr.DataArray:
    """Return a random map with a spectrum that is flat for waves longer than `roll_off`
    and falls as ``q^(-2 (1 + hurst))`` down to the wave `cut_off`, of 8 nodes.

    Parameters
    ----------
    rq : float or str
        Root mean square of the heights, in m or with a unit.
    hurst : float
        Exponent of the roughness, above 0 and at most 1.
    roll_off, cut_off : float or str
        Longest and shortest wave of the roughness, in m or with a unit.
    nodes : int
        Number of nodes along each axis.
    seed : int
        Seed of the random heights.

    Raises
    ------
    InputError
        If a number is out of range, or the map is too small for the longest wave.

    Examples
    --------
    >>> rough = ss.surface.self_affine(
    ...     rq="1 um", hurst=0.8, roll_off="40 um", cut_off="5 um", nodes=64
    ... )
    >>> round(1e6 * float(rough.std()), 6)
    1.0
    """
    rms, long, short = (
        length_of(name, value)
        for name, value in (("rq", rq), ("roll_off", roll_off), ("cut_off", cut_off))
    )
    n = whole("nodes", nodes, at_least=FEWEST_NODES, at_most=4096)
    start = whole("seed", seed, at_least=0)
    spacing = short / 8.0
    exponent = read_value("hurst", hurst, "1", "0.8")
    if exponent > 1.0:
        raise refused("hurst", hurst, "must be at most 1")
    if not short < long <= n * spacing:
        raise InputError(
            f"roll_off = {engineering(long, 'm')}: must lie between cut_off and the "
            f"size of the map, {engineering(n * spacing, 'm')}; take more nodes"
        )
    wave = np.hypot(*wave_numbers((n, n), spacing)) / (2.0 * np.pi)
    amplitude = np.maximum(wave * long, 1.0) ** (-1.0 - exponent)
    amplitude[(wave > 1.0 / short) | (wave == 0.0)] = 0.0
    noise = np.random.default_rng(start).standard_normal((n, n))
    values = fft.irfft2(amplitude * fft.rfft2(noise), s=(n, n))
    return as_map(values * (rms / values.std()), spacing)


_CUT_OFFS = {2e-8: 8e-5, 1e-7: 2.5e-4, 2e-6: 8e-4, 1e-5: 2.5e-3, math.inf: 8e-3}
"""Cut-off length of a profile, by the largest Ra for which it is used (ISO 4288). RSm
is between a sixth of the cut-off and half of it.
"""


def from_drawing(
    *,
    ra: Length,
    rsm: Length | None = None,
    nodes: int = 512,
    seed: int = 1,
) -> xr.DataArray:
    """Return a random map of a surface that is specified in a drawing: Gaussian heights
    with ``Rq = 1.25 Ra``, waves from RSm down to a sixteenth of it, Hurst exponent 0.8.

    Two numbers leave much uncertain, as the note says. By default, RSm is the middle of
    the range for which ISO 4288 uses the cut-off of this Ra.

    Raises `InputError` if a number is out of range.

    Examples
    --------
    >>> drawn = ss.surface.from_drawing(ra="0.8 um", rsm="0.1 mm", nodes=128)
    >>> round(1e6 * float(drawn.std()), 3)
    1.003
    """
    roughness = length_of("ra", ra)
    usual = next(
        cut for most, cut in _CUT_OFFS.items() if roughness <= most
    ) / math.sqrt(12.0)
    long = usual if rsm is None else length_of("rsm", rsm)
    found = self_affine(
        rq=math.sqrt(math.pi / 2.0) * roughness,
        hurst=0.8,
        roll_off=long,
        cut_off=long / 16.0,
        nodes=nodes,
        seed=seed,
    )
    factors = (1.6, 6.6) if rsm is None else (2.0, 4.0)
    note = (
        f"from a drawing, with waves from {engineering(long, 'm', 3)} down: the "
        "stiffness of its contacts is known within a factor {:g}, their diameters "
        "within {:g}"
    )
    return found.assign_attrs(note=note.format(*factors), factor=max(factors))


def read(
    file: Any,
    *,
    unit: str | None = None,
    spacing: Length | None = None,
) -> xr.DataArray:
    """Read a map of heights.

    Parameters
    ----------
    file : path or object
        ``.npz`` (with an array ``height`` and, optionally, ``spacing`` and ``unit``),
        ``.csv`` or ``.asc`` (rows of numbers; a header may give width and height of the
        map, value units, spacing). Other files need SurfaceTopography; a topography of
        that package is also accepted.
    unit : str, optional
        Unit of the heights, ``"um"``; needed unless the file gives it.
    spacing : float or str, optional
        Distance between nodes, in m or with a unit; needed unless the file gives it.

    Raises
    ------
    InputError
        If the file cannot be read, has holes, no unit of heights or no spacing, or
        pixels that are not square.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "map.npz"
    >>> np.savez(file, height=np.random.default_rng(1).normal(size=(64, 64)))
    >>> ss.surface.read(file, unit="um", spacing="2 um").sizes["x"]
    64
    """
    if not isinstance(file, (str, os.PathLike)):
        return _of_topography(file, "topography")
    path = Path(file)
    files.size(path, "map of heights", largest=LARGEST_FILE)
    files.begin(path, 1)
    readers = {".npz": _arrays, ".csv": _rows, ".asc": _rows, ".txt": _rows}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        return _of_topography(_topography_in(path), path.name)
    try:
        values, about = reader(path)
    except InputError:
        raise
    except (OSError, ValueError, KeyError, *DAMAGED) as error:
        raise InputError(
            f"{path}: cannot be read as a map of heights ({error}); write rows of "
            "numbers, or numpy.savez(file, height=..., spacing=..., unit='um')"
        ) from None
    if spacing is not None:
        about |= {"spacing": spacing}
    unit = unit or about.get("unit")
    if unit is None:
        raise InputError(
            f"{path}: the unit of the heights is missing; give it: --unit um, or "
            "read(file, unit='um')"
        )
    size = length_of("unit", f"1 {unit}")
    return _sized(path, size * values, about)


def _sized(path: Path, values: Array, about: dict[str, Any]) -> xr.DataArray:
    """Return the map with the given spacing, or that from the size of the map."""
    if "spacing" in about:
        steps: Any = length_of("spacing", about["spacing"])
    elif "width" in about and values.ndim == 2:
        size = about["width"], about.get("depth", about["width"])
        across, down = (length_of("width", each) for each in size)
        steps = down / values.shape[0], across / values.shape[1]
    else:
        raise InputError(
            f"{path}: the spacing of the nodes is missing; give it: --spacing '0.5 um' "
            "or read(file, spacing='0.5 um')"
        )
    return as_map(values, steps)


def _arrays(path: Path) -> tuple[Array, dict[str, Any]]:
    """Return the heights in an archive of arrays, and its single numbers and texts."""
    raw = files.read(path, "map of heights", largest=LARGEST_FILE)
    with np.load(io.BytesIO(raw)) as archive:
        names = archive.files
        flat = [name for name in names if archive[name].ndim == 2]
        chosen = "height" if "height" in names else flat[0] if len(flat) == 1 else ""
        if not chosen:
            raise InputError(
                f"{path}: holds {shown(names)}; the heights must be called 'height'"
            )
        about = {
            name: archive[name].item() for name in names if archive[name].ndim == 0
        }
        return np.asarray(archive[chosen], dtype=float), about


def _rows(path: Path) -> tuple[Array, dict[str, Any]]:
    """Return the heights in rows of numbers, and the values in the header above."""
    text = as_utf8(files.read(path, "map of heights", largest=LARGEST_FILE)).decode()
    lines = [line for line in text.splitlines() if line.strip()]
    rows = (i for i, line in enumerate(lines) if _BEGINS_ROW.match(line))
    begin = next(rows, None)
    if begin is None:
        raise ValueError("it has no rows of numbers")
    about = _header(lines[:begin])
    layout = find_layout(lines[begin : begin + FEWEST_NODES])
    is_blank = layout.mark.isspace() and layout.mark != "\t"
    cells = pd.read_csv(
        io.StringIO("\n".join(lines[begin:])),
        sep=r"\s+" if is_blank else layout.mark,
        decimal="," if layout.comma else ".",
        header=None,
    )
    values = np.array(cells.apply(pd.to_numeric, errors="coerce"), dtype=float)
    if np.isnan(values[:, -1]).all():  # each row ends with a separator
        values = values[:, :-1]
    _refuse_other_tables(path, values)
    if "hole" in about:
        values[values == float(about.pop("hole"))] = np.nan
    return values, about


def _header(lines: list[str]) -> dict[str, str]:
    """Return the values in the lines of a header, by the keys that are known here."""
    about = {}
    for line in lines:
        found = _HEADER.fullmatch(line)
        if found and (key := _NAMES.get((found[1] or found[2]).lower())):
            value = re.sub(r'["\t;]+,?["\t;]*', " ", found[3]).replace(",", ".")
            about[key] = value.strip().removesuffix("/pixel")
    return about


def _refuse_other_tables(path: Path, values: Array) -> None:
    """Refuse rows of points or of a profile, and heights beside their coordinates."""
    rows, columns = values.shape
    if columns <= 3 and rows >= FEWEST_NODES:
        raise InputError(
            f"{path}: {rows} rows of {columns} numbers are points or a profile; export "
            "a map, each row with the heights along one line"
        )
    for name, edge in (("column", values[:, 0]), ("row", values[0])):
        steps = np.diff(edge)
        if np.ptp(steps) < _ALIKE * abs(steps.mean()):
            raise InputError(
                f"{path}: the first {name} rises evenly, as coordinates do: leave it "
                "out, and give --spacing"
            )


def _topography_in(path: Path) -> Any:
    """Return the topography in a file of an instrument, read by SurfaceTopography."""
    try:
        import SurfaceTopography
    except ImportError:
        raise InputError(
            f"{path}: is no .npz, .csv or .asc; pip install 'stickslip[surface]' reads "
            "files of instruments, or export the map as rows of numbers"
        ) from None
    return SurfaceTopography.read_topography(str(path))


def _of_topography(topography: Any, place: str) -> xr.DataArray:
    """Return the map of a topography of SurfaceTopography, in m."""
    try:
        given: Any = np.ma.asarray(topography.heights(), dtype=float)
        values = np.ma.filled(given, np.nan)
        steps = topography.pixel_size
        unit = topography.unit
    except AttributeError:
        raise refused(
            place,
            topography,
            "must be a file or a topography of SurfaceTopography",
        ) from None
    if unit is None:
        raise InputError(f"{place}: the unit of the heights is missing")
    size = length_of("unit", f"1 {unit}")
    return as_map(size * values, tuple(size * s for s in steps))
