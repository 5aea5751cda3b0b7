"""The arm that a page is about, with all that can be done with it: moving, learning, choosing, putting back."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from threading import Event, Lock, Thread
from typing import Any

from pneumarm.arm import ArmSpec, guarded, open_arm
from pneumarm.control.versions import HISTORY, TRAINED, put_back, read_history
from pneumarm.errors import PneumarmError, UnusableInput
from pneumarm.live.choices import Choice, Mover, choices_in, monitor_for, opened
from pneumarm.live.faults import OFFERED
from pneumarm.live.learning import Learning, LeftOff
from pneumarm.live.lease import ControlLease
from pneumarm.live.orders import AnyOrder, Beat, Choose, HandOver, Learn, PutBack, Stop, Take
from pneumarm.live.pace import in_real_time
from pneumarm.live.picture import drawing_of
from pneumarm.live.screen import Screen
from pneumarm.live.session import Mode, Session
from pneumarm.run import RunSettings, settings_in
from pneumarm.simulation.enough import EnoughSettings
from pneumarm.transitions.collect import recording_seconds


class LiveArm:
    """An arm and what can move it. Its thread opens the arm, moves it, and lets it learn when somebody wants that.

    Args:
        settings: of the arm, and of a run that is begun with it.
        named: files of controllers that were named, ``plan:SIM`` among them.
        folder: of the run; None where there is none.
        method: of one's own that trained the agents, MODULE:NAME, if it is not installed.

    Raises:
        UnusableInput: there is no such arm or controller.

    """

    def __init__(
        self, settings: RunSettings, named: Sequence[str], folder: Path | None, method: str | None = None
    ) -> None:
        self.settings, self.folder = settings, folder
        self.screen, self.lease = Screen(), ControlLease()
        self._named, self._method = [Choice(Path(name).name, name) for name in named], method
        self._leave, self._learn, self._stop_learning = Event(), Event(), Event()
        self._lock = Lock()  # of choosing: one at a time
        self._failure: BaseException | None = None
        self._session = self._open(self._choices())
        self._thread = Thread(target=self._main, name="arm", daemon=True)

    def __enter__(self) -> "LiveArm":
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.leave()
        self._thread.join()
        if self._failure is not None and error[0] is None:
            raise self._failure

    def leave(self) -> None:
        """Have the arm vented and closed, at the next turn."""
        self._leave.set()
        self._stop_learning.set()
        self._session.leave()

    def told_to(self, page: int) -> dict[str, Any]:
        """Return how things stand, as ``page`` is told it."""
        lease = self.lease
        return self.screen.state | {
            "you": page,
            "writer": lease.writer,
            "asking": lease.asking,
            "pages": len(lease.pages),
        }

    def order(self, page: int, order: AnyOrder) -> None:
        """Do what ``page`` asks for, or have it done; choosing takes a while.

        Raises:
            UnusableInput: it does not control the arm, or that cannot be done.

        """
        self.lease.hear(page)
        if isinstance(order, Beat):
            return
        if isinstance(order, Take):
            self.lease.take(page)
        elif isinstance(order, HandOver):
            self.lease.hand_over(page)
        elif isinstance(order, Stop):  # whoever sees that something goes wrong
            self._stop_learning.set()
            self._session.order(order)
        elif page != self.lease.writer:
            raise UnusableInput("another page controls the arm; ask for control")
        elif isinstance(order, Learn):
            self._begin_learning()
        elif isinstance(order, Choose):
            self._choose(order.controller)
        elif isinstance(order, PutBack):
            self._put_back(order.version)
        else:
            self._session.order(order)

    # ---- the arm's thread

    def _main(self) -> None:
        try:
            while not self._leave.is_set():
                with self._session.arm:
                    self._session.run()
                if self._learn.is_set() and not self._leave.is_set():
                    self._do_learning()
                if not self._leave.is_set():
                    self._session = self._open(self._choices())
        except BaseException as error:
            self._failure = error
            self.screen.tell(mode=Mode.FAILED, why=f"{error}; end pneumarm and begin again")

    def _open(self, choices: list[Choice]) -> Session:
        """Open the arm and the first of ``choices`` for it; nothing moves yet."""
        arm = open_arm(self.settings.arm, self.settings.seed)
        try:
            mover = opened(choices[0], arm, self._method) if choices else None
            watch = monitor_for(choices[0] if choices else None, arm.spec, self._method)
            paced = in_real_time(arm)
            self.screen.show(arm.spec, arm.read(), None, None)
        except BaseException:
            arm.close()
            raise
        drawing, to_scale = drawing_of(arm)
        spec = arm.spec
        self.screen.tell(
            arm=self.settings.arm,
            joints=spec.joints,
            muscles=spec.muscles,
            period=spec.period,
            range=spec.degrees(spec.angle_range),
            goals=None if mover is None else spec.degrees(mover.goal_range),
            most_bar=spec.max_pressure,
            drawing=drawing.for_page("#arm"),
            to_scale=to_scale,
            offered={name: [one.words, one.place] for name, one in OFFERED.items()},
            choices=[[one.name, one.version] for one in choices],
            in_use=self._in_use(),
            can_learn=self._can_learn(),
            minutes=round(self._recording(spec) / 60),
        )
        return Session(guarded(paced), mover, watch, self.screen, lambda: self.lease.silence)

    def _recording(self, spec: ArmSpec) -> float:
        """Return about how long the arm is recorded when it learns [s]."""
        wanted = self.settings.transitions
        return EnoughSettings().most_of(spec) if wanted is None else recording_seconds(wanted, spec.period)

    def _choices(self) -> list[Choice]:
        return [*self._named, *(choices_in(self.folder) if self.folder is not None else [])]

    def _in_use(self) -> int | None:
        """Return the version of the agent that is in use in the run's folder."""
        if self.folder is None or not (self.folder / HISTORY).exists():
            return None
        with suppress(UnusableInput):
            return read_history(self.folder).version
        return None

    # ---- learning

    def _can_learn(self) -> bool:
        """Whether there is a folder whose run is not done."""
        return self.folder is not None and not all((self.folder / name).exists() for name in ("report.html", TRAINED))

    def _begin_learning(self) -> None:
        if not self._can_learn():
            raise UnusableInput("there is nothing to learn: no folder of a run was given, or it is done")
        self._stop_learning.clear()
        self._learn.set()
        self._session.leave()

    def _do_learning(self) -> None:
        assert self.folder is not None
        self._learn.clear()
        self.screen.tell(mode="learning", why="", notice="", wrong=[], was_wrong=[], controller=None)
        try:
            Learning(self.folder, self._settings(), self.screen, self._stop_learning.is_set).do()
        except LeftOff as error:
            self.screen.tell(notice=str(error))
        except PneumarmError as error:
            self.screen.tell(notice=f"the learning failed: {error}")

    def _settings(self) -> RunSettings:
        assert self.folder is not None
        return settings_in(self.folder, (self.settings.arm, self._method)) or self.settings

    # ---- choosing

    def _choose(self, name: str) -> None:
        choice = next((one for one in self._choices() if one.name == name), None)
        if choice is None:
            raise UnusableInput(f"there is no controller {name!r}")
        with self._lock:
            session = self._session
            session.order(self._opened(choice, session))
        self.screen.tell(notice="")

    def _opened(self, choice: Choice, session: Session) -> Mover:
        return opened(choice, session.arm, self._method)

    def _put_back(self, version: int) -> None:
        if self.folder is None:
            raise UnusableInput("no folder of a run was given, so there are no versions")
        with self._lock:
            put_back(self.folder, version)
            self.screen.tell(in_use=version, notice=f"version {version} is the one in use from now on")
