"""Adaptation: an agent goes on learning from the arm that it moves."""

from pneumarm.adaptation.adaptation import COMPARED, Adaptation, AdaptationSettings, adaptation_of
from pneumarm.adaptation.change import WatchSettings
from pneumarm.adaptation.events import Event, sentences
from pneumarm.adaptation.refit import RefitSettings
from pneumarm.adaptation.trial import TrialSettings

__all__ = [
    "COMPARED",
    "Adaptation",
    "AdaptationSettings",
    "Event",
    "RefitSettings",
    "TrialSettings",
    "WatchSettings",
    "adaptation_of",
    "sentences",
]
