"""The explorer in a real browser: what a user does on each page.

Every window fails on any message in its console.
"""

import base64
import json
import os
import re
from contextlib import ExitStack
from pathlib import Path

import headless
import numpy as np
import pytest

from stickslip import cli, fitting
from stickslip.explorer import documents
from stickslip.fitting.model import KEYS
from stickslip.io import datasets as store
from stickslip.io import rig_files as rigs
from stickslip.model import Rig
from stickslip.simulation import simulate

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(headless.CHROMIUM is None, reason=headless.WHY_NOT),
]

PICTURES = os.environ.get("STICKSLIP_SCREENSHOTS")
"""Folder, such as docs/images, into which the pictures of the docs are written."""
SCREEN = {"width": 1280, "height": 800}
PHONE = {"width": 390, "height": 844}
NATURAL = "Sliding or stick-slip? (natural units)"
RULES = Path(headless.__file__).with_name("accessibility.js").read_text()
STIFFNESS = "#field-slider-stiffness"


@pytest.fixture(scope="module")
def server():
    with headless.server() as running:
        yield running


@pytest.fixture(scope="module")
def browser():
    with headless.browser() as started:
        yield started


@pytest.fixture
def bench(browser, server):
    """A window as it opens: a bench in SI."""
    with headless.window(browser, server) as opened:
        settled(opened)
        yield opened


@pytest.fixture
def page(bench):
    """A window with a rig in natural units."""
    choose(bench, NATURAL)
    return bench


def settled(page, about="run"):
    """Wait until the page shows the rig in its fields."""
    page.wait_for_selector(f"body[data-{about}-state='']")


def put(page, selector, text):
    """Type into an input, and confirm it."""
    page.fill(selector, text)
    page.press(selector, "Enter")


def enter(page, field, text, then=""):
    """Type into a field, and wait until the value is accepted or refused."""
    put(page, f"#field-{field}", text)
    page.wait_for_selector(f"body[data-run-state='{then}']")


def until(page, expression):
    """Wait until a JavaScript condition holds: the page forbids `wait_for_function`."""
    for _ in range(headless.PATIENCE // 100):
        if page.evaluate(expression):
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"{expression}; the page: {page.inner_text('body')[:2000]}")


def choose(page, title):
    """Choose a preset, and wait for its run."""
    page.select_option("#preset", label=title)
    settled(page)


def move(page, value, selector=STIFFNESS):
    """Set a field or a slider; return the regime of the run that is drawn then."""
    return page.evaluate(headless.MOVE, [selector, str(value)])["kind"]


def state(page):
    """Return the document in the address; typed text counts once the field is left."""
    page.evaluate("document.activeElement.blur()")
    page.click("#link")
    text = page.evaluate("location.hash").partition("/")[2]
    return json.loads(base64.urlsafe_b64decode(text + "=" * (-len(text) % 4)))


def download(page, button, folder):
    with page.expect_download() as begun:
        page.click(button)
    file = folder / begun.value.suggested_filename
    begun.value.save_as(file)
    return file


def sawtooth(folder):
    t = np.arange(0, 20, 0.01)
    force = 3 + (0.9 * t % 1) * 0.8 + np.random.default_rng(0).normal(0, 0.01, t.size)
    file = folder / "bench.csv"
    heading = "time [s],Friction force at the left load cell [N]"
    rows = [f"{a:.3f},{b:.4f}" for a, b in zip(t, force, strict=True)]
    file.write_text("\n".join([heading, *rows, ""]))
    return file


