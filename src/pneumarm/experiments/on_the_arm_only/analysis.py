"""What the rows say of learning on the arm alone, beside the thesis' guess."""

from pneumarm.experiments.analysis import analysed, filled_words
from pneumarm.experiments.experiment import Analysis, TrialRows
from pneumarm.experiments.means import mean, of_trial
from pneumarm.experiments.on_the_arm_only.from_scratch import ON_ARM, OnTheArmOnly
from pneumarm.experiments.on_the_arm_only.progress import progress_alt, progress_figure
from pneumarm.report.page import Picture


def analysis(experiment: OnTheArmOnly, rows: TrialRows) -> Analysis:
    """Return the hours beside the thesis' guess."""
    by_arm = [[row.figures for row in runs] for runs in of_trial(rows, ON_ARM)]
    learned = [figures for runs in by_arm for figures in runs]
    won = sum(f["met"] > 0 for f in learned)
    words, found = filled_words(experiment, rows, won=won, agents=len(learned))
    took = ("hours", "movements", "seconds of a movement")
    return analysed(
        experiment,
        rows,
        words,
        found,
        figures={
            **{name: mean(rows, name, ON_ARM).figures() for name in took},
            "met": won / len(learned),
            "reward": {name: mean(rows, "reward", t).figures() for t, name in experiment.trials.items()},
        },
        pictures={0: [Picture(progress_figure(by_arm), words.sections[0].figure, progress_alt(learned))]},
    )
