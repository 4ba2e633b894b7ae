"""The explorer without a browser: documents, answers, and what the server refuses."""

import base64
import http.client
import json
import re
import struct
import time
from copy import deepcopy
from functools import partial
from pathlib import Path

import headless
import numpy as np
import pytest

from stickslip import cli, fitting, quick_fit
from stickslip import simulate as simulated
from stickslip.errors import InputError
from stickslip.explorer import documents, fronts, simulate, stability, traces
from stickslip.io import rig_files as rigs
from stickslip.paper import cases
from stickslip.sliding import kinetic_friction

for needed in ("starlette", "uvicorn", "plotly"):
    pytest.importorskip(needed)
client = pytest.importorskip("websockets.sync.client")

NATURAL = "Sliding or stick-slip? (natural units)"


def silent(_share):
    """A watch that never interrupts."""


def preset(title, among=documents.presets()):
    """Return a copy of the document of a preset."""
    (found,) = (each["document"] for each in among if each["title"] == title)
    return deepcopy(found)


def small(**parts):
    document = preset(NATURAL)
    few = document["simulation"] | {"contacts": 300}
    document["simulation"] = {} if "simulation__method" in parts else few
    return changed(document, parts)


def changed(document, parts):
    """Change keys of a document, written `table__key`, or whole tables."""
    for key, value in parts.items():
        table, _, name = key.partition("__")
        if name:
            document[table][name] = value
        else:
            document[table] = value
    return document


def numbers(packed):
    return np.frombuffer(base64.b64decode(packed["bdata"]), "<f4")


# ---------------------------------------------------------------- documents


def test_presets_hold_every_figure_and_every_example_rig():
    presets = {each["title"]: each["document"] for each in documents.presets()}
    assert "PMMA slider" in presets
    for figure in range(1, 12):
        (title,) = (title for title in presets if title.startswith(f"Fig. {figure}:"))
        document = presets[title]
        case = getattr(cases, f"FIG{figure}")
        rig = documents.rig_of(document)
        assert rig.slider.stiffness == case.slider.stiffness
        assert rig.interface.thresholds == case.interface.thresholds
        assert rig.interface.delay == case.interface.delay


@pytest.mark.parametrize(
    "document",
    [preset["document"] for preset in documents.presets()],
    ids=lambda d: d["name"],
)
def test_a_rig_is_the_same_in_other_units(document):
    units = document.get("units", "SI")
    there = documents.in_units(document, "SI" if units == "natural" else "natural")
    scales = there.get("scales")
    returned = documents.in_units(there["document"], units, scales)["document"]
    was = documents.rig_of(document)
    back = documents.rig_of(returned)
    if document == documents.first_document():  # word for word
        keys = "interface.contact_strength", "slider.stiffness", "drive.velocity"
        for table, key in (each.split(".") for each in keys):
            assert returned[table][key] == document[table][key]
    # The unit of time may change on the way, which ratios without time do not feel. The
    # page shows five digits.
    assert back.slider.stiffness == pytest.approx(was.slider.stiffness, rel=1e-3)
    energies = [each.slider.mass * each.natural.velocity**2 for each in (back, was)]
    assert energies[0] == pytest.approx(energies[1], rel=3e-3)
    ratios = [each.slider.damping / each.slider.frequency for each in (back, was)]
    assert ratios[0] == pytest.approx(ratios[1], rel=3e-3)


NATURAL_AND_SI = small(), documents.of(rigs.example("pmma_slider"))


@pytest.mark.parametrize("parameter", documents.NAMES)
@pytest.mark.parametrize("document", NATURAL_AND_SI, ids=["natural", "SI"])
def test_a_parameter_turned_is_where_it_was_put(parameter, document):
    # in the unit of time of the document; other thresholds have none to convert
    if parameter == "ageing":
        with pytest.raises(InputError, match="has no ageing to vary"):
            documents.with_parameters(document, {"ageing": 1.0})
        document = deepcopy(dict(document))
        time = 0.5 if "units" in document else "0.5 s"
        document["interface"]["ageing"] = {"model": "langevin", "time": time}
    before = documents.values_of(documents.rig_of(document))
    turned = {parameter: 1.5 * before[parameter]}
    after = documents.rig_of(documents.with_parameters(document, turned))
    assert documents.values_of(after) == pytest.approx(before | turned, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("document", "over"),
    zip(
        NATURAL_AND_SI, (["velocity", "delay"], ["stiffness", "velocity"]), strict=True
    ),
    ids=["natural", "SI"],
)
def test_the_rig_stands_on_the_map_where_its_fields_say(document, over):
    values = documents.values_of(documents.rig_of(document))
    request = {"document": document, "over": over, "around": 3.0}
    (told,) = stability.chart(request, silent)
    assert told["here"] == pytest.approx([values[name] for name in over])


