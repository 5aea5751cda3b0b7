"""Evolution of recurrent networks by Enforced Sub-Populations (thesis section 4.5; first recommendation of 7.3).

pneumarm train arm.sim arm.db --out arm.agent --method esp --own.velocity false
"""

from pneumarm.learning.evolution.agent import EvolvedAgent
from pneumarm.learning.evolution.settings import EvolutionSettings
from pneumarm.learning.evolution.training import evolve
from pneumarm.learning.method import Method

__all__ = ["ESP", "EvolutionSettings", "EvolvedAgent", "evolve"]

ESP = Method(EvolutionSettings, evolve, EvolvedAgent.load)