def test_the_first_minute_a_softer_spring_and_a_kept_trace(bench):
    assert "it sticks and slips" in " ".join(bench.text_content("#intro").split())
    assert bench.input_value("#units") == "SI"
    assert bench.text_content("#regime") == "stick-slip"
    assert re.fullmatch(r"1\.\d+ Hz", bench.text_content("#often"))
    choose(bench, NATURAL)
    names = (
        "document.querySelector('#plot-force').data.map((trace) => trace.name).join()"
    )
    for method in ("contacts", "master equation"):
        bench.select_option("#field-simulation-method", method)
        assert move(bench, 20) == "smooth sliding"
        assert move(bench, 2) == "stick-slip"
        until(bench, f"{names} === 'force,slips,Fₖ,Fₛ,slip'")
    bench.click("#keep")
    assert move(bench, 20) == "smooth sliding"
    until(bench, f"{names}.startsWith('before,force')")
    bench.click("#keep")
    until(bench, f"{names}.startsWith('force')")
    move(bench, 1000, STIFFNESS + "-slider")
    assert float(bench.input_value(STIFFNESS)) == 50
    bench.click("#reset")
    assert bench.input_value(STIFFNESS) == "2"


def test_every_preset_runs_after_another_and_every_quantity_is_explained(bench):
    heights = set()  # a text that shifted fields would move them under the pointer
    for each in documents.presets():
        choose(bench, each["title"])
        assert bench.locator(".complaint:visible").count() == 0
        regimes = "stick-slip", "smooth sliding", "sustained oscillation", "speed sweep"
        assert bench.text_content("#regime") in regimes
        assert bench.text_content("#preset option:checked") == each["title"]
        fields = bench.locator("#fields .field input[type=text], #fields .field select")
        for i in range(fields.count()):
            fields.nth(i).focus()
            assert len(bench.text_content("#help")) > 25
            heights.add(bench.evaluate("document.querySelector('#help').offsetHeight"))
    assert len(heights) == 1
    bench.click("#glossary-open")
    assert bench.locator("#glossary dt").count() >= 25
    bench.click("#glossary-close")
    assert bench.is_hidden("#glossary")


def test_fields_take_numbers_with_units_and_refuse_the_rest_beside_them(bench):
    for typed, shown in (
        ("2,5", "2.5 N/m"),
        ("400 N/m", "400 N/m"),
        ("0,4 kN/m", "0.4 kN/m"),
        ("", "0.4 kN/m"),
        ("0.5", "0.5 kN/m"),
    ):
        enter(bench, "slider-stiffness", typed)
        bench.locator(STIFFNESS).blur()
        assert (
            bench.input_value(STIFFNESS) == state(bench)["slider"]["stiffness"] == shown
        )
    enter(bench, "drive-velocity", "300 rpm", "refused")
    assert "rpm" in bench.text_content("#field-drive-velocity-complaint")
    # the unit that was refused has not become that of the field
    enter(bench, "drive-velocity", "4")
    assert state(bench)["drive"]["velocity"] == "4 mm/s"
    enter(bench, "simulation-contacts", "10 000")
    assert state(bench)["simulation"]["contacts"] == 10_000
    choose(bench, NATURAL)
    for field, text in (
        ("slider-stiffness", "0x10"),
        ("slider-stiffness", "1e999"),
        ("slider-mass", "0"),
        ("drive-velocity", "x"),
        ("interface-delay", "soon"),
        ("interface-delay-std", "x"),
        ("interface-ageing-time", "5 ms"),
        ("simulation-contacts", "1.5"),
        ("simulation-seed", "?"),
    ):
        before = bench.input_value(f"#field-{field}")
        enter(bench, field, text, "refused")
        assert bench.text_content(f"#field-{field}-complaint")
        assert bench.get_attribute(f"#field-{field}", "aria-invalid") == "true"
        assert bench.locator(".complaint:visible").count() == 1
        for part in ("#live", "#more", "#stage"):
            faded = f"document.querySelector('{part} .fades')"
            opacity = bench.evaluate(f"getComputedStyle({faded}).opacity")
            assert float(opacity) < 0.5
        assert "Refused" in bench.text_content("#run-words")
        enter(bench, field, before)  # and the page still works
        assert bench.locator(".complaint:visible").count() == 0