def test_a_parameter_turned_keeps_the_kelvins():
    heated = preset("Teaching bench, contacts broken by heat")
    document = documents.with_parameters(heated, {"stiffness": 500.0})
    assert document["interface"]["activation"]["temperature"] == "293 K"
    natural = documents.in_units(document, "natural")["document"]
    width = natural["interface"]["activation"]["width"]
    assert width == pytest.approx(0.00809, rel=1e-3)


@pytest.mark.parametrize(
    ("at", "value"),
    [
        *(("slider.mass", value) for value in (0, "", 1e-22)),
        *(("drive.velocity", value) for value in (0, "fast")),
        *(("simulation.contacts", value) for value in (10**12, 10**7, "many", 0)),
        ("slider.damping", -3),
        ("interface.delay", -0.1),
        ("interface.delay.std", {"mean": 0.1, "std": "x"}),
        ("interface.thresholds.std", {"distribution": "gaussian", "std": -1.0}),
        ("interface.initial", {"distribution": "gaussian", "mean": 0.0, "std": 3.0}),
        ("interface.ageing.time", {"model": "langevin", "time": -1}),
        ("simulation.seed", -1),
        ("simulation.method", "magic"),
    ],
)
def test_a_complaint_names_the_field(at, value):
    document = small(**{"__".join(at.split(".")[:2]): value})
    with pytest.raises(InputError) as caught:
        next(simulate.run({"document": document}, silent))
    (complaint,) = documents.complaints(caught.value)
    assert complaint["key"] == at


# ---------------------------------------------------------------- answers


def test_a_run_is_thinned_out_and_keeps_its_peaks():
    document = small()
    request = {"document": document, "width": 500, "cursor": 0.5}
    run, friction = simulate.run(request, silent)
    force = numbers(run["force"]["values"])
    assert force.size < 1_600
    full = simulated(documents.rig_of(document))["spring_force"].to_numpy()
    assert force.max() == pytest.approx(full.max(), rel=1e-6)
    assert force.min() == pytest.approx(full.min(), rel=1e-6)
    assert run["regime"]["kind"] == "stick-slip"
    assert run["slips"]["count"] == len(run["slips"]["start"])
    Q = numbers(run["stretchings"]["stretching_density"]["values"])
    x = numbers(run["stretchings"]["x"]["values"])
    assert 0.3 < Q.sum() * (x[1] - x[0]) <= 1.001
    assert run["stretchings"]["at"] == pytest.approx(20.0)
    assert friction["friction"]["static"] == pytest.approx(0.79560, abs=1e-4)
    assert friction["friction"]["kinetic"] == pytest.approx(0.505 / 1.2, abs=1e-4)


def test_answers_are_json():
    request = {"document": small(interface__delay="never"), "cursor": 7}  # beyond 1
    for answer in simulate.run(request, silent):
        json.dumps(answer, allow_nan=False)


@pytest.mark.slow
def test_every_preset_has_a_run_and_no_regime_that_more_of_it_would_tell():
    for each in documents.presets():
        *_, run, friction = simulate.run({"document": each["document"]}, silent)
        assert run["regime"]["kind"] != "undecided", each["title"]
        assert friction["friction"]["words"]


def test_a_run_that_would_take_long_is_cut_short_and_says_so():
    run, _ = simulate.run({"document": preset("PMMA slider"), "seconds": 0.04}, silent)
    assert run["span"][1] < 5.0  # of 10 s
    assert re.search(r"first [\d.]+ % of the drive", run["notes"][0])


