"""The answer to: will this rig stick-slip, at which speeds, and what would stop it.

`predict` answers for a `Rig`; `chart` computes the stability map around it. Three
questions are kept apart, because their answers differ:

- *elastic instability*: is the spring softer than the steepest fall of the force,
  ``K < K*``, Eq. (8)? This is necessary for a first slip, but does not suffice for
  stick-slip to persist.
- *linear stability*: does smooth sliding, once reached, resist a small perturbation?
- *sustained stick-slip*: does stick-slip persist from a start at rest? Where it does,
  although smooth sliding is stable, the rig is bistable.
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