def test_units_and_damping_can_be_told_in_the_other_way(page):
    page.select_option("#units", "SI")
    page.wait_for_selector("#field-interface-contact_strength")
    assert page.input_value("#field-interface-contact_strength") == "768 N"
    page.click("#field-slider-damping ~ .unit button")
    page.wait_for_selector("#field-slider-damping_ratio")
    page.select_option("#units", "natural")
    page.wait_for_selector("#field-interface-contact_strength", state="detached")
    assert float(page.input_value("#field-slider-damping_ratio")) == pytest.approx(
        100 / 141.42, rel=1e-2
    )


def test_a_measured_friction_curve_takes_the_place_of_strength_and_delay(bench):
    before = bench.input_value("#field-interface-contact_strength")
    enter(bench, "interface-friction", "0.1 mm/s, 5 N; 1 mm/s, 4 N; 10 mm/s, 3.5 N")
    assert not bench.is_visible("#field-interface-contact_strength")
    assert "4 N" in bench.input_value("#field-interface-friction")
    enter(bench, "interface-friction", "0.1 mm/s, 5 N; 1 mm/s", "refused")
    assert "must be a point" in bench.text_content(
        "#field-interface-friction-complaint"
    )
    enter(bench, "interface-friction", "none")
    assert bench.input_value("#field-interface-contact_strength") == before


def test_nothing_is_simulated_while_a_number_is_typed_and_the_newest_move_wins(page):
    page.evaluate(
        """() => { window.runs = []; const send = WebSocket.prototype.send;
        WebSocket.prototype.send = function (text) { const said = JSON.parse(text);
          if (said.kind === "run") window.runs.push(said.document.slider.stiffness);
          return send.call(this, text); }; }"""
    )
    page.fill(STIFFNESS, "")
    page.locator(STIFFNESS).press_sequentially("1,5", delay=50)
    assert page.input_value(STIFFNESS) == "1.5"
    assert page.evaluate("window.runs") == []
    assert "press Enter" in page.text_content("#run-words")
    page.press(STIFFNESS, "Enter")
    settled(page)
    page.fill(STIFFNESS, "3.5")  # takes effect after a pause
    until(page, "window.runs.length === 2")
    assert page.evaluate("window.runs") == [1.5, 3.5]
    page.evaluate(
        """() => { const input = document.querySelector("#field-slider-stiffness");
        for (const value of [...Array(60).keys()].map((i) => 2 + i).concat([20])) {
          input.value = value; input.dispatchEvent(new Event("input")); input.dispatchEvent(new Event("change")); } }"""  # noqa: E501
    )
    settled(page)
    assert page.text_content("#regime") == "smooth sliding"
    assert page.evaluate("window.runs.length") < 20


def test_what_is_being_computed_is_dimmed_and_says_so(bench):
    put(bench, "#field-simulation-contacts", "200000")  # takes a second or two
    assert bench.get_attribute("#live", "data-state") == "computing"
    assert "from before" in bench.text_content("#run-words")
    until(
        bench, "getComputedStyle(document.querySelector('#live .fades')).opacity < 0.5"
    )
    choose(bench, "Rock slabs")
    # of 80 s: no longer the 40 s of the bench
    assert float(bench.text_content("#plot-force .xtick >> nth=-1")) > 60
    assert bench.is_hidden("#run-words")


def test_the_cursor_chooses_the_time_and_the_contacts_are_replayed_in_step(
    browser, server
):
    with headless.window(browser, server, reduced_motion="no-preference") as page:
        page.wait_for_selector("#stage-words:has-text('40 of the 1000 contacts')")
        drawing = "document.querySelector('#drawing').dataset"
        begun = page.evaluate(
            f"[{drawing}.time, document.querySelector('#live .cursor').style.transform]"
        )
        until(page, f"Number({drawing}.broken) > 1 && {drawing}.time !== '{begun[0]}'")
        cursor = "document.querySelector('#live .cursor').style.transform"
        assert page.evaluate(cursor) != begun[1]
        page.click("#play")
        stopped = page.evaluate(f"{drawing}.time")
        box = page.locator("#plot-force .nsewdrag").bounding_box()
        assert page.evaluate(f"{drawing}.time") == stopped
        page.mouse.click(box["x"] + 0.25 * box["width"], box["y"] + 50)
        until(page, f"Math.abs(Number({drawing}.time) - 3) < 0.1")
        choose(page, "Teaching bench, contacts broken by heat")
        settled(page, "law")
        here = "document.querySelector('#plot-law').data[1].y[0]"
        assert "maximum at" in page.text_content("#law-turning")
        cold = page.evaluate(here)
        move(page, 1200, "#field-interface-activation-temperature")
        settled(page, "law")
        assert page.evaluate(here) < 0.9 * cold, "a warmer interface has less friction"


