"""What a case is made of, as a digest: code, records and values in, the same text everywhere and always out.

A finished case is found again by this digest alone, so two rules hold. Equal content gives equal digests in
every process (no ``hash``, no addresses, no order of sets). What cannot be read with certainty is refused,
not guessed.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import hashlib
import inspect
import pickle
import struct
import textwrap
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import PurePath

import numpy as np

from stickslip.errors import InputError

AxisValue = float | int | bool | str


def digest(content: bytes) -> str:
    """Return the digest of some content: 32 hexadecimal digits."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def encode(value: object, place: str = "the value") -> bytes:
    """Return bytes that are equal for equal content and differ for different content.

    Parameters
    ----------
    value : object
        Numbers, text, containers, arrays, records (dataclasses), functions, or anything that can be pickled.
    place : str
        Where the value stands, for the message.

    Raises
    ------
    InputError
        If the content cannot be read.
    """
    plain = _plain(value)
    if plain is not None:
        return plain
    match value:
        case types.FunctionType() | types.MethodType() | functools.partial():
            return _joined(b"code", [f"{k}={v}".encode() for k, v in sorted(code_parts(value).items())])
        case types.BuiltinFunctionType() | type():
            return _tagged(b"name", f"{value.__module__}.{value.__qualname__}".encode())
    inner = getattr(value, "py_func", None)  # a function compiled by numba
    if isinstance(inner, types.FunctionType):
        return encode(inner, place)
    try:
        return _tagged(b"pickle", pickle.dumps(value, protocol=5))
    except Exception as error:
        raise InputError(
            f"{place} = {value!r}: its content cannot be read ({error}), so a finished case could not be "
            "told from a changed one; use numbers, text, arrays or frozen records"
        ) from None


def code_parts(function: Callable[..., object]) -> dict[str, str]:
    """Digests of all that decides what a function returns, by name: a message can say which has changed.

    The parts are the source, default and bound arguments, the functions of the same module that it calls, and
    the plain values (numbers, text, arrays, records) that it reads from its module or its surroundings. Code
    of other modules is not followed: the version of this package is part of every sweep, the rest is for
    ``fingerprint``.
    """
    return {name: digest(content) for name, content in _parts(function, "code", set())}


def axis_encodings(axes: Mapping[str, Sequence[AxisValue]]) -> dict[str, list[bytes]]:
    """Encode every value of every axis, axes sorted by name: content does not depend on their order."""
    return {name: [_cell(name, value) for value in axes[name]] for name in sorted(axes)}


def cell_content(values: Mapping[str, AxisValue]) -> bytes:
    """Return the content of one case: names and values of its axes, in an order of its own."""
    return b"".join([_cell(name, values[name]) for name in sorted(values)])


def _cell(name: str, value: AxisValue) -> bytes:
    """Encode one axis of one case; this runs for every case, so numbers take a short cut to the same bytes."""
    if type(value) is float:
        content = b"float:8:%b;" % struct.pack("<d", value)
    elif type(value) is int:
        digits = b"%d" % value
        content = b"int:%d:%b;" % (len(digits), digits)
    else:
        content = encode(value)
    label = name.encode()
    return _tagged(b"cell", b":%d:%b;:%d:%b;" % (len(label), label, len(content), content))


def identity_digest(identity: Mapping[str, str]) -> bytes:
    """Digest of what a sweep is, for `cell_key`."""
    return digest("".join(f"{part}={value};" for part, value in sorted(identity.items())).encode()).encode()


def cell_key(identity: bytes, content: bytes) -> int:
    """Key of one finished case, from what the sweep is and where the case stands: 64 bits, never 0.

    `identity` is a digest, at most 64 bytes.
    """
    return int.from_bytes(hashlib.blake2b(content, digest_size=8, key=identity).digest(), "little") or 1


def cell_seed(seed: int, values: Mapping[str, AxisValue]) -> int:
    """Seed of one case, from the sweep's `SeedSequence` and the content of the case alone: 63 bits.

    It is the same for any number of workers, any executor, any batch, any order of the axes, and in a sweep
    over more values of the same axes. The children that ``SeedSequence.spawn`` numbers are told apart by a keyed
    hash of their content instead, since numbers would change with the axes.
    """
    content = hashlib.blake2b(cell_content(values), digest_size=8, key=_root(seed)).digest()
    return int.from_bytes(content, "little") >> 1


@functools.lru_cache(maxsize=16)
def _root(seed: int) -> bytes:
    return np.random.SeedSequence(seed).generate_state(16, np.uint32).astype("<u4").tobytes()