def test_a_run_that_is_undecided_goes_on_by_itself():
    document = documents.first_document()
    document["drive"]["velocity"] = "80 mm/s"
    first, *_, last, _ = simulate.run({"document": document}, silent)
    assert first["regime"]["kind"] == "undecided"
    assert first["going_on"]
    assert last["regime"]["kind"] == "sustained oscillation"
    assert last["span"][1] > 1.9 * first["span"][1]
    assert "went on by itself" in last["notes"][0]


def test_the_law_of_friction_turns_where_theory_says():
    document = preset("Teaching bench, contacts broken by heat")
    (told,) = simulate.law({"document": document}, silent)
    x_s = 5e-4
    strength, unit = document["interface"]["contact_strength"].split()
    assert document["interface"]["breaking_displacement"] == "500 um"
    assert unit == "N"
    rig = documents.rig_of(document)
    v = numbers(told["speed"]["values"])[::10].astype(float)
    friction = kinetic_friction(rig.interface, v / x_s * rig.scales.time)
    expected = friction * float(strength)
    assert numbers(told["values"])[::10] == pytest.approx(expected, rel=1e-5)
    (turning,) = told["turning"]
    assert turning["words"].startswith("maximum at ")
    assert turning["at"][1] >= numbers(told["values"]).max() * (1 - 1e-6)


def test_the_law_of_friction_of_a_rig_in_si_units_is_in_si_units():
    """By hand: contacts carry (1 + .2^2)/2 of 2400 N, and hold half of the time."""
    document = documents.of(rigs.example("brake_pad"))
    (told,) = simulate.law({"document": document}, silent)
    v, force = told["here"]
    assert v == pytest.approx(0.02)
    assert force == pytest.approx(2400.0 * 0.52 * 0.5, rel=1e-6)
    assert told["speed"]["unit"] == "m/s"
    assert told["force"]["unit"] == "N"
    assert told["speed"]["ends"] == pytest.approx([0.02 / 300, 0.02 * 300])
    assert numbers(told["values"]).max() < 2400.0


def frames_of(document, cursor=0.5):
    (answer,) = simulate.contacts({"document": document, "cursor": cursor}, silent)
    frames = answer["frames"]
    names = "times", "force", "slider", "drive"
    arrays = {name: numbers(frames[name]) for name in names}
    x = np.frombuffer(base64.b64decode(frames["stretching"]["bdata"]), "<i2")
    x = x * frames["step"]
    flags = np.frombuffer(base64.b64decode(frames["flags"]["bdata"]), "u1")
    shape = (-1, frames["shown"])
    return frames, arrays, x.reshape(shape), flags.reshape(shape)


def test_the_drawing_replays_the_very_run_of_the_trace():
    document = small(simulation__contacts=40)
    rig = documents.rig_of(document)
    frames, arrays, x, flags = frames_of(document)
    run = simulated(rig)
    assert frames["exact"]
    assert frames["shown"] == frames["of"] == 40
    expected = np.interp(arrays["times"], run["time"], run["displacement"])
    np.testing.assert_allclose(arrays["slider"], expected, atol=2e-3)
    held = flags & 1 == 1
    # The force of the contacts in the drawing is the friction force of the run: all are
    # shown.
    friction = np.where(held, x, 0.0).sum(axis=1) / 40
    quiet = np.abs(np.gradient(friction)) < 5e-3
    expected = np.interp(arrays["times"], run["time"], run["friction_force"])
    np.testing.assert_allclose(friction[quiet], expected[quiet], atol=0.02)
    # All breaks of the run are shown: detached, or attached elsewhere, in the next
    # frame.
    broke = held[:-1] & (~held[1:] | (flags[1:] & 2 == 2))
    assert broke.sum() > 40
    # they break near their thresholds, 1 within some standard deviations
    assert np.abs(x[:-1][broke]).min() > 0.5
    stays = held[:-1] & held[1:] & (flags[1:] & 2 == 0)
    moved = np.diff(arrays["slider"])[:, None] * np.ones(40)
    np.testing.assert_allclose(np.diff(x, axis=0)[stays], moved[stays], atol=2e-3)


def test_a_master_equation_is_drawn_with_contacts_that_are_said_to_be_others():
    frames, *_ = frames_of(small(simulation__method="master equation"))
    assert not frames["own"]
    assert not frames["exact"]


