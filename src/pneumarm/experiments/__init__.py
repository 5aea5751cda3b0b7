"""The laboratory: experiments that anyone can run again, next to the thesis' own numbers.

``pneumarm experiment NAME`` computes the rows that are missing, a row a trial and run, and draws a page from them.
All experiments of a laboratory share a folder:

    LABORATORY/arms/ARM/                  transitions and simulation of each arm, made once
    LABORATORY/NAME/settings.json         what decides the rows; other settings need another laboratory
    LABORATORY/NAME/rows.jsonl            the rows, appended durably, never computed twice
    LABORATORY/NAME/results.json          what they say, for programs
    LABORATORY/NAME/page.html             what they say, for people

To add an experiment, make a folder (a package) here; :mod:`.registry` finds it by its ``EXPERIMENT``. It holds

- ``__init__.py``: the question, the factors and the command, and ``EXPERIMENT``;
- ``words.toml``: what is estimated from the rows, the tables and pictures of the page, and the claims of the thesis
  with what each states beforehand (:mod:`.words`); :mod:`.analysis` makes the page of it;
- where what is varied is more than data, a module named for it: the trials, ``settings`` (JSON that decides the
  rows), ``prepare`` (what is needed of an arm; :func:`~.preparation.simulated` collects and fits) and ``measure`` (a
  row: pure, seeded by :func:`~.experiment.run_seed`, so that all trials of a run begin alike);
- where the page needs something of its own, ``analysis.py``: pure functions from rows to estimates, tables, pictures;
- a ``design.toml`` where there is an orthogonal array, and the thesis' tables as ``thesis_*.csv``, trials by runs.

An experiment is an :class:`~.experiment.Experiment`. Several are made alike: trainings in an arm's simulation
(:class:`~.trainings.Trainings`), agents that move the arm (:class:`~.moving.OnTheArm`), lessons for several joints
(:class:`~.several_joints.SeveralJoints`); :mod:`.there_and_back` goes from an arm, however it is collected from, back
to it. Means over arms, with intervals and tables, are in :mod:`.means`, and :mod:`.pictures` draws them.

Trainings of the thesis' agent by an orthogonal array need no code: :class:`~.factorial.Factorial` is such an
experiment. :mod:`.design` is of use for tables from anywhere (``pneumarm taguchi analyse``).
"""
