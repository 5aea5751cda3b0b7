"""Hierarchical learning (thesis section 6.2): an upper agent says which angles to head for, lower ones open valves.

pneumarm train arm.sim arm.db --out arm.agent --method hierarchy --own.period 10
"""

from pneumarm.learning.hierarchy.agent import HierarchicalAgent
from pneumarm.learning.hierarchy.settings import HierarchySettings
from pneumarm.learning.hierarchy.training import train_hierarchy
from pneumarm.learning.method import Method

__all__ = ["HIERARCHY", "HierarchicalAgent", "HierarchySettings", "train_hierarchy"]

HIERARCHY = Method(HierarchySettings, train_hierarchy, HierarchicalAgent.load)
