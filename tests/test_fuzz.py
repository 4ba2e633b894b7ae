"""Any input gives an answer or a refusal of one line, in seconds.

Never another exception, a warning or a page of text. The quick run takes a few
examples, the slow one a thousand, always the same; `make fuzz` takes others.
"""

import inspect
import json
import os
import re
import time
import tomllib
from dataclasses import is_dataclass, replace
from functools import cache
from pathlib import Path
from pydoc import locate

import numpy as np
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mechanisms import MECHANISMS, TENTH, interface_with

import stickslip as ss
from stickslip import surface, sweep
from stickslip.errors import LONGEST_MESSAGE, UndecidedError
from stickslip.explorer import documents, simulate
from stickslip.io import rig_files
from stickslip.simulation import estimate
from stickslip.structures import export, state_space
from stickslip.sweep import NamedStudy, run_study, status_of

OTHERS = "FUZZ_EXAMPLES" in os.environ
EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "25"))
LONGEST = 10.0
"""CPU seconds that one example may take."""
WORTH = 0.5
"""Seconds; runs that would take longer are not made here."""

EDGES = [0, -1, 1, 1e-300, 5e-324, 1e300, 1e25, 1e-25, 1e12, 1e-12, 1e-4, 10**400]
USUAL_NUMBERS = [-0.0, 0.1, 2.5, 40]
NUMBERS = st.one_of(
    st.sampled_from([*EDGES, *USUAL_NUMBERS]), st.floats(), st.integers(), st.booleans()
)
UNITS = ["N/m", "um", "mm/s", "ms", "g", "N", "m", "s", "1/s", "kg", "µm", "", "²"]
QUANTITIES = st.builds(
    "{} {}".format, NUMBERS, st.sampled_from([*UNITS, "furlong", "N m"])
)
FACTORS = [1e-12, 1e-6, 1e-3, 0.1, -1, 10, 1e3, 1e6, 1e12]
WORDS = ["never", "contacts", "master equation", "gaussian", "SI", "natural"]
TEXTS = st.one_of(
    st.text(max_size=12),
    QUANTITIES,
    st.sampled_from([*WORDS, "9**9**9 N/m", "4,0 MN/m"]),
    st.integers(1, 100_000).map("x".__mul__),
)
VALUES = st.recursive(
    st.one_of(NUMBERS, TEXTS),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=6), inner, max_size=3)
    ),
    max_leaves=6,
)
PLAIN = VALUES | st.none() | st.just(b"1") | st.just(1j) | st.just(object())


@cache
def documents_to_begin_with():
    small = rig_files.to_document(RIG)
    to_and_fro = {"start": 1.0, "end": -1.0, "duration": 2.0}
    pieces = small | {"drive": {"pieces": [to_and_fro]}}
    speeds = small | {"drive": {"velocity": {"from": 0.5, "to": 2.0}}}
    speeds["feasible"] = {"stiffness": [1.0, 4.0]}
    interfaces = [interface_with(fields) for fields in MECHANISMS.values()]
    mechanisms = [rig_files.to_document(replace(RIG, interface=i)) for i in interfaces]
    examples = map(rig_files.example_file, rig_files.example_names())
    shipped = [tomllib.loads(file.read_text()) for file in examples]
    return [small, speeds, pieces, rig_files.to_document(CHAIN), *mechanisms, *shipped]


def paths(node, at=()):
    for key, value in node.items():
        yield (*at, key)
        if isinstance(value, dict):
            yield from paths(value, (*at, key))


@st.composite
def rigs(draw):
    """The content of a rig file with values changed, removed or added."""
    document = json.loads(json.dumps(draw(st.sampled_from(documents_to_begin_with()))))
    for _ in range(draw(st.integers(0, 3))):
        *where, last = draw(st.sampled_from(list(paths(document))))
        node = document
        for key in where:
            node = node[key]
        match draw(st.integers(0, 5)):
            case 0:
                del node[last]
            case 1:
                node[draw(st.text(min_size=1, max_size=8))] = draw(VALUES)
            case 2 if isinstance(node[last], (int, float)) and abs(node[last]) < 1e300:
                node[last] = node[last] * draw(st.sampled_from(FACTORS))
            case _:
                node[last] = draw(VALUES)
        if not any(True for _ in paths(document)):
            break
    return document


def with_a_rig_file(document, tmp_path):
    place = tmp_path / "rig.toml"
    try:
        place.write_text(tomli_w.dumps(document))
    except (UnicodeEncodeError, ValueError):
        return  # no file can contain it
    rig = ss.read_rig(place)
    if estimate(rig).seconds < WORTH:
        ss.regime(ss.simulate(rig))


def with_the_text_of_a_rig_file(changes, tmp_path):
    text = tomli_w.dumps(documents_to_begin_with()[0]).encode()
    for at, what in changes:
        at = int(at * len(text))
        text = text[:at] + what + text[at + 1 :]
    place = tmp_path / "rig.toml"
    place.write_bytes(text)
    estimate(ss.read_rig(place))


