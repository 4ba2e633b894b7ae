"""Figures 6 and 7: claims come out as settled, pictures have ink and labels, data make their way to a file."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from stickslip import store
from stickslip.paper import fig6, fig7

FIGURES = {"fig6": fig6.FIGURE, "fig7": fig7.FIGURE}
SETTLED = {
    "fig6": {9: "reproduced under the stated reading"},
    "fig7": {10: "reproduced", 12: "reproduced under the stated reading"},
}


@pytest.mark.parametrize("name", FIGURES)
def test_the_quick_figure(name, tmp_path):
    weigh(FIGURES[name], SETTLED[name], FIGURES[name].compute(quick=True), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_the_full_figure(name, tmp_path):
    weigh(FIGURES[name], SETTLED[name], FIGURES[name].compute(), tmp_path)


def weigh(figure, settled, data, folder):
    data = store.load(store.save(data, folder / "data.nc"))
    claims = figure.check(data)
    assert {claim.number: claim.verdict for claim in claims} == settled
    failed = [str(claim) for claim in claims if not claim.ok]
    assert not failed, "\n".join(failed)
    assert all(variable.attrs["long_name"] for variable in data.variables.values())
    canvas = FigureCanvasAgg(figure.draw(data))
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba())[..., :3]
    assert 0.01 < np.mean(np.any(image < 250, axis=-1)) < 0.5
    for panel in canvas.figure.axes:
        assert panel.has_data()
        assert panel.get_ylabel() or panel.yaxis.get_ticklabels()