def test_the_tour_asks_five_questions_that_can_be_answered(bench):
    page = bench
    page.click("#tour-begin")
    answers_ = (
        ("slider-stiffness", "300 N/m"),
        ("slider-stiffness", "6000"),
        ("drive-velocity", "60"),
        ("simulation-contacts", "10 000"),
        ("simulation-contacts", "100"),
    )
    for number, (field, value) in enumerate(answers_, start=1):
        page.wait_for_selector(f"#tour-title:has-text('{number} of 5')")
        settled(page)
        assert page.text_content("#tour-answer") == ""
        until(page, "document.querySelector('#plot-force').data[0].name === 'before'")
        begin = page.input_value(f"#field-{field}")
        put(page, f"#field-{field}", value)
        page.wait_for_selector("#tour-answer:has-text('Yes.')")
        page.click("#tour-reset")
        settled(page)
        assert page.input_value(f"#field-{field}") == begin
        assert page.text_content("#tour-answer") == ""
        page.click("#tour-next")
    assert page.is_hidden("#tour")


def test_the_map_follows_the_rig_and_moves_it(page):
    page.click("#tab-map")
    page.wait_for_selector("#plot-map .heatmaplayer image")
    dot = (
        "(() => { const plot = document.querySelector('#plot-map'); return "
        "plot.data[plot.data.length - 1].x[0]; })()"
    )
    stiffness = f"Number(document.querySelector('{STIFFNESS}').value)"
    enter(page, "slider-stiffness", "4")
    until(page, f"Math.abs({dot} - 4) < 1e-6")
    box = page.locator("#plot-map .nsewdrag").bounding_box()
    middle = box["y"] + 0.5 * box["height"]
    page.mouse.move(box["x"] + 0.6 * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.9 * box["width"], middle)
    page.mouse.up()
    until(page, f"Math.abs({stiffness} / (2 * 20 ** 0.8) - 1) < 0.02")
    page.locator("#plot-map").press("ArrowLeft")  # before the run comes: the dot stays
    page.locator("#plot-map").press("ArrowRight")
    until(page, f"Math.abs({stiffness} / (2 * 20 ** 0.8) - 1) < 0.02")
    settled(page)
    # not stick-slip; whether it is undecided or a small oscillation depends on the
    # noise of the contacts
    regime = "document.querySelector('#map-regime').textContent"
    until(page, f"/^(smooth|undecided|sustained)/.test({regime})")
    page.locator("#plot-map").press("ArrowLeft")
    until(page, f"Math.abs({stiffness} / (2 * 20 ** 0.8 / 1.05) - 1) < 0.02")
    enter(page, "interface-delay", "never")
    page.wait_for_selector("#map-complaint:has-text('never re-attach')")
    assert page.get_attribute("[data-about=map]", "data-state") == "refused"
    put(page, "#field-interface-delay", "0.4")
    settled(page, "map")
    assert page.is_hidden("#map-complaint")