ODD_CELLS = ["", "nan", "1,5", "1.2 N", "950 mN", "time", "#", "²", "12:30:00", "-"]
CELLS = st.one_of(NUMBERS.map(str), st.sampled_from(ODD_CELLS))
HEADERS = ["", "time,force\n", "Time,Force\ns,N\n", "t [s];F [N]\n", "[section]\n"]


@st.composite
def traces(draw):
    """A measured sawtooth with the faults that loggers add, and some that none adds."""
    separator = draw(st.sampled_from([",", ";", "\t", " ", ", "]))
    count = draw(st.sampled_from([0, 1, 3, 40, 400]))
    size = draw(st.sampled_from([1.0, 1e-9, 1e9, 1e-320, 1e308, 0.0]))
    rows = [
        [f"{0.1 * i:.3f}", f"{size * (5 + 0.1 * (i % 20)):.6g}"] for i in range(count)
    ]
    for _ in range(draw(st.integers(0, 4))):
        if rows:
            row = draw(st.sampled_from(rows))
            row[draw(st.integers(0, 1)) if len(row) > 1 else 0] = draw(CELLS)
    header = draw(st.sampled_from([*HEADERS, "\ufeffa,b\n"]))
    return header + "\n".join(separator.join(row) for row in rows)


def with_a_trace(text, tmp_path):
    place = tmp_path / "trace.csv"
    place.write_text(text)
    trace = ss.read_trace(place)
    ss.drops(trace)
    ss.regime(trace)


INTERFACE = ss.Interface(thresholds=TENTH, delay=ss.Delay(0.2))
CHAIN = ss.Rig(
    INTERFACE,
    ss.Chain(blocks=4, coupling=10.0, mass=0.01, damping=1.0, leaf=0.1),
    ss.constant(1.0, duration=1.0),
    method=ss.Contacts(20, seed=1),
)
RIG = ss.Rig(
    INTERFACE,
    ss.Slider(stiffness=2.0, mass=1e-4, damping=200.0),
    ss.constant(1.0, duration=4.0),
    method=ss.Contacts(50, seed=1),
)
RECORDS = (ss.model.Parabolic, ss.model.Renewal, ss.model.Sheet)
PAGES = "cycles elastic fitting measure rate-state stability surface sweeps theory"
REFERENCE = Path(__file__).parents[1] / "docs" / "reference"
TEXTS = [(REFERENCE / f"{page}.md").read_text() for page in PAGES.split()]
NAMES = dict.fromkeys(re.findall(r"autofunction:: (\S+)", "".join(TEXTS)))
NAMES.pop("stickslip.fitting.table")  # takes minutes
PUBLIC = [*map(locate, NAMES), *RECORDS, estimate, export, state_space]
PUBLIC += [
    getattr(room, name) for room in (ss, surface, sweep) for name in room.__all__
]


def is_called(call):
    """Return whether it is a function, or a record of the model."""
    is_record = is_dataclass(call) and call.__module__.startswith("stickslip.model")
    is_lazy = inspect.isgeneratorfunction(call)
    return (inspect.isfunction(call) and not is_lazy) or is_record


CALLS = {
    f"{call.__module__}.{call.__name__}": call for call in filter(is_called, PUBLIC)
}
"""Functions that users call, and the records they pass to them."""
SAWTOOTH = "time,force\n" + "\n".join(
    f"{0.1 * i:.1f},{5 + 0.1 * (i % 20):.2f}" for i in range(600)
)


def each(names, value):
    return dict.fromkeys(names.split(), value)


USUAL = {
    "interface": INTERFACE,
    "rig": RIG,
    "slider": RIG.slider,
    "drive": RIG.drive,
    "thresholds": TENTH,
    "parameter": "velocity",
    "between": (0.5, 2.0),
    "values": ((1.0, 2.0), (1.0, 2.0)),
    "edges": (0.5, 1.0),
    "holds": (1.0,),
    "study": NamedStudy(run=len, name="lengths", version="1"),
    "axes": {"velocity": [1.0]},
    "name": "brake_pad",
    **each("mean scale shape rate velocity before start push mass shear", 1.0),
    **each("stiffness distance after end duration high static_friction", 2.0),
    **each("std low slope width time activation stretching prestress speed", 0.1),
    **each("attempts height coupling damping kinetic_friction", 10.0),
    **each("blocks along across", 4),
}
"""Values of all parameters except the one under test."""


@st.composite
def arguments(draw):
    """The name of a function and its arguments, one or two of them odd."""
    name = draw(st.sampled_from(sorted(CALLS)))
    parameters = inspect.signature(CALLS[name]).parameters
    needed = [each.name for each in parameters.values() if each.default is each.empty]
    first = needed if inspect.isfunction(CALLS[name]) else list(parameters)
    among = (first, list(parameters)) if first else ()
    some = [draw(st.sampled_from(each)) for each in among]
    given = {each: USUAL.get(each, 0) for each in {*needed, *some}}
    return name, given | {each: draw(PLAIN) for each in some}


def with_arguments(given_, _tmp_path):
    name, given_ = given_
    CALLS[name](**given_)


