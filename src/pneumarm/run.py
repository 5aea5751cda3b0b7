"""The whole job, stage by stage, from an arm to a controller that adapts on it; it can be interrupted anywhere.

A folder holds a run: ``settings.json`` (what was asked for), ``transitions.db``, ``simulation.safetensors``,
``agent.safetensors``, ``adapted.safetensors``, the versions in between in ``agents/`` with ``adaptation.json``,
``episodes.csv``, ``report.html``, and ``results.json``, which grows by the stages that are done. A second call with
the same folder goes on after the last of them.
"""

import json
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Self

import msgspec
from msgspec import Meta

from pneumarm.analysis import analyse
from pneumarm.arm import Arm, ArmSpec, open_arm
from pneumarm.arm.open import shape_of
from pneumarm.bound.reaching import BoundSettings, known_bound
from pneumarm.console import jsonable, peak_memory
from pneumarm.control import Monitor, TransferSettings, save_history, transfer, version_keeper
from pneumarm.control.condition import collected_results
from pneumarm.control.monitor import Mode
from pneumarm.control.transfer import monitor_of
from pneumarm.control.versions import ADAPTED, TRAINED
from pneumarm.errors import UnusableInput
from pneumarm.files import make_folder, read_json, refuse_code, require_output, write_json
from pneumarm.learning import (
    LOOKING_AHEAD,
    LearnSettings,
    ServoSettings,
    goals_of,
    load_agent,
    results_with_lookahead,
    test_ahead,
    train,
)
from pneumarm.learning import test as test_agent
from pneumarm.moving.trial import MoveTrialSettings, try_moving
from pneumarm.planning import PlanSettings
from pneumarm.progress import Display, compiling, silent
from pneumarm.records import demonstrate, marked_record, moving_record, training_record
from pneumarm.rehearsal import Rehearsal, WarmUpJob
from pneumarm.report.beside import ReportBeside
from pneumarm.report.files import REPORT, TEST, read_results, save_demonstration, write_spec
from pneumarm.report.shown import read_shown
from pneumarm.report.viewing import write_view
from pneumarm.settings import NonNegativeInt, PositiveInt
from pneumarm.simulation import FitSettings, Simulation, fit_store
from pneumarm.simulation.enough import EnoughSettings, collect_enough
from pneumarm.statistics import FEWEST
from pneumarm.task import BeginStates, begin_states, read_episodes, write_episodes
from pneumarm.transitions import (
    FEWEST_TRANSITIONS,
    KINDS,
    WHOLE_PERIODS,
    CollectResult,
    CollectSettings,
    Store,
    collect,
)

SETTINGS = "settings.json"
RECORDED = "recorded.svg"
"""A picture that plays: how the arm moved at the end of its recording."""

_PLANNED = 40  # movements, by default
_DRAWN = {"transfer": ("learned",), "settle": ("learned", "moved", "reached")}
"""Parts of the report that can be drawn once a stage begins: nothing that it says in them changes any more."""


@dataclass(frozen=True)
class RunTransferSettings(TransferSettings):
    """As of a transfer, in minutes of the arm's time instead of hours."""

    episodes: int = 30
    """Movements while learning (thesis section 5.5.1: progress is seen after some 750)."""
    test_episodes: int = 15
    """Greedy movements before and again after learning; at least 500 for figures to be compared."""


@dataclass(frozen=True)
class RunSettings(LearnSettings):
    """What a run is asked for. A folder is resumed with the same settings only."""

    arm: str = "virtual"
    """virtual, virtual:seed=N, serial:PORT, simulation:FILE or python:module:callable."""
    seed: int = 0
    """Random seed."""
    joints: int | None = None
    """Expected number of joints; others are refused."""
    transitions: Annotated[int, Meta(ge=FEWEST_TRANSITIONS)] | None = None
    """How many to collect; by default until enough.

    The thesis collected 200,000, in two hours (section 3.2.2). By default until more would not help."""
    enough: EnoughSettings = field(default_factory=EnoughSettings)
    """When more would not help."""
    test_episodes: PositiveInt = 10_000
    """Movements tested in simulation (thesis section 5.2)."""
    bound_episodes: NonNegativeInt | None = None
    """Movements to goals that are planned, as a bound.

    They are planned with the true physics of a virtual arm and say what can be achieved; 0 for none. By default 40
    for agents that are to reach goals, else none; for each joint more an eighth of them, because a plan for two takes
    ten times as long."""
    collect: CollectSettings = field(default_factory=CollectSettings)
    fit: FitSettings = field(default_factory=FitSettings)
    transfer: RunTransferSettings = field(default_factory=RunTransferSettings)
    moving: MoveTrialSettings = field(default_factory=MoveTrialSettings)

    def of_the_thesis(self) -> Self:
        """Return the settings with the thesis' sizes and its way of collecting in place of those left as they are."""
        usual, thesis, transfer = RunTransferSettings(), TransferSettings(), self.transfer
        if transfer == usual:
            transfer = replace(transfer, episodes=thesis.episodes, test_episodes=thesis.test_episodes)
        collecting = WHOLE_PERIODS if self.collect == CollectSettings() else self.collect
        return replace(self, transitions=self.transitions or 200_000, collect=collecting, transfer=transfer)

    @property
    def settles(self) -> bool:
        """Whether the agent is to settle at goals, hold them and follow references, and not to reach goals alone."""
        return "settle" in self.found.tasks

    @property
    def planned(self) -> int:
        """Movements of one joint that are planned."""
        usual = 0 if self.settles else _PLANNED
        return usual if self.bound_episodes is None else self.bound_episodes