def test_every_axis_of_the_map_works_and_its_legend_is_true(bench):
    bench.click("#tab-map")
    settled(bench, "map")
    assert "in Hz" in bench.text_content("#map-legend")
    options = (
        "[...document.querySelector('#across').options].filter((o) => "
        "!o.disabled).map((o) => o.value)"
    )
    for name in bench.evaluate(options):
        bench.select_option("#across", name)
        settled(bench, "map")
        values = "document.querySelector('#plot-map').data[0].z.flat()"
        assert bench.evaluate(f"{values}.some((v) => v !== null)")
    for scheme in ("dark", "light"):
        bench.emulate_media(color_scheme=scheme)
        drawn = """(() => {
            const probe = document.createElement("i"), data = document.querySelector("#plot-map").data;
            const shown = (colour) => { probe.style.color = colour; document.body.append(probe);
              const found = getComputedStyle(probe).color; probe.remove(); return found; };
            const swatch = (name) => getComputedStyle(document.querySelector(`.swatch.${name}`)).backgroundColor;
            const [stable, , unstable] = data[0].colorscale.map(([, colour]) => shown(colour));
            return unstable === swatch("unstable") && stable === swatch("stable"); })()"""  # noqa: E501
        until(bench, drawn)


def test_a_mitigation_is_applied_and_works(page):
    page.click("#tab-stop")
    page.wait_for_selector("#mitigations button")
    assert " from " in page.locator("#mitigations p:has(button)").first.text_content()
    page.locator("#mitigations p button").first.click()
    # The run on the page is short: it ends while stick-slip still decays. The verdict
    # comes from longer ones.
    page.wait_for_selector("#verdict:has-text('smooth')")
    settled(page)
    assert "stick-slip" not in page.text_content("#regime")


def test_a_measured_trace_is_analysed_and_what_is_none_is_told(page, tmp_path):
    page.click("#tab-trace")
    binary = tmp_path / "x.bin"
    huge = tmp_path / "huge.csv"
    columns = tmp_path / "columns.csv"
    binary.write_bytes(bytes(range(256)) * 50)
    with huge.open("wb") as file:
        file.truncate(200_000_000)
    columns.write_text(
        "time,a,b\n" + "\n".join(f"{i},{i % 7},{i % 5}" for i in range(100))
    )
    for file, words in (
        (binary, "binary"),
        (huge, "200 MB"),
        (columns, "which column is the force?"),
    ):
        page.set_input_files("#file", file)
        page.wait_for_selector(f"#trace-complaint:has-text('{words}')")
    page.select_option("#column-force", label="3: b: 0 to 4")
    page.wait_for_selector("#trace-state:has-text('columns.csv: 100 rows')")
    assert page.locator("#trace-complaint").is_hidden()
    dropped = (
        "(text) => { const d = new DataTransfer(); d.items.add(new File([text], "
        "'dropped.csv')); return d; }"
    )
    data = page.evaluate_handle(dropped, sawtooth(tmp_path).read_text())
    page.dispatch_event("body", "drop", {"dataTransfer": data})
    page.wait_for_selector("#trace-state:has-text('dropped.csv: 2000 rows')")
    page.wait_for_selector("#trace-regime:has-text('stick-slip')")
    assert page.input_value("#column-force") == ""  # this file has no column b
    assert "17 slips, marked" in page.text_content("#plot-trace")
    assert "79" in page.text_content("#statistics tr:has-text('drop')")
    assert page.text_content("#plot-trace .ytitle") == "force (N)"


def test_a_sample_is_fitted_at_once_and_opened_in_simulate(browser, server, tmp_path):
    with headless.window(browser, server, viewport=PHONE) as page:
        page.click("#tab-fit")
        page.click("#sample")
        settled(page, "fit")
        assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
        lines = "document.querySelector('#plot-quick').data"
        drawn = page.evaluate(f"{lines}.map((t) => [t.name, t.x.length ?? 2])")
        assert [name for name, _ in drawn] == ["simulated", "measured"]
        words = page.text_content("#quick-words")
        assert "does not fit: its own run drops" in words
        assert "the trace 7.33 N every 15.1 s" in words
        assert page.input_value("#fit-static") == "12.52"
        assert "N/s" in page.text_content("#fit-fields .field:has(#fit-rate)")
        put(page, "#fit-rate", "0,6")
        page.wait_for_selector("#fit-complaint:has-text('loading_rate = 0.6 N/s')")
        assert page.get_attribute("[data-about=fit]", "data-state") == "refused"
        put(page, "#fit-rate", "")
        settled(page, "fit")
        assert page.input_value("#fit-rate") == "0.4999"
        rig = rigs.read_rig(download(page, "#quick-save", tmp_path))
        assert rig.in_units(1.0, "force") == "15.82 N"
        page.click("#quick-open")
        settled(page)
        assert page.input_value("#field-slider-stiffness") == "350 N/m"
        assert page.text_content("#regime") == "stick-slip"