def bar(title, **parts):
    return changed(preset(title, documents.page_content()["bars"]), parts)


def test_a_front_that_a_push_sets_off_runs_through_the_bar():
    (told,) = fronts.fronts({"chain": bar("A front, set off by a push")}, silent)
    (event,) = told["events"]
    assert event["blocks"] == told["blocks"] == 100
    assert event["speed"] == pytest.approx(1.0, abs=0.2)  # about that of sound
    view = event["view"]
    velocity = np.frombuffer(base64.b64decode(view["velocity"]["bdata"]), "u1")
    velocity = velocity.reshape(100, view["rows"]).T
    moving = velocity > 170
    arrival = np.where(moving.any(axis=0), moving.argmax(axis=0), view["rows"])
    # a slanted line in space and time
    assert np.corrcoef(arrival[5:90], np.arange(5, 90))[0, 1] > 0.98


# ---------------------------------------------------------------- fit


def test_a_trace_in_milliseconds_shows_its_frequency_in_hertz():
    rows = "\n".join(f"{10 * i},{5 + i % 150}" for i in range(3000))
    *_, found = traces.trace({"content": f"t (ms),F (N)\n{rows}".encode()}, silent)
    value, unit = found["regime"]["frequency"].split()
    assert (float(value), unit) == (pytest.approx(1 / 1.5, rel=0.01), "Hz")


BENCH = {"stiffness": "350 N/m", "speed": "1.5 mm/s", "mass": "75.6 g"}


@pytest.fixture(scope="module")
def slips():
    """The sample as a page sends it: slips with known parameters."""
    (answer,) = traces.sample({}, silent)
    return {"name": "sample.csv", "content": answer["text"].encode()}


def test_readings_are_those_of_the_trace(slips, monkeypatch, tmp_path):
    monkeypatch.setenv("STICKSLIP_CACHE", str(tmp_path))
    first, missing, plan = traces.fit(slips, silent)
    peaks = fitting.pick_events(fitting.synthetic_trace()).peaks
    assert float(first["readings"]["static"]) == pytest.approx(peaks.mean(), rel=1e-3)
    # the parameters of the sample
    assert float(first["readings"]["rate"]) == pytest.approx(0.5, rel=0.02)
    needed = "the stiffness of the driving spring, its speed and the mass of the slider"
    assert needed in missing["missing"]
    assert [size["draws"] for size in plan["table"]["sizes"]] == [2_000, 6_000]
    # nothing is kept yet
    coarse, fine = (each["seconds"] for each in plan["table"]["sizes"])
    assert fine > coarse > 0


def test_the_rig_at_once_is_that_of_quick_fit_and_is_seen_beside_the_trace(slips):
    options = BENCH | {"half": "2 mm/s"}
    first, quick, _ = traces.fit(slips | {"options": options, "seconds": 2.0}, silent)
    given = {key: float(value) for key, value in first["readings"].items()}
    friction = {f"{key}_friction": given[key] for key in ("static", "kinetic")}
    rig = quick_fit(
        **friction, loading_rate=given["rate"], half_speed="2 mm/s", **BENCH
    )
    made = documents.rig_of(quick["quick"]["document"])
    assert made.scales.force == pytest.approx(rig.scales.force, rel=1e-3)
    delay = rig.interface.delay.moment(1)
    assert made.interface.delay.moment(1) == pytest.approx(delay, rel=1e-3)
    overlay = quick["quick"]["overlay"]
    lines = overlay["trace"], overlay["series"][0]
    trace, simulated = (numbers(line["y"]) for line in lines)
    assert 1.0 < np.ptp(trace) / 7.3 < 3.0
    assert np.ptp(simulated) > 3.0


def test_a_fit_with_intervals_knows_the_bench(slips, monkeypatch):
    def names(_events, *, known, **_more):
        raise InputError(" ".join(sorted(fitting.bench.read_known(known))))

    monkeypatch.setattr(fitting, "fit", names)
    request = slips | {"options": BENCH, "draws": 2_000, "table": True}
    with pytest.raises(InputError, match="mass stiffness velocity"):
        next(traces.posterior(request, silent))


