"""The laboratory: experiments that anyone can run again, next to the thesis' own numbers.

``pneumarm experiment NAME`` computes the rows that are missing, a row a trial and run, and draws a page from them.
All experiments of a laboratory share a folder:

    LABORATORY/arms/ARM/                  transitions and simulation of each arm, made once
    LABORATORY/NAME/settings.json         what decides the rows; other settings need another laboratory
    LABORATORY/NAME/rows.jsonl            the rows, appended durably, never computed twice
    LABORATORY/NAME/results.json          what they say, for programs
    LABORATORY/NAME/page.html             what they say, for people

To add an experiment, make a folder (a package) here and name it in :mod:`.registry`. The folder holds

- ``__init__.py``: the question, the factors, the command and the answer in two sentences, and ``EXPERIMENT``;
- a module named for what is varied: the trials, ``settings`` (JSON that decides the rows), ``prepare`` (what is
  needed of an arm; :func:`~.preparation.simulated` collects and fits) and ``measure`` (a row: pure, seeded by
  :func:`~.experiment.run_seed`, so that all trials of a run begin alike);
- ``analysis.py``: pure functions from rows to intervals, tables and pictures; runs nothing;
- ``words.toml``: the words that go with them, and the claims of the thesis with the rule each is judged by
  (:mod:`.words`);
- a ``design.toml`` where there is an orthogonal array, and the thesis' tables as ``thesis_*.csv``, trials by runs.

What experiments have in common is in the class that theirs are of: trainings in an arm's simulation
(:class:`~.trainings.Trainings`), an agent that moves the arm or agents that are compared on it
(:class:`~.moving.OnTheArm`, :class:`~.moving.AgentsByTrial`), and all the way from an arm, however it is collected
from, back to it (:class:`~.there_and_back.ThereAndBack`). What rows say over arms, with intervals and tables, is
:mod:`.means`, and :mod:`.pictures` draws it.

Trainings of the thesis' agent by an orthogonal array need no code: :class:`~.factorial.Factorial` is such an
experiment. :mod:`.design` is of use for tables from anywhere (``pneumarm taguchi analyse``).
"""
