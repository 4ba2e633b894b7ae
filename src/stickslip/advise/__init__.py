"""The answer to: will this rig stick-slip, at which speeds, and what would stop it.

`predict` answers for a `Rig`; `chart` draws up the map around it. Three questions are
kept apart, because their answers differ:

- *elastic instability*: is the spring softer than the steepest fall of the force,
  ``K < K*``, Eq. (8)? Needed for a first slip, not enough for stick-slip to persist.
- *linear stability*: does smooth sliding, once there, resist a small disturbance?
- *sustained stick-slip*: does stick-slip go on from a start at rest? Between the last
  two the rig is bistable.
"""

from stickslip.advise.answer import ElasticPrediction, Prediction
from stickslip.advise.chart import chart
from stickslip.advise.doubt import Doubt
from stickslip.advise.findings import (
    Findings,
    Margin,
    WaveAnswer,
    WaveFindings,
    frequency_unit,
)
from stickslip.advise.mitigations import Mitigation
from stickslip.advise.prediction import complete, predict
from stickslip.advise.survey import Band

__all__ = [
    "Band",
    "Doubt",
    "ElasticPrediction",
    "Findings",
    "Margin",
    "Mitigation",
    "Prediction",
    "WaveAnswer",
    "WaveFindings",
    "chart",
    "complete",
    "frequency_unit",
    "predict",
]