@pytest.mark.takes(5)
def test_the_run_of_the_bench_leads_to_a_rig_with_its_delay():
    """Friction in fast slips tells less than slow sliding, which gives the delay."""
    bench = documents.rig_of(documents.first_document())
    run = simulated(bench)
    columns = zip(run["time"].values, run["spring_force"].values, strict=True)
    rows = [f"{t:.7g},{F:.7g}" for t, F in columns]
    content = "\n".join(["time [s],force [N]", *rows]).encode()
    known = {"stiffness": "300 N/m", "speed": "5 mm/s", "mass": "200 g"}
    known["damping"] = "0.025"
    # F_k of its interface
    kinetic = {"kinetic": "0.624 N"}
    for more, error, marked in (({}, 0.3, True), (kinetic, 0.2, False)):
        request = {"content": content, "options": known | more}
        first, answer, _ = traces.fit(request, silent)
        # not the ringing that follows each
        assert first["slips"][0].startswith("13 slips")
        made = documents.rig_of(answer["quick"]["document"])
        assert made.value("delay") == pytest.approx(bench.value("delay"), rel=error)
        assumed = answer["quick"]["assumed"]
        assert any("slide slowly" in line for line in assumed) is marked


PULLED = "Pulled at one end: precursors"
FORCED = {"slider": {"mass": 1.0}, "drive": {"force": 0.3, "duration": 4.0}}
MANY = {"simulation__contacts": 10**6}
PER_ROW = "in the field seconds per row"
COLUMNS = b"".join(b"%d %d %d\n" % (3 * i % 20, i * i % 7, i % 5) for i in range(60))
COLUMN = b"".join(b"%d\n" % (i % 7) for i in range(60))


@pytest.mark.parametrize(
    ("ask", "given", "words"),
    [
        (traces.fit, {"options": BENCH | {"stiffness": "soft"}}, "stiffness = 'soft'"),
        (traces.fit, {"options": BENCH | {"kinetic": "20 N"}}, "kinetic"),
        (traces.fit, {"options": BENCH | {"rate": "0.6 N/s"}}, "loading_rate"),
        (traces.fit, {"options": BENCH | {"damping": "1.5"}}, "damping ratio"),
        (traces.trace, {"content": b"t b c\n" + COLUMNS}, "in the field force column"),
        (traces.trace, {"content": b"force\n" + COLUMN}, PER_ROW),
        (traces.trace, {"content": b"time force odd\n" + COLUMNS}, PER_ROW),
        (traces.posterior, {"options": BENCH, "draws": 6_000}, "explorer does not"),
        (fronts.fronts, {"chain": bar(PULLED, chain__blocks=5_000)}, "at most 400 bl"),
        (fronts.fronts, {"chain": bar(PULLED, drive__duration=1e9)}, "times shorter"),
        (fronts.fronts, {"chain": bar(PULLED, **MANY)}, "simulation.contacts"),
        (fronts.fronts, {"chain": bar(PULLED, chain__coupling="stiff")}, "coupling"),
        (simulate.run, {"document": bar(PULLED)}, "is shown on the page Fronts"),
        (simulate.run, {"document": small(**FORCED)}, "a slider on a spring"),
    ],
)
def test_what_a_page_refuses_is_one_line_about_its_fields(
    slips, monkeypatch, tmp_path, ask, given, words
):
    # a table that is already kept would be used
    monkeypatch.setenv("STICKSLIP_CACHE", str(tmp_path))
    with pytest.raises(InputError, match=words) as refused:
        list(ask(slips | given, silent))
    assert not re.search(r"\n|--", str(refused.value))


# ----------------------------------------------------------- the command and the server


def test_without_the_extra_one_line_says_what_to_install(capsys, monkeypatch):
    monkeypatch.setattr("stickslip.explorer.find_spec", lambda _name: None)
    assert cli.main(["explore"]) == 2
    assert "pip install 'stickslip[explorer]'" in capsys.readouterr().err


@pytest.fixture(scope="module")
def server():
    with headless.server() as running:
        yield running


def ask(server, path, **headers):
    timeout = headless.PATIENCE / 1e3
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=timeout)
    try:
        connection.putrequest("GET", path, skip_host="Host" in headers)
        for name, value in headers.items():
            connection.putheader(name.replace("_", "-"), value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders())
    finally:
        connection.close()


