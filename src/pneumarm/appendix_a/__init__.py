"""The errors of thesis appendix A played on a virtual arm, beside the same arm without them.

:mod:`~pneumarm.appendix_a.runs` makes a run, :mod:`~pneumarm.appendix_a.playing_errors` all of them with their
pictures, and :mod:`~pneumarm.appendix_a.errors_page` a page of those.
"""