def test_a_dropped_trace_leads_to_its_rig_and_to_what_would_stop_it(bench, tmp_path):
    page = bench
    run = fitting.synthetic_trace()
    both = tmp_path / "both.csv"
    rows = zip(run["time"].to_numpy(), run["spring_force"].to_numpy(), strict=True)
    heading = "time [s],left force [N],right force [N]\n"
    both.write_text(heading + "".join(f"{t},0.1,{F:.4f}\n" for t, F in rows))
    page.click("#tab-trace")
    page.set_input_files("#file", both)
    page.wait_for_selector("#trace-complaint:has-text('which column is the force?')")
    page.select_option("#column-force", "right force")
    page.wait_for_selector("#trace-regime:has-text('stick-slip')")
    page.click("#trace-next")
    page.wait_for_selector("#fit-words:has-text('give the stiffness')")
    known = {"stiffness": "350", "speed": "1.5 mm/s", "mass": "75.6 g"}
    for name, value in known.items():
        put(page, f"#fit-{name}", value)
    page.wait_for_selector("#quick-words:has-text('This rig')")
    settled(page, "fit")
    names = page.evaluate(
        "document.querySelector('#plot-quick').data.map((trace) => trace.name)"
    )
    assert names == ["simulated", "measured"]
    page.click("#quick-next")
    settled(page, "stop")
    assert page.text_content("#verdict").startswith(
        "quick fit: at 1.5 mm/s: stick-slip, "
    )
    assert page.input_value(STIFFNESS) == "350 N/m"
    assert page.locator("#mitigations button, #attempts li").count() > 0


@pytest.mark.slow
def test_intervals_say_what_a_trace_shows_and_can_be_stopped(browser, server, tmp_path):
    with headless.window(browser, server) as page:
        page.click("#tab-fit")
        page.click("#sample")
        page.wait_for_selector("#fit-full:has-text('6,000 simulations, about')")
        page.click("#fit-full")
        page.wait_for_selector("#posterior-progress[value]")
        page.click("#posterior-stop")
        page.wait_for_selector("#posterior-words:has-text('Stopped')")
        page.wait_for_selector("#fit-coarse:not([disabled])")
        page.click("#fit-coarse")
        page.wait_for_selector("#fit-parameters td", timeout=300_000)
        settled(page, "posterior")
        rows = page.locator("#fit-parameters tbody tr")
        assert rows.count() == 6
        told = rows.locator(".tells").all_text_contents()
        assert set(told) <= {"identified", "weak", "not identified", "at a bound"}
        assert told[KEYS.index("damping_ratio")] == "identified"
        assert len(page.evaluate("document.querySelector('#plot-predicted').data")) == 4
        saved = rigs.read_rig(download(page, "#fit-save", tmp_path))
        assert "interface.thresholds.std" in saved.fitted
        put(page, "#fit-mass", "0.1")
        page.wait_for_selector("#posterior-words:has-text('fit again')")
        assert page.get_attribute("[data-about=posterior]", "data-state") == "computing"