def _plain(value: object) -> bytes | None:
    """Encode values that are their own content; None for all others."""
    match value:
        case None:
            return b"none;"
        case enum.Enum():
            return _tagged(b"enum", f"{type(value).__qualname__}.{value.name}".encode())
        case bool():
            return b"true;" if value else b"false;"
        case np.generic():
            return _plain(value.item())
        case int():
            return _tagged(b"int", str(value).encode())
        case float():
            return _tagged(b"float", struct.pack("<d", value))
        case complex():
            return _tagged(b"complex", struct.pack("<dd", value.real, value.imag))
        case str():
            return _tagged(b"str", value.encode())
        case bytes():
            return _tagged(b"bytes", value)
        case PurePath():
            return _tagged(b"path", str(value).encode())
        case np.ndarray() if value.dtype != object:
            head = f"{value.dtype.str}{value.shape}".encode()
            return _joined(b"array", [head, np.ascontiguousarray(value).tobytes()])
        case tuple() | list():
            return _joined(type(value).__name__.encode(), [encode(item) for item in value])
        case set() | frozenset():
            return _joined(b"set", sorted(encode(item) for item in value))
        case dict() if type(value) is dict:  # a Counter or a defaultdict is filled by the code, not read
            pairs = [_joined(b"item", [encode(key), encode(item)]) for key, item in value.items()]
            return _joined(b"dict", sorted(pairs))
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = [
            _joined(b"item", [field.name.encode(), encode(getattr(value, field.name))])
            for field in dataclasses.fields(value)
        ]
        return _joined(b"record " + type(value).__qualname__.encode(), fields)
    return None


def _tagged(tag: bytes, content: bytes) -> bytes:
    return b"%s:%d:%s;" % (tag, len(content), content)


def _joined(tag: bytes, items: list[bytes]) -> bytes:
    return _tagged(tag, b"".join(_tagged(b"", item) for item in items))


def _parts(value: object, name: str, seen: set[object]) -> Iterator[tuple[str, bytes]]:
    value = getattr(value, "py_func", value)
    match value:
        case functools.partial():
            yield f"{name}: bound arguments", encode((value.args, dict(value.keywords)), name)
            yield from _parts(value.func, name, seen)
        case types.MethodType():
            yield f"{name}: its object", encode(value.__self__, name)
            yield from _parts(value.__func__, name, seen)
        case types.FunctionType():
            if value.__code__ not in seen:
                seen.add(value.__code__)
                yield from _function_parts(value, name, seen)
        case types.BuiltinFunctionType() | type():
            yield name, encode(value, name)
        case _ if callable(value):
            yield f"{name}: its object", encode(value, name)
            yield f"{name}: its class", _source(type(value))
            method = inspect.getattr_static(type(value), "__call__", None)
            if isinstance(method, types.FunctionType):
                yield from _parts(method, f"{name}: {type(value).__qualname__}", seen)


def _function_parts(function: types.FunctionType, name: str, seen: set[object]) -> Iterator[tuple[str, bytes]]:
    yield name, _source(function)
    yield f"{name}: defaults", encode((function.__defaults__, function.__kwdefaults__), name)
    wrapped = getattr(function, "__wrapped__", None)
    if wrapped is not None:
        yield from _parts(wrapped, f"{name}: wrapped", seen)
    surroundings = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
    for inner, cell in surroundings.items():
        try:
            yield from _name_parts(function, inner, cell.cell_contents, name, seen)
        except ValueError:  # not bound yet
            continue
    for inner in sorted(_names(function.__code__)):
        if inner in function.__globals__:
            yield from _name_parts(function, inner, function.__globals__[inner], name, seen)


def _name_parts(
    function: types.FunctionType, inner: str, value: object, name: str, seen: set[object]
) -> Iterator[tuple[str, bytes]]:
    """Parts of what a function reads by name: functions and classes of its own module, and plain values."""
    plain_function = getattr(value, "py_func", value)
    if isinstance(plain_function, types.FunctionType):
        if plain_function.__module__ == function.__module__:
            yield from _parts(plain_function, f"{name}: {inner}", seen)
    elif isinstance(value, type):
        if value.__module__ == function.__module__ and value not in seen:
            seen.add(value)
            yield f"{name}: {inner}", _source(value)
    else:
        content = _quietly_plain(value)
        if content is not None:
            yield f"{name}: {inner}", content


def _quietly_plain(value: object) -> bytes | None:
    # A list that holds an open file is somebody's log, not a parameter.
    try:
        return _plain(value)
    except InputError:
        return None


def _names(code: types.CodeType) -> set[str]:
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names |= _names(constant)
    return names


def _source(value: types.FunctionType | type) -> bytes:
    try:
        return textwrap.dedent(inspect.getsource(value)).encode()
    except (OSError, TypeError):  # typed at a prompt
        return _bytecode(value.__code__) if isinstance(value, types.FunctionType) else encode(value.__qualname__)


def _bytecode(code: types.CodeType) -> bytes:
    constants = [
        _bytecode(item) if isinstance(item, types.CodeType) else repr(item).encode() for item in code.co_consts
    ]
    return _joined(b"bytecode", [code.co_code, " ".join(code.co_names).encode(), *constants])
