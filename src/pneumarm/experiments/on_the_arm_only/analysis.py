"""What the rows say of learning on the arm alone, beside the thesis' guess."""

from pneumarm.experiments.differences import Interval
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import by_trial, difference, mean, of_trial
from pneumarm.experiments.on_the_arm_only.from_scratch import IN_SIMULATION, ON_ARM, OnTheArmOnly
from pneumarm.experiments.on_the_arm_only.progress import progress_alt, progress_figure
from pneumarm.experiments.pictures import dots, section
from pneumarm.report.page import Picture
from pneumarm.statistics import wilson


def analysis(experiment: OnTheArmOnly, rows: TrialRows) -> Analysis:
    """Return the hours beside the thesis' guess."""
    trials = experiment.trials
    by_arm = [[row.figures for row in runs] for runs in of_trial(rows, ON_ARM)]
    learned = [figures for runs in by_arm for figures in runs]
    won = sum(f["met"] > 0 for f in learned)
    low, high = (float(end) for end in wilson(won, len(learned)))  # all or none of them would have no spread
    took = {name: mean(rows, name, ON_ARM) for name in ("hours", "movements", "seconds of a movement")}
    found = {
        "met": Interval((low + high) / 2, (high - low) / 2, len(learned)),
        "hours": took["hours"],
        "movements": took["movements"],
        "seconds": took["seconds of a movement"],
        "success": mean(rows, "success_rate", ON_ARM),
        "reward": mean(rows, "reward", ON_ARM),
        "more": difference(rows, "reward", ON_ARM, IN_SIMULATION),
    }
    words = experiment.words.filled({**found, "won": won, "agents": len(learned)})
    progress = Picture(progress_figure(by_arm), words.sections[0].figure, progress_alt(learned))
    shown = {
        "reward on the arm [-]": [mean(rows, "reward", t) for t in trials],
        "arm time [h]": [mean(rows, "hours", t) for t in trials],
    }
    reward = dots(list(trials.values()), shown, words.sections[1].figure)
    return words.analysis(
        found,
        figures={
            **{name: one._asdict() for name, one in took.items()},
            "met": won / len(learned),
            "reward": by_trial(rows, trials, "reward"),
        },
        sections=[
            section(words.sections[0], rows, trials, figures=[progress]),
            section(words.sections[1], rows, trials, figures=[reward]),
        ],
    )