def test_fronts_are_drawn_with_one_cursor_and_a_bar_file_opens_on_them(
    browser, tmp_path
):
    bar = documents.page_content()["bars"][2]["document"] | {"name": "My bar"}
    (tmp_path / "bar.toml").write_text(rigs.to_toml(documents.any_rig_of(bar)))
    with (
        headless.server(str(tmp_path / "bar.toml")) as running,
        headless.window(browser, running) as page,
    ):
        settled(page, "fronts")
        assert page.text_content("#bar option:checked") == "My bar"
        page.select_option("#bar", label="Pulled at one end: precursors")
        page.wait_for_selector("body[data-fronts-state=computing]")
        settled(page, "fronts")
        count = page.locator("#fronts-events tbody button").count()
        assert count >= 2
        assert f"{count} events, marked" in page.text_content("#plot-side")
        page.locator("#fronts-events tbody button").first.click()
        until(page, "document.querySelector('#spacetime').dataset.event === '0'")
        near = page.evaluate(
            "document.querySelector('#plot-side')._fullLayout.xaxis.range"
        )
        assert near[1] - near[0] < 1_000
        page.focus("#spacetime")
        page.keyboard.press("ArrowRight")
        page.wait_for_selector("#fronts-at:has-text('slip')")
        assert page.is_visible("#page-fronts .cursor")
        put(page, "#bar-chain-blocks", "2")
        page.wait_for_selector("#fronts-complaint:has-text('at least 3')")
        assert page.get_attribute("[data-about=fronts]", "data-state") == "refused"


def test_downloads_reproduce_the_run(page, tmp_path):
    move(page, 3)
    forms = "toml", "nc", "png", "svg"
    toml, nc, png, svg = (
        download(page, f"[data-download={form}]", tmp_path) for form in forms
    )
    rig = rigs.read_rig(toml)
    run = store.load(nc)
    assert rig.slider.stiffness == 3
    alone = Rig(rig.interface, rig.slider, rig.drive)
    made = simulate(alone, method=rig.method, output=rig.output, start=rig.start)
    np.testing.assert_array_equal(made["spring_force"], run["spring_force"])
    shown = page.evaluate(
        "Array.from(document.querySelector('#plot-force')._fullData[0].y)"
    )
    assert max(shown) == pytest.approx(float(made["spring_force"].max()), rel=1e-6)
    assert png.read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in svg.read_bytes()
    assert cli.main(["simulate", str(toml), "--json"]) == 0


def test_a_link_restores_the_state_and_computes_nothing_before_a_click(
    browser, server, page
):
    move(page, 7)
    page.click("#tab-map")
    there = state(page)
    address = page.evaluate("location.href")
    context = browser.new_context()
    other = context.new_page()
    asked = []

    def hear(sent):  # playwright accepts no bound method of a list
        asked.append(sent)

    other.on("websocket", lambda socket: socket.on("framesent", hear))
    other.goto(address)
    other.wait_for_selector("#waiting:not([hidden])")
    assert other.get_attribute("#tab-map", "aria-selected") == "true"
    assert other.input_value(STIFFNESS) == "7"
    for tab in ("map", "stop", "simulate"):
        other.click(f"#tab-{tab}")
    assert state(other) == there
    assert asked == []
    other.click("#go")
    settled(other)
    other.reload()  # the own page reloads by itself
    settled(other)
    context.close()
    with headless.window(browser, server, "#interface/%%%") as damaged:
        assert "damaged" in damaged.text_content("#notice")
        assert damaged.input_value(STIFFNESS) == "300 N/m"


def test_two_windows_do_not_disturb_each_other_and_outlive_the_server(browser):
    with ExitStack() as stack:
        with headless.server() as running:
            windows = []
            for stiffness in (2, 20):
                context = browser.new_context()
                stack.callback(context.close)
                windows.append(context.new_page())
                windows[-1].goto(running.url)
                settled(windows[-1])
                choose(windows[-1], NATURAL)
                move(windows[-1], stiffness)
            kinds = [window.text_content("#regime") for window in windows]
            assert kinds == ["stick-slip", "smooth sliding"]
            springs = [state(window)["slider"]["stiffness"] for window in windows]
            assert springs == [2, 20]
        for window in windows:
            window.wait_for_selector("#notice:has-text('The server is gone')")
            assert window.is_visible("#plot-force .trace")


