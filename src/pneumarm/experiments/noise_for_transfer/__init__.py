"""Which noise on the simulation's predictions makes an agent that is good on the arm?

Factors: the kind of noise (white, correlated over 5 steps), whether a slow arm gets less, and how much: 1, 2 and 4
times the deviation of the fit's error; besides, no noise at all. In every run all agents begin with the same weights
and make the same movements on the arm.

    pneumarm experiment noise-for-transfer --out laboratory

Answer here: agents trained without noise earn as much on the arm as with the thesis' noise, whose simulation is
better than the thesis'. Four times the noise costs some 13 of reward, and far more where a slow arm gets as much as a
fast one. More noise shortens the training instead of lengthening it.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from pneumarm.experiments.differences import Interval, above, all_hold, within
from pneumarm.experiments.evidence import difference, mean, numbers, over_arms, plain, signed, table, thesis, values
from pneumarm.experiments.experiment import Analysis, Claim, Figures, LaboratorySettings, Report, Rows
from pneumarm.experiments.pictures import Axis, against
from pneumarm.experiments.there_and_back import (
    TRAINING,
    Prepared,
    ThereAndBack,
    agent_columns,
    prepared,
    trained_and_moved,
    usual,
)
from pneumarm.report.page import Section
from pneumarm.simulation.noise import NoiseSettings

_MARGIN = 1.0  # reward that does not matter: one action


@dataclass(frozen=True)
class NoiseForTransfer(ThereAndBack):
    """Agents trained with noises, on the arm."""

    factors: tuple[float, ...] = (1.0, 2.0, 4.0)
    """Deviations of the noise, in those of the fit's error; the first is the thesis' 1."""
    name: str = "noise-for-transfer"
    title: str = "Noise for the transfer"
    question: str = "Which noise on the simulation's predictions, and how much, makes an agent good on the arm?"
    source: str = "Thesis section 3.4, eq. 3.8 and 3.9"

    @property
    def noises(self) -> Mapping[str, NoiseSettings]:
        """The noises by what they are called."""
        found = {"none": NoiseSettings(kind="none")}
        for kind in ("white", "correlated"):
            for by_velocity in (False, True):
                for factor in self.factors:
                    words = f"{kind}, {'by velocity' if by_velocity else 'fixed'}, {factor:g}"
                    found[words] = NoiseSettings(kind=kind, factor=factor, by_velocity=by_velocity)
        return found

    @property
    def trials(self) -> Mapping[int, str]:
        """The noises."""
        return dict(enumerate(self.noises, 1))

    def settings(self) -> Any:
        """Return the noises and the training."""
        noises = {words: msgspec.to_builtins(noise) for words, noise in self.noises.items()}
        return {**super().settings(), "noises": noises}

    def prepare(self, arm: str, folder: Path, settings: LaboratorySettings, progress: Report) -> Prepared:
        """Return the arm's simulation."""
        return prepared(arm, folder, usual(settings), settings, progress)

    def measure(self, material: Prepared, trial: int, run: int, settings: LaboratorySettings) -> Figures:
        """Train an agent with the noise of ``trial``, and move the arm with it."""
        noise = self.noises[self.trials[trial]]
        return trained_and_moved(material, replace(TRAINING, noise=noise), run, settings)

    def trial(self, kind: str, by_velocity: bool, factor: float) -> int:
        """Return the number of a trial."""
        wanted = NoiseSettings(kind=kind, factor=factor, by_velocity=by_velocity)  # type: ignore[arg-type]
        return 1 + list(self.noises.values()).index(wanted)

    def analyse(self, rows: Rows) -> Analysis:
        """Return what becomes of each noise on the arm."""
        columns = agent_columns("actions", "switches")
        trials, pictures = self.trials, []
        axis = Axis("deviation of the noise [of the error]", (0.0, *self.factors))
        for kind in ("correlated", "white"):
            for by_velocity in (True, False):
                chosen = [1, *(self.trial(kind, by_velocity, factor) for factor in self.factors)]
                called = f"{kind} noise, {'less for a slow arm' if by_velocity else 'the same at all speeds'}"
                caption = f"{called[0].upper()}{called[1:]}: what agents trained with it do."
                pictures.append(against(rows, {trial: trials[trial] for trial in chosen}, axis, columns, caption))
        return Analysis(
            summary=[
                self.question,
                self._answer(rows),
                "A noise is white or correlated, fixed or less for a slow arm (by velocity), and so many times as "
                "large as the fit's error. It is that of training; in the test in simulation an agent meets its own. "
                "Values are means over arms with 95 % intervals.",
            ],
            figures=numbers(rows, trials, columns),
            sections=[
                Section("Agents", tables=[table(rows, trials, columns, "What agents trained with each noise do.")]),
                Section("Against the amount", figures=pictures),
            ],
            claims=self.claims(rows),
        )

    def _answer(self, rows: Rows) -> str:
        gains = {trial: difference(rows, "reward", trial, 1) for trial in self.trials if trial != 1}
        best = max(gains, key=lambda trial: gains[trial].mean)
        sure = [self.trials[trial] for trial, gain in gains.items() if gain.low > 0]
        worse = [self.trials[trial] for trial, gain in gains.items() if gain.high < 0]
        return (
            f"Without noise agents earn {plain(mean(rows, 'reward', 1), 1)} on the arm. Of {len(gains)} noises the "
            f"best on average is {self.trials[best]}: {signed(gains[best], 1)} against none. Surely better, "
            f"each taken alone: {'; '.join(sure) or 'none'}; surely worse: {'; '.join(worse) or 'none'}."
        )

    def claims(self, rows: Rows) -> list[Claim]:
        """Return what the thesis says, and what the rows say to it."""
        said = thesis(__name__)
        usual = self.trial(said["kind"], said["by_velocity"], said["factor"])
        most = self.trial(said["kind"], said["by_velocity"], max(self.factors))
        gain = difference(rows, "reward", usual, 1)
        much = difference(rows, "reward", most, usual)
        longer = difference(rows, "episodes", most, usual)
        trial, once = self.trial, said["factor"]

        def gained(pairs: Iterable[tuple[int, int]]) -> Interval:
            """Return by how much the first of each pair of trials earns more, on average over the pairs."""
            gains = [values(rows, "reward", first) - values(rows, "reward", second) for first, second in pairs]
            return over_arms(np.mean(gains, axis=0))

        kind = gained((trial("correlated", slow, once), trial("white", slow, once)) for slow in (False, True))
        speed = gained((trial(one, True, once), trial(one, False, once)) for one in ("white", "correlated"))
        return [
            Claim(
                "Noise makes an agent better on the arm",
                "[10] found so; seems necessary (section 3.4); no number",
                f"reward with the thesis' noise less that without: {signed(gain)}",
                above(gain),
                "noise",
            ),
            Claim(
                f"Too much noise ({max(self.factors):g} times) needs more training, to a marginal effect on the arm",
                "[10] found so; no number",
                f"{signed(longer, 0)} episodes; reward {signed(much)}, marginal being within {_MARGIN:g}",
                all_hold([above(longer), within(much, _MARGIN)]),
                "noise",
            ),
            Claim(
                "Correlated noise is better than white noise",
                "taken as more realistic (section 3.4); no number",
                f"difference of the reward at 1 times: {signed(kind)}",
                above(kind),
                "noise-kind",
            ),
            Claim(
                "Less noise for a slow arm is better",
                "by figure 3.2; no number",
                f"difference of the reward at 1 times: {signed(speed)}",
                above(speed),
                "noise-kind",
            ),
        ]


EXPERIMENT = NoiseForTransfer()
"""``pneumarm experiment``."""