def websocket_status(server, **headers):
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket"}
    upgrade |= {"Sec_WebSocket_Version": "13"}
    upgrade |= {"Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ=="}
    return ask(server, "/session", **upgrade, **headers)[0]


def test_binds_to_loopback_only(server):
    listening = []
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for line in Path(table).read_text().splitlines()[1:]:
            address = line.split()[1]
            state = line.split()[3]
            if state == "0A" and int(address.rpartition(":")[2], 16) == server.port:
                listening.append(address.rpartition(":")[0])
    assert listening == [f"{struct.unpack('<I', bytes([127, 0, 0, 1]))[0]:08X}"]


def test_other_hosts_and_origins_are_refused(server):
    port = server.port
    assert ask(server, "/")[0] == 200
    assert ask(server, "/", Host=f"localhost:{port}")[0] == 200
    foreign = "evil.example", f"evil.example:{port}", f"127.0.0.1.evil:{port}"
    for host in (*foreign, "127.0.0.1", f"127.0.0.1:{port + 1}"):
        assert ask(server, "/", Host=host)[0] == 403
        assert websocket_status(server, Host=host, Origin=f"http://{host}") == 403
    foreign = "http://evil.example", "null", f"https://127.0.0.1:{port}"
    for origin in (*foreign, f"http://127.0.0.1:{port + 1}"):
        assert ask(server, "/", Origin=origin)[0] == 403
        assert websocket_status(server, Origin=origin) == 403
    # a browser always says where a websocket comes from
    assert websocket_status(server) == 403
    assert websocket_status(server, Origin=f"http://127.0.0.1:{port}") == 101


def test_every_answer_carries_the_headers_of_safety(server):
    for path in ("/", "/plotly/plotly.min.js", "/explorer.js", "/nothing"):
        _, headers = ask(server, path)
        headers = {name.lower(): value for name, value in headers.items()}
        assert headers["content-security-policy"].startswith("default-src 'self'")
        assert "script-src" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cross-origin-resource-policy"] == "same-origin"


def test_files_outside_the_static_folder_are_not_served(server):
    folders = "/..", "/%2e%2e", "/plotly/.."
    paths = [f"{folder}/server.py" for folder in folders]
    for path in (*paths, "//etc/passwd", "/../../etc/passwd"):
        assert ask(server, path)[0] in (400, 404)


# --------------------------------------------------------------- what no message can do


@pytest.fixture
def session(server):
    with headless.session(server) as opened:
        yield opened
        # the session still answers
        assert opened.ask("edit", small(), units="natural").get("done")


def told(answer):
    (error,) = answer["errors"]
    assert len(error["message"]) < 420
    assert not error["message"].startswith("this failed")
    return error["message"]


def quick_rig(**parts):
    """The bench of the examples, in a short run of few contacts."""
    document = documents.of(rigs.example("pmma_slider"))
    document["simulation"] = {"contacts": 100}
    document["drive"] = {"velocity": "0.4 mm/s", "distance": "10 um"}
    return changed(document, parts)


def asked(kind, content=None, **more):
    """Return a message as a page sends it."""
    text = json.dumps({"kind": kind, "id": 1} | more)
    return text if content is None else text.encode() + b"\n" + content


RIG = {"document": small()}
PLANE = {"over": ["stiffness", "velocity"]}
TRACE = b"time,force\n" + b"".join(b"%.2f,%d\n" % (0.01 * i, i % 7) for i in range(60))


def request_of(kind, number):
    return f'{{"kind":{kind},"id":{number}}}'