@pytest.mark.parametrize("size", [SCREEN, PHONE], ids=["screen", "phone"])
def test_every_page_fits_and_is_accessible_to_all(browser, server, tmp_path, size):
    """Nothing overflows sideways and no label is cut off, in light and dark mode. Draws
    the pictures for the docs on request.
    """
    ready = {
        "simulate": "#plot-stretchings .trace",
        "map": "#plot-map .heatmaplayer image",
        "stop": "#margins td",
        "trace": "#plot-trace .trace",
        "fit": "#plot-quick .trace",
        "fronts": "#fronts-events td",
    }
    with headless.window(browser, server, viewport=size) as page:
        page.click("#tour-begin")
        settled(page)
        assert page.evaluate(RULES) == [], "the tour"
        page.click("#tour-end")
        choose(page, documents.presets()[0]["title"])
        for name, selector in ready.items():
            page.click(f"#tab-{name}")
            if name == "trace":
                page.set_input_files("#file", sawtooth(tmp_path))
            if name == "fit":
                page.click("#sample")
            for scheme in ("light", "dark"):
                page.emulate_media(color_scheme=scheme)
                page.wait_for_selector(selector)
                until(page, f"({LAYOUT})() === ''")
                ink, paper = page.evaluate(
                    "() => ['color', 'backgroundColor'].map((key) => "
                    "getComputedStyle(document.body)[key])"
                )
                assert contrast(ink, paper) > 7
                until(page, f"({RULES})().length === 0")
                if PICTURES and (
                    name == "simulate" or (size, scheme) == (SCREEN, "light")
                ):
                    take_picture(page, name, size, scheme)
        page.click("#glossary-open")
        assert page.evaluate(RULES) == [], "the glossary"


LAYOUT = """() => {
  const cut = [...document.querySelectorAll("svg .xtitle, svg .ytitle")].filter((text) => {
    const box = text.getBoundingClientRect(), plot = text.closest(".plot").getBoundingClientRect();
    return box.width && (box.left < plot.left - 2 || box.right > plot.right + 2 || box.top < plot.top - 2
      || box.bottom > plot.bottom + 2); }).map((text) => text.textContent);
  if (document.documentElement.scrollWidth > document.documentElement.clientWidth) cut.push("the page");
  return cut.join(); }"""  # noqa: E501


def take_picture(page, name, size, scheme):
    form = "-phone" if size is PHONE else ""
    dark = "-dark" if scheme == "dark" else ""
    Path(PICTURES).mkdir(parents=True, exist_ok=True)
    page.screenshot(path=Path(PICTURES) / f"explorer-{name}{form}{dark}.png")


def contrast(one, two):
    def luminance(colour):
        parts = [int(part) / 255 for part in re.findall(r"\d+", colour)[:3]]
        parts = [
            c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts
        ]
        return float(np.dot(parts, (0.2126, 0.7152, 0.0722)))

    bright, dim = sorted((luminance(one), luminance(two)), reverse=True)
    return (bright + 0.05) / (dim + 0.05)


def test_every_control_can_be_touched_without_an_error(bench):
    """`window` fails on any message in the console."""
    page = bench
    for name in ("simulate", "map", "stop", "trace", "fit", "fronts"):
        page.click(f"#tab-{name}")
        if name == "fit":
            page.click("#sample")
            page.wait_for_selector("body[data-fit-state='']")
        elsewhere = (
            # minutes, or another page
            "[role=tab], [data-download], #fit-coarse, #fit-full, .next, #quick-open"
        )
        elsewhere += "" if name == "simulate" else ", #tour-begin"
        controls = page.locator(
            ":is(button, select, input[type=checkbox], "
            f"input[type=range]):not({elsewhere}):visible"
        )
        for i in range(controls.count()):
            control = controls.nth(i)
            if not control.is_visible() or not control.is_enabled():
                continue
            kind = control.evaluate("(node) => node.type")
            if kind == "range":
                control.fill(str(int(control.input_value()) // 2 + 200))
            elif kind == "select-one" and control.get_attribute("id") != "preset":
                control.select_option(index=0)
            elif kind in ("checkbox", "button", "submit"):
                control.click()
                if page.is_visible("#glossary"):
                    page.click("#glossary-close")
    page.click("#tab-simulate")
    page.click("#reset")
    settled(page)