class Run:
    """A run in a folder. Every stage leaves its files first and then its figures in ``results.json``."""

    def __init__(
        self,
        folder: Path,
        settings: RunSettings,
        progress: Display = silent,
        seen_by: Callable[[Arm], Arm] = lambda arm: arm,
        monitor: Mode = "stop",
        tell: Callable[[str], None] = lambda line: None,
    ) -> None:
        """Take up the run in ``folder``, if there is one; ``seen_by`` may put something around the arm that shows it.

        What there is to be seen before the end is told by ``tell``, in a line.

        Raises:
            UnusableInput: the folder's parent is missing, it holds something else, or a run with other settings.

        """
        self.folder, self.settings, self.progress, self._seen_by = folder, settings, progress, seen_by
        self._monitor, self._tell = monitor, tell
        self.results: dict[str, Any] = {}
        self._stage = ""
        self.store = folder / "transitions.db"
        self.simulation = folder / "simulation.safetensors"
        self.agent = folder / TRAINED
        self.adapted = folder / ADAPTED
        self.episodes = folder / "episodes.csv"
        self._rehearsal = Rehearsal()
        compiling.watch()
        self._claim()

    @property
    def _wanted(self) -> dict[str, Any]:
        wanted: dict[str, Any] = json.loads(json.dumps(asdict(self.settings)))
        del wanted["joints"]  # what the arm must have is no choice
        return wanted

    def _claim(self) -> None:
        folder, wanted = self.folder, self._wanted
        require_output(folder)
        file = folder / SETTINGS
        if file.exists():
            found = read_json(file, "the settings of a run")
            if found != wanted:
                raise UnusableInput(
                    f"{folder}: holds a run with other settings ({_differences(found, wanted)}); "
                    "give the same ones or another folder"
                )
            if self._results_file.exists():
                self.results = read_results(folder)
        elif folder.is_dir() and any(folder.iterdir()):
            raise UnusableInput(f"{folder}: is not empty and holds no run; give another folder")

    @property
    def _results_file(self) -> Path:
        return self.folder / "results.json"

    def do(self) -> dict[str, Any]:
        """Do all stages that are not done yet and return the results.

        Raises:
            UnusableInput: there is no such arm, or it has another number of joints; nothing was written.

        """
        stages = {
            "collect": self._collect,
            "simulation": self._fit,
            "training": self._train,
            "test": self._test,
            "transfer": self._transfer,
            "settle": self._move,
            "bound": self._bound,
        }
        left_out = {"settle": not self.settings.settles, "bound": self.settings.planned == 0}  # these only note that
        counted = [name for name in stages if not left_out.get(name)]
        last = len(counted) + 1
        with ReportBeside(self.folder) as page:
            with self._rehearsal:
                self._begin()
                for name, stage in stages.items():
                    if name in counted:
                        self._stage = f"stage {counted.index(name) + 1} of {last}"
                    if name not in self.results:
                        if name != "collect":  # nothing more is to run beside an arm while it is recorded
                            page.begin()
                        for part in _DRAWN.get(name, ()):
                            page.draw(part)
                        with self._noted(name):
                            if name != "collect":
                                self._rehearsal.wait_for(name)
                            self.results |= stage()
            self._stage = f"stage {last} of {last}"
            if not (self.folder / REPORT).exists():
                with self._noted("report"), self.progress("writing the report") as report:
                    report(0, 1)
                    page.write()
                    report(1, 1)
        return self.results

    def _begin(self) -> None:
        """Begin the folder, if there is such an arm."""
        if "collect" in self.results:
            return
        if (shape := shape_of(self.settings.arm)) is not None:
            self._rehearse(shape)
        if not (self.folder / SETTINGS).exists():
            open_arm_checked(self.settings).close()
            make_folder(self.folder)
            write_json(self.folder / SETTINGS, self._wanted)

    def numbered(self, title: str) -> str:
        """Return ``title``, of something that is being done, with the stage that it belongs to."""
        return f"{self._stage}: {title}"

    @contextmanager
    def _noted(self, stage: str) -> Iterator[None]:
        """Write the results of a ``stage`` with how long it took; once they are there it is not done again."""
        began, compiled = time.perf_counter(), compiling.seconds
        yield
        for name, seconds in (
            ("wall_seconds", time.perf_counter() - began),
            ("compile_seconds", compiling.seconds - compiled),
        ):
            self.results[name] = self.results.get(name, {}) | {stage: round(seconds, 3)}
        for name, megabytes in (
            ("peak_memory_mb", peak_memory()),
            ("rehearsal_memory_mb", self._rehearsal.memory),
        ):
            self.results[name] = max(megabytes, self.results.get(name, 0.0))
        write_json(self._results_file, jsonable(self.results))

    def _collect(self) -> dict[str, Any]:
        wanted = self.settings
        with (
            self.progress("collecting") as report,
            self._seen_by(open_arm_checked(wanted)) as arm,
            Store.for_arm(self.store, arm.spec) as store,
        ):
            self._rehearse(arm.spec)
            watch = Monitor(arm.spec, mode=self._monitor)

            def record(transitions: int) -> CollectResult:
                return collect(
                    arm,
                    store,
                    transitions,
                    wanted.seed,
                    progress=report,
                    settings=wanted.collect,
                    watch=watch,
                    exact=wanted.transitions is not None,
                )

            decided = {}
            if wanted.transitions is None:
                decided = {"enough": collect_enough(record, store, wanted.enough)}
            collected = record(wanted.transitions or FEWEST_TRANSITIONS)
            write_spec(self.folder, arm.spec)
            marked_record(store).save(self.folder)
        write_view(read_shown(self.store), self.folder / RECORDED)
        self._tell(f"the arm as it moved: {self.folder / RECORDED}, which plays in a browser; the report follows")
        return {"collect": collected_results(collected, watch) | decided}

    def _rehearse(self, spec: ArmSpec) -> None:
        """Have the kernels of the later stages compiled from now on, while an arm that is like ``spec`` is moved."""
        wanted = self.settings
        if isinstance(wanted.chosen, ServoSettings):
            physics = wanted.arm if wanted.planned and shape_of(wanted.arm) is not None else None
            self._rehearsal.begin(WarmUpJob(spec, wanted.fit, wanted.chosen, physics))

    def _fit(self) -> dict[str, Any]:
        with Store.open(self.store) as store:
            with self.progress("fitting the simulation") as report:
                fit = self.settings.fit if self.settings.settles else self.settings.fit.of_single_steps()
                fitted = fit_store(store, replace(fit, seed=self.settings.seed), progress=report)
            with self.progress("measuring its errors"):
                analysis = analyse(store, fitted.simulation, fitted.filtered)
        fitted.simulation.save(self.simulation)
        analysis.save(self.folder)
        for line in fitted.result.remarks:
            self._tell(line)
        return {"filter": analysis.figures["filter"], "simulation": fitted.results() | analysis.figures}

    def _train(self) -> dict[str, Any]:
        simulation = Simulation.load(self.simulation)
        with self.progress("training") as report:
            training = train(
                simulation,
                self._begin_states(simulation),
                self.settings.chosen,
                seed=self.settings.seed,
                method=self.settings.found,
                progress=lambda now: report(100 * now.share, 100),
                checkpoint=self.folder / "training.checkpoint",
            )
        training.agent.save(self.agent)
        training_record(training).save(self.folder)
        return {"training": training.results()}

    def _test(self) -> dict[str, Any]:
        simulation, agent = Simulation.load(self.simulation), load_agent(self.agent)
        begin, episodes, seed = self._begin_states(simulation), self.settings.test_episodes, self.settings.seed
        with self.progress("testing in the simulation"):
            tested = test_agent(agent, simulation, begin, episodes, seed)
            ahead = test_ahead(agent, simulation, begin, min(episodes, LOOKING_AHEAD), seed)
        tested.save(self.folder / TEST)
        return {"test": results_with_lookahead(tested, ahead)}

    def _transfer(self) -> dict[str, Any]:
        wanted = self.settings
        with (
            self.progress("moving on the arm") as report,
            self._seen_by(open_arm_checked(wanted)) as arm,
            Store.append_to(self.store) as store,
        ):
            agent = load_agent(self.agent)
            moved = transfer(
                agent,
                arm,
                store,
                wanted.transfer,
                seed=wanted.seed,
                progress=report,
                keep_version=version_keeper(self.folder),
                watch=monitor_of(agent, arm, self._monitor),
            )
            demonstrations = demonstrate(moved.agent, arm, wanted.seed)
            marked_record(store).save(self.folder)
        moved.agent.save(self.adapted)
        save_history(self.folder, moved.adapted)
        write_episodes(self.episodes, moved.movements)
        for number, shown in enumerate(demonstrations):
            save_demonstration(self.folder, shown, number)
        return {"transfer": moved.results()}

    def _move(self) -> dict[str, Any]:
        """Say in degrees and seconds how the adapted agent settles, holds and tracks, if it does."""
        wanted, agent = self.settings, load_agent(self.adapted)
        found: dict[str, Any] = {"settle": None, "track": []}
        controller = agent.controller()
        if controller is None:
            return found
        with self.progress("moving to goals") as report, self._seen_by(open_arm_checked(wanted)) as arm:
            tried = try_moving(arm, controller, goals_of(agent), wanted.moving, seed=wanted.seed, progress=report)
        if tried.moved:
            moving_record(tried).save(self.folder)
        return found | tried.results()

    def _bound(self) -> dict[str, Any]:
        """Say what could be achieved in the first movements of the tests on the arm (thesis section 5.5.1)."""
        wanted = self.settings
        if wanted.planned == 0:
            return {
                "bound": {"missing": "it is planned for agents that are to reach goals, or where it is asked for"}
            }
        agent, made = load_agent(self.agent), read_episodes(self.episodes)
        rewards = {phase: made[phase].reward for phase in ("before", "after")}
        episodes = max(min(wanted.planned, FEWEST), wanted.planned // 8 ** (agent.spec.joints - 1))
        settings = BoundSettings(episodes, PlanSettings(cutoff=agent.settings.cutoff))
        with self.progress("planning with the true physics") as report, open_arm_checked(wanted) as arm:
            return {
                "bound": known_bound(
                    arm, goals_of(agent), rewards, settings,
                    seed=wanted.seed, reward=agent.settings.reward, progress=report,
                )
            }  # fmt: skip

    def _begin_states(self, simulation: Simulation) -> BeginStates:
        with Store.open(self.store) as store:
            # Collected sequences only: those of the transfer come later, and a resumed run must see the same.
            return begin_states(store.blocks(kinds=KINDS), simulation.window, simulation.scaling, simulation.spec)


def open_arm_checked(settings: RunSettings) -> Arm:
    """Open the arm of a run.

    Raises:
        UnusableInput: there is no such arm, or it has another number of joints.

    """
    arm = open_arm(settings.arm, settings.seed)
    if settings.joints not in (None, arm.spec.joints):
        arm.close()
        raise UnusableInput(f"{settings.arm} has {arm.spec.joints} joint(s), asked for are {settings.joints}")
    return arm


def settings_in(folder: Path, named: Collection[str | None] = ()) -> RunSettings | None:
    """Return the settings of the run in ``folder``; None where it holds none.

    An arm or a method that is somebody's code is taken from it only if it is among those that the user ``named``:
    opening a folder runs nothing that is named in it.

    Raises:
        UnusableInput: they are damaged, of another version, or name code that the user has not named.

    """
    file = folder / SETTINGS
    if not file.exists():
        return None
    found = read_json(file, "the settings of a run")
    for option, code in (("arm", "python:"), ("method", ":")):
        name = found.get(option)
        if isinstance(name, str) and code in name and name not in named:
            refuse_code(file, option, name)
    try:
        return msgspec.convert(found, RunSettings)
    except (msgspec.ValidationError, UnusableInput) as error:
        raise UnusableInput(f"{file}: holds no settings of a run that can be used ({error})") from error


def _differences(found: Any, wanted: Any, place: str = "") -> str:
    if not (isinstance(found, dict) and isinstance(wanted, dict)):
        return f"{place} was {found!r}, is {wanted!r}"
    names = [name for name in found.keys() | wanted.keys() if found.get(name) != wanted.get(name)]
    return ", ".join(
        _differences(found.get(name), wanted.get(name), f"{place}.{name}" if place else name)
        for name in sorted(names)
    )