chart = partial(asked, "chart", **RIG)
edit = partial(asked, "edit", **RIG)
trace = partial(asked, "trace", TRACE)
KINDS = '["run"]', '{"a":1}', '"hello"', f'"{"x" * 1_900}"'
LONG = dict.fromkeys(map(str, range(60_000)), 1)
DAMAGED = {
    "no JSON": [
        "[" * 100_000,
        '{"kind":"run","id":1,"document":' * 20_000,
        request_of('"run"', "9" * 5_000),
        b"\x00\x01\xff",
        *(request_of('"run"', number) for number in ("NaN", "-Infinity", "1e999")),
        "",
        '{"kind":"run","id":1,"document":{"name":"\\ud800"}}',
    ],
    "whole number": [request_of('"run"', number) for number in ("1.5", "true", '"1"')],
    "not known": ["[]", "null", "3", *(request_of(kind, 1) for kind in KINDS)],
    "must be a table": [request_of('"run"', 1), '{"kind":"run","id":1,"document":[1]}'],
    "more": [asked("run", document=LONG)],
    "2.0 MB": ['"' + "x" * 2_000_000 + '"'],
    "damaged": [asked("trace", b"\x89HDF\r\n\x1a\n" + bytes(100), name="x.nc")],
    "too few": [asked("trace", b"time,force\n1,2\n2,3\n", name="../../x.csv")],
    "no such column": [
        trace(options={"force": x}) for x in ("²", "9" * 5_000, "-1", "0")
    ],
    "too small for double precision": [trace(options={"step": "1e-320"})],
    "64 characters": [trace(options={"step": "1" * 5_000})],
    "not in a unit of 's'": [trace(options={"step": "4 kg"})],
    "a table of texts": [trace(options=[1])],
    "empty": [asked("trace", b"", name=3)],
    "51 MB, more than 50": [asked("trace", bytes(51_000_000))],
    "around": [chart(**PLANE, around=x) for x in ("x", [1], True, 1, 1e300)],
    "over": [
        chart(over=x) for x in ([["a"], 1], {"a": 1}, [1, 2], "ab", None, ["mass"] * 2)
    ],
    "must be": [edit(turn=x) for x in ([1], None, {"stiffness": True}, {"mass": "1"})],
    "is no parameter": [edit(turn={"x" * 1_900: 1})],
    "units": [edit(units=x) for x in ("imperial", ["SI"], None)],
    "true or false": [edit(damping_ratio=x) for x in (None, 1, "yes")],
}


@pytest.mark.parametrize(
    ("message", "words"),
    [(message, words) for words, messages in DAMAGED.items() for message in messages],
    ids=lambda value: ascii(value[:100][-40:]),
)
def test_a_damaged_message_is_refused_and_the_session_goes_on(session, message, words):
    line = told(session.send(message))
    assert words in line
    assert "/tmp" not in line


MISREAD = "9**9**9**9 N/m", "4 " + "N" * 1_500, "4,0 MN/m", "1e999 N/m"
MISREAD += 4, None, {"a": 4}
FINE = {"distribution": "empirical", "weights": [1.0] * 2_000}
FINE["edges"] = np.linspace(0.5, 1.5, 2_001).tolist()
WIDE = {"distribution": "gaussian", "std": 1.7e308}
PIECES = [{"start": 1, "end": 1, "duration": 0.01}] * 2_000
AT_ONCE = {"model": "langevin", "time": 1e-9}


@pytest.mark.parametrize(
    ("document", "key"),
    [
        *((quick_rig(slider__stiffness=each), "slider.stiffness") for each in MISREAD),
        (small(simulation__interval=1e-6), "simulation.interval"),
        (quick_rig(simulation__interval="1 ns"), "simulation.interval"),
        (small(drive={"pieces": PIECES}), "drive.pieces"),
        (small(interface__thresholds=FINE), "interface.thresholds"),
        (small(interface__delay=0, interface__ageing=AT_ONCE), "interface.ageing.time"),
        (small(interface__thresholds=WIDE), None),
        (small(drive__velocity=1e-300), None),
        (quick_rig(name="x" * 3000), "name"),
        (quick_rig(assumed={"slider.mass": 5}), "assumed.slider.mass"),
    ],
    ids=lambda value: ascii(str(value)[-60:]),
)
def test_no_document_holds_the_server_or_is_misread(session, document, key):
    begun = time.monotonic()
    answer = session.ask("run", document)
    assert told(answer)
    assert key in (None, answer["errors"][0]["key"])
    assert time.monotonic() - begun < 10


def test_a_distribution_too_narrow_for_theory_still_runs(session):
    narrow = {"distribution": "gaussian", "std": 1e-6}
    document = small(interface__thresholds=narrow, drive__distance=5)
    assert session.ask("run", document).get("done")
    for kind in ("chart", "advice"):
        answer = session.ask(kind, document, over=["stiffness", "velocity"])
        assert "at least 0.002 of the mean" in told(answer)