def with_a_message(message, _tmp_path):
    text, kind, document = message
    request = documents.from_json(
        text if kind is None else json.dumps({**document, "kind": kind})
    )
    if kind is not None:
        for _ in getattr(simulate, kind)(request, ignored):
            pass


def ignored(_part):
    """Ignore the progress."""


@st.composite
def messages(draw):
    if draw(st.integers(0, 3)) == 0:
        brackets = st.integers(1, 2000).map(lambda n: "[" * n)
        text = draw(st.text(max_size=40) | brackets | VALUES.map(json.dumps))
        return text, None, {}
    document = draw(rigs())
    names = st.sampled_from(["cursor", "width", "turn", "units", "relative_damping"])
    extra = draw(st.dictionaries(names, VALUES))
    kind = draw(st.sampled_from(["run", "edit", "stretchings"]))
    return "", kind, {"document": document, **extra}


def halves(store):
    study = NamedStudy(run=half, name="half", version="1")
    return run_study(study, {"a": [1.0, 2.0, 3.0]}, store=store)


@cache
def run_as_bytes():
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        run = ss.simulate(RIG.replace(output=ss.Output(interval=0.05)))
        # The same bytes at every commit.
        run.attrs["provenance"] = run.attrs["provenance"].replace(ss.__version__, "0.1")
        ss.save(run, f"{folder}/run.nc")
        halves(f"{folder}/s.sqlite")
        found = []
        for name in ("run.nc", "s.sqlite"):
            with open(f"{folder}/{name}", "rb") as file:
                found.append(file.read())
        return found


def half(a, seed):
    """A case of a sweep."""
    return {"b": a / 2 + 0 * seed}


PLACES = st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 7))
DAMAGE = st.lists(PLACES, min_size=1, max_size=20)


def damaged(content, bits, cut):
    content = bytearray(content)
    for at, bit in bits:
        # its beginning tells what kind of file it is
        content[int(at**2 * len(content))] ^= 1 << bit
    return bytes(content if cut is None else content[: int(cut * len(content))])


def with_a_damaged_run(damage, tmp_path):
    place = tmp_path / "run.nc"
    place.write_bytes(damaged(run_as_bytes()[0], *damage))
    run = ss.load(place)
    ss.regime(run)
    ss.drops(run)
    ss.rerun(run)


def with_a_damaged_store(damage, tmp_path):
    place = tmp_path / "s.sqlite"
    place.write_bytes(damaged(run_as_bytes()[1], *damage))
    status_of(place)
    found = halves(place)
    assert np.array_equal(found["b"], [0.5, 1.0, 1.5]), (
        "a damaged store is read as if it were whole"
    )


CUTS = st.none() | st.floats(0, 1)
SPLICES = st.lists(
    st.tuples(st.floats(0, 1, exclude_max=True), st.binary(max_size=3)), max_size=4
)
WHOLE = rig_files.to_document(RIG)
CALL = "stickslip.sliding.rigid_motion.static_friction", {"interface": INTERFACE}
PROPERTIES = {
    "rig files": (with_a_rig_file, rigs(), WHOLE),
    "texts of rig files": (with_the_text_of_a_rig_file, SPLICES, []),
    "traces": (with_a_trace, traces(), SAWTOOTH),
    "arguments": (with_arguments, arguments(), CALL),
    "messages": (with_a_message, messages(), ("", "run", {"document": WHOLE})),
    "damaged runs": (with_a_damaged_run, st.tuples(DAMAGE, CUTS), ([], None)),
    "damaged stores": (with_a_damaged_store, st.tuples(DAMAGE, CUTS), ([], None)),
}
"""An action, its input, and a complete example of the input."""


@pytest.mark.parametrize(
    "examples", [EXAMPLES, pytest.param(1000, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("name", PROPERTIES)
def test_an_answer_or_one_line(name, examples, tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where a name is drawn, a file is made
    use, strategy, whole = PROPERTIES[name]

    @settings(
        max_examples=examples,
        derandomize=not OTHERS,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def holds(what):
        line, seconds = told(use, what, tmp_path)
        assert len(line) <= LONGEST_MESSAGE + 20
        assert "\n" not in line
        if seconds > LONGEST:  # unless kernels were compiled on the way
            assert told(use, what, tmp_path)[1] < LONGEST

    use(whole, tmp_path)  # the complete example passes, and everything is compiled
    holds()
    out, err = capfd.readouterr()
    assert "Traceback" not in out + err


@pytest.mark.parametrize("name", CALLS)
def test_an_object_for_any_argument_is_refused(name):
    parameters = inspect.signature(CALLS[name]).parameters.values()
    needed = {p.name: USUAL.get(p.name, 0) for p in parameters if p.default is p.empty}
    for odd in (p.name for p in parameters if p.kind is not p.VAR_KEYWORD):
        with pytest.raises(ss.InputError):
            CALLS[name](**needed | {odd: object()})


def told(use, what, tmp_path):
    """Return the line that refuses an input (empty if none does), and the duration."""
    begun = time.process_time()
    line = ""
    try:
        use(what, tmp_path)
    except (ss.InputError, UndecidedError) as error:
        line = str(error)
    return line, time.process_time() - begun
