"""Learning in many simulated arms at once.

``arms`` is the environment of many arms, ``layers`` networks over many samples, ``inputs`` what they see; ``policy``
and ``values`` are two ways to learn from that, ``side_by_side`` trains several learners at once, ``acting`` and
``actor`` let a policy act, in a fleet and on an arm.
"""
